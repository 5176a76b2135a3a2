import json
import re
import shutil
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

import screwgauge
from screwgauge import Limits
from support import bad_engines
from support.bench import journals
from support.command import main
from support.gate import GateSettings, Item, Processes, address, check_items, files_in, gate_run, sentence_of
from support.packages import install
from support.repository import edited, scene, tell, worse

pytestmark = pytest.mark.slow


@pytest.mark.slow
def test_an_assertion_of_a_result_alone_fails_where_the_result_does(theirs):
    Path("edited.xml").write_text(worse(Path("four-bar.xml").read_text(encoding="utf-8"), 0.01), encoding="utf-8")
    scene_ = screwgauge.load_scene("turn.toml")
    for edit, right in (("four-bar.xml", True), ("edited.xml", False)):
        own = replace(scene_, models={"mujoco": Path(edit)})
        assert bool(screwgauge.run(own, ["screw", "mujoco"], ["actuator_force"])) is right
        assert bool(screwgauge.diagnose("four-bar.xml", edit)) is right
        assert bool(screwgauge.check("four-bar.xml", edit)) is right


def test_what_agrees_passes_in_every_form(theirs):
    found = screwgauge.check("turn.toml")
    found.assert_ok()
    assert found.exit_status == 0
    assert all(one.ok and one.reason for row in found.rows for one in row.errors)
    record = json.loads(found.json)
    assert record["ok"]
    assert [row["scene"] for row in record["rows"]] == ["turn"]
    assert {"joint_position", "actuator_force", "loop_closure"} <= {one.quantity for one in found.rows[0].errors}
    suite = ET.fromstring(found.junit())
    assert suite.attrib == {"name": "screwgauge", "tests": "1", "failures": "0", "errors": "0"}
    assert "| turn | ✓ ok |" in found.markdown()
    assert "usual condition number: joint_position 1e-11" in found.markdown()
    assert [*found.annotations()] == []


def heavier(text: str) -> str:
    return text.replace('mass="1.2"', f'mass="{1.2 * (1 + 1e-9)!r}"')


@pytest.mark.parametrize(
    ("change", "cause"), [(partial(worse, by=1e-6), "coupler: inertia yy"), (heavier, "coupler: mass")]
)
def test_a_change_fails_with_place_values_tolerance_and_cause(theirs, change, cause):
    edited(theirs / "four-bar.xml", change)
    found = screwgauge.check(theirs / "turn.toml")
    assert found.exit_status == 1
    with pytest.raises(AssertionError) as raised:
        found.assert_ok()
    said = str(raised.value)
    worst = found.rows[0].worst
    assert said.startswith("turn: actuator_force at a, t = 0")
    for side, value in zip((worst.a, worst.b), worst.values, strict=True):
        assert f"{side} {value:.10g}"[:14] in said
    assert "tolerance 1e-11 (rounding" in said
    assert cause in said
    (line,) = found.annotations()
    assert line.startswith(f"::error file={theirs}/four-bar.xml,line=")
    number = int(line.partition("line=")[2].partition(":")[0])
    assert 'name="coupler"' in (theirs / "four-bar.xml").read_text().splitlines()[number - 1]
    failure = ET.fromstring(found.junit()).find("testcase/failure")
    assert cause in failure.get("message")


def test_tolerances_are_the_scene_s_then_the_file_s_then_derived(theirs):
    edited(theirs / "four-bar.xml", lambda text: worse(text, 1e-4))
    (theirs / "loose.toml").write_text("actuator_force = 1e-2\njoint_position = 1e-3\n")
    allowed = 'models.mujoco = "four-bar.xml"\nallow = ["coupler.inertia"]\n'
    (theirs / "own.toml").write_text(scene(f"{allowed}tolerances.joint_position = 1e-9"))
    (theirs / "turn.toml").write_text(scene(allowed))
    found = screwgauge.check("own.toml", "turn.toml", tolerances=theirs / "loose.toml")
    assert found.ok
    said = {(row.scene, e.quantity): (e.tolerance, e.reason) for row in found.rows for e in row.errors}
    assert said["own", "joint_position"] == (1e-9, "from the scene")
    assert said["turn", "joint_position"] == (1e-3, "from --tolerances")
    assert said["own", "actuator_force"] == (1e-2, "from --tolerances")
    assert not screwgauge.check("turn.toml", tolerances={"actuator_force": 1e-7}).ok


def test_digits_that_a_file_is_cut_to_are_admitted_and_no_more(theirs):
    def cut(text: str) -> str:
        return re.sub(r"\d+\.\d{6,}", lambda match: f"{float(match[0]):.6g}", text)

    edited(theirs / "four-bar.xml", lambda text: cut(text.replace('mass="1.2"', 'mass="1.20000000"')))
    found = screwgauge.check("turn.toml")
    assert found.ok, found
    assert any("6 digits in four-bar.xml" in one.reason for one in found.rows[0].errors)
    assert "wider than usual" in found.rows[0].sentence
    edited(theirs / "four-bar.xml", lambda text: text.replace('mass="1.2"', 'mass="1.20002"'))
    assert not screwgauge.check("turn.toml").ok


