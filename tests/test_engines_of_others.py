import json
import os
import sys

import numpy as np
import pytest

import screwgauge
from screwgauge.study.answers import LONG
from support import hostile_engine
from support.command import main
from support.engines import ENGINES, Error, Solution, Values, ask, engines, further_engines, get_engine, model_files

QUANTITIES = ["joint_position", "generalized_force"]


def right(problem) -> Solution:
    return ask("screw", model_files("3ups-upu-s", "screw"), problem)


def spoilt(results) -> str:
    assert [*results.solutions] == ["screw", "pinocchio"]
    good = results.pairs[(results.pairs["a"] == "screw") & (results.pairs["b"] == "pinocchio")]
    assert {*good["quantity"]} == {*QUANTITIES}
    assert good["ok"].all()
    assert results.exit_status == 3
    return results.failures["mujoco"].reason


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.parametrize("kind", hostile_engine.WRONG)
def test_an_answer_with_something_wrong_is_its_own_row(kind, stand_in, scene, tmp_path):
    change, word = hostile_engine.WRONG[kind]
    stand_in(mujoco=lambda problem: change(right(problem)))
    results = screwgauge.run(scene, quantities=QUANTITIES)
    reason = spoilt(results)
    assert word in reason
    assert len(reason) < 500
    if kind == "complex":
        results.write(tmp_path)


@pytest.mark.sampled(3)
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # as the command line has it
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324])
def test_any_double_can_be_compared_and_told(value, stand_in, scene, tmp_path):
    def answer(problem):
        found = right(problem)
        values = {k: Values(v.components, v.units, np.full_like(v.array, value)) for k, v in found.values.items()}
        extreme = np.full(len(problem.task), abs(value))
        values["unheard"] = values["joint_position"]
        more = {"condition": extreme, "work": extreme}
        errors = dict.fromkeys(QUANTITIES, Error(extreme, {"rad": value}))
        return Solution("any", "", values, **more, errors=errors)

    stand_in(mujoco=answer)
    results = screwgauge.run(scene, quantities=QUANTITIES)
    good = results.pairs[(results.pairs["a"] == "screw") & (results.pairs["b"] == "pinocchio")]
    assert good["ok"].all()
    assert not results.ok
    results.write(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [np.float32, np.longdouble, ">f8", np.int64])
def test_real_numbers_of_other_kinds_are_doubles(kind, stand_in, scene):
    def answer(problem):
        found = right(problem)
        values = {k: Values(v.components, v.units, v.array.astype(kind)) for k, v in found.values.items()}
        return Solution("other", "", values, found.condition)

    stand_in(mujoco=answer)
    results = screwgauge.run(scene, quantities=QUANTITIES)
    assert results.failures == {}
    assert results.values("joint_position", "mujoco").dtype == np.float64


def test_long_notes_are_cut_and_say_by_how_much(stand_in, scene):
    def answer(problem):
        found = right(problem)
        return Solution("long", "", found.values, found.condition, notes=("x" * 10_000,), warnings=("y" * 10_000,))

    stand_in(mujoco=answer)
    found = screwgauge.run(scene, quantities=QUANTITIES).solutions["mujoco"]
    assert found.notes[0] == "x" * LONG + "... (8000 more characters)"
    assert len(found.warnings[0]) < LONG + 50


@pytest.mark.parametrize("error", [hostile_engine.UnreadableError(), ValueError("x" * 10_000_000)])
def test_an_error_that_cannot_be_read_is_a_row(error, stand_in, scene):
    def fails(problem):
        raise error

    stand_in(mujoco=fails)
    assert len(spoilt(screwgauge.run(scene, quantities=QUANTITIES))) < 2 * LONG


@pytest.mark.parametrize("source", ["NO_ENGINE", "LONG"])
def test_what_describes_no_engine_is_an_engine_that_cannot_be_loaded(source, scene):
    with further_engines({"loud": f"support.hostile_engine:{source}"}):
        assert engines()["loud"].meaning == "cannot be loaded"
        results = screwgauge.run(scene, ["screw", "loud"], QUANTITIES)
    assert [*results.failures] == ["loud"]
    assert [*results.solutions] == ["screw"]


def test_an_engine_is_called_as_its_entry_says(scene):
    with further_engines({"loud": "support.hostile_engine:IMPOSTOR"}):
        assert get_engine("loud").name == "loud"
        assert get_engine("screw") is ENGINES["screw"]
        results = screwgauge.run(scene, ["loud", "screw"], QUANTITIES)
    assert {name: answer.engine for name, answer in results.solutions.items()} == {"loud": "loud", "screw": "screw"}


@pytest.mark.slow
def test_nothing_that_an_engine_prints_stands_before_the_json(
    paper_scene, isolated, tmp_path, capfd, monkeypatch, no_progress
):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    options = ["--engines", "screw,loud", "--quantities", "joint_position", "--json", "--out", str(tmp_path / "out")]
    with further_engines({"loud": "support.hostile_engine:ENGINE"}):
        assert main(["run", str(paper_scene()), *options]) == 0
    said = capfd.readouterr()
    assert json.loads(said.out)["ok"] is True
    assert not {"imported", "solving", "in C"} & {*said.err.split("\n")}


@pytest.mark.slow
def test_nothing_that_an_engine_prints_reaches_who_calls_from_python(scene, isolated, capfd, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    with further_engines({"loud": "support.hostile_engine:ENGINE"}):
        assert "loud" in screwgauge.run(scene, ["screw", "loud"], QUANTITIES).solutions
    assert capfd.readouterr() == ("", "")


def test_nothing_that_an_engine_prints_stands_in_a_list(capfd):
    with further_engines({"listed": "support.hostile_engine:ENGINE"}):
        assert main(["list", "engines"]) == 0
    said = capfd.readouterr()
    assert "listed" in said.out
    assert "imported" not in said.out + said.err
