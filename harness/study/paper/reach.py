"""What the paper's own case can test, and what it cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import dynamics, screws
from screwgauge.reference.paper import printed
from screwgauge.reference.paper.scheme import Bracket
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.errata import Case, largest


@dataclass(frozen=True, slots=True)
class Reach:
    """What the paper's own case can test.

    Attributes:
        load, gravity, inertia: Largest share of each in the generalised force Q_a [N m].
        driving: Largest driving force [N].
        bracket: Largest change of a driving force by the bracket of eq. (36) as printed [N].
        joint_error: Largest error that the same bracket makes in joint accelerations [%].
    """

    load: float
    gravity: float
    inertia: float
    driving: float
    bracket: float
    joint_error: float

    @property
    def sentence(self) -> str:
        share = 100.0 * self.bracket / self.driving
        return (
            f"The paper's own case tests statics and hardly any dynamics: in Q_a the load makes {self.load:.0f} N m, "
            f"gravity {self.gravity:.0f} and inertia {self.inertia:.2g}; a bracket that is wrong by "
            f"{self.joint_error:.0f} % in joint accelerations changes its driving forces by {self.bracket:.2g} N "
            f"of {self.driving:.0f} N, {share:.2g} %."
        )


def reach(case: Case) -> Reach:
    """Splits Q_a into its causes, and runs the wrong bracket through to the driving forces."""
    still = np.zeros(3)
    parts = []
    inertia = case.wrench(still, [])
    for gravity, loads in ((still, case.loads), (case.scene.gravity, [])):
        F, T = case.wrench(gravity, loads)
        parts.append(largest(case.generalized(F - inertia[0], T - inertia[1])[:, 0]))
    right, wrong = (_driving_by(case, form) for form in (screws.lie_bracket, printed.lie_bracket))
    beta = printed.accelerations(case.side, case.S, case.w, case.A[:, -1], printed.lie_bracket)[0]
    exact = case.side.gather(case.beta)
    return Reach(
        load=parts[0],
        gravity=parts[1],
        inertia=largest(case.generalized(*inertia)[:, 0]),
        driving=largest(right),
        bracket=largest(wrong - right),
        joint_error=100.0 * largest(beta - exact) / largest(exact),
    )


def _driving_by(case: Case, bracket: Bracket) -> Array:
    """Driving forces [N] with all accelerations by eqs. (44) and (26) under a bracket. Shape (n, 4)."""
    lay, side = case.lay, case.side
    _, along = printed.accelerations(side, case.S, case.w, case.A[:, -1], bracket)
    A = np.zeros_like(case.A)
    for joint in lay.mechanism.joints:
        chain, last = np.argwhere(side.used & (side.columns == lay.columns[joint.name][-1]))[0]
        A[:, lay.mechanism.body_index[joint.child]] = along[:, chain, last]
    motion = dynamics.body_motion(lay, case.rate.pose, case.rate.V, A)
    F, T = dynamics.required_wrench(lay, case.rate.pose, motion, case.scene.gravity, case.loads)
    return case.driving(F, T)
