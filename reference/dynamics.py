"""The Newton-Euler equations of all bodies as one system, ``c Q = m A + W + F_E`` (section 5 of the paper).

Corrected against the paper: gravity as ``m (a - g)``, lever arms from the centre of mass to the point of action,
the moment of the U-joint's wrist and ``(O - P) x F_S`` are in, and the sign of the load says who exerts it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.reference import linear, screws
from screwgauge.reference.along import joint_wrenches
from screwgauge.reference.applied import Load
from screwgauge.reference.kinematics import Velocities
from screwgauge.reference.layout import Layout
from screwgauge.reference.pose import Pose, centres_of_mass
from screwgauge.reference.reactions import Reactions, joint_point, reaction_components
from screwgauge.reference.rotations import Array, cross


@dataclass(frozen=True, slots=True, eq=False)
class BodyMotion:
    """Motion of all moving bodies in world axes, gravity not included.

    Attributes:
        com: Position of the centre of mass [m]. Shape (n, n_body, 3).
        omega, beta: Angular velocity [rad/s] and acceleration [rad/s^2]. Shape (n, n_body, 3).
        a: Acceleration of the centre of mass [m/s^2], eqs. (49)-(50). Shape (n, n_body, 3).
        J: Inertia tensor in world axes [kg m^2], eq. (52). Shape (n, n_body, 3, 3).
    """

    com: Array
    omega: Array
    beta: Array
    a: Array
    J: Array


def body_motion(lay: Layout, at: Pose, V: Array, A: Array) -> BodyMotion:
    """Motion of the bodies from their twists `V` and acceleration screws `A`, shape (n, n_body + 1, 6)."""
    bodies = lay.mechanism.bodies
    R = at.R[:, 1:]
    com = centres_of_mass(lay, at)
    J = R @ np.stack([body.inertia for body in bodies]) @ R.swapaxes(2, 3)
    V, A = V[:, 1:], A[:, 1:]
    return BodyMotion(com, V[..., :3], A[..., :3], screws.acceleration_at(V, A, com), J)


def required_wrench(
    lay: Layout, at: Pose, motion: BodyMotion, gravity: Array, loads: Sequence[Load]
) -> tuple[Array, Array]:
    """What joints and actuators must exert on each body: the right side of eqs. (53)-(55).

    Args:
        gravity: [m/s^2]. Shape (3,).
        loads: On bodies; their forces and torques may have shape (n, 3), too.

    Returns:
        Force [N] and moment about the centre of mass [N m] of each body. Shape (n, n_body, 3) each.
    """
    mass = lay.mechanism.masses.astype(motion.a.dtype)
    F = mass[:, None] * (motion.a - gravity)
    Jw = (motion.J @ motion.omega[..., None])[..., 0]
    T = (motion.J @ motion.beta[..., None])[..., 0] + cross(motion.omega, Jw)
    for load in loads:
        i = lay.mechanism.body_index[load.body]
        F[:, i - 1] -= load.force
        T[:, i - 1] -= load.torque
        if load.point is not None:
            arm = at.R[:, i] @ (load.point - lay.mechanism.body(load.body).com)
            T[:, i - 1] -= cross(arm, load.force)
    return F, T


def partial_motion(lay: Layout, rate: Velocities, com: Array) -> tuple[Array, Array]:
    """Velocities of the centres of mass and angular velocities per rate of each independent coordinate.

    Args:
        com: Position of the centres of mass [m]. Shape (n, n_body, 3).

    Returns:
        ``d v_com / d yd`` and ``d omega / d yd``. Shape (n, n_body, k, 3) each.
    """
    tree = lay.tree_columns
    partial = np.einsum("bi,nij,nix->nbjx", lay.path[1:, tree], rate.K[:, tree], rate.pose.S[:, tree])
    return partial[..., 3:] + cross(partial[..., :3], com[:, :, None]), partial[..., :3]


def generalized_force(lay: Layout, rate: Velocities, motion: BodyMotion, F: Array, T: Array) -> Array:
    """What the actuators must deliver for each independent coordinate, by virtual power.

    ``Q_j = sum over bodies of F . d v_com / d yd_j + T . d omega / d yd_j``; unique whatever the preload.

    Returns:
        [N m or N]. Shape (n, k).
    """
    return virtual_power(F, T, *partial_motion(lay, rate, motion.com))


def virtual_power(F: Array, T: Array, linear_part: Array, angular_part: Array) -> Array:
    """The same from what `partial_motion` gives, if that is known. Shape (n, k)."""
    return np.asarray(np.einsum("nbx,nbjx->nj", F, linear_part) + np.einsum("nbx,nbjx->nj", T, angular_part))


def joint_reactions(lay: Layout, at: Pose) -> Reactions:
    """The reaction components of all joints and couplings at a pose (56 - 4 for the 3-UPS-UPU-S)."""
    mechanism, index, joints = lay.mechanism, lay.mechanism.body_index, lay.mechanism.joints
    found = reaction_components(
        joints,
        [at.R[:, index[joint.parent]] for joint in joints],
        [at.R[:, index[joint.child]] for joint in joints],
        [at.p[:, index[joint.child]] for joint in joints],
    )
    return found.with_couplings(mechanism.couplings, dict(zip(mechanism.coordinates, mechanism.units, strict=True)))


def force_matrix(lay: Layout, at: Pose, com: Array, reactions: Reactions) -> Array:
    """The matrix c of eq. (57): what each unknown exerts on each body (force; moment about its centre of mass).

    Unknowns are the reaction components, then the actuator forces. A coupling ``q_i = p(q_j)`` acts along both of its
    coordinates, by 1 along q_i and -p' along q_j, so that it has no power.

    Returns:
        Shape (n, 6 n_body, n_reaction + n_actuator).
    """
    mechanism, index = lay.mechanism, lay.mechanism.body_index
    n, m = len(com), len(reactions.names)
    c = np.zeros((n, len(mechanism.bodies) + 1, 6, m + len(mechanism.actuators)), dtype=com.dtype)

    def act(column: int, joint_at: int, f: Array, moment: Array, point: Array) -> None:
        joint = mechanism.joints[joint_at]
        for body, sign in ((index[joint.child], 1.0), (index[joint.parent], -1.0)):
            if body:  # the ground needs no balance
                c[:, body, :3, column] = sign * f
                c[:, body, 3:, column] = sign * (moment + cross(point - com[:, body - 1], f))

    for k, joint_at in enumerate(reactions.joints):
        act(k, joint_at, reactions.force[:, k], reactions.moment[:, k], reactions.point[:, k])
    if mechanism.couplings:
        for k, along in enumerate(mechanism.coupling_rows.matrix(at.q).swapaxes(0, 1), len(reactions.joints)):
            c[:, 1:, :, k] = joint_wrenches(lay, at, com, along).reshape(n, -1, 6)
    for k, (joint, column) in enumerate(zip(mechanism.actuators, mechanism.actuated_columns, strict=True)):
        child = index[joint.child]
        S = at.S[:, column]
        turns = joint.kind == "R"
        f = np.zeros((n, 3)) if turns else S[:, 3:]
        moment = S[:, :3] if turns else np.zeros((n, 3))
        point = joint_point(joint, at.R[:, child], at.p[:, child])
        act(m + k, mechanism.joints.index(joint), f, moment, point)
    return c[:, 1:].reshape(n, 6 * len(mechanism.bodies), c.shape[3])


def min_norm(B: Array, Q: Array) -> tuple[Array, Array]:
    """The actuator forces of smallest norm with ``B^T f = Q``.

    Args:
        B: Actuator rates per rate of y, d L / d y. Shape (n, n_actuator, k).
        Q: Generalised forces. Shape (n, k).

    Returns:
        Shape (n, n_actuator), and the condition number of B, (n,).
    """
    back, condition = linear.inverted(B)
    return (Q[:, None] @ back)[:, 0], condition


def preload_space(B: Array) -> Array:
    """Actuator forces that move nothing, the null space of ``B^T``. Shape (n, n_actuator, n_actuator - k)."""
    U, _, _ = np.linalg.svd(B, full_matrices=True)
    return np.asarray(U[..., B.shape[-1] :])


def preload_rows(B: Array, m: int) -> Array:
    """Rows below the Newton-Euler system of m unknowns, the last being actuator forces: they hold no preload.

    Returns:
        Shape (n, n_actuator - k, m).
    """
    preload = preload_space(B)
    rows = np.zeros((len(B), preload.shape[2], m))
    rows[:, :, m - B.shape[1] :] = preload.swapaxes(1, 2)
    return rows


def rule_rows(lay: Layout, at: Pose, B: Array, reactions: Reactions, *, axial: bool) -> Array:
    """Rows below the Newton-Euler system: no preload, or no force across the line of eq. (56) if there is one.

    Returns:
        Shape (n, n_actuator - k, m).
    """
    m = len(reactions.names) + B.shape[1]
    if not axial or lay.mechanism.axial is None:
        return preload_rows(B, m)
    rows = np.zeros((len(B), B.shape[1] - B.shape[2], m))
    rows[:, :, [reactions.names.index(f"{lay.mechanism.axial[0]}.f{axis}") for axis in "xyz"]] = axial_directions(
        lay, at
    )
    return rows


def axial_directions(lay: Layout, at: Pose) -> Array:
    """Two directions across the line on which eq. (56) wants the spherical joint's force. Shape (n, 2, 3)."""
    if lay.mechanism.axial is None:
        raise ValueError("the mechanism names no joint for this rule")
    name, direction = lay.mechanism.axial
    joint = lay.mechanism.joint(name)
    R = at.R[:, lay.mechanism.body_index[joint.child]]
    return across_direction(R, direction)


