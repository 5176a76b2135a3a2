"""MuJoCo's soft loops on the loaded default scene: a floor that no time step removes, and the refinement that does."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from screwgauge.scene.scene import load_scene
from screwgauge.study.cases.case import GOOD, SILENT
from screwgauge.study.stress.driven import refinement, softness
from screwgauge.study.stress.driven.held import Held, hold
from screwgauge.study.stress.driven.mujoco_steps import Setting, step

STEPS = (2e-3, 5e-4, 1e-4)  # [s]
FLAT = 0.01  # slope of a floor: discretisation changes it by less than its own size times dt / 0.02 s
STRAIGHT = 0.1  # of a whole slope: higher orders still act at the largest steps
INTEGRATORS = [name.removeprefix("mjINT_") for name in mujoco.mjtIntegrator.__members__]


@pytest.fixture(scope="module")
def held() -> Held:
    """The default scene from t = 1 s on; the loops have given way, to a fraction of a percent, after 0.2 s."""
    return hold(load_scene("3ups-upu-s"), 1.0, np.linspace(0.0, 0.2, 3), 1e-11)


def slope(x, y) -> float:
    """Of log y over log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_loop_opens_by_seven_millimetres_whatever_step_and_integrator(held: Held, integrator: str) -> None:
    gaps = [step(held, Setting(integrator), dt).gap.max() for dt in STEPS]
    assert abs(slope(STEPS, gaps)) < FLAT
    assert min(gaps) > 6.5e-3
    assert max(gaps) < 7.5e-3


def test_a_stiffer_loop_opens_less_as_impedance_and_time_constant_say(held: Held) -> None:
    impedances = np.array([0.99, 0.999, 0.9999])
    gaps = [step(held, Setting(impedance=d), 1e-4).gap.max() for d in impedances]
    assert slope((1 - impedances) / impedances, gaps) == pytest.approx(1.0, abs=STRAIGHT)
    constants = (0.0025, 0.005, 0.01)
    gaps = [step(held, Setting(impedance=0.95, constant=c), 1e-4).gap.max() for c in constants]
    assert slope(constants, gaps) == pytest.approx(2.0, abs=STRAIGHT)


def test_refined_steps_have_no_floor_but_an_error_of_first_order(held: Held) -> None:
    found = [step(held, Setting(impedance=0.9999, passes=4), dt) for dt in STEPS]
    assert slope(STEPS, [steps.gap[1:].max() for steps in found]) == pytest.approx(1.0, abs=STRAIGHT)
    columns = [held.names.index(name) for name in found[0].names]
    right = held.reactions[:, columns]
    errors = [np.abs(steps.force - right).max() / np.abs(right).max() for steps in found]
    assert slope(STEPS, errors) == pytest.approx(1.0, abs=STRAIGHT)
    energies = [np.abs(steps.energy - held.path.energy).max() for steps in found]
    assert slope(STEPS, energies) == pytest.approx(1.0, abs=STRAIGHT)


def test_each_pass_of_refinement_adds_one_to_the_slope_over_softness() -> None:
    softnesses = np.array([1e-2, 3e-3, 1e-3])
    for passes in (0, 1, 2):
        errors = [refinement.mujoco(1.0 - s, passes, np.nan).error for s in softnesses]
        assert slope(softnesses / (1 - softnesses), errors) == pytest.approx(passes + 1, abs=STRAIGHT)


def test_four_passes_bring_the_accelerations_below_a_billionth_at_the_hardest_loop() -> None:
    errors = [refinement.mujoco(0.9999, passes, np.nan).error for passes in range(5)]
    # each pass but the last, which ends in rounding, is worth more than three digits
    assert np.diff(np.log10(errors[:4])).max() < -3.0
    assert errors[4] < GOOD


def test_a_rung_holds_every_engine_and_only_mujoco_is_silent() -> None:
    found = list(softness.climb(1e-3, 0.05))
    labels = dict.fromkeys(finding.engine for finding in found)
    assert list(labels) == ["screw", *softness.settings()]
    assert {finding.quantity for finding in found} == {*("loop_gap", "constraint_force", "energy", "joint_position")}
    assert all(finding.error < GOOD for finding in found if finding.engine == "screw")
    silent = [finding for finding in found if finding.verdict == SILENT]
    assert silent
    assert all(finding.engine.startswith("mujoco") and finding.reason for finding in silent)
