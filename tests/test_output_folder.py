import hashlib
import json
import os
import re
import signal

import pytest

import screwgauge
from support.command import main
from support.errors import OutputError, ReportError
from support.pages import Picture, Text, file_name
from support.report import MANIFEST, run_page, write_report

DATA = {"numbers.json": {"a": 1}, "summary.json": {"ok": True}}
PICTURE = Picture("01-curve", "A curve", '<svg viewBox="0 0 1 1"></svg>')


def files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}


def report(folder, *blocks, data=DATA):
    return write_report(folder, lambda: [Text("A report", 1), *blocks], data)


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


@pytest.fixture
def command(out, paper_scene, no_progress):
    asked = ["run", str(paper_scene()), "--engines", "screw", "--quantities", "generalized_force", "--out", str(out)]
    return lambda *more: main([*asked, *more])


def test_only_what_the_last_report_wrote_is_replaced_or_removed(out):
    report(out, PICTURE, data={**DATA, "old.json": {}})
    mine = {"notes.txt", "samples.parquet", "plots/mine.svg", "plots/02-mine.svg"}
    for name in mine:
        (out / name).write_text("mine", encoding="utf-8")
    report(out)
    ours = {"report.md", "report.html", "numbers.json", "summary.json"}
    assert files(out) == ours | mine | {MANIFEST}
    assert all((out / name).read_text(encoding="utf-8") == "mine" for name in mine)
    assert set(json.loads((out / MANIFEST).read_text(encoding="utf-8"))["files"]) == ours


def test_a_plot_goes_beside_a_file_of_the_users_own(out):
    (out / "plots").mkdir(parents=True)
    (out / "plots" / "01-curve.svg").write_text("mine", encoding="utf-8")
    report(out, PICTURE, PICTURE)
    assert (out / "plots" / "01-curve.svg").read_text(encoding="utf-8") == "mine"
    text = (out / "report.md").read_text(encoding="utf-8")
    for name in ("01-curve-2", "01-curve-3"):
        assert (out / "plots" / f"{name}.svg").is_file()
        assert f"(plots/{name}.svg)" in text


@pytest.mark.parametrize("name", ["report.md", "report.html", "errors.csv", MANIFEST, "samples.parquet"])
def test_a_file_of_the_users_own_in_the_way_is_refused_before_any_work(name, out, command, capfd, monkeypatch):
    monkeypatch.setattr("screwgauge.api.run", None)
    out.mkdir()
    (out / name).write_text("mine", encoding="utf-8")
    assert command("--samples") == 2
    said = capfd.readouterr().err
    assert said.startswith(f"screwgauge: {out}: {name} ")
    assert said.endswith(("another folder.\n", "--force.\n"))
    assert files(out) == {name}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plots", "report.md", "errors.csv", "report-files.json"])
def test_links_are_not_followed_out_of_the_folder(name, out, tmp_path, command, capfd):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "01-joint-position.svg").write_text("mine", encoding="utf-8")
    assert command() == 0
    before = files(out)
    target = elsewhere if name == "plots" else elsewhere / "01-joint-position.svg"
    if name == "plots":
        (out / name).rename(tmp_path / "old")
    else:
        (out / name).unlink()
    (out / name).symlink_to(target)
    capfd.readouterr()
    assert command() == 2
    assert f"{name} is a link" in capfd.readouterr().err
    assert files(elsewhere) == {"01-joint-position.svg"}
    assert (elsewhere / "01-joint-position.svg").read_text(encoding="utf-8") == "mine"
    assert files(out) - {"plots"} <= before


@pytest.mark.parametrize(
    "name", ["../mine.txt", "/mine.txt", "plots/../../mine.txt", "deep/er/mine.txt", "..", "plots/.."]
)
def test_a_list_of_files_that_leads_elsewhere_removes_nothing(name, out, tmp_path):
    report(out)
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    said = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
    said["files"][name] = [hashlib.sha256(b"mine").hexdigest()]
    (out / MANIFEST).write_text(json.dumps(said), encoding="utf-8")
    report(out)
    assert (tmp_path / "mine.txt").is_file()


@pytest.mark.parametrize("files_", [["notes.txt", "mine.csv"], {"notes.txt": [], "mine.csv": ["0" * 64]}])
def test_a_list_that_somebody_else_wrote_removes_nothing(files_, out):
    out.mkdir()
    for name in ("notes.txt", "mine.csv"):
        (out / name).write_text("mine", encoding="utf-8")
    (out / MANIFEST).write_text(json.dumps({"files": files_}), encoding="utf-8")
    report(out)
    assert {"notes.txt", "mine.csv"} <= files(out)


def test_a_file_that_was_changed_since_is_one_s_own(out):
    report(out, data={**DATA, "old.json": {}})
    (out / "old.json").write_text("worked on", encoding="utf-8")
    report(out)
    assert (out / "old.json").read_text(encoding="utf-8") == "worked on"
    (out / "report.md").write_text("worked on", encoding="utf-8")
    with pytest.raises(OutputError, match=r"report\.md exists"):
        report(out)


