"""Measures all errata of the paper, by running the printed form and the right one of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from screwgauge.engines.screw.scheme import Bracket, chain_accelerations
from screwgauge.reference import dynamics as bodies
from screwgauge.reference import screws
from screwgauge.reference.rotations import Array
from screwgauge.study.paper import dynamics, kinematics, printed
from screwgauge.study.paper.case import STEP, Case, every, largest, percent
from screwgauge.study.paper.errata import Erratum, Values, tabulated
from screwgauge.study.paper.scheme import SchemeRuns, scheme_runs, scheme_values

NUMBERS = range(1, 19)


class Reach:
    """Q_a split into its causes, and a wrong bracket carried through to the driving forces.

    Attributes:
        load, gravity, inertia: Largest share of each in the generalised force Q_a [N m].
        driving: Largest driving force [N].
        bracket: Largest change of a driving force by the bracket of eq. (36) as printed [N].
        joint_error: Largest error that the same bracket makes in joint accelerations [%].
    """

    def __init__(self, case: Case) -> None:
        inertia = case.generalized(*case.wrench(np.zeros(3), loaded=False))[:, 0]
        self.load = largest(case.generalized(*case.wrench(np.zeros(3)))[:, 0] - inertia)
        self.gravity = largest(case.generalized(*case.wrench(loaded=False))[:, 0] - inertia)
        self.inertia = largest(inertia)
        (right, _), (wrong, beta) = (_by_bracket(case, form) for form in (screws.lie_bracket, printed.lie_bracket))
        self.driving, self.bracket = largest(right), largest(wrong - right)
        self.joint_error = percent(beta, case.side.gather(case.beta))

    @property
    def sentence(self) -> str:
        share = 100.0 * self.bracket / self.driving
        return (
            f"The paper's own case tests statics and hardly any dynamics: in Q_a the load makes {self.load:.0f} N m, "
            f"gravity {self.gravity:.0f} and inertia {self.inertia:.2g}; a bracket that is wrong by "
            f"{self.joint_error:.0f} % in joint accelerations changes its driving forces by {self.bracket:.2g} N "
            f"of {self.driving:.0f} N, {share:.2g} %."
        )


def _by_bracket(case: Case, bracket: Bracket) -> tuple[Array, Array]:
    """Driving forces [N] and joint accelerations chain by chain, by eqs. (44) and (26) under a bracket.

    Returns:
        Shapes (n, 4), (n, 5, m).
    """
    lay, side = case.lay, case.side
    beta, along = chain_accelerations(side, case.S, case.w, case.A[:, -1], bracket)
    A = np.zeros_like(case.A)
    for joint in lay.mechanism.joints:
        chain, last = np.argwhere(side.used & (side.columns == lay.columns[joint.name][-1]))[0]
        A[:, lay.mechanism.body_index[joint.child]] = along[:, chain, last]
    moved = bodies.body_motion(lay, case.rate.pose, case.rate.V, A)
    return case.driving(*case.wrench(bodies=moved)), beta


@dataclass(frozen=True, slots=True, eq=False)
class Paper:
    """All errata, measured, with what the plots need."""

    errata: tuple[Erratum, ...]
    reach: Reach
    runs: SchemeRuns
    axial: dynamics.AxialRule

    @property
    def complete(self) -> bool:
        """Every number has a finite measurement."""
        return {row.number for row in self.errata if np.isfinite(row.effect)} >= set(NUMBERS)


def measure(progress: Callable[[str, float], None] = lambda step, share: None) -> Paper:
    """Measures all errata: some seconds, most of them for the paper's 10 000 steps."""
    case = Case(every(STEP))
    progress("kinematics", 0.0)
    values: dict[int, Iterable[Values]] = {number: found(case) for number, found in kinematics.ERRATA.items()}
    progress("dynamics", 0.1)
    forces = dynamics.Forces(case)
    values |= {number: found(case, forces) for number, found in dynamics.ERRATA.items()}
    axial, values[15] = dynamics.axial_rule()
    runs = scheme_runs(case, lambda share: progress("scheme", 0.3 + 0.7 * share))
    values[8] = scheme_values(runs)
    return Paper(tabulated(values), Reach(case), runs, axial)


@lru_cache(maxsize=1)
def measured() -> Paper:
    """`measure`, once in the life of a program: it depends on nothing but the code."""
    return measure()
