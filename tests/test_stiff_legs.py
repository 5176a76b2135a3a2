"""Stiff springs in the legs, at reduced size: the reference, accelerations, what is admitted and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from screwgauge.models.catalog import load_mechanism
from screwgauge.study.cases.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Finding
from screwgauge.study.stress.stiff import accelerations as stiff_accelerations
from screwgauge.study.stress.stiff import motion as stiff_motion
from screwgauge.study.stress.stiff.springs import leg_springs


def right(stiffness: float) -> stiff_motion.Right:
    return stiff_motion.right_motion(leg_springs(load_mechanism("3ups-upu-s"), stiffness))


def integrated(stiffness: float, method: stiff_motion.Method) -> list[Finding]:
    """`screw` on its own acceleration, by one of scipy's methods."""
    found = right(stiffness)
    problem = stiff_motion.make_problem(leg_springs(load_mechanism("3ups-upu-s"), stiffness), found.times)
    return list(stiff_motion.integrated("screw Radau", replace(problem, method=method), found))


def test_the_fastest_eigenvalue_is_a_hundred_thousand_at_the_hardest_springs() -> None:
    stiffness = np.array([1e6, 1e10])
    fastest = [right(k).fastest for k in stiffness]
    assert fastest[1] == pytest.approx(1e5, rel=0.05)
    assert np.diff(np.log(fastest)) / np.diff(np.log(stiffness)) == pytest.approx(0.5, abs=0.01)


def test_the_reference_and_an_explicit_method_agree() -> None:
    """Two integrators that share nothing but the accelerations; DOP853 at 1e-9 leaves some 1e-10."""
    for finding in integrated(1e4, stiff_motion.Method("DOP853", 1e-9, 1e-11)):
        assert finding.error < GOOD, finding


def test_a_looser_tolerance_is_admitted_to_lose_digits() -> None:
    for finding in integrated(1e4, stiff_motion.RADAU):
        assert finding.verdict == DEGRADED
        assert "the tolerance, 1e-05, admits" in finding.reason


def test_an_explicit_method_is_refused_with_its_stable_step() -> None:
    found = right(1e10)
    problem = stiff_motion.make_problem((), found.times)
    motion, energy = stiff_motion.explicit(problem, found)
    assert motion.verdict == energy.verdict == REFUSED
    assert "eigenvalue of 9.9e+04 1/s bounds its step to 6.1e-05 s" in motion.reason


def test_the_error_of_accelerations_grows_with_stiffness_as_the_guard_admits() -> None:
    stiffness = np.array([1e7, 1e8, 1e9, 1e10])
    found = {k: list(stiff_accelerations.climb(k)) for k in (1e2, *stiffness)}
    assert {finding.verdict for finding in found[1e2]} == {OK}
    for i, engine in enumerate(("screw", "pinocchio", "mujoco")):
        rows = [found[k][i] for k in stiffness]
        assert {row.engine for row in rows} == {engine}
        slope = np.polyfit(np.log(stiffness), np.log([row.error for row in rows]), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.3)  # rounding errors scatter
        assert all(row.verdict in (OK, DEGRADED) for row in rows)
    admitted = [found[k][0].admitted for k in stiffness]
    assert np.polyfit(np.log(stiffness), np.log(admitted), 1)[0] == pytest.approx(1.0, abs=1e-3)  # dampers: root


def test_a_rung_holds_every_engine_and_only_fixed_steps_are_silent() -> None:
    found = list(stiff_motion.climb(1e2))
    assert list(dict.fromkeys(finding.engine for finding in found)) == [
        *("screw DOP853", "screw Radau", "pinocchio Radau", "mujoco Radau"),
        *("pinocchio Euler", "mujoco Euler", "mujoco implicitfast"),
    ]
    assert {finding.quantity for finding in found} == {"motion", "energy"}
    for finding in found:
        own = finding.engine in ("pinocchio Euler", "mujoco Euler", "mujoco implicitfast")
        assert (finding.verdict == SILENT) == own, finding
        assert finding.reason
