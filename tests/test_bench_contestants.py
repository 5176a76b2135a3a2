"""Contestants of benches."""

import pickle
import re
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.study.bench import contestants as registry
from screwgauge.study.bench import run as run_module
from screwgauge.study.linkages import FILE, LENGTHS, MASSES, MOMENTS, four_bar_states, write_four_bar
from support.acting import JointSpring
from support.bench import TABLE, Contestant, Plan, bench
from support.engines import ENGINES, Engine, Method, ModelFiles, Values, get_engine
from support.errors import DescriptionError, UnknownNameError
from support.judging import deviation, score
from support.mechanism import load_mechanism
from support.scene import QUANTITIES, GivenMotion, States, pose_scene
from support.solve import in_precision, layout

PLAN = Plan(samples=5, rounds=1, budget=1e9, quick=True)


@pytest.fixture
def found(bench_of_all):
    return bench_of_all


@pytest.mark.slow
def test_there_are_enough_of_them(found):
    assert len(found.rows) >= 40
    assert len({row.contestant.family for row in found.rows}) >= 8


def test_every_row_has_an_error_and_a_time_or_a_reason(found):
    for row in found.rows:
        if row.status == "ok":
            assert row.time_s > 0
            assert np.isfinite(row.error) or row.quantity == "none"
        else:
            assert row.reason
    failed = [row.contestant for row in found.rows if row.status != "ok"]
    assert [one.name for one in failed if get_engine(one.method.engine).installed] == ["four-bar"]


@pytest.mark.parametrize(
    "entry", TABLE["lines"], ids=lambda entry: entry["name"] if "name" in entry else entry["family"]
)
def test_an_entry_says_nothing_that_no_contestant_has(entry):
    values = [value for values in entry.get("over", {}).values() for value in values if isinstance(value, dict)]
    said = {*entry, *entry.get("over", {}), *(name for value in values for name in value)}
    words = {"engine", "settings", "variant", "over", "each", "slow", "named"}
    understood = {field.name for field in fields(Contestant)} | words
    odd = [name for name in said - understood if not re.search(rf"(\{{|\$){name}\b", str(entry))]
    assert set(odd) <= {"which"}  # an axis of tables, whose name is never asked for


def test_no_two_contestants_share_a_key(found):
    keys = [(row.contestant.key, row.quantity) for row in found.rows]
    assert len(set(keys)) == len(keys)


#: Contestant, words of its setting, quantities, and least and largest error of each row.
ERRORS = [
    *((name, "", QUANTITIES, 0.0, 1e-13) for name in ("closed-form", "screw-trajectory", "screw-per-sample")),
    *((name, "", QUANTITIES, 0.0, 1e-13) for name in ("pinocchio-path", "mujoco-path")),
    ("float32", "", QUANTITIES, 1e-8, 1e-5),  # seven digits less rounding
    ("mj-inverse-projected", "", ["actuator_force"], 0.0, 5e-14),
    ("pinocchio-rnea", "", ["actuator_force"], 0.0, 5e-14),
    ("mj-inverse-naive", "", ["actuator_force"], 0.1, np.inf),
    ("paper-printed", "", ["joint_position"], 0.1, np.inf),  # however small the steps
    ("paper-corrected", "RK4, step = 0.001", ["joint_position"], 0.0, 1e-9),
    ("mj-forward", "0.9999", ["joint_acceleration"], 0.1, np.inf),
    ("mj-refinement", "0.9999, 5 passes", ["joint_acceleration"], 0.0, 5e-10),
]


@pytest.mark.parametrize(("name", "setting", "quantities", "least", "most"), ERRORS)
def test_errors_are_what_a_method_is_worth(found, name, setting, quantities, least, most):
    for quantity in quantities:
        rows = [row for row in found.rows if (row.contestant.name, row.quantity) == (name, quantity)]
        errors = [row.error for row in rows if setting in row.contestant.setting]
        assert least <= min(errors) <= max(errors) <= most


