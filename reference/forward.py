"""Forward dynamics: accelerations for given forces, the Newton-Euler system with unknown accelerations.

`forward` projects it onto the independent coordinates, ``M ydd = Q - h`` with ``M = sum of m v_j v_k + w_j J w_k``;
`forward_dense` solves for all joint accelerations and reactions at once. Both are regular for redundant constraints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from screwgauge.reference import linear, screws
from screwgauge.reference.along import joint_wrenches
from screwgauge.reference.applied import GRAVITY, Applied, Load, Spring
from screwgauge.reference.dynamics import (
    BodyMotion,
    body_motion,
    force_matrix,
    joint_reactions,
    partial_motion,
    required_wrench,
    virtual_power,
)
from screwgauge.reference.errors import DescriptionError, SingularPoseError
from screwgauge.reference.kinematics import Velocities, accelerations
from screwgauge.reference.layout import Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import centres_of_mass, constraint_matrix
from screwgauge.reference.rotations import Array, cross
from screwgauge.reference.springs import check_springs, spring_energy, spring_forces


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """What acts on a mechanism, constant in time or sample by sample.

    Attributes:
        actuators: Force of each actuator [N or N m]. Shape (n_actuator,) or (n, n_actuator); None is zero.
        joints: Motor forces along all joint coordinates, added to those. Shape (n_q,) or (n, n_q).
        gravity: [m/s^2]. Shape (3,).
        loads: On bodies, forces of shape (3,) or (n, 3).
        springs: Springs and dampers.
    """

    actuators: Array | None = None
    joints: Array | None = None
    gravity: Array = field(default_factory=lambda: np.array(GRAVITY))
    loads: Sequence[Load] = ()
    springs: Sequence[Spring] = ()


def forces_at(mechanism: Mechanism, applied: Applied, t: float) -> Forces:
    """All that acts at a time [s]."""
    joints = np.zeros(len(mechanism.coordinates))
    for motor in applied.motors:
        joints[mechanism.coordinates.index(motor.coordinate)] += motor.force(t)
    return Forces(joints=joints, gravity=applied.g, loads=applied.loads, springs=applied.springs)


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """How a mechanism answers to forces.

    Attributes:
        ydd: Accelerations of the independent coordinates [rad/s^2 or m/s^2]. Shape (n, k).
        M: Inertia matrix of the independent coordinates. Shape (n, k, k).
        condition: Condition number of the closed loops over the independent coordinates. Shape (n,).
    """

    ydd: Array
    M: Array
    condition: Array


@dataclass(frozen=True, slots=True, eq=False)
class DenseResponse:
    """The same from the whole system.

    Attributes:
        qdd: Accelerations of all joint coordinates [rad/s^2 or m/s^2]. Shape (n, n_q).
        reactions: Components in the order of `names` [N or N m], the smallest where constraints are redundant.
            Shape (n, m).
        names: ``a.fx`` and so on.
    """

    qdd: Array
    reactions: Array
    names: tuple[str, ...]


def joint_forces(lay: Layout, forces: Forces, n: int) -> Array:
    """Actuator forces and motor forces along all joint coordinates [N or N m]. Shape (n, n_q)."""
    mechanism = lay.mechanism
    total = np.zeros((n, len(mechanism.coordinates)))
    given = (
        ("actuator forces", forces.actuators, mechanism.actuated_columns),
        ("joint forces", forces.joints, list(range(total.shape[1]))),
    )
    for what, values, columns in given:
        if values is None:
            continue
        if np.shape(values) not in ((len(columns),), (n, len(columns))):
            raise DescriptionError(
                f"{what} of shape {np.shape(values)} for {len(columns)} of them at {n} poses",
                mechanism.name,
                f"give an array of shape ({len(columns)},) or ({n}, {len(columns)})",
            )
        total[:, columns] += values
    return total


def _without_ydd(lay: Layout, rate: Velocities, forces: Forces) -> tuple[Array, Array, BodyMotion, Array, Array]:
    """Forces along all joints, then joint accelerations, motion and required wrench where y has no acceleration."""
    check_springs(lay.mechanism, forces.springs)
    tau, loads = spring_forces(lay, rate, forces.springs)
    beta, A = accelerations(lay, rate, np.zeros((len(tau), rate.K.shape[2])))
    motion = body_motion(lay, rate.pose, rate.V, A)
    wrench = required_wrench(lay, rate.pose, motion, forces.gravity, [*forces.loads, *loads])
    return tau + joint_forces(lay, forces, len(tau)), beta, motion, *wrench


def _inertia(lay: Layout, linear_part: Array, angular_part: Array, J: Array) -> Array:
    M = np.einsum("b,nbjx,nbkx->njk", lay.mechanism.masses, linear_part, linear_part)
    return np.asarray(M + np.einsum("nbjx,nbxy,nbky->njk", angular_part, J, angular_part))


def inertia_matrix(lay: Layout, rate: Velocities) -> Array:
    """Inertia matrix of the independent coordinates, kinetic energy being ``yd M yd / 2``. Shape (n, k, k)."""
    motion = body_motion(lay, rate.pose, rate.V, np.zeros_like(rate.V))
    return _inertia(lay, *partial_motion(lay, rate, motion.com), motion.J)


def forward(lay: Layout, rate: Velocities, forces: Forces) -> Response:
    """Accelerations of the independent coordinates for given forces.

    Only motion is projected, never reactions: what redundant constraints leave open does not matter.

    Args:
        rate: Closed poses and their rates, from `screwgauge.reference.kinematics.rates`.
        forces: What acts on the mechanism.

    Raises:
        SingularPoseError: The independent coordinates do not determine the motion there, or some move no mass.
    """
    condition = linear.condition(rate.A)
    _check_poses(lay, rate.pose.q, condition)
    tau, _, motion, F, T = _without_ydd(lay, rate, forces)
    partial = partial_motion(lay, rate, motion.com)
    M = _inertia(lay, *partial, motion.J)
    _check_inertia(lay, M)
    Q = np.einsum("nij,ni->nj", rate.K, tau) - virtual_power(F, T, *partial)
    return Response(linear.solve(M, Q[..., None])[..., 0], M, condition)


def _check_poses(lay: Layout, q: Array, condition: Array) -> None:
    bad = np.flatnonzero(~(condition < linear.SINGULAR))
    if bad.size:
        y = q[bad[0], lay.mechanism.independent_columns]
        raise SingularPoseError(
            f"the independent coordinates do not determine the motion there (condition number {condition[bad[0]]:.2g})",
            f"{lay.mechanism.name} at {lay.mechanism.described(y, 9)}",
            "choose other coordinates or step over the pose",
        )


def _check_inertia(lay: Layout, M: Array) -> None:
    """Coordinates may be in rad and m, so that the matrix is judged with ones on its diagonal."""
    d = np.sqrt(np.einsum("njj->nj", M))
    for j, label in enumerate(lay.mechanism.independent):
        if not (d[:, j] > 0.0).all():
            what = f"the coordinate '{label}' moves no mass"
            raise SingularPoseError(what, lay.mechanism.name, "give its bodies inertia")
    if not (linear.condition(M / (d[:, :, None] * d[:, None, :])) < linear.SINGULAR).all():
        what = "some combination of the independent coordinates moves no mass"
        raise SingularPoseError(what, lay.mechanism.name, "give the bodies inertia")


def forward_dense(lay: Layout, rate: Velocities, forces: Forces) -> DenseResponse:
    """All joint accelerations and reactions from the balance of every body and the closure of every loop.

    ``[D -c; G 0] [qdd; R] = [c_a f - W; -bias]`` in the minimum-norm least-squares sense: the check of `forward`.
    """
    at, (n, n_q) = rate.pose, rate.pose.q.shape
    # any closed motion will do as the one from which the accelerations are counted
    tau, beta, motion, F, T = _without_ydd(lay, rate, forces)
    reactions = joint_reactions(lay, at)
    m = len(reactions.names)
    c = force_matrix(lay, at, motion.com, reactions)[..., :m]
    D = _inertia_of_joints(lay, rate, motion.com, motion.J)
    right = joint_wrenches(lay, rate.pose, motion.com, tau) - np.concatenate([F, T], axis=2).reshape(n, -1)
    G = constraint_matrix(lay, at)
    system = np.block([[D, -c], [G, np.zeros((n, G.shape[1], m))]])
    right = np.concatenate([right, np.zeros((n, G.shape[1]))], axis=1)
    # equal sizes of the columns, whose units differ; what stays far below is redundancy
    size = np.linalg.norm(system, axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    unknown = np.linalg.pinv(system / size, rcond=1e-12) @ right[..., None] / size.swapaxes(1, 2)
    return DenseResponse(beta + unknown[:, :n_q, 0], unknown[:, n_q:, 0], reactions.names)


def _inertia_of_joints(lay: Layout, rate: Velocities, com: Array, J: Array) -> Array:
    """Force and moment about its centre of mass that each body needs per joint acceleration.

    Returns:
        Shape (n, 6 n_body, n_q).
    """
    S = lay.path[None, 1:, :, None] * rate.pose.S[:, None]  # (n, n_body, n_q, 6)
    a = S[..., 3:] + cross(S[..., :3], com[:, :, None])
    force = lay.mechanism.masses[None, :, None, None] * a
    moment = np.einsum("nbxy,nbiy->nbix", J, S[..., :3])
    D = np.concatenate([force, moment], axis=3).swapaxes(2, 3)
    return np.asarray(D.reshape(len(D), -1, S.shape[2]))


def power(lay: Layout, rate: Velocities, forces: Forces) -> Array:
    """Power of all that stores no energy: actuators, motors, loads and dampers [W]. Shape (n,)."""
    dampers = [replace(spring, stiffness=0.0) for spring in forces.springs if spring.damping]
    tau, loads = spring_forces(lay, rate, dampers)
    total = np.sum((tau + joint_forces(lay, forces, len(tau))) * rate.w, axis=1)
    at, index = rate.pose, lay.mechanism.body_index
    for load in (*forces.loads, *loads):
        i = index[load.body]
        point = lay.mechanism.body(load.body).com if load.point is None else load.point
        V, r = rate.V[:, i], at.p[:, i] + at.R[:, i] @ point
        total += np.sum(load.force * screws.velocity_at(V, r) + load.torque * V[:, :3], axis=1)
    return np.asarray(total)


def energy(lay: Layout, rate: Velocities, forces: Forces) -> Array:
    """Kinetic energy and that stored in gravity and springs [J]. Shape (n,)."""
    yd = rate.w[:, lay.mechanism.independent_columns]
    kinetic = 0.5 * np.einsum("nj,njk,nk->n", yd, inertia_matrix(lay, rate), yd)
    height = centres_of_mass(lay, rate.pose) @ forces.gravity
    return np.asarray(kinetic - height @ lay.mechanism.masses + spring_energy(lay, rate.pose, forces.springs))
