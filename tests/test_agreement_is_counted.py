import sys
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

import screwgauge
from support.engines import ENGINES, Values, ask, model_files
from support.report import summary, verdict

QUANTITIES = ("joint_position", "joint_velocity", "actuator_force", "reaction")


def wrong_but_at(rows):
    def solve(problem):
        right = ask("screw", model_files("slider-crank", "screw"), problem)
        factor = np.where(np.isin(np.arange(len(problem.task)), rows), 1.0, 7.0)[:, None]
        values = {q: Values(v.components, v.units, v.array * factor) for q, v in right.values.items()}
        return replace(right, values=values, rows=np.array(rows))

    return solve


@pytest.fixture
def crank():
    return screwgauge.load_scene("slider-crank").at(np.linspace(0.0, 1.0, 21))


@pytest.mark.parametrize("rows", [[0], [3, 4, 5], [*range(20)]])
def test_a_sample_that_is_missing_is_no_agreement(rows, stand_in, crank):
    stand_in(mujoco=wrong_but_at(rows))
    results = screwgauge.run(crank, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert results.pairs["ok"].all()
    assert (results.outcomes, results.exit_status) == (("partly",), 1)
    (one,) = results.refusals
    assert (one.engine, one.quantities, len(one.rows)) == ("mujoco", QUANTITIES, 21 - len(rows))
    assert verdict(results).word == "✗ PARTLY"
    assert f"{len(rows)} of 21 samples" in verdict(results).text
    assert summary(results)["outcomes"] == ["partly"]


def test_a_quantity_that_is_missing_is_no_agreement(stand_in, crank):
    def solve(problem):
        right = ask("screw", model_files("slider-crank", "screw"), problem)
        return replace(right, values={q: v for q, v in right.values.items() if q != "reaction"})

    stand_in(mujoco=solve)
    results = screwgauge.run(crank, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert (results.outcomes, results.exit_status) == (("partly",), 1)


def test_who_says_that_he_stopped_has_not_answered_all(stand_in, crank):
    def solve(problem):
        return replace(ask("screw", model_files("slider-crank", "screw"), problem), stopped="t = 1 s: enough")

    stand_in(mujoco=solve)
    results = screwgauge.run(crank, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert (results.outcomes, results.exit_status) == (("partly",), 1)
    assert "enough" in verdict(results).text


class Shy:
    def __init__(self, model):
        self.model, self.lacks = model, {"reaction": "its bearings are sealed"}

    def solve(self, problem, progress=None):
        return self.model.solve(replace(problem, wanted=problem.wanted - {*self.lacks}))


def test_what_a_loaded_model_says_that_it_lacks_is_listed_and_no_failure(monkeypatch, crank):
    module, entry = ModuleType("shy"), ENGINES["mujoco"]
    module.load = lambda files: Shy(entry.load(files))
    monkeypatch.setitem(sys.modules, "shy", module)
    monkeypatch.setitem(ENGINES, "mujoco", replace(entry, source="shy:load"))
    results = screwgauge.run(crank, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert (results.outcomes, results.exit_status) == (("agree",), 0)
    assert any("its bearings are sealed" in note for note in results.solutions["mujoco"].notes)


class Late(Shy):
    def solve(self, problem, progress=None):
        self.lacks = {"reaction": "I do not know"}
        return replace(super().solve(problem), lacks=self.lacks)


def test_what_it_says_after_it_was_asked_is_no_leave_to_leave_out(monkeypatch, crank):
    module, entry = ModuleType("late"), ENGINES["mujoco"]

    def load(files):
        model = Late(entry.load(files))
        model.lacks = {}
        return model

    module.load = load
    monkeypatch.setitem(sys.modules, "late", module)
    monkeypatch.setitem(ENGINES, "mujoco", replace(entry, source="late:load"))
    results = screwgauge.run(crank, engines=["screw", "mujoco"], quantities=QUANTITIES)
    assert (results.outcomes, results.exit_status) == (("partly",), 1)


def test_forces_of_unlike_trees_that_nobody_compares_are_no_agreement():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0])
    results = screwgauge.run(scene, engines=["pinocchio", "mujoco-full"], quantities=["tree_force", "actuator_force"])
    assert (results.outcomes, results.apart) == (("partly",), ("tree_force",))


def test_samples_that_truth_does_not_look_at_are_those_that_its_entry_says():
    pytest.importorskip("flint")
    most = ENGINES["truth"].most
    scene = screwgauge.load_scene("slider-crank").at(np.linspace(0.0, 1.0, most + 3))
    results = screwgauge.run(scene, engines=["screw", "truth"], quantities=["joint_position"])
    assert (results.outcomes, results.solutions["truth"].n_solved) == (("agree",), most)