@pytest.mark.slow
def test_two_model_files_are_a_pair(theirs):
    shutil.copy(theirs / "four-bar.xml", theirs / "other.xml")
    found = screwgauge.check("four-bar.urdf", "other.xml")
    assert found.rows[0].scene == "four-bar.urdf - other.xml"
    assert str(found).startswith("✓ OK: 1 of 1 pass. Models agree")  # no engine, no judge
    edited(theirs / "other.xml", lambda text: worse(text, 1e-6))
    row = screwgauge.check("four-bar.urdf", "other.xml").rows[0]
    assert row.status == "differ"
    assert "coupler: inertia yy" in row.sentence
    assert 'name="coupler"' in (theirs / "other.xml").read_text().splitlines()[row.line - 1]
    assert screwgauge.check("four-bar.urdf", "other.xml", tolerances={"tree_force": 1e-4}).ok
    edited(theirs / "other.xml", lambda text: text.replace('mass="1.2"', 'mass="1.3"'))
    assert not screwgauge.check("four-bar.urdf", "other.xml", tolerances={"tree_force": 1e-4}).ok


@pytest.mark.parametrize(
    ("status", "by", "same"), [("shown", 1e-8, True), ("not shown", 1e-8, False), ("shown", 1e-4, False)]
)
def test_tensors_that_mujoco_compiles_inexactly_are_no_difference_of_the_files(status, by, same, theirs, monkeypatch):
    monkeypatch.setattr("screwgauge.diagnosis.facts.fact.is_shown_here", lambda case: status == "shown")
    shutil.copy(theirs / "four-bar.xml", theirs / "other.xml")
    edited(theirs / "other.xml", lambda text: worse(text, by))
    (row,) = screwgauge.check("four-bar.urdf", "other.xml").rows
    assert (row.status == "agree") is same, row.sentence
    assert ("MuJoCo's compiler" in row.sentence) is same


def test_a_folder_is_its_scenes_and_a_broken_one_is_a_row(theirs):
    (theirs / "broken.toml").write_text("mechanism = \n")
    (theirs / "wrong.toml").write_text(scene("colour = 1"))
    found = screwgauge.check(".")
    assert {row.scene: row.status for row in found.rows} == {
        "broken": "refused",
        "turn": "agree",
        "wrong": "refused",
    }
    assert found.exit_status == 2
    assert "unknown key 'colour'" in found.rows[2].sentence
    assert main(["check", "broken.toml", "--junit", "junit.xml"]) == 2
    assert ET.parse(theirs / "junit.xml").getroot().get("errors") == "1"


def test_smoke_takes_few_samples_and_says_what_they_test(theirs):
    row = screwgauge.check("turn.toml", smoke=True).rows[0]
    assert row.ok
    assert row.coverage.startswith("3 samples. 12 of 30 inertial parameters")
    row = screwgauge.check("a01-pendulum", smoke=True).rows[0]
    assert row.ok
    assert row.coverage.startswith("The first 0.1 s.")


@pytest.mark.slow
def test_smoke_leaves_out_no_scene_however_large():
    (row,) = screwgauge.check("a02-fourbar-40", smoke=True).rows
    assert row.ok
    assert {"observable", "joint_acceleration", "energy_balance"} <= {error.quantity for error in row.errors}


def test_a_missing_engine_and_nan_fail(theirs, stand_in):
    def nothing(problem):
        raise ImportError("No module named 'mujoco'", name="mujoco")

    stand_in(mujoco=nothing)
    found = screwgauge.check("turn.toml")
    assert found.exit_status == 3
    assert ET.fromstring(found.junit()).get("errors") == "1"


@pytest.mark.slow
def test_the_command_leaves_files_for_ci(theirs, monkeypatch, capsys):
    edited(theirs / "four-bar.xml", lambda text: worse(text, 1e-6))
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(theirs / "summary.md"))
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    (theirs / "summary.md").write_text("before\n")
    assert main(["check", "turn.toml", "--junit", "junit.xml", "--out", "out"]) == 1
    assert ET.parse(theirs / "junit.xml").getroot().get("failures") == "1"
    summary = (theirs / "summary.md").read_text()
    assert summary.startswith("before\n## Screwgauge")
    assert "coupler: inertia yy" in summary
    printed = capsys.readouterr().out
    assert "\n::error file=" in printed
    assert "✗ FAILED: 0 of 1 pass." in printed
    page = (theirs / "out" / "report.md").read_text(encoding="utf-8")
    assert page.startswith("# Check of turn")
    assert page.count("| turn | ✗ differ |") == 1
    assert page.index("coupler: inertia yy") < page.index("plots/01-turn.svg") < page.index("## Largest tolerances")
    assert main(["check", "turn.toml", "--json", "--out", "out"]) == 1
    assert json.loads(capsys.readouterr().out)["rows"][0]["status"] == "differ"
    assert json.loads((theirs / "out" / "check.json").read_text())["rows"][0]["status"] == "differ"