def across_direction(R: Array, direction: Array) -> Array:
    """Two world directions orthogonal to a body-fixed one. Shapes (n, 3, 3), (3,) -> (n, 2, 3)."""
    basis = np.linalg.svd(direction[None])[2][1:]
    return np.asarray((R @ basis.T).swapaxes(1, 2))


def force_system(c: Array, rule: Array, units: Sequence[str], length: float) -> tuple[Array, Array, Array]:
    """The Newton-Euler system without dimension, and what its balances and its unknowns were divided by.

    Args:
        c, rule, units, length: See `solve_newton_euler`.

    Returns:
        Shapes (n, 6 n_body + n_redundant, m), (6 n_body,), (m,).
    """
    size = np.where(np.array(units) == "N m", length, 1.0)
    rows = np.resize([1.0, 1.0, 1.0, length, length, length], c.shape[1])
    return np.concatenate([c / rows[:, None], rule], axis=1) * size, rows, size


def solve_newton_euler(
    c: Array, F: Array, T: Array, rule: Array, units: Sequence[str], length: float, *, wide: Array | None = None
) -> tuple[Array, Array]:
    """All constraint and actuator forces, ``c Q = m A + W + F_E`` with the rule's rows below (eqs. 56-58).

    Moments are divided by a length, as equations and as unknowns, so that the size of the mechanism does not matter.
    Next to a singular pose some unknowns are large and cancel in the others, while the rounding of c does not: one step
    of iterative refinement, its residual from a wider c, gives those digits back.

    Args:
        c: From `force_matrix`. Shape (n, 6 n_body, m).
        F, T: From `required_wrench`. Shape (n, n_body, 3).
        rule: Rows that fix the redundant actuation, their right side being zero. Shape (n, n_redundant, m).
        units: Of the unknowns, c's columns.
        length: Length of the mechanism [m].
        wide: The same c in a wider format, see `screwgauge.reference.precision.wide_force_matrix`.

    Returns:
        Unknowns in the order of c's columns, shape (n, m), and the condition number of the system, shape (n,).
    """
    system, rows, size = force_system(c, rule, units, length)
    b = np.concatenate([F, T], axis=2).reshape(len(F), -1) / rows
    right = np.concatenate([b, np.zeros(rule.shape[:2])], axis=1)
    inverse, condition = linear.inverted(system)  # one factorisation for three uses
    unknown = (inverse @ right[..., None])[..., 0]
    if wide is not None:
        exact = np.concatenate([wide / rows[:, None], rule.astype(wide.dtype)], axis=1) * size
        residual = right - np.einsum("nij,nj->ni", exact, unknown)
        unknown = unknown + (inverse @ residual.astype(system.dtype)[..., None])[..., 0]
    return unknown * size, condition