@pytest.mark.slow
def test_newton_improves_with_every_step(monkeypatch):
    scene = screwgauge.load_scene("3ups-upu-s").at(np.linspace(0.0, 2.0, 51))  # close enough for a prediction
    plan = Plan(samples=51, rounds=1, budget=1e9, quick=True)
    chosen = [c for c in registry.choose(["newton"]) if c.quantities == ("joint_position",)]
    monkeypatch.setattr(run_module, "choose", lambda names, *, quick: chosen)
    found = bench(scene, plan=plan)
    steps = ("0 Newton", "1 Newton", "2 Newton", "to rounding")
    errors = [max(row.error for row in found.rows if step in row.contestant.setting) for step in steps]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 1e-4
    assert errors[-1] < 5e-14


def test_the_four_bar_shows_not_a_number_by_default_and_its_cure(found):
    default, one, two = (row for row in found.rows if row.contestant.name == "four-bar")
    assert default.status == "failed"
    assert "rank 2 of 3" in default.reason
    assert np.isnan(default.error)
    assert two.error < 1e-12 < one.error < 4e-8


@pytest.mark.slow
def test_single_precision_closes_loops_that_closed_form_leaves_open():
    rows = bench(screwgauge.load_scene("3ups-upu-s-offset"), plan=PLAN, contestants=["float32", "closed-form"]).rows
    errors = {(row.contestant.name, row.quantity): row.error for row in rows}
    assert errors["closed-form", "joint_position"] > 1e-3
    assert errors["float32", "joint_position"] < 1e-5


def test_the_solver_stays_in_single_precision(paper):
    lay = layout(in_precision(paper, np.float32))
    arrays = [lay.path, lay.loop, paper.home.astype(np.float32), *(body.com for body in lay.mechanism.bodies)]
    assert {array.dtype for array in arrays} == {np.dtype(np.float32)}
    assert paper.bodies[0].com.dtype == np.float64


def test_an_unknown_contestant_is_named_with_a_hint():
    with pytest.raises(UnknownNameError, match="did you mean 'mj-forward'"):
        registry.choose(["mj-foward"])
    with pytest.raises(ScrewgaugeError):
        registry.choose([])


def test_families_and_contestants_can_be_chosen():
    assert {c.family for c in registry.choose(["mujoco", "floor"])} == {"mujoco", "floor"}
    assert {c.name for c in registry.choose(["mujoco-path"])} == {"mujoco-path"}
    every = [c.key for c in registry.contestants(quick=False) if get_engine(c.method.engine).installed]
    assert [c.key for c in registry.choose(None)] == every


def test_a_contestant_whose_engine_is_missing_or_that_raises_is_a_row(monkeypatch):
    def load(files, **settings):
        raise ZeroDivisionError("no luck")

    broken = ModuleType("broken_engine")
    broken.load = load
    monkeypatch.setitem(sys.modules, "broken_engine", broken)
    for name, source in (("absent", "no_such_engine:load"), ("broken", "broken_engine:load")):
        monkeypatch.setitem(ENGINES, name, Engine(name, "", source, frozenset((GivenMotion,)), f"{name}-engine"))
    like = registry.choose(["closed-form"], quick=True)
    chosen = [
        *(replace(c, name="absent", method=Method("absent")) for c in like),
        replace(like[0], name="broken", method=Method("broken")),
    ]
    monkeypatch.setattr(run_module, "choose", lambda names, *, quick: chosen)
    rows = bench(screwgauge.load_scene("3ups-upu-s"), plan=PLAN).rows
    assert [row.contestant.name for row in rows] == ["absent", "broken"]  # one for all settings of what is missing
    assert [row.status for row in rows] == ["failed", "failed"]
    assert "not installed" in rows[0].reason
    assert rows[1].reason == "ZeroDivisionError: no luck"


@pytest.mark.parametrize(
    "chosen",
    [registry.contestants(quick=False), registry.simulators("DOP853", 1.0, quick=False)],
    ids=["given motion", "simulation"],
)
def test_all_contestants_are_data(chosen):
    for contestant in chosen:
        again = pickle.loads(pickle.dumps(contestant))
        assert again.key == contestant.key
        assert again.method == contestant.method


