import importlib.util
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from campaigns import compiled

import screwgauge
from screwgauge.engines.screw.programs import Bounds
from support.engines import ModelFiles, get_engine
from support.solve import Work, layout

pytestmark = pytest.mark.slow

BACKENDS = ["numpy", *(["llvm"] if importlib.util.find_spec("llvmlite") else [])]
STATES = 300


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(compiled, "SAMPLES", 60)
    monkeypatch.setattr(compiled, "CERTIFIED", 4)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_random_states_on_both_sides_of_the_leg_singularity(backend):
    (row,) = compiled.measured("states", 0, [backend], STATES)
    assert row["ok"] is True, row
    assert STATES / 2 < row["by_program"] < STATES


@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed"), [("rccc", 2), ("planar-4", 3)])
def test_random_mechanisms(family, seed):
    (row,) = compiled.measured(family, seed, ["numpy"], 0)
    assert row["ok"] is True, row
    assert row["by_program"] == row["samples"]
    assert row["certified"] == (4 if importlib.util.find_spec("flint") else 0)


def test_estimates_that_are_too_small_are_found(monkeypatch):
    right = Bounds.estimate

    def wrong(*args):
        sums, errors = right(*args)
        return sums, [1e-6 * error for error in errors]

    monkeypatch.setattr(Bounds, "estimate", wrong)
    monkeypatch.setattr(compiled, "estimate_errors", lambda part, units, length: np.zeros((len(part.trust.gain), 99)))
    assert compiled.measured("states", 0, ["numpy"], 60)[0]["ok"] is False


def test_numbers_that_only_one_solver_has_are_wrong():
    a, b = np.array([[1.0, np.nan], [np.nan, 2.0]]), np.array([[1.0, np.nan], [1.0, 2.0]])
    assert compiled.beyond(a[:1], b[:1], np.ones((1, 2)), angle=False) == 0.0
    assert compiled.beyond(a, b, np.ones((2, 2)), angle=False) > 1.0
    assert compiled.beyond(b, b + 1.0, np.full((2, 2), np.nan), angle=False) > 1.0  # nor is a bound that is no number


def test_a_whole_turn_is_no_difference():
    assert compiled.beyond(np.array([[np.pi]]), np.array([[-np.pi]]), np.array([[1e-12]]), angle=True) < 1.0


def test_the_truth_is_within_the_estimates():
    """Leg 1's wrist is bent by a right angle, where three angles would lock."""
    pytest.importorskip("flint", reason="python-flint is not installed")
    scene, motion = screwgauge.load_scene("3ups-upu-s"), compiled.states(1, seed=1)
    motion = replace(motion, y=np.array([[-0.88532719, 0.70695677]]))
    problem = replace(scene, task=motion, drive=None, text={}).problem(("joint_position", "actuator_force"))
    truth = get_engine("truth").load(ModelFiles(scene.mechanism_file)).solve(problem)
    answer = screwgauge.compile(scene, truth.values, backend="numpy")(motion.y, motion.yd, motion.ydd, estimates=True)
    for name, values in truth.values.items():
        for i, unit in enumerate(dict.fromkeys(values.units)):
            columns = [c for c, u in enumerate(values.units) if u == unit]
            error = np.abs(answer[name][:, columns] - values.array[:, columns]).max(axis=1)
            assert (error <= answer.estimate[name][:, i]).all(), (name, unit)


def test_one_actuator_that_hardly_moves_is_badly_conditioned(tmp_path):
    """Its force is 2e5 N m, of which 1.5e-12 is lost."""
    scene = screwgauge.random(2, "rscr", tmp_path)
    motion = scene.at(np.linspace(scene.t[0], scene.t[-1], 300)).motion.part(slice(0, 54))
    work = Work(layout(scene.mechanism), scene.problem(["actuator_force"]))
    condition = work.part(motion, work.close(motion, work.predict(motion))).trust.forces["actuator_force"]
    assert condition[53] > 1e3 > 300.0 > condition[0]


def test_a_doubtful_sample_changes_no_estimate_but_its_own():
    scene, motion = screwgauge.load_scene("3ups-upu-s"), compiled.states(50, seed=2)
    y = 0.1 * motion.y
    solver = screwgauge.compile(scene, ["actuator_force"], backend="numpy")
    clear = solver(y, motion.yd, motion.ydd, estimates=True)
    assert not clear.by_array
    estimate = clear.estimate["actuator_force"].copy()
    y[7] = 1e-9 - np.arctan2(0.3 * 3**0.5, 0.5), 0.0  # the base of leg 2 locks
    out = solver.buffers(50)
    mixed = solver(y, motion.yd, motion.ydd, out=out, estimates=True)
    assert mixed.by_array == {"badly conditioned": 1}
    others = np.delete(np.arange(50), 7)
    assert np.allclose(mixed.estimate["actuator_force"][others], estimate[others], rtol=0.1)
    assert mixed.estimate["actuator_force"][7] > 1e3 * estimate[7]
    again = solver(0.1 * motion.y, motion.yd, motion.ydd, out=out, estimates=True)
    assert not again.by_array
    assert np.array_equal(again.estimate["actuator_force"], estimate)


@pytest.mark.slow
@pytest.mark.parametrize("estimates", [False, True])
def test_streams_take_the_same_memory_however_long_they_are(estimates):
    scene = screwgauge.load_scene("3ups-upu-s")
    motion = scene.motion
    chunk = motion.y[:256].copy(), motion.yd[:256].copy(), motion.ydd[:256].copy()
    solver = screwgauge.compile(scene, ["actuator_force"], backend="numpy")
    expected = solver(*chunk)["actuator_force"]
    peaks = []
    for count in (3, 30):
        tracemalloc.start()
        for answer in solver.stream((chunk for _ in range(count)), estimates=estimates):
            assert np.array_equal(answer["actuator_force"], expected)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] <= peaks[0] + 2**16
