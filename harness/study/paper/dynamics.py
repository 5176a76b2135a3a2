"""All forces of the paper's case under a rule; errata 12 to 14 and 16, of its dynamics, each by a function."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import dynamics
from screwgauge.reference.paper import printed
from screwgauge.reference.reactions import joint_point
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.case import HALF, Case, largest, longest
from screwgauge.study.paper.errata import Values


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """All forces of the case.

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

    c: Array
    system: Array
    condition: Array
    F: Array
    T: Array
    actuator: Array
    joint_F: Array
    joint_T: Array
    point: Array


def solve_forces(case: Case, rule: str = "min_norm") -> Forces:
    """Forces under a rule, ``min_norm`` or ``spherical_axial``."""
    lay, at, mechanism = case.lay, case.rate.pose, case.lay.mechanism
    F, T = case.wrench()
    reactions = dynamics.joint_reactions(lay, at)
    c, m = dynamics.force_matrix(lay, at, case.bodies.com, reactions), len(reactions.names)
    if rule == "min_norm":
        rows = dynamics.preload_rows(case.B, c.shape[2])
    else:
        rows = np.zeros((len(case.t), 2, c.shape[2]))
        rows[:, :, [reactions.names.index(f"s.f{x}") for x in "xyz"]] = dynamics.axial_directions(lay, at)
    units = reactions.units + mechanism.actuator_units
    unknown, condition = dynamics.solve_newton_euler(c, F, T, rows, units, case.rate.system.length)
    force, moment = np.zeros((2, len(case.t), len(mechanism.joints), 3))
    for k, owner in enumerate(reactions.joints):
        force[:, owner] += unknown[:, k, None] * reactions.force[:, k]
        moment[:, owner] += unknown[:, k, None] * reactions.moment[:, k]
    for k, (joint, column) in enumerate(zip(mechanism.actuators, mechanism.actuated_columns, strict=True)):
        force[:, mechanism.joints.index(joint)] += unknown[:, m + k, None] * at.S[:, column, 3:]
    child = [mechanism.body_index[joint.child] for joint in mechanism.joints]
    points = [joint_point(j, at.R[:, i], at.p[:, i]) for j, i in zip(mechanism.joints, child, strict=True)]
    system, point = np.concatenate([c, rows], axis=1), np.stack(points, axis=1)
    return Forces(c, system, condition, F, T, unknown[:, m:], force, moment, point)


def gravity(case: Case, forces: Forces) -> list[Values]:
    """Generalised and driving forces, each where the two differ most."""
    wrong, right = case.wrench(-case.scene.applied.g), (forces.F, forces.T)
    return [
        _farthest(case.generalized(*wrong)[:, 0], case.generalized(*right)[:, 0]),
        _farthest(case.driving(*wrong), case.driving(*right)),
    ]


def _farthest(wrong: Array, right: Array) -> Values:
    i = int(np.argmax(np.abs(wrong - right)))
    return Values(wrong.flat[i], right.flat[i])


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


_Lever = tuple[str, printed.Reading]
#: Kind of body and wrong reading of its lever arms. Eq. (55) has terms of one kind only: there ``from`` is right.
_WRONG: list[_Lever] = [("lower", "to"), ("lower", "from"), ("upper", "to"), ("upper", "from"), ("platform", "to")]


def levers(case: Case, forces: Forces) -> list[Values]:
    """Imbalances by each reading; T_B about C and about the end of the lower half, where that matters most."""
    rows = [
        Values(_imbalance(case, forces, reading, kind), _imbalance(case, forces, "right", kind))
        for kind, reading in _WRONG
    ]
    base, slide = (_joints(case, *(f"leg{k}.{role}" for k in range(1, 5))) for role in ("base", "slide"))
    A, C, T_C = forces.point[:, base], forces.point[:, slide], forces.joint_T[:, slide]
    end = A + HALF * (C - A) / np.linalg.norm(C - A, axis=2, keepdims=True)
    shift = np.cross(C - end, forces.joint_F[:, slide])
    size = np.linalg.norm(shift, axis=2)
    worst = np.unravel_index(np.argmax(size), size.shape)
    return [*rows, Values(longest((T_C + shift)[worst]), longest(T_C[worst]), effect=size[worst])]


def _joints(case: Case, *names: str) -> list[int]:
    joints = [joint.name for joint in case.lay.mechanism.joints]
    return [joints.index(name) for name in names]


def platform(case: Case, forces: Forces) -> list[Values]:
    wrist, *others, s = _joints(case, *(f"leg{k}.wrist" for k in range(1, 5)), "s")
    T_C, rest = forces.joint_T[:, wrist], forces.joint_T[:, others].sum(axis=1)
    lever = np.cross(forces.point[:, s] - case.bodies.com[:, -1], forces.joint_F[:, s])
    return [
        Values(0.0, longest(T_C)),
        Values(0.0, longest(lever)),
        Values(longest(rest - T_C - lever), _imbalance(case, forces, "right", "platform")),
    ]


def right_inverse(forces: Forces) -> list[Values]:
    c = forces.c
    b = np.concatenate([forces.F, forces.T], axis=2).reshape(len(c), -1)
    y = np.linalg.solve(c @ c.swapaxes(1, 2), b[..., None])
    Q = (c.swapaxes(1, 2) @ y)[..., 0]
    # fifty-four numbers for fifty-six unknowns: read as the first of them, the rest zero
    as_printed = np.concatenate([y[..., 0], np.zeros((len(y), c.shape[2] - y.shape[1]))], axis=1)
    left = (100.0 * largest((c @ q[..., None])[..., 0] - b) / largest(b) for q in (as_printed, Q))
    return [Values(y.shape[1], Q.shape[1]), Values(*left)]
