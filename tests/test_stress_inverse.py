"""The stress cases of inverse dynamics, at one or two rungs each: how many digits are kept, and by whom."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from screwgauge import load_scene
from screwgauge.study.bench import question as questions
from support.command import printed_by
from support.engines import solve
from support.mechanism import load_mechanism, mechanism_path
from support.questions import ENGINES, POSES, WRIST_LOCKS, compare, exactly, findings, still
from support.stress import CASES, DEGRADED, OK, REFUSED, Finding, decades
from support.stress import climb as climb_rung

FORCES = ("generalized_force", "actuator_force")
#: Rounding (2e-16) times the condition of regular poses (up to 300) would leave 13.2 digits if errors never cancelled.
REGULAR = 1e-13
INVERSE = ("upu-singularity", "u-lock", "wrist-chart", "mass-ratio", "speed", "scale", "load")


@cache
def rung(case: str, severity: float) -> tuple[Finding, ...]:
    return tuple(climb_rung(CASES[case], severity, quick=True))


def climb(case: str, *severities: float) -> dict[tuple[float, str, str], Finding]:
    """Findings of a reduced run by severity, engine and quantity."""
    rungs = CASES[case].rungs(quick=True, severities=severities)
    return {(one, each.engine, each.quantity): each for one in rungs for each in rung(case, one)}


@pytest.mark.parametrize("name", [*INVERSE, "inertia-anisotropy", "closure-violation"])
def test_a_case_has_six_rungs_on_a_ladder_within_its_range(name: str) -> None:
    case = CASES[name]
    assert len(case.full) >= 6
    assert len(case.quick) >= 6
    for rungs in (case.full, case.quick):
        assert len(set(rungs)) == len(rungs)
        assert all(case.low <= severity <= case.high for severity in rungs)
        ratios = np.diff(np.log10([severity for severity in rungs if severity]))
        assert np.allclose(ratios, ratios[0])


@pytest.mark.slow
def test_cases_are_listed_without_loading_an_engine() -> None:
    code = (
        "import sys; from screwgauge.study.bench.stress import CASES; "
        "print(sorted({'pinocchio', 'mujoco', 'flint', 'scipy', 'vl_convert'} & set(sys.modules)))"
    )
    assert printed_by(code).strip() == "[]"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "severities"),
    [
        ("mass-ratio", (1e-6, 1e6)),
        ("speed", (0.0, 1e3)),
        ("scale", (1e-2, 1e3)),
        ("load", (0.0, 1e9)),
        ("inertia-anisotropy", (1.0, 1e-9)),
    ],
)
def test_regular_extremes_cost_no_engine_its_digits(case: str, severities: tuple[float, ...]) -> None:
    found = climb(case, *severities)
    for (_, _, quantity), finding in found.items():
        assert finding.verdict == OK, finding
        if quantity in FORCES:
            assert finding.error <= REGULAR, finding
    assert {engine for _, engine, _ in found} == {"screw", "pinocchio", "mujoco"}


def test_bodies_that_an_engine_refuses_are_refused_rows_with_its_words() -> None:
    found = climb("scale", 1e-3)
    assert {engine for (_, engine, _), one in found.items() if one.verdict == REFUSED} == {"mujoco"}
    assert "mass and inertia" in found[1e-3, "mujoco", "reaction"].reason


def test_legs_without_inertia_about_their_axes_cost_no_engine_its_digits() -> None:
    found = climb("inertia-anisotropy", 1e-15)
    for (_, _, quantity), one in found.items():
        assert one.verdict == OK, one
        assert quantity not in FORCES or one.error <= REGULAR, one


def test_a_grain_sized_mechanism_is_solved_or_refused() -> None:
    """Thresholds are relative to the mechanism's length, and MuJoCo's bound of 1e-15 kg m^2 is not."""
    found = climb("scale", 1e-3)
    for (_, engine, quantity), finding in found.items():
        assert finding.verdict == (REFUSED if engine == "mujoco" else OK)
        if engine != "mujoco" and quantity in FORCES:
            assert finding.error <= REGULAR


def check_none_is_wrong_without_a_word(found: dict[tuple[float, str, str], Finding]) -> None:
    for finding in found.values():
        assert finding.verdict in (OK, DEGRADED, REFUSED), finding
        assert finding.verdict == OK or finding.reason
    assert any(finding.verdict != OK for finding in found.values())


@pytest.mark.slow
@pytest.mark.parametrize("case", ["upu-singularity", "u-lock"])
def test_near_singular_poses_nobody_is_wrong_without_a_word(case: str) -> None:
    check_none_is_wrong_without_a_word(climb(case, 1e-6, 1e-12))


@pytest.mark.slow
def test_a_locked_chart_costs_the_minimal_cut_no_force(tmp_path: Path) -> None:
    """Full cuts, whose coordinates lock there, are `test_the_full_cut_flags_what_it_loses_at_a_chart_lock`."""
    asked = [
        question
        for question in CASES["wrist-chart"].ask(1e-10, True, tmp_path)
        if not any(m.engine.endswith("-full") for m in question.methods)
    ]
    assert len(asked) == len(WRIST_LOCKS)
    for question in asked:
        found = [
            finding for finding in findings(question) if finding.quantity in (*FORCES, "reaction", "com_acceleration")
        ]
        assert {finding.engine.split()[0] for finding in found} == {*ENGINES}
        assert all(finding.error <= REGULAR for finding in found)


def test_the_singularity_of_the_upu_leg_costs_our_forces_nothing() -> None:
    """c = 0 is recognised and forces follow from virtual power; projected paths lose digits, and say so."""
    found = climb("upu-singularity", 1e-6)
    for quantity in (*FORCES, "joint_acceleration", "com_acceleration"):
        assert found[1e-6, "screw", quantity].error <= REGULAR
        for engine in ("pinocchio", "mujoco"):
            assert found[1e-6, engine, quantity].verdict == DEGRADED
            assert "error estimate" in found[1e-6, engine, quantity].reason
    assert found[1e-6, "screw", "reaction"].error <= 1e-9  # the moment of leg 1's wrist itself is 1e8 N m


def test_what_is_refused_says_which_singularity_it_is() -> None:
    assert "leg2.base locks" in climb("u-lock", 1e-12)[1e-12, "screw", "generalized_force"].reason


@pytest.mark.slow
def test_near_a_base_lock_a_digit_is_lost_with_every_decade() -> None:
    ladder = (1e-3, 1e-6, 1e-9)
    found = climb("u-lock", *ladder)
    for engine in ("pinocchio", "mujoco"):
        errors = [found[distance, engine, "generalized_force"].error for distance in ladder]
        slope = np.polyfit(np.log10(ladder), np.log10(errors), 1)[0]
        assert -1.3 < slope < -0.7  # rounding of 1e-16 m over the distance, from one sample: a matter of luck


@pytest.mark.slow
@pytest.mark.parametrize(("name", "lock"), WRIST_LOCKS.items())
def test_truth_encloses_what_is_close_to_a_lock(name: str, lock: float) -> None:
    """192 bits leave five digits of an acceleration 1e-12 rad from a lock; twice as many leave twenty and more."""
    base = load_scene("3ups-upu-s")
    scene = replace(base, mechanism=load_mechanism(name), mechanism_file=mechanism_path(name))
    y = np.array([lock, 0.0]) + np.array([[0.1], [1e-12]]) * np.array([-np.sign(lock), -0.5])
    solutions, failures = solve(still(scene, y, np.ones_like(y)), ("truth",), ("com_acceleration", "reaction"))
    assert not failures
    assert solutions["truth"].rows is None
    for quantity, radius in {q: error.radius for q, error in solutions["truth"].errors.items()}.items():
        assert radius.max() < 1e-20 * np.abs(solutions["truth"].values[quantity].array).max()


def test_without_a_truth_the_judge_measures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(questions, "solve", lambda *scene: ({}, {}))
    scene = still(load_scene("3ups-upu-s"), POSES)
    found = {one.engine: one for one in findings(compare(scene, tmp_path, setting="still"))}
    assert set(found) == {"screw still", "pinocchio still", "mujoco still"}
    for one in found.values():
        assert one.quantity == "judge"
        assert one.verdict == OK
        assert "truth" in one.reason


def test_changed_numbers_are_written_to_the_last_bit() -> None:
    for value in (0.1, 1.42e-6, 2.87 * 1e9, np.nextafter(0.46, 1.0), 5.56e-19):
        assert Fraction(exactly(value)) == Fraction(float(value))


def test_decades_are_the_literals() -> None:
    assert decades(-5, -1) == (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    assert decades(2, -2, 2) == (1e2, 1.0, 1e-2)


def test_every_case_is_registered_once() -> None:
    assert len(set(CASES.values())) == len(CASES)
