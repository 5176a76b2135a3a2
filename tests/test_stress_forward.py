"""Stress cases that drive engines forward or for long, at reduced size: proximal, redundant-constraints, long-run."""

from __future__ import annotations

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.stress import CASES, DEGRADED, ITERATIONS, OK, SILENT, Finding, climb

ROUNDING = 1e-11  # of accelerations of 0.1 that are left of forces of 1 kN


@pytest.mark.parametrize(
    "name", ["softness", "refinement", "proximal", "redundant-constraints", "long-run", "stiff-legs"]
)
def test_ladders_have_six_rungs_and_three_when_quick(name: str) -> None:
    case = CASES[name]
    assert len(set(case.full)) >= 6
    assert len(set(case.quick)) >= 3
    assert case.low <= min(*case.full, *case.quick)
    assert max(*case.full, *case.quick) <= case.high


def labelled(found: list[Finding], engine: str) -> Finding:
    (finding,) = (finding for finding in found if finding.engine == engine)
    return finding


def test_mu_of_zero_is_fine_on_full_rank_and_silently_not_a_number_below_it() -> None:
    found = climb(CASES["proximal"], 0.0)
    for iterations in ITERATIONS:
        assert labelled(found, f"pinocchio full rank {iterations}x").verdict == OK
        assert labelled(found, "pinocchio deficient safe").error < 1e-13  # a hundred roundings
        lost = labelled(found, f"pinocchio deficient {iterations}x")
        assert np.isnan(lost.error)
        assert lost.verdict == SILENT
        assert lost.condition > 1e16


@pytest.mark.slow
def test_the_error_goes_as_mu_to_the_power_of_the_iterations() -> None:
    mus = np.array([1e-6, 1e-5, 1e-4])
    found = [climb(CASES["proximal"], mu) for mu in mus]
    for loop in ("full rank", "deficient"):
        for iterations in (1, 2):
            errors = [labelled(rows, f"pinocchio {loop} {iterations}x").error for rows in found]
            slope = np.polyfit(np.log(mus), np.log(errors), 1)[0]
            assert slope == pytest.approx(iterations, abs=0.05)  # the next order is 1e-2 of it at 1e-4
    one = [finding for rows in found for finding in rows if "1x" in finding.engine]
    assert {finding.verdict for finding in one} == {DEGRADED}
    assert all(finding.tolerance < 100 * finding.error for finding in one)


def test_redundant_constraints_leave_forces_in_the_plane_unique_and_frames_lock_the_loop() -> None:
    found = climb(CASES["redundant-constraints"], 2.0)
    for finding in found:
        if finding.quantity == "reaction":
            assert "compared: fx, fy; not unique, left out: fz, mx, my (6 redundant" in finding.reason
        if finding.engine in ("pinocchio 6D", "mujoco weld"):
            assert finding.verdict == SILENT
            assert finding.error > 0.1
            assert "leaves 0 freedoms of 1" in finding.reason
        else:
            assert finding.error < ROUNDING, finding


@pytest.mark.slow
def test_a_long_run_keeps_its_digits_where_the_scheme_drifts() -> None:
    found = climb(CASES["long-run"], 1000.0)
    for finding in found:
        if finding.engine == "screw":
            assert finding.error < 4e-14  # a hundred times the rounding of angles of 1 rad
    short = climb(CASES["long-run"], 100.0)
    drift = [labelled(rows, "paper Euler").error for rows in (short, found)]
    assert drift[1] > 5 * drift[0] > 1e-4
    assert labelled(found, "paper Euler").verdict == SILENT
    assert labelled(found, "paper RK4").error < 1e-10


def test_a_forward_scene_is_not_streamed() -> None:
    with pytest.raises(ScrewgaugeError, match="integrated, not streamed"):
        next(iter(screwgauge.stream(screwgauge.load_scene("a01-pendulum"), [np.array([0.0, 0.1])])))


def test_a_singular_pose_is_met_in_a_stream_too(write) -> None:
    """The motion passes b = 0.3568 rad between two parts."""
    text = 'mechanism = "3ups-upu-s"\n[motion.a]\noffset = 0\n[motion.b]\npolynomial = [0, 0.05]\n[time]\ntimes = [0]\n'
    scene = screwgauge.load_scene(write("through.toml", text))
    found = screwgauge.stream(scene, [np.array([0.0, 7.0]), np.array([7.2, 8.0])], quantities=["joint_velocity"])
    assert next(found)[0][-1] == 7.0
    with pytest.raises(ScrewgaugeError, match=r"leg1\.wrist"):
        next(found)
