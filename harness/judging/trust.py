"""How far solutions can be trusted: estimated errors, singular poses passed, integration errors, rejected samples.

Errors are estimated from conditioning, and for simulations also from integration: the same motion, integrated with
looser tolerances, shows the size of the integration error. For samples without numbers, the responsible singularity is
found from the description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, compress

import numpy as np

from screwgauge.judging.allowance import Integrated
from screwgauge.problem import GivenMotion, Problem, Rows
from screwgauge.quantities import QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import gimbal_lock, near_singularity
from screwgauge.reference.rotations import Array, within_half_turn
from screwgauge.solution import Solution, Values


def examine_path(lay: Layout, q: Array, t: Array, near: float) -> tuple[Array, Array, str]:
    """Examine all samples of a motion, and sign changes of the determinant between them.

    Args:
        q: Joint coordinates of the description, as an engine integrated them. Shape (m, n_q).
        t: Times [s]. Shape (m,).
        near: Condition number assumed for a singular pose between two samples; an integrator steps over poses with a
            larger condition number.

    Returns:
        Largest condition number of the loop equations up to each sample, shape (m,).
        Error that rounding may have caused up to each sample, shape (m,). Accelerations near a singular pose have an
        error of about eps times the condition number squared, which affects all later samples; infinite if no digit is
        correct.
        Description of the singular poses that the motion passed, if any.
    """
    A = loop_equations(lay).matrix(q)  # includes coordinates at rest, which may begin to move at a singular pose
    condition = linear.condition(A) if A.shape[2] else np.ones(len(q))
    signs = np.linalg.slogdet(A)[0] if A.shape[1] == A.shape[2] else np.zeros(len(A))  # no sign with redundant rows
    crossed = np.flatnonzero(signs[1:] * signs[:-1] < 0)
    met = condition.copy()
    met[crossed + 1] = np.maximum(met[crossed + 1], near)
    met = np.maximum.accumulate(np.nan_to_num(met, nan=np.inf))
    with np.errstate(over="ignore"):
        estimate = linear.ROUNDED * linear.EPS * met**2
    note = ""
    if crossed.size:
        i = int(crossed[0])
        nearest = i if condition[i] > condition[i + 1] else i + 1
        count = f"{crossed.size} times, first " if crossed.size > 1 else ""
        note = (
            f"passes a singular pose {count}between t = {t[i]:.6g} and {t[i + 1]:.6g} s: "
            f"{near_singularity(lay, q[[nearest]])}"
        )
    return met, np.where(estimate < linear.DIGIT, estimate, np.inf), note


#: Tolerances of further runs relative to the first run. If truncation determines the steps, errors are proportional to
#: the tolerances, and the largest difference between two runs is nine times the error of the first run.
LOOSER = (3.0, 10.0)
#: Factor of the largest difference. If rounding dominates, all runs have random errors of equal size. For 40 light
#: cart-poles with known motion, the largest difference among three runs was at least 0.31 of the first run's error; the
#: difference between two runs was at least 0.05 of that error.
SAFETY = 4.0


def integration_note(found: Integrated) -> str:
    """Describe the integration error of a simulation."""
    if not found:
        return "the integration error is unknown"
    sizes = found.get("joint_position") or next(iter(found.values()))
    largest = ", ".join(f"{np.nanmax(error):.1e} {unit}" for unit, error in sizes.items())
    times = " and ".join(f"{factor:g}" for factor in LOOSER)
    return f"integration error, estimated from runs with {times} times the tolerances: at most {largest}"


def integration_errors(solution: Solution, looser: Sequence[Solution]) -> Integrated:
    """Estimate a simulation's integration error from runs with looser tolerances.

    The error never decreases with time, and is NaN from the first sample at which a run has no number.

    Args:
        looser: The runs with looser tolerances, with the same quantities and samples; empty if they failed.
    """
    errors: dict[str, dict[str, Array]] = {}
    for name, has in solution.values.items() if looser else ():
        runs = [has, *(one.values[name] for one in looser)]
        apart = {
            unit: [_largest_difference(*pair, unit) for pair in combinations(runs, 2)]
            for unit in dict.fromkeys(has.units)
        }
        errors[name] = {unit: SAFETY * np.max(each, axis=0) for unit, each in apart.items()}
    return errors


def _largest_difference(a: Values, b: Values, unit: str) -> Array:
    """Return the largest difference in components of a unit up to each sample. Shape (n,)."""
    columns = [i for i, has in enumerate(a.units) if has == unit]
    difference = a.array[:, columns] - b.array[:, columns]
    if unit == "rad":
        difference = within_half_turn(difference)
    return np.asarray(np.maximum.accumulate(np.abs(difference).max(axis=1)))  # NaN persists


#: Condition number above which a singular pose or a gimbal lock counts as the reason for missing numbers.
NEAR = 1e8
SHOWN = 5


@dataclass(frozen=True, slots=True, eq=False)
class Refusal:
    """Quantities that an engine rejects at some samples for one reason.

    Attributes:
        rows: The samples. Shape (n,).
        what: The singularity, without a full stop.
        sentence: The singularity with pose, times and missing quantities.
    """

    engine: str
    quantities: tuple[str, ...]
    rows: Rows
    what: str
    sentence: str


def refusals(mechanism: Mechanism, problem: Problem, solution: Solution) -> tuple[Refusal, ...]:
    """Group the samples at which numbers are missing in a given motion, by reason."""
    motion = problem.task
    if not isinstance(motion, GivenMotion):
        return ()
    groups: dict[tuple[tuple[int, ...], tuple[str, ...]], list[str]] = {}
    for quantity in (name for name in QUANTITIES if name in solution.values):
        lost = ~np.isfinite(solution.values[quantity].array)
        # without an estimate of conditioning, missing numbers do not count as rejected: they are the engine's fault
        error = solution.errors.get(quantity)
        condition = np.zeros(1) if error is None or error.condition is None else error.condition
        lost &= ~(condition <= linear.SINGULAR)[:, None]
        if lost.any():
            some = [bool(column.any()) for column in lost.T]
            part = () if all(some) else tuple(compress(solution.values[quantity].components, some))
            groups.setdefault((tuple(np.flatnonzero(lost.any(axis=1)).tolist()), part), []).append(quantity)
    refused = []
    for (rows, part), quantities in groups.items():
        first = motion.y[rows[0]]
        what = _reason(mechanism, problem.rule, quantities, first)
        t = ", ".join(f"{motion.t[i]:.6g}" for i in rows[:SHOWN]) + (", ..." if len(rows) > SHOWN else "")
        sentence = (
            f"{what} at {len(rows)} of {len(motion)} samples (t = {t} s; first at {mechanism.pose_text(first)}): "
            f"{', '.join(quantities)}{' of ' if part else ''}{', '.join(part)} cannot be computed there"
        )
        refused.append(Refusal(solution.engine, tuple(quantities), np.array(rows), what, sentence))
    return tuple(refused)


def _reason(mechanism: Mechanism, rule: str, quantities: list[str], y: Array) -> str:
    lay = layout(mechanism)
    q = positions(lay, y[None], np.zeros(1))
    system = loop_equations(lay)
    if not linear.condition(system.matrix(q))[0] < NEAR:
        return near_singularity(lay, q)
    orientations = system.chart_conditions(q)[0]  # condition numbers of the cut joints' coordinates
    if orientations.size and not orientations.max() < NEAR:
        return gimbal_lock(lay, int(np.argmax(np.where(np.isnan(orientations), np.inf, orientations))))
    if rule != "min_norm" and all(QUANTITIES[name].ruled for name in quantities):
        return f"rule {rule} is singular"
    return f"the equations of {', '.join(quantities)} are singular"
