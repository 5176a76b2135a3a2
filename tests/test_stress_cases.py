"""Stress cases and their questions."""

import pickle
from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from screwgauge import load_scene
from screwgauge.study.bench import question as questions
from support.bench import TABLE
from support.command import loaded_after
from support.engines import solve
from support.mechanism import load_mechanism, mechanism_path
from support.questions import ENGINES, POSES, WRIST_LOCKS, compare, exact_text, findings, scene_at
from support.stress import CASES, OK, decades

FORCES = ("generalized_force", "actuator_force")
#: Rounding (2e-16) times the condition of regular poses (up to 300) would leave 13.2 digits if errors never cancelled.
REGULAR = 1e-13


@pytest.mark.parametrize("name", CASES)
def test_a_case_has_six_rungs_on_a_ladder_within_its_range(name: str) -> None:
    case = CASES[name]
    assert len(case.full) >= 6
    assert len(case.quick) >= 3
    for rungs in (case.full, case.quick):
        assert len(set(rungs)) == len(rungs)
        assert all(case.low <= severity <= case.high for severity in rungs)


@pytest.mark.slow
def test_cases_are_listed_without_loading_an_engine() -> None:
    code = "from screwgauge.study.bench.stress import CASES"
    assert loaded_after(code, "pinocchio", "mujoco", "flint", "scipy", "vl_convert") == set()


@pytest.mark.slow
def test_a_locked_chart_costs_the_minimal_cut_no_force(tmp_path: Path) -> None:
    every = CASES["wrist-chart"].ask(1e-10, True, tmp_path)
    asked = [one for one in every if not any(method.engine.endswith("-full") for method in one.methods)]
    assert len(asked) == len(WRIST_LOCKS)
    for question in asked:
        found = [row for row in findings(question) if row.quantity in (*FORCES, "reaction", "com_acceleration")]
        assert {row.engine.split()[0] for row in found} == {*ENGINES}
        assert all(row.error <= REGULAR for row in found)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "lock"), WRIST_LOCKS.items())
def test_truth_encloses_what_is_close_to_a_lock(name: str, lock: float) -> None:
    base = load_scene("3ups-upu-s")
    scene = replace(base, mechanism=load_mechanism(name), mechanism_file=mechanism_path(name))
    y = np.array([lock, 0.0]) + np.array([[0.1], [1e-12]]) * np.array([-np.sign(lock), -0.5])
    solutions, failures = solve(scene_at(scene, y, np.ones_like(y)), ("truth",), ("com_acceleration", "reaction"))
    assert not failures
    assert solutions["truth"].rows is None
    for quantity, radius in {q: error.radius for q, error in solutions["truth"].errors.items()}.items():
        assert radius.max() < 1e-20 * np.abs(solutions["truth"].values[quantity].array).max()


def test_without_a_truth_the_judge_measures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(questions, "solve", lambda *scene: ({}, {}))
    scene = scene_at(load_scene("3ups-upu-s"), POSES)
    found = {one.engine: one for one in findings(compare(scene, tmp_path, setting="still"))}
    assert set(found) == {"screw still", "pinocchio still", "mujoco still"}
    for one in found.values():
        assert one.quantity == "judge"
        assert one.verdict == OK
        assert "truth" in one.reason


def test_changed_numbers_are_written_to_the_last_bit() -> None:
    for value in (0.1, 1.42e-6, 2.87 * 1e9, np.nextafter(0.46, 1.0), 5.56e-19):
        assert Fraction(exact_text(value)) == Fraction(float(value))


def test_decades_are_the_literals() -> None:
    assert decades(-5, -1) == (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    assert decades(2, -2, 2) == (1e2, 1.0, 1e-2)


def test_every_case_is_registered_once() -> None:
    assert len(CASES) == len(TABLE["cases"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["upu-singularity", "closure-violation", "refinement", "proximal", "long-run"])
def test_a_copy_is_answered_to_the_last_bit(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    with np.errstate(all="ignore"):
        for question in case.ask(case.quick[0], True, tmp_path):
            for one, other in zip(findings(question), findings(pickle.loads(pickle.dumps(question))), strict=True):
                np.testing.assert_equal(asdict(replace(other, time_s=0.0)), asdict(replace(one, time_s=0.0)))
