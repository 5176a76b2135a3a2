import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import screwgauge
from support import engine_of_harm as harm
from support.engines import ENGINES, Failure, Method, ModelFiles, further_engines, get_engine, put
from support.packages import install
from support.repository import repository, scene, worse

pytestmark = pytest.mark.slow
FORCE = '["actuator_force"]'
SOURCE = {harm.NAME: f"{harm.__name__}:ENGINE"}


def with_harm(folder: Path, mode: str) -> Path:
    (folder / mode).mkdir()
    text = (folder / "four-bar.toml").read_text(encoding="utf-8").replace('"four-bar"', f'"{mode}"', 1)
    (folder / mode / "machine.toml").write_text(text, encoding="utf-8")
    said = scene(quantities=FORCE).replace('"four-bar.toml"', f'"{mode}/machine.toml"').replace('"mujoco"', '"harm"')
    (folder / f"{mode}.toml").write_text(said, encoding="utf-8")
    return folder / f"{mode}.toml"


@pytest.fixture
def folder(theirs):
    install(theirs, "harm", SOURCE)
    (theirs / "red.toml").write_text(scene('models.mujoco = "red.xml"', FORCE), encoding="utf-8")
    repository(theirs / "old")
    shutil.copy("red.toml", "old")
    text = Path("four-bar.xml").read_text(encoding="utf-8")
    for place, factor in (("red.xml", 0.01), ("old/red.xml", 0.0)):
        Path(place).write_text(worse(text, factor), encoding="utf-8")
    return theirs


def status_of(mode: str) -> set[str]:
    if mode in harm.CHANGES or mode in harm.RIGHT:
        return {"agree"}
    return {"failed"} if mode in harm.ENDS else {"failed", "differ", "partly"}


def test_whatever_an_engine_does_costs_its_own_row(folder):
    for mode in harm.MODES:
        with_harm(folder, mode)
    for i in range(4):
        shutil.copy("red.toml", f"red-{i}.toml")
        shutil.copy("turn.toml", f"turn-{i}.toml")
    places, mark = os.pathsep.join([str(folder), str(Path(__file__).parent)]), f"harm in {folder}"
    command = [sys.executable, "-P", "-m", "screwgauge.cli", "check", ".", "-j", "2", "--json"]
    environment = {**os.environ, "PYTHONPATH": places, "MARK": mark}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    rows = {row["scene"]: row for row in json.loads(done.stdout)["rows"]}
    for name, row in rows.items():
        expected = {"differ"} if name.startswith("red") else {"agree"} if name.startswith("turn") else status_of(name)
        assert row["status"] in expected, (name, row["sentence"])
    assert {*harm.MODES} < {*rows}
    assert not (folder / harm.MARK).exists()
    assert "Traceback" not in done.stderr
    assert "::" not in done.stderr
    assert marked(mark) == []


def marked(mark: str) -> list[int]:
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (place / "environ").read_bytes():
                found.append(int(place.name))
        except OSError:  # it has ended, or is another user's
            continue
    return found


@pytest.mark.parametrize("mode", ["chdir", "patch", "environ", "path", "inputs", "signals", "address", "code"])
def test_python_asks_engines_of_others_in_their_own_process(folder, mode):
    file, before = with_harm(folder, mode), (os.getcwd(), dict(os.environ), [*sys.path])
    with further_engines(SOURCE):
        results = screwgauge.run(screwgauge.load_scene(file), ["harm", "screw"])
    assert (os.getcwd(), dict(os.environ), [*sys.path]) == before
    assert not (folder / harm.MARK).exists()
    assert [*results.failures] == (["harm"] if status_of(mode) != {"agree"} else [])
    assert results.ok == (status_of(mode) == {"agree"})


def test_its_module_is_imported_by_no_process_of_ours(folder, monkeypatch):
    monkeypatch.delitem(sys.modules, harm.__name__, raising=False)
    with further_engines(SOURCE):
        assert get_engine("harm") == replace(harm.ENGINE, apart=True)
        results = screwgauge.run(screwgauge.load_scene(with_harm(folder, "thread")), ["harm", "screw"])
    assert results.ok
    assert harm.__name__ not in sys.modules


@pytest.mark.parametrize("mode", ["prints", "free", "thread"])
def test_an_engine_of_an_extra_runs_in_its_own_process(folder, mode, monkeypatch, capfd):
    monkeypatch.setitem(ENGINES, "harm", replace(harm.ENGINE, apart=True))
    monkeypatch.delitem(sys.modules, harm.__name__, raising=False)
    results = screwgauge.run(screwgauge.load_scene(with_harm(folder, mode)), ["harm", "screw"])
    assert [*results.failures] == (["harm"] if mode == "free" else [])
    assert harm.__name__ not in sys.modules
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("mode", ["thread", "address"])
def test_studies_ask_it_in_its_own_process(folder, mode, monkeypatch):
    monkeypatch.delitem(sys.modules, harm.__name__, raising=False)
    asked = screwgauge.load_scene(with_harm(folder, mode))
    with further_engines(SOURCE):
        answer = put(Method("harm"), ModelFiles(asked.mechanism_file), asked.problem(["actuator_force"]))
    assert isinstance(answer, Failure) == (mode == "address")
    assert harm.__name__ not in sys.modules


def test_what_it_printed_before_it_failed_stands_in_the_traceback(folder):
    with further_engines({"loud": "support.hostile_engine:FAILS"}):
        results = screwgauge.run(screwgauge.load_scene("turn.toml"), ["loud", "screw"], ["joint_position"])
    failure: Failure = results.failures["loud"]
    assert failure.reason == "ValueError: no idea"
    assert "solving" in failure.traceback
