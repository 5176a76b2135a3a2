"""Erratum 15: the rule of eq. (56), measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import dynamics
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.errata import Erratum, erratum, every, paper_case
from screwgauge.study.paper.forces import solve_forces

NEAR_TURN = 6.283  # s: the sample of the paper's 1 ms grid that is nearest to t = 2 pi


@dataclass(frozen=True, slots=True, eq=False)
class AxialRule:
    """Driving forces under eq. (56) beside the smallest ones, every 10 ms.

    Attributes:
        t: Time [s]. Shape (n,).
        size, least: Largest driving force under each rule [N]; not a number where eq. (56) has no solution. Shape (n,).
        condition: Smallest condition number (2-norm) of the equations under each rule, eq. (56) first.
        singular: How many of t = 0, pi, 2 pi, 3 pi are singular under each rule.
        equations: How many equations eq. (56) stands for.
    """

    t: Array
    size: Array
    least: Array
    condition: tuple[float, float]
    singular: tuple[int, int]
    equations: int


def axial_rule() -> AxialRule:
    """Runs eq. (56) as the two equations that it stands for."""
    case = paper_case(np.union1d(every(0.01), [NEAR_TURN]))
    forces, condition = solve_forces(case, "spherical_axial")
    size = np.where(condition <= SINGULAR, np.abs(forces.unknown[:, -4:]).max(axis=1), np.nan)
    least = np.abs(case.driving(forces.F, forces.T)).max(axis=1)
    some, turns = paper_case(every(0.1)[1:]), paper_case(np.arange(4.0) * np.pi)
    rules = ("spherical_axial", "min_norm")
    best = [float(np.linalg.cond(solve_forces(some, rule)[0].system).min()) for rule in rules]
    singular = [int(np.sum(solve_forces(turns, rule)[1] > SINGULAR)) for rule in rules]
    equations = dynamics.axial_directions(case.lay, case.rate.pose).shape[1]
    return AxialRule(case.t, size, least, (best[0], best[1]), (singular[0], singular[1]), equations)


def axial_errata(found: AxialRule) -> list[Erratum]:
    """The rows of erratum 15."""
    words, regular = ("F_S along O P", "minimum norm"), np.isfinite(found.size)
    ratio = np.median(found.size[regular] / found.least[regular])

    def at(time: float) -> tuple[float, float]:
        i = int(np.argmin(np.abs(found.t - time)))
        return found.size[i], found.least[i]

    count = erratum(
        15, "(56)", "equations that it stands for", ("one", "two, across O P"), (1, found.equations), "count"
    )
    medians = float(np.median(found.size[regular])), float(np.median(found.least[regular]))
    return [
        count,
        erratum(15, "(56)", "singular of t = 0, pi, 2 pi, 3 pi", words, found.singular, "count"),
        erratum(15, "(56)", "largest driving force, median", words, medians, "N"),
        erratum(15, "(56)", "the same, median of the ratio", words, (ratio, 1.0), "factor", effect=ratio),
        erratum(15, "(56)", "driving force at t = 6.28 s", words, at(6.28), "N"),
        erratum(15, "(56)", "driving force at t = 6.283 s", words, at(NEAR_TURN), "N"),
        erratum(15, "(56)", "condition number, smallest", words, found.condition, "1"),
    ]
