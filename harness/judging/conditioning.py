"""How far numbers can be trusted: what engines estimate of their errors, and the poses that a motion passes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.graph import Layout
from screwgauge.reference.mobility import near_singularity
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution

#: Relative error from which a result is flagged: half of the digits of a double, and a thousand times the tolerance
#: of the comparison, so that what is flagged cannot be mistaken for a modelling error of interest, nor the reverse.
LIMIT = 1e-8


def flagged(solution: Solution) -> dict[str, NDArray[np.bool_]]:
    """Samples of each quantity whose estimated error is above `LIMIT`. Quantity -> booleans of shape (n,)."""
    return {name: ~(estimate <= LIMIT) for name, estimate in solution.estimate.items()}


@dataclass(frozen=True, slots=True)
class Guarded:
    """How far one quantity of one engine can be trusted over all samples that the engine solved.

    Attributes:
        condition: Largest condition number of what it was solved from.
        estimate: Largest estimated error, infinite where not one digit is right or there is no number.
        flagged: Number of samples above `LIMIT`, those without a number among them.
        worst_t: Time of the largest estimate [s].
    """

    engine: str
    quantity: str
    condition: float
    estimate: float
    flagged: int
    n_sample: int
    worst_t: float

    @property
    def ok(self) -> bool:
        return not self.flagged


def guarded(solution: Solution, t: Array) -> list[Guarded]:
    """One row for each quantity with an estimate. `t`: times [s], shape (n,)."""
    rows = []
    for name, flags in flagged(solution).items():
        worst, condition = int(np.argmax(solution.estimate[name])), float(np.max(solution.conditions[name]))
        size = float(solution.estimate[name][worst])
        rows.append(Guarded(solution.engine, name, condition, size, int(flags.sum()), len(t), float(t[worst])))
    return rows


def passed(lay: Layout, q: Array, t: Array, near: float) -> tuple[Array, Array, str]:
    """Looks at all samples of a motion, and between them for changes of the determinant's sign.

    Args:
        q: Joint coordinates of the description, as an engine integrated them. Shape (m, n_q).
        t: Times [s]. Shape (m,).
        near: Condition number assumed of a singular pose that lies between two samples: those above are stepped over.

    Returns:
        Largest condition number of the closed loops over y met up to each sample, shape (m,). What rounding may have
        made of it: accelerations next to a singular pose are off by about eps times the square, and every later sample
        has that behind it; infinite where no digit is left, shape (m,). Where the motion passed singular poses, if it
        did.
    """
    at = pose(lay, q)
    A = loop_equations(lay).matrix(at)  # no coordinate is at rest here: those that are may begin to move at such a pose
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
            f"{near_singularity(lay, at.rows([nearest]))}"
        )
    return met, np.where(estimate < linear.DIGIT, estimate, np.inf), note
