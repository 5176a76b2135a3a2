"""Velocities and accelerations of a closed mechanism (sections 3 and 4 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.equations.closure import Closed, CutJoint, Loops
from screwgauge.reference.equations.kinematics import Bracket, Coordinates, bias_screws, twists
from screwgauge.reference.equations.ops import Ops
from screwgauge.reference.equations.screws import Array, acceleration_at
from screwgauge.reference.mechanism import Mechanism


class Motion(Closed):
    """Velocities and accelerations at a closed pose; each is worked out when it is first asked for.

    Attributes:
        yd: Rates of the independent coordinates. Shape (..., k).
        near: Column of a cut joint's angle -> what it is to be near to, among all that mean the same; else it is within
            half a turn.
        bracket: In place of the Lie bracket, to see what a part of it does.
    """

    bracket: Bracket | None = None

    def __init__(
        self, loops: Loops, at: Coordinates, yd: Array, ydd: Array | None, folds: Sequence[Any], ops: Ops
    ) -> None:
        """`ydd`: second derivatives of the independent coordinates, shape (..., k); None where forces decide."""
        super().__init__(loops, at, folds, ops)
        self.yd, self._ydd, self.near = yd, ydd, dict[int, Any]()

    @property
    def mechanism(self) -> Mechanism:
        return self.loops.lay.mechanism

    @property
    def ydd(self) -> Array:
        """Second derivatives of the independent coordinates. Shape (..., k)."""
        if self._ydd is None:
            raise TypeError("no accelerations are given")
        return self._ydd

    @cached_property
    def w(self) -> Array:
        """Rates of the tree's coordinates, eq. (26). Shape (..., n_q)."""
        return self.velocities(self.yd)

    @cached_property
    def V(self) -> Array:
        """Twists of the bodies, eq. (15). Shape (..., b, 6)."""
        return twists(self.pose, self.w)

    @cached_property
    def partial(self) -> list[Array]:
        """Twists of the bodies per rate of each independent coordinate. Shape (..., b, 6) each."""
        return [twists(self.pose, self.K[..., j, :]) for j in range(self.K.shape[-2])]

    @cached_property
    def joint_map(self) -> Array:
        """Velocity map of all joints. Shape (..., n_q, k)."""
        rates = np.moveaxis(self.K, -2, 0)
        columns = [self._with_cuts(w, lambda cut, V=V: cut.rates(V)) for w, V in zip(rates, self.partial, strict=True)]
        return np.stack(columns, axis=-1)

    @cached_property
    def bias(self) -> Array:
        """Their acceleration screws without joint accelerations. Shape (..., b, 6)."""
        return bias_screws(self.pose, self.w, self.V, self.bracket)

    @cached_property
    def beta(self) -> Array:
        """Second derivatives of the tree's coordinates, eq. (48). Shape (..., n_q)."""
        return self.accelerations(self.ydd, self.w, self.V, self.bias)

    @cached_property
    def A(self) -> Array:
        """Acceleration screws of the bodies, eq. (44). Shape (..., b, 6)."""
        return self.bias + twists(self.pose, self.beta)

    @property
    def com(self) -> Array:
        """Centres of mass. Shape (..., b - 1, 3)."""
        return self.pose.com

    @cached_property
    def com_acceleration(self) -> Array:
        """Their accelerations, eq. (50). Shape (..., b - 1, 3)."""
        return acceleration_at(self.V[..., 1:, :], self.A[..., 1:, :], self.com)

    @cached_property
    def joint_position(self) -> Array:
        """Coordinates of all joints, see `near`. Shape (..., n_q)."""
        return self._with_cuts(self.q, self._cut_position)

    def _cut_position(self, cut: CutJoint) -> Array:
        found = list[Any]()
        for column, (x, cosine) in zip(self.loops.lay.columns[cut.at.joint.name], cut.values, strict=True):
            angle = self.near.get(column, 0.0)
            s, c = self.ops.sin(angle), self.ops.cos(angle)
            turns = cosine is not None
            found.append(angle + self.ops.atan2(x * c - cosine * s, cosine * c + x * s) if turns else x)
        return np.stack(np.broadcast_arrays(*found), axis=-1)

    @cached_property
    def joint_velocity(self) -> Array:
        """Rates of all joints. Shape (..., n_q)."""
        return self._with_cuts(self.w, lambda cut: cut.rates(self.V))

    @cached_property
    def joint_acceleration(self) -> Array:
        """Second derivatives of the coordinates of all joints. Shape (..., n_q)."""
        return self.accelerations_of_joints(self.beta, self.A)

    def accelerations_of_joints(self, beta: Array, A: Array) -> Array:
        """The same from those of the tree and the acceleration screws of the bodies. (..., n_q), (..., b, 6)."""
        return self._with_cuts(beta, lambda cut: cut.accelerations(self.V, A, self.bracket))

    @cached_property
    def screws(self) -> Array:
        """Unit screws of all joints. Shape (..., n_q, 6)."""
        S = self.pose.S + 0.0
        for cut in self.cuts:
            S[..., self.loops.lay.columns[cut.at.joint.name], :] = cut.S
        return S

    def joint_coordinate(self, coordinate: str) -> Any:
        """A joint coordinate by its name. Shape (...)."""
        c = self.mechanism.coordinates.index(coordinate)
        return (self.joint_position if c in self.loops.owner else self.q)[..., c]

    def joint_rate(self, coordinate: str) -> Any:
        """Its rate. Shape (...)."""
        c = self.mechanism.coordinates.index(coordinate)
        return (self.joint_velocity if c in self.loops.owner else self.w)[..., c]

    def _with_cuts(self, tree: Array, own: Any) -> Array:
        """Numbers of all coordinates from those of the tree, and of each cut joint from its own two bodies."""
        found = tree + 0.0
        for cut in self.cuts:
            found[..., self.loops.lay.columns[cut.at.joint.name]] = own(cut)
        return found
