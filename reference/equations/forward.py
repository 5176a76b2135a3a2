"""Forward dynamics: accelerations of the independent coordinates, or of all bodies at once, under given forces.

`Forward` projects the equations on the independent coordinates; `NewtonEuler` solves for all accelerations and
reactions together, eqs. (57) and (58). Inverse dynamics is in `dynamics`.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.equations.applied_forces import (
    load_power,
    motor_force,
    resisting_force,
    stretch,
    stretch_rate,
)
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.joint_types import constraint_wrenches, dual_wrenches, reaction_names
from screwgauge.reference.equations.kinematics import TreePose, zeros
from screwgauge.reference.equations.ops import System
from screwgauge.reference.equations.recursion import at_origin, body_accelerations
from screwgauge.reference.equations.screws import Array, cross, dot, join, times, transpose, velocity_at
from screwgauge.reference.mechanism import GROUND, Joint, by_role
from screwgauge.reference.resistance import LOSSES, resistances
from screwgauge.reference.rotations import across_direction


class Forward(Dynamics):
    """Motion under given forces at a closed pose; a `Dynamics` with the resulting accelerations."""

    @cached_property
    def partial_motion(self) -> tuple[Array, Array]:
        """Velocities of mass centres, and angular velocities in body axes, per unit rate of y. (..., k, b - 1, 3)."""
        each = [V[..., 1:, :] for V in self.partial]
        turn = transpose(self.pose.R[..., 1:, :, :])
        return (
            np.stack([velocity_at(V, self.com) for V in each], axis=-3),
            np.stack([times(turn, V[..., :3]) for V in each], axis=-3),
        )

    @cached_property
    def _partial_momenta(self) -> tuple[Array, Array]:
        """Linear and angular momenta of `partial_motion`. Shape (..., k, b - 1, 3)."""
        v, w = self.partial_motion
        return self.mechanism.masses[:, None] * v, times(self.mechanism.inertias, w)

    @cached_property
    def inertia_matrix(self) -> Array:
        """Inertia matrix M in the kinetic energy ``yd M yd / 2``, computed from partial motions. Shape (..., k, k)."""
        (v, w), (mv, Jw), mechanism = self.partial_motion, self._partial_momenta, self.mechanism
        k = v.shape[-3]
        M = zeros(self.K[..., 0], k, k)
        for i in range(k):
            for j in range(i + 1):
                pair = dot(mv[..., i, :, :], v[..., j, :, :]) + dot(Jw[..., i, :, :], w[..., j, :, :])
                M[..., i, j] = M[..., j, i] = pair.sum(-1)
        for c in np.flatnonzero(mechanism.rotors):
            row = self.joint_map[..., c, :]
            M = M + mechanism.rotors[c] * row[..., :, None] * row[..., None, :]
        return M

    @property
    def ydd(self) -> Array:
        """Second derivatives of the independent coordinates, given or computed from the forces. Shape (..., k)."""
        if self._ydd is None:
            return self.response
        return self.followed if self.idle else self._ydd

    @cached_property
    def neutral(self) -> Array:
        """Rates of y that move no actuator: one column per idle coordinate, whose rate is 1. Shape (..., k, m)."""
        unit, idle, driven = self.loops.sizes[self.loops.y_columns], [*self.idle], self.driven
        N, moved = zeros(self.B[..., 0], len(unit), len(idle)), -self.rates_of_actuators[..., idle]
        if self._oversteered:
            moved = transpose(self.rates_of_actuators[..., driven]) @ moved
        for j, i in enumerate(idle):
            N[..., driven, j] = self.steering.solve(moved[..., j]) * unit[driven] / unit[i]
            N[..., i, j] = 1.0
        return N

    @cached_property
    def steering(self) -> System:
        """Dimensionless actuator rates per unit rate of the driven coordinates, or their Gram matrix."""
        B = self.rates_of_actuators[..., self.driven]
        return self.ops.square(transpose(B) @ B if self._oversteered else B)

    @cached_property
    def rates_of_actuators(self) -> Array:
        """Dimensionless B. Shape (..., n_act, k)."""
        sizes = self.loops.sizes
        return self.B * sizes[self.loops.y_columns] / sizes[self.mechanism.actuated_columns, None]

    @property
    def _oversteered(self) -> bool:
        return len(self.mechanism.actuator_names) > len(self.driven)

    @cached_property
    def followed(self) -> Array:
        """Second derivatives: given values and, for idle coordinates, x from ``N^T (Q + M x) = 0``. Shape (..., k).

        Q are the forces along y at x = 0, and M the columns of the inertia matrix for idle coordinates; actuators
        cannot exert forces along N.
        """
        idle, ydd = [*self.idle], super().ydd + 0.0
        ydd[..., idle] = 0.0
        still = self.accelerations(ydd)
        moved = body_accelerations(self.pose, self.w, still)
        tau = self.demand(moved.needs(self.applied.g), self.acting(still, moved))
        Q = times(transpose(self.neutral), self.virtual_power(tau))
        ydd[..., idle] = self.idle_masses.solve(-Q / self.idle_sizes) / self.idle_sizes
        return ydd

    @cached_property
    def idle_masses(self) -> System:
        """``N^T M`` for the idle coordinates, each scaled by the square root of its inertia."""
        d, N, idle = self.idle_sizes, transpose(self.neutral), [*self.idle]
        total = sum(N @ part @ transpose(momenta[..., idle, :]) for part, momenta in self.momenta)
        return self.ops.square(total / (d[..., :, None] * d[..., None, :]))

    @cached_property
    def idle_reluctance(self) -> Any:
        """Norm of the inverse of `idle_masses`. Shape (...).

        It is 1 if idle and given coordinates are decoupled, and infinite where the matrix is singular.
        """
        return self.ops.sqrt(self.idle_masses.response(np.ones(len(self.idle))).sum(-1))

    @cached_property
    def idle_sizes(self) -> Array:
        """Square root of the inertia of each idle coordinate. Shape (..., m)."""
        own = sum((part * momenta).sum(-1)[..., [*self.idle]] for part, momenta in self.momenta)
        return np.stack([self.ops.sqrt(own[..., j]) for j in range(len(self.idle))], axis=-1)

    @cached_property
    def momenta(self) -> list[tuple[Array, Array]]:
        """Linear, angular and rotor velocities per unit rate of each y_k, and their momenta. Shape (..., k, n) each."""
        mechanism, pairs = self.mechanism, zip(self.partial_motion, self._partial_momenta, strict=True)
        flat = [(_flatten(velocity), _flatten(momentum)) for velocity, momentum in pairs]
        if (turning := np.flatnonzero(mechanism.rotors)).size:
            rows = transpose(self.joint_map[..., turning, :])
            flat.append((rows, mechanism.rotors[turning] * rows))
        return flat

    @cached_property
    def response(self) -> Array:
        """Second derivatives of the independent coordinates under all forces, ``M^-1 (Q - h)``. Shape (..., k)."""
        still = self.accelerations(0.0 * self.yd)
        moved = body_accelerations(self.pose, self.w, still)
        tau = self.demand(moved.needs(self.applied.g), self.acting(still, moved))
        return self._masses.solve(-self.virtual_power(tau) / self._sizes) / self._sizes

    @cached_property
    def _masses(self) -> System:
        """M scaled to a unit diagonal, because coordinates may be in rad and m."""
        d = self._sizes
        return self.ops.square(self.inertia_matrix / (d[..., :, None] * d[..., None, :]))

    @cached_property
    def _sizes(self) -> Array:
        """Square roots of the diagonal of M. Shape (..., k)."""
        return np.stack([self.ops.sqrt(self.inertia_matrix[..., j, j]) for j in range(self.K.shape[-2])], axis=-1)

    @cached_property
    def inertia_gain(self) -> Any:
        """Squared norm of the inverse of M scaled to unit diagonal. Shape (...).

        If k = 1, inertia of the total mass at the mechanism's length, divided by M.
        """
        if self.K.shape[-2] == 1:
            size = self.loops.sizes[self.loops.y_columns[0]]
            return self.mechanism.mass * (self.loops.length / size) ** 2 / self.inertia_matrix[..., 0, 0]
        return self._masses.response(np.ones(self.K.shape[-2])).sum(-1)

    @property
    def kinetic_energy(self) -> Any:
        """Kinetic energy, ``yd M yd / 2`` [J]. Shape (...)."""
        return 0.5 * dot(self.yd, times(self.inertia_matrix, self.yd))

    @property
    def potential_energy(self) -> Any:
        """Potential energy of gravity and springs [J]. Shape (...)."""
        total = -(self.mechanism.masses * dot(self.com, self.applied.g)).sum(-1)
        for spring in self.applied.springs:
            length = stretch(self, spring)
            total = total + 0.5 * spring.stiffness * length * length
        return total

    @property
    def energy(self) -> Any:
        """Kinetic energy plus the potential energy of gravity and springs [J]. Shape (...)."""
        return self.kinetic_energy + self.potential_energy

    @property
    def input_power(self) -> Any:
        """Power of motors, loads, dampers, friction and given forces, which do not store energy [W]. Shape (...)."""
        total = 0.0 * self.yd[..., 0]
        for load in self.applied.loads:
            if load.body != GROUND:
                total = total + load_power(self, load)
        for motor in self.applied.motors:
            total = total + motor_force(self, motor) * self.joint_rate(motor.coordinate)
        for spring in self.applied.springs:
            rate = stretch_rate(self, spring)
            total = total - spring.damping * rate * rate
        for one in resistances(self.mechanism.joints, LOSSES):
            total = total - resisting_force(self, one) * self.joint_rate(one.coordinate)
        return total if self.given_forces is None else total + dot(self.given_forces, self.joint_velocity)


def _flatten(x: Array) -> Array:
    """Flatten the vectors of all bodies. Shape (..., b, 3) -> (..., 3 b)."""
    return x.reshape(*x.shape[:-2], 3 * x.shape[-2])


def balances(com: Array, W: Array) -> Array:
    """Stack wrenches on bodies, with moments about centres of mass, eqs. (53)-(55). (..., b, 6) -> (..., 6 b - 6)."""
    W = W[..., 1:, :]
    moved = join(W[..., :3], W[..., 3:] - cross(com, W[..., :3]))
    return moved.reshape(*moved.shape[:-2], 6 * moved.shape[-2])


def on_bodies(at: TreePose, joint: Joint, W: Array) -> Array:
    """Expand wrenches of a joint on its child to wrenches on all bodies. Shape (..., m, 6) -> (..., m, b, 6)."""
    index = at.lay.mechanism.body_index
    total = np.zeros((*W.shape[:-1], len(index), 6), dtype=W.dtype)
    total[..., index[joint.child], :] += W
    total[..., index[joint.parent], :] -= W
    return total


def joint_wrenches(at: TreePose, S: Array, columns: Collection[int]) -> Array:
    """Return the wrenches that unit forces along joint coordinates exert on all bodies, eq. (8).

    The force along one coordinate has no power along the joint's remaining coordinates.

    Args:
        S: Unit screws of all joints. Shape (n, n_q, 6).
        columns: Coordinates whose joints are evaluated.

    Returns:
        Wrenches; zero for coordinates of all other joints. Shape (n, n_q, b, 6).
    """
    total = np.zeros((*S.shape[:-1], len(at.lay.mechanism.body_index), 6), dtype=S.dtype)
    for joint in at.lay.mechanism.joints:
        of_joint = at.lay.columns[joint.name]
        if {*of_joint} & {*columns}:
            total[..., of_joint, :, :] = on_bodies(at, joint, dual_wrenches(at.joint(joint), S[..., of_joint, :]))
    return total


def exerted_wrenches(at: Dynamics) -> Array:
    """Return the wrenches of all applied forces on the bodies, including forces along joints. Shape (n, b, 6)."""
    driven = np.flatnonzero(at.applied_along.any(axis=0)).tolist()
    along = np.einsum("ni,nibx->nbx", at.applied_along, joint_wrenches(at.pose, at.screws, driven))
    return np.asarray(at_origin(at.pose, at.applied_wrenches) + along)


def force_matrix(at: TreePose, q: Array, S: Array) -> Array:
    """Build the matrix c of eq. (57): wrench of each unknown on each body, see `balances`.

    Unknowns are the reaction components, in the order of `reaction_names`, followed by the actuator forces. A coupling
    ``q_i = sum_k p_k(q_k)`` acts with force 1 along q_i and -p_k' along q_k, so that its power is zero.

    Args:
        q, S: Coordinates and unit screws of all joints. Shapes (n, n_q), (n, n_q, 6).

    Returns:
        Shape (n, 6 (b - 1), n_reaction + n_actuator).
    """
    mechanism = at.lay.mechanism
    slopes = mechanism.coupling_rows.matrix(q)
    along = joint_wrenches(at, S, {*mechanism.actuated_columns, *np.flatnonzero(slopes.any(axis=(0, 1))).tolist()})
    parts = [on_bodies(at, joint, constraint_wrenches(at.joint(joint))) for joint in by_role(mechanism.joints)]
    parts += [np.einsum("nmi,nibx->nmbx", slopes, along), along[:, mechanism.actuated_columns]]
    return transpose(balances(at.com[:, None], np.concatenate(parts, axis=1)))


def preload_space(B: Array) -> Array:
    """Return the internal actuator forces: the null space of ``B^T``. Shape (n, n_actuator, n_actuator - k)."""
    U, _, _ = np.linalg.svd(B, full_matrices=True)
    return np.asarray(U[..., B.shape[-1] :])


class NewtonEuler:
    """System of eq. (57) at n samples, with additional rows that determine redundant actuators.

    Moments are divided by the mechanism's length in equations and unknowns, so that units of length do not matter.

    Attributes:
        c: System matrix, see `force_matrix`.
        names, units: Names and units of the reaction components, which are the first unknowns.
    """

    def __init__(self, at: Dynamics) -> None:
        self.at, self.c = at, force_matrix(at.pose, at.q, at.screws)
        (self.names, self.units), length = reaction_names(at.mechanism.joints, at.mechanism.couplings), at.loops.length
        self.rows = np.resize([1.0, 1.0, 1.0, length, length, length], self.c.shape[1])
        self.size = np.where(np.array([*self.units, *at.mechanism.actuator_units]) == "N m", length, 1.0)

    @cached_property
    def rule(self) -> Array:
        """Rows that set the preload, or the force across the line of eq. (56), to zero. Shape (n, l, m)."""
        at, (n, _, m) = self.at, self.c.shape
        if at.axial and at.mechanism.axial is not None:
            name, direction = at.mechanism.axial
            rows = np.zeros((n, 2, m))
            body = at.mechanism.body_index[at.mechanism.joint(name).child]
            rows[:, :, [self.names.index(f"{name}.f{axis}") for axis in "xyz"]] = across_direction(
                at.pose.R[:, body], direction
            )
            return rows
        preload = preload_space(at.B)
        rows = np.zeros((n, preload.shape[2], m))
        rows[:, :, len(self.names) :] = transpose(preload)
        return rows

    def scale_system(self, c: Array) -> Array:
        """Scale the system with matrix c, which may be in higher precision. Shape (n, 6 (b - 1) + l, m)."""
        return np.concatenate([c / self.rows[:, None], self.rule.astype(c.dtype)], axis=1) * self.size

    @cached_property
    def _inverted(self) -> tuple[Array, Array]:
        return linear.invert(self.scale_system(self.c))

    @property
    def condition(self) -> Array:
        """Condition number of the scaled system. Shape (n,)."""
        return self._inverted[1]

    def solve(self, need: Array, wide: Array | None = None) -> Array:
        """Solve eq. (58) for all constraint and actuator forces, given the required wrenches, see `balances`.

        Near a singular pose, large unknowns cancel in the equations, but rounding errors of c do not. One step of
        iterative refinement, with the residual computed from a more precise c, recovers the lost digits.

        Args:
            need: Required wrenches for p cases. Shape (n, 6 (b - 1), p).
            wide: Matrix c in higher precision.

        Returns:
            Forces in the order of c's columns. Shape (n, m, p).
        """
        inverse, below = self._inverted[0], np.zeros((len(need), self.rule.shape[1], need.shape[2]))
        right = np.concatenate([need / self.rows[:, None], below], axis=1)
        unknown = inverse @ right
        if wide is not None:
            unknown = unknown + inverse @ (right - self.scale_system(wide) @ unknown).astype(self.c.dtype)
        return np.asarray(unknown * self.size[:, None])

    @property
    def need(self) -> Array:
        """Wrenches that joints and actuators must exert on the bodies, see `balances`. Shape (n, 6 (b - 1))."""
        return balances(self.at.com, at_origin(self.at.pose, self.at.required) - exerted_wrenches(self.at))

    def response(self) -> tuple[Array, Array]:
        """Solve for all joint accelerations and reactions from the balance of every body and the closure of every loop.

        The system ``[D -c; G 0] [qdd; R] = [W; 0]`` is solved in the minimum-norm least-squares sense. Actuators exert
        only the given forces. Any closed motion may serve as the reference for accelerations.

        Returns:
            Shapes (n, n_q), (n, n_reaction).
        """
        at, loops, m = self.at, self.at.loops, len(self.names)
        c, G = self.c[..., :m], at.system.A[:, : loops.given.start]
        still = at.accelerations(0.0 * at.yd)
        need = self._needs(at.w, still, at.applied.g) - exerted_wrenches(at)
        unit = np.eye(at.q.shape[-1])[loops.columns, None]
        D = balances(at.com, self._needs(0.0 * unit, unit, np.zeros(3))).transpose(1, 2, 0) * loops.size
        system = np.block([[D, -c], [G, np.zeros((*G.shape[:2], m))]])
        right = np.concatenate([-balances(at.com, need), np.zeros(G.shape[:2])], axis=1)
        # scale the columns, whose units differ, to equal size; much smaller singular values indicate redundancy
        size = np.linalg.norm(system, axis=1, keepdims=True)
        size = np.where(size > 0.0, size, 1.0)
        unknown = (np.linalg.pinv(system / size, rcond=1e-12) @ right[..., None] / transpose(size))[..., 0]
        beta, k = still.copy(), len(loops.columns)
        beta[:, loops.columns] += unknown[:, :k] * loops.size
        return at.accelerations_of_joints(beta, body_accelerations(at.pose, at.w, beta)), unknown[:, k:]

    def _needs(self, w: Array, beta: Array, g: Array) -> Array:
        """Return the wrenches about O that tree rates and accelerations require. (..., n_q) -> (..., b, 6)."""
        pose = self.at.pose
        return at_origin(pose, body_accelerations(pose, w, beta).needs(g))
