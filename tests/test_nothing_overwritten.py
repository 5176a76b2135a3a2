import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import screwgauge
from screwgauge.reference.outputs import is_as_written, stamp
from screwgauge.report.folder import lock_folder
from support.command import main
from support.errors import OutputError
from support.repository import repository, scene

MINE = "# mine\n"

pytestmark = pytest.mark.usefixtures("inside", "no_progress")


@pytest.fixture
def bars() -> None:
    repository(Path())
    for path in Path().glob("four-bar*.*"):
        if path.name != "four-bar.toml":
            path.unlink()
    assert main(["models", "four-bar.toml", "--out", "."]) == 0
    text = Path("four-bar.xml").read_text(encoding="utf-8")
    assert 'mass="0.5"' in text
    Path("b.xml").write_text(text.replace('mass="0.5"', 'mass="0.6"'), encoding="utf-8")


def refused(*arguments: str) -> str:
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    assert main([*arguments]) == 2
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before
    return " ".join(arguments)


WRITING = {
    "run --csv": (
        ["run", "slider-crank", "--engines", "screw", "--quantities", "joint_position", "--csv", "v"],
        "v/screw.csv",
    ),
    "view --out": (["view", "a01-pendulum", "--out", "mine.toml"], "mine.toml"),
    "view --png": (["view", "a01-pendulum", "--png", "mine.png"], "mine.png"),
    "view --pdf": (["view", "a01-pendulum", "--pdf", "mine.pdf"], "mine.pdf"),
    "view --svg": (["view", "a01-pendulum", "--svg", "mine.svg"], "mine.svg"),
    "check --junit": (["check", "slider-crank", "--smoke", "--junit", "mine.xml"], "mine.xml"),
    "check --update": (["check", "slider-crank", "--smoke", "--update", "--baseline", "mine.json"], "mine.json"),
    "diagnose --fix": (["diagnose", "four-bar.xml", "b.xml", "--fix", "mine.xml"], "mine.xml"),
    "import": (["import", "four-bar.urdf", "--out", "mine.toml"], "mine.toml"),
    "import's scene": (["import", "four-bar.urdf", "--out", "mine.toml"], "mine.scene.toml"),
    "models": (["models", "four-bar.toml", "--out", "out"], "out/four-bar.loops.toml"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITING)
def test_a_file_of_one_s_own_is_overwritten_by_force_only(name, bars, capsys):
    command, file = WRITING[name]
    Path(file).parent.mkdir(exist_ok=True)
    Path(file).write_text(MINE, encoding="utf-8")
    refused(*command)
    said = capsys.readouterr()
    assert said.err.startswith(f"screwgauge: {file}: already exists and ")
    assert said.err.endswith("or overwrite it with --force.\n")
    assert main([*command, "--force"]) in (0, 1)
    assert Path(file).read_bytes() != MINE.encode()
    assert main(command) in (0, 1)  # which is now as it was written here


READING = {
    "view": ["view", "four-bar.toml", "--out", "four-bar.toml"],
    "view two": ["view", "four-bar.toml", "b.xml", "--out", "b.xml"],
    "check": ["check", "scene.toml", "--smoke", "--junit", "scene.toml"],
    "check a model": ["check", "four-bar.xml", "b.xml", "--junit", "four-bar.xml"],
    "diagnose A": ["diagnose", "four-bar.xml", "b.xml", "--fix", "four-bar.xml"],
    "diagnose A by a library": ["diagnose", "four-bar.xml@mujoco", "b.xml", "--fix", "four-bar.xml"],
    "models of a model": ["models", "four-bar.urdf", "--out", "."],
    "import": ["import", "four-bar.urdf", "--loops", "four-bar.loops.toml", "--out", "four-bar.loops.toml"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", READING)
def test_what_a_command_reads_is_not_overwritten_even_if_it_was_written_here(name, bars, capsys):
    Path("scene.toml").write_text(stamp(scene()), encoding="utf-8")
    refused(*READING[name])
    said = capsys.readouterr().err
    assert "--force" in said or name.startswith("check")


#: Outputs that are one file, under whatever name: the files that are named twice.
TWICE = {
    "junit and baseline": ["--junit", "f", "--baseline", "f", "--update"],
    "another way": ["--junit", "f", "--baseline", "../{here}/f", "--update"],
    "junit and report": ["--junit", "out/report.md"],
    "baseline and numbers": ["--baseline", "out/check.json", "--update"],
}


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("name", TWICE)
def test_two_outputs_at_one_place_are_refused_before_any_work(name, force, capsys):
    Path("out").mkdir()
    given = [each.format(here=Path().absolute().name) for each in TWICE[name]]
    refused("check", "slider-crank", "--out", "out", *given, *force)
    assert "is an output of both " in capsys.readouterr().err


def test_outputs_of_other_commands_at_one_place_are_refused(bars, capsys):
    refused("diagnose", "four-bar.xml", "b.xml", "--out", "out", "--fix", "out/diagnosis.json")
    assert "is an output of both " in capsys.readouterr().err


READ = ("scene.toml", "four-bar.toml", "four-bar.xml", "motion.csv", "tolerances.toml", "more.xml")


@pytest.mark.parametrize("name", [*READ, "f", "out/report.md"])
def test_the_summary_of_a_job_is_added_to_no_file_of_the_command(name, bars, monkeypatch, capsys):
    Path("more.xml").write_text("<mujocoinclude/>", encoding="utf-8")
    Path("four-bar.xml").write_text(
        Path("four-bar.xml").read_text(encoding="utf-8").replace("</mujoco>", '<include file="more.xml"/></mujoco>')
    )
    Path("motion.csv").write_text("t,crank,crankd,crankdd\n0,0,0,0\n1,0,0,0\n", encoding="utf-8")
    lines = scene('models.mujoco = "four-bar.xml"').splitlines()
    lines[1:3] = ['motion = { csv = "motion.csv" }']
    Path("scene.toml").write_text("\n".join(lines), encoding="utf-8")
    Path("tolerances.toml").write_text("reaction = 1e-9\n", encoding="utf-8")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", name)
    refused("check", "scene.toml", "--tolerances", "tolerances.toml", "--junit", "f", "--out", "out")
    assert "GITHUB_STEP_SUMMARY" in capsys.readouterr().err


def test_the_second_model_is_never_overwritten(bars, capsys):
    for force in ([], ["--force"]):
        assert main(["diagnose", "four-bar.xml", "b.xml", "--fix", "b.xml", *force]) == 2
    assert 'mass="0.6"' in Path("b.xml").read_text(encoding="utf-8")


def test_what_was_written_here_is_written_again_and_what_was_changed_since_is_not(bars, capsys):
    command = ["models", "four-bar.toml", "--out", "."]
    assert main(command) == 0
    for name in ("four-bar.urdf", "four-bar-full.xml", "four-bar.loops.toml"):
        assert is_as_written(Path(name))
        text = Path(name).read_text(encoding="utf-8")
        Path(name).write_text(text.replace("crank", "handle", 1), encoding="utf-8")
        refused(*command)
        assert f"{name}: already exists and nothing" in capsys.readouterr().err
        Path(name).unlink()
        assert main(command) == 0


@pytest.fixture(scope="module")
def results() -> screwgauge.Results:
    scene = screwgauge.load_scene("slider-crank").at([0.0, 0.1])
    return screwgauge.run(scene, ["screw", "pinocchio"], ["actuator_force"])


@pytest.fixture(scope="module")
def check() -> screwgauge.CheckReport:
    return screwgauge.check("slider-crank", smoke=True)


#: Method -> name of the fixture that has it, file that it writes.
KEEPING = {
    "to_html": ("results", "page.html"),
    "to_csv": ("results", "v.csv"),
    "figure": ("results", "f.pdf"),
    "write_baseline": ("check", "known.json"),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", KEEPING)
def test_python_too_overwrites_by_force_only(method, request):
    fixture, name = KEEPING[method]
    result, file = request.getfixturevalue(fixture), Path("new") / name
    keep = result.figure("actuator_force").save if method == "figure" else getattr(result, method)
    keep(file)
    keep(file)  # as it was written here
    before = {*Path("new").iterdir()}
    file.write_text(MINE, encoding="utf-8")
    with pytest.raises(OutputError, match=r"already exists .*force=True"):
        keep(file)
    assert file.read_text(encoding="utf-8") == MINE
    keep(file, force=True)
    keep(file)
    assert {*Path("new").iterdir()} == before


@pytest.mark.slow
def test_a_fix_takes_no_place_of_what_a_diagnosis_read(bars):
    found = screwgauge.diagnose("four-bar.xml", "b.xml")
    found.write_fix("fixed.xml")
    found.write_fix("fixed.xml")
    for name in ("four-bar.xml", "mine.xml"):
        Path("mine.xml").write_text(MINE, encoding="utf-8")
        before = Path(name).read_bytes()
        with pytest.raises(OutputError, match="overwrite it with force=True"):
            found.write_fix(name)
        assert Path(name).read_bytes() == before
        found.write_fix(name, force=True)
    with pytest.raises(OutputError, match="is B itself"):
        found.write_fix("b.xml", force=True)


def test_nothing_but_a_file_is_in_the_way_and_a_link_stays(results):
    os.mkfifo("pipe.html")
    Path("folder.html").mkdir()
    for name in ("pipe.html", "folder.html"):
        with pytest.raises(OutputError, match=r"not a regular file|a folder"):
            results.to_html(name, force=True)
    Path("shelf").mkdir()
    Path("link.html").symlink_to("shelf/page.html")
    results.to_html("link.html", force=True)
    assert Path("link.html").is_symlink()
    assert is_as_written(Path("shelf/page.html"))


@pytest.mark.slow
def test_a_junit_file_of_the_last_check_is_replaced(capsys):
    command = ["check", "slider-crank", "--smoke", "--junit", "junit.xml"]
    assert main(command) == 0
    first = Path("junit.xml").read_bytes()
    assert main(command) == 0
    assert Path("junit.xml").read_bytes() != b""
    assert is_as_written(Path("junit.xml"))
    assert first.startswith(b"<?xml")


@pytest.mark.slow
def test_a_report_does_not_replace_the_table_that_it_is_about(capsys):
    asked = ["--engines", "screw,mine", "--quantities", "joint_position", "--samples", "--out", "out"]
    found = screwgauge.run(screwgauge.load_scene("slider-crank"), ["screw"], ["joint_position"])
    found.write("out", samples=True)
    table = pd.read_parquet("out/samples.parquet").rename(columns=lambda name: name.removeprefix("screw/"))
    table.to_parquet("out/samples.parquet")
    text = (Path(screwgauge.__file__).parent / "scenes" / "slider-crank.toml").read_text(encoding="utf-8")
    Path("mine.toml").write_text(f'tables.mine = "out/samples.parquet"\n{text}', encoding="utf-8")
    refused("run", "mine.toml", *asked)
    assert "the report's samples.parquet" in capsys.readouterr().err


@pytest.mark.slow
def test_a_report_takes_the_place_of_one_s_own_files_by_force_only(capsys):
    Path("out").mkdir()
    Path("out/errors.csv").write_text("mine", encoding="utf-8")
    run = ["run", "slider-crank", "--engines", "screw", "--quantities", "joint_position", "--out", "out"]
    refused(*run)
    assert capsys.readouterr().err.endswith("--force.\n")
    assert main([*run, "--force"]) == 0
    assert Path("out/errors.csv").read_text(encoding="utf-8").startswith("quantity,")


@pytest.mark.slow
def test_the_second_command_into_a_folder_is_refused(capsys):
    run = ["run", "slider-crank", "--engines", "screw", "--quantities", "joint_position", "--out", "out"]
    with lock_folder(Path("out")):
        assert main(run) == 2
        assert "out: another command is writing" in capsys.readouterr().err
        with pytest.raises(OutputError, match="another command"):
            screwgauge.run(screwgauge.load_scene("slider-crank"), ["screw"], ["joint_position"]).write("out")
    assert not Path("out").exists()  # nothing was put there
    assert main(run) == 0


def test_a_folder_is_free_when_who_held_it_is_killed():
    code = "from pathlib import Path; from screwgauge.report.folder import lock_folder\n"
    code += "with lock_folder(Path('out')): print(flush=True); input()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, **pipes) as one:
        one.stdout.readline()
        with pytest.raises(OutputError, match="another command"), lock_folder(Path("out")):
            pass
        one.kill()
        one.wait()
    with lock_folder(Path("out")):
        pass


@pytest.mark.parametrize("text", ["", "<a/>", "a = 1\n", "<a>\n</a>\n\n"])
def test_a_digest_tells_a_text_as_it_was_written(text, write):
    file = write("file", stamp(text))
    assert is_as_written(file)
    for other in (text, f"{stamp(text)}\n", f"x{stamp(text)}", stamp(text).removesuffix("\n")):
        file.write_text(other, encoding="utf-8")
        assert not is_as_written(file)
