"""What the READMEs say is so: their example files, commands, output, links, keys, columns and options."""

from __future__ import annotations

import json
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge.report.listing import listing
from support.command import main
from support.mechanism import load_mechanism
from support.models import read_loops

ROOT = Path(__file__).parents[1]
TEXTS = {
    folder: (ROOT / folder / "README.md").read_text(encoding="utf-8")
    for folder in (".", "models", "harness/scenes", "harness/casebook", "reference", "reports")
}
README = TEXTS["."]
LONGEST = 200


FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(text: str, language: str = "") -> list[str]:
    """The fenced blocks of one language."""
    return [block for has, block in FENCE.findall(text) if has == language]


def squeezed(text: str) -> str:
    return " ".join(text.split())


def block_with(beginning: str) -> str:
    """The block of the README that begins so."""
    (found,) = [block for block in blocks(README) if block.startswith(beginning)]
    return found


def shown(name: str) -> str:
    """The TOML block of the README that a file of this name is introduced with."""
    (found,) = re.findall(rf"^`{re.escape(name)}`.*?^```toml\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    return found


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """A folder with the files that the README shows, and what its shell commands make of them."""
    folder = tmp_path_factory.mktemp("readme")
    for name in ("four-bar.toml", "turn.toml", "gate.toml"):
        (folder / name).write_text(shown(name), encoding="utf-8")
    commands = block_with("screwgauge models")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["models", "four-bar.toml", "--out", "."]) == 0
    (old, new, source, target) = re.search(r"^sed 's/(.*)/(.*)/' (\S+) > (\S+)$", commands, re.MULTILINE).groups()
    generated = (folder / source).read_text(encoding="utf-8")
    assert generated.count(old) == 1
    (folder / target).write_text(generated.replace(old, new), encoding="utf-8")
    return folder


@pytest.fixture
def run(example, monkeypatch, capsys):
    """Runs the command line on a scene of the README; its exit status and what it printed, spaces squeezed."""

    def carried_out(*arguments: str, command: str = "run") -> tuple[int, str]:
        monkeypatch.chdir(example)
        status = main([command, *arguments])
        return status, squeezed(capsys.readouterr().out)

    return carried_out


def test_readme_is_short() -> None:
    assert len(README.splitlines()) <= LONGEST
    assert len(shown("four-bar.toml").splitlines()) <= 25
    assert len(README.split("## Glossary")[1].strip().splitlines()) <= 25


def test_first_two_commands_are_those_that_others_rely_on() -> None:
    assert blocks(README)[0].splitlines() == [
        "pip install . && screwgauge run                 # the paper's scene, three engines, a verification report",
        "pip install '.[test]' && pytest                 # the tests",
    ]


@pytest.mark.slow
def test_four_bar_runs_with_all_three_engines(run) -> None:
    status, said = run("turn.toml")
    assert status == 0
    count = re.search(r"all (\d+) comparisons agree", README)[1]
    assert f"screw, pinocchio and mujoco agree: all {count} comparisons are within tolerance" in said


@pytest.mark.slow
def test_reversed_axis_faults_the_loop_that_it_opens(example, run) -> None:
    model = (example / "four-bar.xml").read_text(encoding="utf-8")
    (joint,) = re.findall(r'<joint name="b" .*?/>', model)
    reversed_one = model.replace(joint, joint.replace('axis="0 1 0"', 'axis="0 -1 0"'))
    assert reversed_one != model
    (example / "reversed.xml").write_text(reversed_one, encoding="utf-8")
    scene = f'{shown("turn.toml")}models.mujoco = "reversed.xml"\n'
    (example / "reversed.toml").write_text(scene, encoding="utf-8")
    status, said = run("reversed.toml", "--quantities", "joint_position")
    assert status == 1
    assert "first in joint_position at b" in said
    assert re.search(r"faults mujoco: loop closure .* at d\.", said)


def test_the_panda_differs_as_its_report_says() -> None:
    """What the README quotes, ``...`` for what it leaves out, is in the committed report of the same command."""
    report = json.loads((ROOT / "reports/panda/diagnosis.json").read_text(encoding="utf-8"))
    said, table = block_with("✗ DIFFER: panda").split("\n\n")
    assert squeezed(said).strip() == f"✗ DIFFER: {report['headline']}"
    rows = [re.fullmatch(r" *(?:(\S+) %)? *(\S.*?)(?: \.\.\.)?", line) for line in table.splitlines()[1:]]
    assert len(rows) >= 3
    for share, sentence in (row.groups() for row in rows):
        (cause,) = (each for each in report["causes"] if each["short"].startswith(sentence))
        assert share is None or 100.0 * cause["share"] == pytest.approx(float(share), rel=1e-2)