@pytest.mark.slow
def test_a_question_that_went_through_a_pickle_has_the_same_answer(tmp_path):
    posed = pose_scene(screwgauge.load_scene("3ups-upu-s"), tmp_path, samples=3)
    all_settings = registry.choose(["constraint-dynamics-default", "paper-corrected", "float32"], quick=True)
    # the settings of a series differ in one number; the first one of the paper's scheme takes the fewest steps
    firsts = {(c.name, c.series, c.quantities): c for c in reversed(all_settings)}
    assert len(firsts) >= 4
    for contestant in firsts.values():
        asked, again = contestant.ask(posed), pickle.loads(pickle.dumps(contestant)).ask(posed)
        problem = pickle.loads(pickle.dumps(again.problems[0]))
        answer = contestant.method.load(asked.files).solve(asked.problems[0])
        other = contestant.method.load(asked.files).solve(problem)
        for name, values in answer.values.items():
            assert (values.array == other.values[name].array).all()


def test_what_rows_say_of_default_settings_is_what_the_engine_says(tmp_path):
    setting = next(c.setting for c in registry.choose(["constraint-dynamics-default"]))
    default = Method("pinocchio", {"mu": None, "iterations": None}).load(write_four_bar(tmp_path))
    assert setting == "ProximalSettings(): mu = 0, 1 iteration"
    assert default.solve(four_bar_states(2)[0]).setting == "constraintDynamics, mu 0, 1 iterations"


def test_the_exact_accelerations_of_the_four_bar_are_those_of_the_whole_newton_euler_system():
    problem, right = four_bar_states(5)
    states, pin = problem.task, [[1.0, 0.0, 0.0]]  # the ball turns back what the rods have turned
    q, v, a = (np.hstack([x, -x.sum(axis=1, keepdims=True) * pin]) for x in (states.q, states.v, right.array))
    tau = np.hstack([states.tau, np.zeros((5, 3))])
    closed = States((*states.coordinates, "pin.q1", "pin.q2", "pin.q3"), q, v, tau=tau)
    answer = Method("screw").load(ModelFiles(FILE)).solve(replace(problem, task=closed)).values["joint_acceleration"]
    assert np.abs(answer.array - a).max() < 1e-12 * np.abs(a).max()


def test_the_exact_accelerations_are_of_the_mechanism_that_is_described():
    bodies = load_mechanism(FILE).bodies
    assert [body.mass for body in bodies] == MASSES.tolist()
    assert [2.0 * body.com[0] for body in bodies] == LENGTHS.tolist()
    assert [body.inertia[2, 2] for body in bodies] == pytest.approx(MOMENTS.tolist(), rel=1e-15, abs=0)


def test_springs_and_motors_are_refused():
    scene = screwgauge.load_scene("3ups-upu-s").under(springs=(JointSpring("leg1.q3", 1.0),))
    with pytest.raises(DescriptionError, match="does not support springs or motors"):
        bench(scene, plan=PLAN)


@pytest.mark.slow
def test_a_mechanism_without_closed_form_says_so():
    scene = screwgauge.load_scene(Path(__file__).parent / "data" / "four-bar-scene.toml")
    rows = bench(scene, plan=PLAN, contestants=["closed-form", "newton", "mujoco-path"]).rows
    assert {r.status for r in rows if r.contestant.name == "closed-form"} == {"failed"}
    assert "no closed form" in rows[0].reason
    assert {r.status for r in rows if r.contestant.name != "closed-form"} == {"ok"}


@pytest.mark.parametrize(
    ("array", "truth", "scales", "error", "rms"),
    [
        ([[1.0, 5.0], [1.0, 3.0]], [[1.0, 3.0], [0.0, 3.0]], (2.0, 8.0), 0.5, np.sqrt((0.25**2 + 0.5**2) / 4)),
        ([[np.nan, 1.0], [1.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], (1.0, 1.0), np.nan, np.nan),
        ([[7.0, 7.0], [1.0, 1.5]], [[np.nan, 1.0], [1.0, 1.0]], (1.0, 1.0), 0.5, np.sqrt(0.5**2 / 2)),
    ],
    ids=["scaled by unit", "not a number", "no truth of a sample"],
)
def test_an_error_is_of_all_components_and_samples(array, truth, scales, error, rms):
    values, right = (Values(("x", "y"), ("rad", "m"), np.array(each)) for each in (array, truth))
    found = score("q", deviation(values, right), dict(zip(("rad", "m"), scales, strict=True)))
    assert (found.error, found.rms) == (pytest.approx(error, nan_ok=True), pytest.approx(rms, nan_ok=True))
    assert ("1 of 2 samples" in found.reason) == np.isnan(error)
