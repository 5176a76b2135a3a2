"""States that do not close: raw answers are off in proportion to the gap, closed ones are not off at all."""

from __future__ import annotations

import numpy as np
import pytest

from support.stress import CASES, FORWARD, HARD, OK, SILENT, Finding, climb

GAPS = (1e-9, 1e-7, 1e-5)
#: Rounding times the condition of the default scene's poses, after a refinement of soft constraints.
CLOSED = 1e-13


@pytest.fixture(scope="module")
def found() -> dict[tuple[float, str, str], Finding]:
    case = CASES["closure-violation"]
    return {(gap, one.engine, one.quantity): one for gap in GAPS for one in climb(case, gap, quick=True)}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["screw", "pinocchio projected", "mujoco projected"])
@pytest.mark.parametrize("quantity", ["actuator_force", FORWARD])
def test_engines_that_close_first_keep_their_digits(found, engine: str, quantity: str) -> None:
    for gap in GAPS:
        assert found[gap, engine, quantity].verdict == OK
        assert found[gap, engine, quantity].error <= CLOSED


@pytest.mark.parametrize(
    ("engine", "quantity"),
    [
        ("pinocchio raw", "actuator_force"),
        ("mujoco raw", "actuator_force"),
        ("pinocchio raw", FORWARD),
        ("pinocchio raw Baumgarte", FORWARD),
        ("mujoco raw", "tree_force"),
    ],
)
def test_a_raw_answer_is_wrong_in_proportion_to_the_gap(found, engine: str, quantity: str) -> None:
    errors = [found[gap, engine, quantity].error for gap in GAPS]
    slope = np.polyfit(np.log10(GAPS), np.log10(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.02)  # linear; the second order is 1e-5 of it


def test_a_raw_error_is_silent_and_has_its_cause(found) -> None:
    for (gap, engine, quantity), finding in found.items():
        if " raw" in engine and finding.error > 1e-9:
            assert finding.verdict == SILENT
            assert finding.reason
        elif " raw" not in engine:
            assert finding.verdict == OK, (gap, engine, quantity)


def test_stiff_constraints_amplify_the_gap(found) -> None:
    """Harder constraints: the same gap makes (1 - d) / d times less yielding, so that much more force."""
    soft, hard = (found[1e-9, engine, "tree_force"].error for engine in ("mujoco raw", f"mujoco raw d={HARD:g}"))
    assert soft > 100 * found[1e-9, "mujoco raw", "actuator_force"].error
    assert hard > 100 * soft


def test_softness_is_named_where_it_hides_the_gap(found) -> None:
    engine = f"mujoco raw d={HARD:g}"
    assert "soft constraints" in found[1e-9, engine, FORWARD].reason
    assert found[1e-9, engine, FORWARD].error == pytest.approx(found[1e-7, engine, FORWARD].error, rel=0.05)
