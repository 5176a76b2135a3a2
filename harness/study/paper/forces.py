"""All forces of the paper's case under a rule, and what each joint exerts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import dynamics
from screwgauge.reference.reactions import Reactions, joint_point
from screwgauge.reference.rotations import Array
from screwgauge.study.paper.errata import Case


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """All forces of the case, preload-free.

    Attributes:
        c: Matrix of eq. (57). Shape (n, 54, 56).
        system: The same with the two rows of the rule. Shape (n, 56, 56).
        F, T: Its right side. Shape (n, n_body, 3) each.
        unknown: Reaction components, then actuator forces. Shape (n, 56).
        joint_F, joint_T: Force and moment about its point that each joint, its actuator included, exerts on its
            child. Shape (n, n_joint, 3) each.
        point: Where. Shape (n, n_joint, 3).
    """

    reactions: Reactions
    c: Array
    system: Array
    F: Array
    T: Array
    unknown: Array
    joint_F: Array
    joint_T: Array
    point: Array


def solve_forces(case: Case, rule: str = "min_norm") -> tuple[Forces, Array]:
    """Forces under a rule, and the condition number of their equations, shape (n,)."""
    lay, at = case.lay, case.rate.pose
    F, T = case.wrench(case.scene.gravity, case.loads)
    reactions = dynamics.joint_reactions(lay, at)
    c = dynamics.force_matrix(lay, at, case.bodies.com, reactions)
    if rule == "min_norm":
        rows = dynamics.preload_rows(case.B, c.shape[2])
    else:
        rows = np.zeros((len(case.t), 2, c.shape[2]))
        rows[:, :, [reactions.names.index(f"s.f{x}") for x in "xyz"]] = dynamics.axial_directions(lay, at)
    unknown, condition = dynamics.solve_newton_euler(c, F, T, rows, reactions, case.rate.system.length)
    wrenches = _joint_wrenches(case, reactions, unknown)
    return Forces(reactions, c, np.concatenate([c, rows], axis=1), F, T, unknown, *wrenches), condition


def _joint_wrenches(case: Case, reactions: Reactions, unknown: Array) -> tuple[Array, Array, Array]:
    mechanism, at = case.lay.mechanism, case.rate.pose
    force, moment = np.zeros((2, len(case.t), len(mechanism.joints), 3))
    m = len(reactions.names)
    for k, owner in enumerate(reactions.joints):
        force[:, owner] += unknown[:, k, None] * reactions.force[:, k]
        moment[:, owner] += unknown[:, k, None] * reactions.moment[:, k]
    for k, (joint, column) in enumerate(zip(mechanism.actuators, mechanism.actuated_columns, strict=True)):
        force[:, mechanism.joints.index(joint)] += unknown[:, m + k, None] * at.S[:, column, 3:]
    index = mechanism.body_index
    points = [joint_point(j, at.R[:, index[j.child]], at.p[:, index[j.child]]) for j in mechanism.joints]
    return force, moment, np.stack(points, axis=1)
