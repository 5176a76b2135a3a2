"""All forces of the paper's case under a rule; errata 12 to 16, of its dynamics, each by a function."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from screwgauge.reference import dynamics
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.reactions import joint_point
from screwgauge.reference.rotations import Array
from screwgauge.study.paper import printed
from screwgauge.study.paper.case import HALF, Case, every, largest, longest
from screwgauge.study.paper.errata import Values

NEAR_TURN = 6.283  # s: the sample of the paper's 1 ms grid that is nearest to t = 2 pi
RULES = ("spherical_axial", "min_norm")


class Forces:
    """All forces of the case under a rule.

    Attributes:
        c: Matrix of eq. (57). Shape (n, 54, 56).
        system: The same with the two rows of the rule. Shape (n, 56, 56).
        condition: Condition number of the equations. Shape (n,).
        F, T: Their right side. Shape (n, n_body, 3) each.
        actuator: Actuator forces [N]. Shape (n, 4).
        joint_F, joint_T: Force and moment about its point that each joint, its actuator included, exerts on its
            child. Shape (n, n_joint, 3) each.
        point: Where. Shape (n, n_joint, 3).
    """

    def __init__(self, case: Case, rule: str = "min_norm") -> None:
        lay, at, mechanism = case.lay, case.rate.pose, case.lay.mechanism
        self.F, self.T = case.wrench()
        reactions = dynamics.joint_reactions(lay, at)
        self.c, m = dynamics.force_matrix(lay, at, case.bodies.com, reactions), len(reactions.names)
        rows = dynamics.rule_rows(lay, at, case.B, reactions, axial=rule != "min_norm")
        self.system = np.concatenate([self.c, rows], axis=1)
        units, length = reactions.units + mechanism.actuator_units, case.rate.system.length
        unknown, self.condition = dynamics.solve_newton_euler(self.c, self.F, self.T, rows, units, length)
        self.actuator = unknown[:, m:]
        self.joint_F, self.joint_T = np.zeros((2, len(case.t), len(mechanism.joints), 3))
        for k, owner in enumerate(reactions.joints):
            self.joint_F[:, owner] += unknown[:, k, None] * reactions.force[:, k]
            self.joint_T[:, owner] += unknown[:, k, None] * reactions.moment[:, k]
        for k, (joint, column) in enumerate(zip(mechanism.actuators, mechanism.actuated_columns, strict=True)):
            self.joint_F[:, mechanism.joints.index(joint)] += unknown[:, m + k, None] * at.S[:, column, 3:]
        child = [mechanism.body_index[joint.child] for joint in mechanism.joints]
        points = [joint_point(j, at.R[:, i], at.p[:, i]) for j, i in zip(mechanism.joints, child, strict=True)]
        self.point = np.stack(points, axis=1)


class AxialRule(NamedTuple):
    """Driving forces under eq. (56) beside the smallest ones, every 10 ms.

    Attributes:
        t: Time [s]. Shape (n,).
        size, least: Largest driving force under each rule [N]; not a number where eq. (56) has no solution. Shape (n,).
    """

    t: Array
    size: Array
    least: Array


def axial_rule() -> tuple[AxialRule, list[Values]]:
    """Runs eq. (56) as the two equations that it stands for; and the rows of erratum 15."""
    case = Case(np.union1d(every(0.01), [NEAR_TURN]))
    forces = Forces(case, "spherical_axial")
    size = np.where(forces.condition <= SINGULAR, np.abs(forces.actuator).max(axis=1), np.nan)
    least = np.abs(case.driving(forces.F, forces.T)).max(axis=1)
    some, turns = Case(every(0.1)[1:]), Case(np.arange(4.0) * np.pi)
    regular = np.isfinite(size)
    ratio = np.median(size[regular] / least[regular])
    return AxialRule(case.t, size, least), [
        Values(1, dynamics.axial_directions(case.lay, case.rate.pose).shape[1]),
        # how many of t = 0, pi, 2 pi, 3 pi are singular
        Values(*(int(np.sum(Forces(turns, rule).condition > SINGULAR)) for rule in RULES)),
        Values(np.median(size[regular]), np.median(least[regular])),
        Values(ratio, 1.0, effect=ratio),
        *(Values(size[i], least[i]) for i in (np.argmin(np.abs(case.t - time)) for time in (6.28, NEAR_TURN))),
        Values(*(np.linalg.cond(Forces(some, rule).system).min() for rule in RULES)),
    ]


def gravity(case: Case, forces: Forces) -> Iterator[Values]:
    """Generalised and driving forces, each where the two differ most."""
    wrong, right = case.wrench(-case.scene.applied.g), (forces.F, forces.T)
    for one, other in (
        (case.generalized(*wrong)[:, 0], case.generalized(*right)[:, 0]),
        (case.driving(*wrong), case.driving(*right)),
    ):
        i = int(np.argmax(np.abs(one - other)))
        yield Values(one.flat[i], other.flat[i])


def _imbalance(case: Case, forces: Forces, reading: printed.Reading, kind: str) -> float:
    """Largest moment [N m] by which the true forces miss the printed balance of one kind of body."""
    worst = 0.0
    for i, body in enumerate(case.lay.mechanism.bodies):
        if body.name.rsplit(".", 1)[-1] != kind:
            continue
        total = np.zeros_like(forces.T[:, i])
        for k, joint in enumerate(case.lay.mechanism.joints):
            if body.name in (joint.parent, joint.child):
                side: printed.Side = "child" if joint.child == body.name else "parent"
                # the lever of F_S does not stand in eq. (55) at all: that is erratum 14
                how: printed.Reading = "right" if joint.name == "s" else reading
                arms = forces.point[:, k] - case.bodies.com[:, i]
                total += printed.body_moment(arms, forces.joint_F[:, k], forces.joint_T[:, k], side, how)
        worst = max(worst, longest(total - forces.T[:, i]))
    return worst


#: Kind of body and wrong reading of its lever arms. Eq. (55) has terms of one kind only: there ``from`` is right.
_WRONG: tuple[tuple[str, printed.Reading], ...] = (
    *(("lower", "to"), ("lower", "from"), ("upper", "to"), ("upper", "from"), ("platform", "to")),
)


def levers(case: Case, forces: Forces) -> Iterator[Values]:
    """Imbalances by each reading; T_B about C and about the end of the lower half, where that matters most."""
    for kind, reading in _WRONG:
        yield Values(_imbalance(case, forces, reading, kind), _imbalance(case, forces, "right", kind))
    base, slide = _joints(case, "base"), _joints(case, "slide")
    A, C, T_C = forces.point[:, base], forces.point[:, slide], forces.joint_T[:, slide]
    end = A + HALF * (C - A) / np.linalg.norm(C - A, axis=2, keepdims=True)
    shift = np.cross(C - end, forces.joint_F[:, slide])
    size = np.linalg.norm(shift, axis=2)
    worst = np.unravel_index(np.argmax(size), size.shape)
    yield Values(longest((T_C + shift)[worst]), longest(T_C[worst]), effect=size[worst])


def _joints(case: Case, role: str) -> list[int]:
    """That joint of each leg."""
    return [i for i, joint in enumerate(case.lay.mechanism.joints) if joint.name.endswith(f".{role}")]


def platform(case: Case, forces: Forces) -> list[Values]:
    wrist, *others = _joints(case, "wrist")
    s = case.lay.mechanism.joints.index(case.lay.mechanism.joint("s"))
    T_C, rest = forces.joint_T[:, wrist], forces.joint_T[:, others].sum(axis=1)
    lever = np.cross(forces.point[:, s] - case.bodies.com[:, -1], forces.joint_F[:, s])
    return [
        Values(0.0, longest(T_C)),
        Values(0.0, longest(lever)),
        Values(longest(rest - T_C - lever), _imbalance(case, forces, "right", "platform")),
    ]


def right_inverse(case: Case, forces: Forces) -> list[Values]:
    c = forces.c
    b = np.concatenate([forces.F, forces.T], axis=2).reshape(len(c), -1)
    y = np.linalg.solve(c @ c.swapaxes(1, 2), b[..., None])
    Q = (c.swapaxes(1, 2) @ y)[..., 0]
    # fifty-four numbers for fifty-six unknowns: read as the first of them, the rest zero
    as_printed = np.concatenate([y[..., 0], np.zeros((len(y), c.shape[2] - y.shape[1]))], axis=1)
    left = (100.0 * largest((c @ q[..., None])[..., 0] - b) / largest(b) for q in (as_printed, Q))
    return [Values(y.shape[1], Q.shape[1]), Values(*left)]


ERRATA = {12: gravity, 13: levers, 14: platform, 16: right_inverse}