def test_the_panda_is_told_as_its_report_says() -> None:
    """The numbers of the text, and the command: its files are those of the report."""
    report = json.loads((ROOT / "reports/panda/diagnosis.json").read_text(encoding="utf-8"))
    text = squeezed(README)
    for side in "AB":
        assert report["models"][side]["file"] in text
    dynamics = {row["quantity"]: row for row in report["dynamics"]}
    assert all(dynamics[f"body {what}"]["scaled"] < 1e-14 for what in ("velocity", "acceleration"))
    torque = dynamics["inverse dynamics"]
    assert f"joint {torque['worst'][-1]} is off by {torque['max_abs']:.1f} N m" in text
    inertias = [np.array(each["b"]) for each in report["differences"] if each["what"] == "inertia"]
    assert all(np.abs(inertia / inertia[0, 0] - np.eye(3)).max() < 3e-3 for inertia in inertias)
    assert {round(inertia[0, 0], 3) for inertia in inertias} == {0.1, 0.2, 0.3}
    damping = [each["b"] / each["a"] for each in report["differences"] if each["what"] == "damping"]
    assert f"up to {max(damping):.0f} times" in text
    assert report["backfill"]["on"] == "file"
    readers = pd.read_csv(ROOT / "reports/readers/readers.csv")
    assert f"[{len(readers.groupby(['source', 'model']))} public models]" in text


def test_no_report_says_where_it_was_made() -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / "reports").glob("*/*.json")}
    assert len(texts) > 4
    assert not {path.parent.name: found for path, text in texts.items() if (found := re.findall(r'"/[^"\s]+"', text))}


@pytest.mark.slow
def test_gate_ends_as_shown(example, run) -> None:
    status, said = run("gate.toml", command="check")
    assert status == 1
    for part in block_with("✗ FAILED").split("..."):
        assert squeezed(part) in said
    text = shown("gate.toml")
    assert text.count("= 1e-3") == 1
    (example / "wide.toml").write_text(text.replace("= 1e-3", "= 1e-2"), encoding="utf-8")
    assert run("wide.toml", command="check")[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "k"), [(folder, k) for folder, text in TEXTS.items() for k in range(len(blocks(text, "python")))]
)
def test_python_runs(folder, k, inside) -> None:
    code = blocks(TEXTS[folder], "python")[k].replace("100_000", "1_000")
    exec(compile(code, f"{folder}/README.md", "exec"), {})


