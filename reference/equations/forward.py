"""Forward dynamics: accelerations for given forces, on the independent coordinates, ``M ydd = Q - h``."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.equations.applied_forces import load_wrench, motor_force, stretch, stretch_rate
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.kinematics import twists, zeros
from screwgauge.reference.equations.ops import System
from screwgauge.reference.equations.screws import Array, dot, power, times, transpose, velocity_at
from screwgauge.reference.mechanism import GROUND


class Forward(Dynamics):
    """Motion that follows from the forces at a closed pose; `Dynamics` of the accelerations found."""

    @cached_property
    def partial_motion(self) -> tuple[Array, Array]:
        """Velocities of centres of mass, and angular ones in body axes, per rate of each y. (..., k, b - 1, 3)."""
        each = [V[..., 1:, :] for V in self.partial]
        turn = transpose(self.pose.R[..., 1:, :, :])
        return (
            np.stack([velocity_at(V, self.com) for V in each], axis=-3),
            np.stack([times(turn, V[..., :3]) for V in each], axis=-3),
        )

    @cached_property
    def inertia_matrix(self) -> Array:
        """M of the kinetic energy ``yd M yd / 2``: partial motions against each other. Shape (..., k, k)."""
        (v, w), mechanism = self.partial_motion, self.mechanism
        mv = mechanism.masses[:, None] * v
        Jw = times(np.array([body.inertia for body in mechanism.bodies]), w)
        k = v.shape[-3]
        M = zeros(self.K[..., 0], k, k)
        for i in range(k):
            for j in range(i + 1):
                pair = dot(mv[..., i, :, :], v[..., j, :, :]) + dot(Jw[..., i, :, :], w[..., j, :, :])
                M[..., i, j] = M[..., j, i] = pair.sum(-1)
        return M

    @property
    def ydd(self) -> Array:
        """Second derivatives of the independent coordinates: given, or the answer to the forces. Shape (..., k)."""
        return self.response if self._ydd is None else self._ydd

    @cached_property
    def response(self) -> Array:
        """Second derivatives of the independent coordinates under all forces, ``M^-1 (Q - h)``. Shape (..., k)."""
        still = self.accelerations(0.0 * self.yd, self.w, self.V, self.bias)
        tau = self.demand(self.inertia(self.V, self.bias + twists(self.pose, still)))
        return self._masses.solve(-self.virtual_power(tau) / self._sizes) / self._sizes

    @cached_property
    def _masses(self) -> System:
        """M with ones on its diagonal, as coordinates may be in rad and m."""
        d = self._sizes
        return self.ops.square(self.inertia_matrix / (d[..., :, None] * d[..., None, :]))

    @cached_property
    def _sizes(self) -> Array:
        """Roots of the diagonal of M. Shape (..., k)."""
        return np.stack([self.ops.sqrt(self.inertia_matrix[..., j, j]) for j in range(self.K.shape[-2])], axis=-1)

    @cached_property
    def inertia_gain(self) -> Any:
        """By how much M amplifies, ones on its diagonal; of one coordinate over all mass at the full length. (...)."""
        if self.K.shape[-2] == 1:
            size = self.loops.sizes[self.loops.y_columns[0]]
            return self.mechanism.mass * (self.loops.length / size) ** 2 / self.inertia_matrix[..., 0, 0]
        return self._masses.response(np.ones(self.K.shape[-2])).sum(-1)

    @property
    def kinetic_energy(self) -> Any:
        """Half the momenta of the bodies times their velocities [J]. Shape (...)."""
        V, mechanism = self.V[..., 1:, :], self.mechanism
        v, w = velocity_at(V, self.com), times(transpose(self.pose.R[..., 1:, :, :]), V[..., :3])
        momenta = mechanism.masses * dot(v, v) + dot(w, times(np.array([body.inertia for body in mechanism.bodies]), w))
        return 0.5 * momenta.sum(-1)

    @property
    def potential_energy(self) -> Any:
        """What is stored in gravity and springs [J]. Shape (...)."""
        total = -(self.mechanism.masses * dot(self.com, self.applied.g)).sum(-1)
        for spring in self.applied.springs:
            length = stretch(self, spring)
            total = total + 0.5 * spring.stiffness * length * length
        return total

    @property
    def energy(self) -> Any:
        """Kinetic energy and that stored in gravity and springs [J]. Shape (...)."""
        return self.kinetic_energy + self.potential_energy

    @property
    def input_power(self) -> Any:
        """Power of motors, given forces, loads and dampers, which store no energy [W]. Shape (...)."""
        mechanism, total = self.mechanism, 0.0 * self.yd[..., 0]
        index = mechanism.body_index
        for load in self.applied.loads:
            if load.body != GROUND:
                total = total + power(load_wrench(self, load), self.V[..., index[load.body], :])
        for motor in self.applied.motors:
            total = total + motor_force(self, motor) * self.joint_rate(motor.coordinate)
        for spring in self.applied.springs:
            rate = stretch_rate(self, spring)
            total = total - spring.damping * rate * rate
        return total if self.given_forces is None else total + dot(self.given_forces, self.joint_velocity)
