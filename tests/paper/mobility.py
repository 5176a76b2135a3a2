"""Section 2 of the paper, screws and mobility: errata 1 to 3."""

from collections.abc import Callable

import numpy as np
from paper.case import Case, largest
from paper.erratum import Erratum, Form

from screwgauge.reference.equations import screws
from screwgauge.reference.linear import null_space
from screwgauge.reference.mobility import mobility
from screwgauge.reference.rotations import Array
from support.freedoms import output_freedoms

#: The free twists of the platform as eq. (14) prints them: fixed axes whatever the pose. Shape (6, 2).
FREE_TWISTS = np.eye(6)[:, :2]
LEANING = np.linspace(0.2, 1.2, 11)  # rad, of a leg from the z-axis


def upu_screws(theta: float, R: float, L: float) -> Array:
    """Screws of the UPU chain leaning by `theta` from the z-axis, eq. (6). Shape (6, 5), columns as in eq. (7)."""
    s, c = np.sin(theta), np.cos(theta)
    rows = [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, R],
        [0, 0, 0, -s, 0, c],
        [c, 0, s, 0, -R * s + L, 0],
        [0, 1, 0, -L * c, 0, R - L * s],
    ]
    return np.array(rows, dtype=float).T


def upu_wrench(theta: float, R: float, L: float) -> Array:
    """The wrench reciprocal to them as eq. (9) prints it: infinite for an upright leg. Shape (6,)."""
    with np.errstate(divide="ignore"):
        return np.array([0.0, 1.0, 0.0, 0.0, 0.0, R - np.divide(L, np.sin(theta))])


def upu_wrench_right(theta: float, R: float, L: float) -> Array:
    """The same line for every `theta`: the null space of eq. (8) over its largest entry. Shape (6,)."""
    S = upu_screws(theta, R, L)
    wrench = null_space(np.concatenate([S[3:], S[:3]]).T)[:, 0]
    return wrench / np.abs(wrench).max()


def overconstraint(case: Case) -> list[Erratum]:
    """1: what 56 unknowns have more than 54 equations is redundant actuation; no constraint is redundant."""
    facts = mobility(case.lay, case.at.q[[len(case.t) // 3]])
    unknowns, equations = len(facts.names), 6 * facts.bodies
    printed = Form(f"{unknowns} unknowns less {equations} equations", unknowns - equations)
    right = Form("constraint components less their rank", facts.overconstraints)
    return [Erratum(1, "E", "title, sect. 2", "redundant constraints", printed, right, "count")]


def free_axes(case: Case) -> list[Erratum]:
    """2: the second free axis turns with the platform. Its angle to the twists that the chains allow."""
    a, fixed = case.motion.y[:, 0], FREE_TWISTS[:, 1]
    moved = np.stack([0 * a, np.cos(a), np.sin(a), 0 * a, 0 * a, 0 * a], axis=1)
    free = [output_freedoms(case.lay, case.at.q[[i]]) for i in range(len(a))]
    printed = Form("the y-axis, whatever the pose", max(_angle(space, fixed) for space in free))
    right = Form("(0, cos a, sin a)", max(_angle(space, axis) for space, axis in zip(free, moved, strict=True)))
    return [Erratum(2, "E", "(14), abstract", "angle of the second free axis", printed, right, "rad")]


def _angle(free: Array, twist: Array) -> float:
    return float(np.arcsin(min(1.0, float(np.linalg.norm(twist - free @ (free.T @ twist))))))


def reciprocal_screws(case: Case) -> list[Erratum]:
    """3: eqs. (6) to (13) are right, but eq. (9) is singular for an upright leg; the sum of eq. (4) ends at N - 1."""
    R, L = float(case.side.start[0, 0, 3]), float(case.lay.mechanism.home[2])

    def work(wrench: Callable[[float, float, float], Array]) -> float:
        powers = (screws.power(wrench(lean, R, L), upu_screws(lean, R, L).T) for lean in LEANING)
        return max(map(largest, powers))

    def infinite(wrench: Callable[[float, float, float], Array]) -> int:
        return int(np.sum(~np.isfinite(wrench(0.0, R, L))))

    freedoms = len(case.lay.columns["leg2.base"]) + 1 + len(case.lay.columns["leg2.wrist"])
    null = "null space of (8)"
    leaning = Form("(9), leaning leg: it holds", work(upu_wrench)), Form(null, work(upu_wrench_right))
    upright = Form("R - L / sin theta", infinite(upu_wrench)), Form(null, infinite(upu_wrench_right))
    terms = Form("i = 0 ... N", freedoms + 1), Form("i = 0 ... N - 1", freedoms)
    return [
        Erratum(3, "A", "(6)-(9)", "work of the wrench on the screws", *leaning, "m"),
        Erratum(3, "A", "(9)", "infinite entries at theta = 0", *upright, "count"),
        Erratum(3, "A", "(4)", "terms in the sum of a UPS chain", *terms, "count"),
    ]


def errata(case: Case) -> list[Erratum]:
    return [*overconstraint(case), *free_axes(case), *reciprocal_screws(case)]