def slug(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("folder", TEXTS)
def test_links_lead_somewhere(folder) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", TEXTS[folder]):
        if target.startswith("https://"):
            continue
        name, _, heading = target.partition("#")
        path = ROOT / folder / name
        assert path.exists(), f"{folder}/README.md: {target}"
        if heading:
            headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in map(slug, headings), f"{folder}/README.md: {target}"


def test_rooms_exist() -> None:
    rooms = block_with("reference/ ")
    top = re.findall(r"^(\w+/)(?: (\w+/))?", rooms, re.MULTILINE)
    below = re.findall(r"^  (\S+(?: \S+)*?)  ", rooms, re.MULTILINE)
    paths = [name for pair in top for name in pair if name]
    paths += [f"harness/{name}" for line in below for name in line.split()]
    assert len(paths) >= 14
    for path in paths:
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("folder", TEXTS)
def test_files_and_modules_that_are_named_exist(folder) -> None:
    prose = FENCE.sub("", TEXTS[folder])
    for path in re.findall(r"`((?:harness|reference|models)/[\w/.-]*)`", prose):
        assert (ROOT / path).exists(), path
    for module in re.findall(r"`(screwgauge(?:\.[a-z_]+)+)`", prose):
        assert find_spec(module), module


MECHANISM = """
name = "m"
{top}
[independent]
y = "a"
[bodies.b]
mass = 1
inertia = {{ xx = 1, yy = 1, zz = 1{inertia} }}
{body}
[joints.a]
kind = "R"
parent = "ground"
child = "b"
axes = [[0, 0, 1]]
{joint}
"""
GIVEN = 'mechanism = "a02-fourbar-2"\nmotion = { crank = { offset = 0 } }\n'
SIMULATED = 'mechanism = "a02-fourbar-2"\nforward = {}\n'
TIME = "time = { duration = 1, step = 0.1 }\n"
UNKNOWN = "unknown_one = 1"


def undocumented(call, path: Path, text: str) -> list[str]:
    """Keys that the error about an unknown one offers and the text has not in code font."""
    with pytest.raises(screwgauge.ScrewgaugeError) as error:
        call(path)
    assert "unknown key 'unknown_one'" in str(error.value)
    known = error.value.remedy.split(": ", 1)[1].split(", ")
    words = {word for code in re.findall(r"`([^`]+)`", FENCE.sub("", text)) for word in re.findall(r"\w+", code)}
    return [key for key in known if key not in words]


@pytest.mark.parametrize(
    "entry",
    [
        {"top": UNKNOWN},
        {"top": f"spherical_axial = {{ {UNKNOWN} }}", "joint": "coordinates = ['a']"},
        {"body": UNKNOWN},
        {"inertia": f", {UNKNOWN}"},
        {"joint": UNKNOWN},
        {"joint": f"child_frame = {{ {UNKNOWN} }}"},
    ],
)
def test_every_key_of_a_mechanism_is_documented(entry, write) -> None:
    path = write("m.toml", MECHANISM.format(**{"top": "", "body": "", "inertia": "", "joint": "", **entry}))
    assert undocumented(load_mechanism, path, TEXTS["models"]) == []


@pytest.mark.parametrize(
    "text",
    [GIVEN + f"time = {{ {UNKNOWN} }}\n", GIVEN.replace("offset", "unknown_one") + TIME]
    + [
        scene + TIME + entry
        for scene in (GIVEN, SIMULATED)
        for entry in [UNKNOWN, f"tolerances = {{ {UNKNOWN} }}"]
        + [f"{name} = [{{ {UNKNOWN} }}]" for name in ("loads", "springs", "motors", "figures")]
    ]
    + [SIMULATED.replace("{}", f"{{ {UNKNOWN} }}") + TIME]
    + [SIMULATED + TIME + f"{name} = [{{ {UNKNOWN} }}]" for name in ("observables", "published")]
    + [SIMULATED + TIME + f"observables = [{{ name = 'o', coordinate = 'a0' }}]\nreference = {{ {UNKNOWN} }}"],
)
def test_every_key_of_a_scene_is_documented(text, write) -> None:
    assert undocumented(screwgauge.load_scene, write("s.toml", text), TEXTS["harness/scenes"] + README) == []


@pytest.mark.parametrize("name", ["four-bar", "four-bar-full"])
def test_every_key_of_a_loops_file_is_documented(name, example, write) -> None:
    text = (example / f"{name}.loops.toml").read_text(encoding="utf-8")
    for bad in (f"{UNKNOWN}\n{text}", f"{text}{UNKNOWN}\n"):
        assert undocumented(read_loops, write(f"{name}.toml", bad), TEXTS["models"]) == []


@pytest.mark.parametrize("path", sorted(ROOT.glob("reports/**/*.csv")), ids=lambda path: str(path.relative_to(ROOT)))
def test_every_column_of_a_table_is_documented(path) -> None:
    columns = set(pd.read_csv(path, nrows=0).columns)
    passages = re.split(r"\n\n|\n(?=\|)", TEXTS["reports"])
    assert any(f"`{path.name}`" in text and columns <= set(re.findall(r"\w[\w-]*", text)) for text in passages)


COMMANDS = ["list", "models", "run", "bench", "stress", "diagnose", "check", "history"]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_documented(command, capsys) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    options = set(re.findall(r"--[a-z]+", capsys.readouterr().out))
    written = set(re.findall(r"--[a-z]+", "".join(TEXTS.values())))
    assert options <= written


def test_every_quantity_case_scene_and_engine_is_documented() -> None:
    texts = "".join(TEXTS.values())
    names = [line.split()[0] for line in listing(None).splitlines() if "  " in line]
    assert len(names) > 40
    assert [name for name in names if f"`{name}`" not in texts] == []