def test_a_report_that_is_cut_off_at_any_file_is_taken_up_by_the_next(out, monkeypatch):
    report(out, PICTURE)
    for k in range(1, 8):
        left = iter(range(k))

        def replaced(a, b, left=left, replace=os.replace):
            if next(left, None) is None:
                raise OSError("killed")
            replace(a, b)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", replaced)
            with pytest.raises((OutputError, ReportError)):
                report(out, PICTURE, Text(f"{k}", 2), data={**DATA, "numbers.json": {"a": k}})
    report(out)
    assert files(out) == {*DATA, MANIFEST, "report.md", "report.html"}


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"files": 1}',
        '{"files": {"a\\u0000b.csv": []}}',
        '{"files": {"\\ud800.csv": []}}',
        '{"files": {"x": ' + "9" * 5000 + "}}",
        "[]",
    ],
    ids=["brackets", "number", "null", "half", "digits", "list"],
)
def test_a_list_that_is_none_is_refused_in_a_sentence(text, out):
    out.mkdir()
    (out / MANIFEST).write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match=r"report-files\.json.*; move it"):
        report(out)


@pytest.mark.parametrize("entry", [{"x" * 300 + ".csv": ["0"]}, {"report.md": 3}, {"report.md": [[1], {}, None]}])
def test_entries_that_prove_nothing_are_passed_over(entry, out):
    out.mkdir()
    (out / MANIFEST).write_text(json.dumps({"files": entry}), encoding="utf-8")
    report(out)
    assert files(out) == {*DATA, MANIFEST, "report.md", "report.html"}


def test_a_page_that_was_left_out_is_made_again(out):
    report(out)
    (out / "report.html").unlink()
    report(out)
    assert files(out) == {*DATA, MANIFEST, "report.md", "report.html"}


def test_no_manifest_is_waited_for(out):
    out.mkdir()
    os.mkfifo(out / MANIFEST)
    with pytest.raises(OutputError, match="is not a list"):
        report(out)


@pytest.mark.parametrize("broken", [ValueError("no such colour"), OSError(36, "File name too long"), RecursionError()])
def test_a_page_that_breaks_leaves_the_numbers_and_no_older_page(broken, out):
    report(out, PICTURE)

    def tell():
        raise broken

    with pytest.raises(ReportError, match=r"report could not be made") as caught:
        write_report(out, tell, {**DATA, "numbers.json": {"a": 2}})
    assert caught.value.exit_status == 3
    assert files(out) == {*DATA, MANIFEST}
    assert json.loads((out / "numbers.json").read_text(encoding="utf-8")) == {"a": 2}
    report(out, PICTURE)
    assert files(out) == {*DATA, MANIFEST, "report.md", "report.html", "plots/01-curve.svg"}


def test_a_picture_that_breaks_is_one_sentence_and_exit_3(out, command, capfd, monkeypatch):
    def breaks(results):
        raise ValueError("no such colour")

    monkeypatch.setattr(run_page, "make_plots", breaks)
    assert command() == 3
    said = capfd.readouterr()
    assert "Only screw ran" in said.out
    assert said.out.endswith("report: none\n")
    assert said.err == (
        f"screwgauge: {out}: the report could not be made (ValueError: no such colour); "
        "use the numbers, which are complete, and report the traceback that --debug prints.\n"
    )
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))["ok"] is True


def test_a_figure_with_a_title_of_300_letters_is_drawn(out, paper_scene, no_progress):
    title, shown = "$x_$ Ünïcode " + "a" * 300, "quantity = 'joint_position', unit = 'rad'"
    figure = f"figures = [{{ title = '{title}', {shown}, panels = {{ '$^' = ['*'] }} }}]"
    scene = screwgauge.load_scene(paper_scene(figures=figure))
    screwgauge.run(scene, ["screw"], ["joint_position"]).write(out)
    (name,) = (path.name for path in out.glob("plots/01*"))
    assert len(name) < 80
    assert file_name("Ü") == "figure"


def test_stopped_while_the_pages_are_made_says_what_is_there(out, command, capfd, monkeypatch):
    monkeypatch.setattr(run_page, "make_plots", lambda results: os.kill(os.getpid(), signal.SIGTERM))
    assert command() == 143
    assert re.fullmatch(f"screwgauge: terminated.* in {out}, .*\n", capfd.readouterr().err)
    assert "summary.json" in files(out)
    assert not [path for path in out.iterdir() if path.name.startswith(".screwgauge")]


@pytest.mark.parametrize("name", ["x" * 300, "x/" * 3000, "a\0b"])
def test_a_folder_that_no_disk_takes_is_bad_input(name, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr("screwgauge.api.run", None)
    assert main(["run", "3ups-upu-s", "--out", str(tmp_path / name)]) == 2
    said = capfd.readouterr().err
    assert "cannot write to the folder (" in said
    assert said.count("\n") == 1
    assert not list(tmp_path.glob("x*"))
