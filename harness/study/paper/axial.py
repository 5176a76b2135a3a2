"""Erratum 15: the rule of eq. (56), measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import dynamics
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.case import every, paper_case
from screwgauge.study.paper.dynamics import solve_forces
from screwgauge.study.paper.errata import Values

NEAR_TURN = 6.283  # s: the sample of the paper's 1 ms grid that is nearest to t = 2 pi
RULES = ("spherical_axial", "min_norm")


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
    condition: tuple[float, ...]
    singular: tuple[int, ...]
    equations: int


def axial_rule() -> AxialRule:
    """Runs eq. (56) as the two equations that it stands for."""
    case = paper_case(np.union1d(every(0.01), [NEAR_TURN]))
    forces = solve_forces(case, "spherical_axial")
    size = np.where(forces.condition <= SINGULAR, np.abs(forces.actuator).max(axis=1), np.nan)
    least = np.abs(case.driving(forces.F, forces.T)).max(axis=1)
    some, turns = paper_case(every(0.1)[1:]), paper_case(np.arange(4.0) * np.pi)
    best = tuple(float(np.linalg.cond(solve_forces(some, rule).system).min()) for rule in RULES)
    singular = tuple(int(np.sum(solve_forces(turns, rule).condition > SINGULAR)) for rule in RULES)
    return AxialRule(case.t, size, least, best, singular, dynamics.axial_directions(case.lay, case.rate.pose).shape[1])


def axial_values(rule: AxialRule) -> list[Values]:
    """The rows of erratum 15."""
    regular = np.isfinite(rule.size)
    size, least = rule.size[regular], rule.least[regular]
    at_turn = [int(np.argmin(np.abs(rule.t - time))) for time in (6.28, NEAR_TURN)]
    return [
        Values(1, rule.equations),
        Values(*rule.singular),
        Values(np.median(size), np.median(least)),
        Values(np.median(size / least), 1.0, effect=np.median(size / least)),
        *(Values(rule.size[i], rule.least[i]) for i in at_turn),
        Values(*rule.condition),
    ]
