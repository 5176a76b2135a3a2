"""How far an integrated motion can be trusted, by the poses that it went through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.engines.estimate import DIGIT, ROUNDED
from screwgauge.problem import Rows
from screwgauge.reference import linear
from screwgauge.reference.closing import make_closing
from screwgauge.reference.pose import Layout, pose
from screwgauge.reference.rotations import Array
from screwgauge.reference.singular import near_singularity


@dataclass(frozen=True, slots=True, eq=False)
class Passed:
    """The poses of a motion.

    Attributes:
        condition: Largest condition number of the closed loops over y met up to each sample. Shape (m,).
        estimate: What rounding may have made of it: accelerations next to a singular pose are off by about eps times
            the square, and every later sample has that behind it; infinite where no digit is left. Shape (m,).
        note: Where the motion passed singular poses, if it did.
    """

    condition: Array
    estimate: Array
    note: str


def passed(lay: Layout, q: Array, t: Array, near: float) -> Passed:
    """Looks at all samples of a motion, and between them for changes of the determinant's sign.

    Args:
        q: Joint coordinates of the description, as an engine found them. Shape (m, n_q).
        t: Times [s]. Shape (m,).
        near: Condition number assumed of a singular pose that lies between two samples: those above are stepped over.
    """
    at = pose(lay, q)
    A = make_closing(lay).matrix(at)  # nothing is held: what rests may begin to move at a singular pose
    condition = linear.condition(A) if A.shape[2] else np.ones(len(q))
    crossed = _crossed(A)
    met = condition.copy()
    met[crossed + 1] = np.maximum(met[crossed + 1], near)
    met = np.maximum.accumulate(np.nan_to_num(met, nan=np.inf))
    with np.errstate(over="ignore"):
        estimate = ROUNDED * linear.EPS * met**2
    note = ""
    if crossed.size:
        i = int(crossed[0])
        nearest = i if condition[i] > condition[i + 1] else i + 1
        times = f"{crossed.size} times, first " if crossed.size > 1 else ""
        note = (
            f"passes a singular pose {times}between t = {t[i]:.6g} and {t[i + 1]:.6g} s: "
            f"{near_singularity(lay, at.rows([nearest]))}"
        )
    return Passed(met, np.where(estimate < DIGIT, estimate, np.inf), note)


def _crossed(A: Array) -> Rows:
    """Samples after which the determinant changes its sign; none where the loops have redundant rows."""
    if A.shape[1] != A.shape[2] or not A.shape[1]:
        return np.zeros(0, dtype=np.intp)
    sign = np.linalg.slogdet(A)[0]
    rows: Rows = np.flatnonzero(sign[1:] * sign[:-1] < 0)
    return rows