def test_an_interrupted_check_on_a_cluster_goes_on_where_it_stopped(theirs, monkeypatch, cache_folder):
    (theirs / "again.toml").write_text(scene())
    items, settings = [Item(name, (f"{name}.toml",)) for name in ("turn", "again")], GateSettings(sentence_of)
    asked, measured = [], gate_run.check_item

    def stops(item, settings, progress):
        asked.append(item.name)
        if asked == ["turn", "again"]:
            raise KeyboardInterrupt
        return measured(item, settings, progress)

    monkeypatch.setattr(gate_run, "check_item", stops)
    with pytest.raises(KeyboardInterrupt):
        check_items(items, settings, place=theirs)
    rows = check_items(items, settings, place=theirs)
    assert asked == ["turn", "again", "again"]
    assert [row.scene for row in rows] == ["turn", "again"]
    assert repr(rows[0].errors) == repr(check_items(items[:1], settings)[0].errors)
    assert not journals()


@pytest.mark.parametrize("name", ["four-bar.toml", "base.toml", "turn.toml", "four-bar.xml", "inner.xml", "motion.csv"])
def test_a_kept_row_is_not_taken_when_any_file_that_was_opened_has_changed(name, theirs):
    Path("four-bar.toml").rename("base.toml")
    Path("four-bar.toml").write_text('extends = "base.toml"\nname = "four-bar"\n', encoding="utf-8")
    text = Path("four-bar.xml").read_text(encoding="utf-8")
    begin, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    Path("inner.xml").write_text(f"<mujoco>{text[begin:end]}</mujoco>", encoding="utf-8")
    Path("four-bar.xml").write_text(f'{text[:begin]}<include file="inner.xml"/>{text[end:]}', encoding="utf-8")
    Path("motion.csv").write_text("t,crank,crankd,crankdd\n0,1,0,0\n0.25,1,0,0\n0.5,1,0,0\n", encoding="utf-8")
    edited(Path("turn.toml"), lambda text: re.sub("motion.crank.*", 'motion = { csv = "motion.csv" }', text))
    item = Item("turn", ("turn.toml",))
    before = address(files=files_in(item))
    assert address(files=files_in(item)) == before
    edited(Path(name), lambda text: f"{text}\n")
    assert address(files=files_in(item)) != before


@pytest.mark.slow
def test_a_crash_costs_one_row(theirs, isolated):
    names = ("segfault", "last")
    for name in names:
        (theirs / f"{name}.toml").write_text(scene(quantities='["joint_position"]'))
    items = [Item(name, (f"{theirs}/{name}.toml",)) for name in names]
    rows = check_items(items, GateSettings(tell), execute=Processes())
    assert [row.status for row in rows] == ["failed", "agree"]
    assert rows[0].sentence.startswith("segfault: comparison: ")
    assert "SIGSEGV" in rows[0].sentence


@pytest.mark.slow
def test_an_engine_that_crashes_or_eats_memory_costs_its_row_and_is_named(theirs, isolated, monkeypatch):
    monkeypatch.setattr("screwgauge.study.isolation._EXECUTORS", {})  # older processes know nothing of the new engines
    monkeypatch.setattr(sys, "path", [*sys.path, str(theirs)])
    install(theirs, "bad_engines", bad_engines.PLACES)
    names = (*bad_engines.NAMES, "mujoco")
    for name in names:
        text = scene(quantities='["joint_position"]').replace('"mujoco"', f'"{name}"')
        (theirs / f"with-{name}.toml").write_text(text)
    items = [Item(f"with-{name}", (f"{theirs}/with-{name}.toml",)) for name in names]
    rows = check_items(items, GateSettings(sentence_of), execute=Processes(2, Limits(memory=0.75)))
    assert [row.status for row in rows] == ["failed", "failed", "agree"], [row.sentence for row in rows]
    assert "segfault: crashed: its process received SIGSEGV" in rows[0].sentence
    assert "hog: MemoryError" in rows[1].sentence


@pytest.mark.slow
def test_what_hangs_costs_its_row(theirs, isolated):
    (theirs / "hang.toml").write_text(scene(quantities='["joint_position"]'))
    rows = check_items(
        [Item("hang", (f"{theirs}/hang.toml",))], GateSettings(tell), execute=Processes(1, Limits(seconds=0.5))
    )
    assert rows[0].status == "failed"
    assert "stopped at the time limit of 0.5 s" in rows[0].sentence
