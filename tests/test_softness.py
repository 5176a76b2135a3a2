"""MuJoCo's soft loops."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.study.bench.loops import constant_force_motion, tree_reference
from support.engines import Method, model_files
from support.geometry import EPS, Array
from support.questions import Question, findings
from support.stress import CASES, GOOD
from support.trees import INTEGRATORS, MujocoTree, has_integrator

pytestmark = pytest.mark.slow

STEPS = (2e-3, 5e-4, 1e-4)  # [s]
FLAT = 0.01  # slope of a floor: discretisation changes it by less than its own size times dt / 0.02 s
STRAIGHT = 0.1  # of a whole slope: higher orders still act at the largest steps
FILES = model_files("3ups-upu-s", "mujoco")


@pytest.fixture(scope="module")
def motion() -> Question:
    # the loops have given way, to a fraction of a percent, after 0.2 s
    return constant_force_motion(0.2, 3, 1e-11)


def step(motion: Question, dt: float, **settings: object) -> dict[str, Array]:
    """Return quantities after MuJoCo's steps."""
    solution = Method("mujoco", {"dt": dt, "work": False, **settings}).load(FILES).solve(motion.problem)
    assert not solution.stopped
    return {name: values.array for name, values in motion.read(motion, solution).items()}


def slope(x, y) -> float:
    """Of log y over log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


@pytest.mark.slow
@pytest.mark.parametrize("integrator", list(filter(has_integrator, INTEGRATORS)))
def test_the_loop_opens_by_seven_millimetres_whatever_step_and_integrator(motion: Question, integrator: str) -> None:
    gaps = [step(motion, dt, integrator=integrator)["loop_gap"].max() for dt in STEPS]
    assert abs(slope(STEPS, gaps)) < FLAT
    assert min(gaps) > 6.5e-3
    assert max(gaps) < 7.5e-3


def test_a_stiffer_loop_opens_less_as_impedance_and_time_constant_say(motion: Question) -> None:
    impedances = np.array([0.99, 0.999, 0.9999])
    gaps = [step(motion, 1e-4, solimp=d)["loop_gap"].max() for d in impedances.tolist()]
    assert slope((1 - impedances) / impedances, gaps) == pytest.approx(1.0, abs=STRAIGHT)
    constants = (0.0025, 0.005, 0.01)
    gaps = [step(motion, 1e-4, solimp=0.95, solref=c)["loop_gap"].max() for c in constants]
    assert slope(constants, gaps) == pytest.approx(2.0, abs=STRAIGHT)


def test_refined_steps_have_no_floor_but_an_error_of_first_order(motion: Question) -> None:
    stepped, right = [step(motion, dt, solimp=0.9999, passes=4) for dt in STEPS], tree_reference(motion).values
    assert slope(STEPS, [one["loop_gap"][1:].max() for one in stepped]) == pytest.approx(1.0, abs=STRAIGHT)
    for quantity in ("constraint_force", "energy"):
        errors = [np.abs(one[quantity] - right[quantity].array).max() for one in stepped]
        assert slope(STEPS, errors) == pytest.approx(1.0, abs=STRAIGHT)


def test_four_passes_bring_the_accelerations_below_a_billionth_at_the_hardest_loop(tmp_path: Path) -> None:
    question = list(CASES["refinement"].ask(1e-4, True, tmp_path))[1]
    methods = tuple(Method("mujoco", {"solimp": 0.9999, "passes": passes}) for passes in range(5))
    errors = [finding.error for finding in findings(replace(question, methods=methods))]
    # each pass but the last, which ends in rounding, is worth more than three digits
    assert np.diff(np.log10(errors[:4])).max() < -3.0
    assert errors[4] < GOOD


def test_what_soft_loops_may_exert_leaves_room_for_another_rounding_of_their_residual(monkeypatch) -> None:
    # eight units in the last place of the largest coordinate, however well the loops close
    scene = screwgauge.load_scene("3ups-upu-s")
    asked, given = list[Array](), MujocoTree.soft_force

    def soft_force(self, q, v, a, residuals):
        asked.append(residuals)
        return given(self, q, v, a, residuals)

    monkeypatch.setattr(MujocoTree, "soft_force", soft_force)
    screwgauge.run(scene.at(scene.t[:2]), ["mujoco"], ["tree_force_soft"])
    reach = max(float(np.abs(joint.parent_frame.p).max()) for joint in scene.mechanism.joints)
    ((position, rate, second),) = asked
    assert 8 * EPS * reach <= position < 1e-12
    assert 0.0 < rate < 1e-12
    assert 0.0 < second < 1e-11


def test_soft_forces_count_among_the_digits_of_a_verdict():
    # they have digits, though their tolerance is wider than that of the scene
    results = screwgauge.run(screwgauge.load_scene("3ups-upu-s").at(np.linspace(0.0, 1.0, 11)), ("pinocchio", "mujoco"))
    soft = results.pairs[results.pairs["quantity"] == "tree_force_soft"]
    assert results.ok
    assert (soft["max_scaled"] > results.scene.tolerance("tree_force_soft")).any()
    assert soft["reason"].eq("").all()
    text = " ".join(repr(results).split())
    assert "apart from tree_force_soft (" in text
    assert "fewest in tree_force_soft" not in text  # whose forces act in no machine
