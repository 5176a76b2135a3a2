"""Velocities and accelerations of a closed mechanism (sections 3 and 4 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.equations.closure import Closed, CutJoint, Loops
from screwgauge.reference.equations.kinematics import Bracket, Coordinates, bias_screws, twists
from screwgauge.reference.equations.ops import Ops
from screwgauge.reference.equations.screws import Array, acceleration_at, times
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

    def __init__(self, loops: Loops, at: Coordinates, yd: Array, ydd: Array, folds: Sequence[Any], ops: Ops) -> None:
        """`ydd`: second derivatives of the independent coordinates. Shape (..., k)."""
        super().__init__(loops, at, folds, ops)
        self.yd, self._ydd, self.near = yd, ydd, dict[int, Any]()

    @property
    def mechanism(self) -> Mechanism:
        return self.loops.lay.mechanism

    @property
    def ydd(self) -> Array:
        """Second derivatives of the independent coordinates. Shape (..., k)."""
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
    def joint_map(self) -> Array:
        """Velocity map of all joints. Shape (..., n_q, k)."""
        found = []
        for j in range(self.K.shape[-2]):
            V = twists(self.pose, self.K[..., j, :])
            found.append(self._with_cuts(self.K[..., j, :], lambda cut, V=V: np.moveaxis(cut.rates(V), -1, 0)))
        return np.stack(found, axis=-1)

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

    @cached_property
    def com(self) -> Array:
        """Centres of mass. Shape (..., b - 1, 3)."""
        own = np.array([body.com for body in self.mechanism.bodies])
        return self.pose.p[..., 1:, :] + times(self.pose.R[..., 1:, :, :], own)

    @cached_property
    def com_acceleration(self) -> Array:
        """Their accelerations, eq. (50). Shape (..., b - 1, 3)."""
        return acceleration_at(self.V[..., 1:, :], self.A[..., 1:, :], self.com)

    @cached_property
    def joint_position(self) -> Array:
        """Coordinates of all joints, see `near`. Shape (..., n_q)."""
        return self._with_cuts(self.q, self._cut_position)

    def _cut_position(self, cut: CutJoint) -> list[Any]:
        found, atan2 = list[Any](), self.ops.atan2
        for column, (x, cosine) in zip(self.loops.lay.columns[cut.at.joint.name], cut.values, strict=True):
            if cosine is None:
                found.append(x)
            elif column in self.near:
                angle = self.near[column]
                s, c = self.ops.sin(angle), self.ops.cos(angle)
                found.append(angle + atan2(x * c - cosine * s, cosine * c + x * s))
            else:
                found.append(atan2(x, cosine))
        return found

    @cached_property
    def joint_velocity(self) -> Array:
        """Rates of all joints. Shape (..., n_q)."""
        return self._with_cuts(self.w, lambda cut: np.moveaxis(cut.rates(self.V), -1, 0))

    @cached_property
    def joint_acceleration(self) -> Array:
        """Second derivatives of the coordinates of all joints. Shape (..., n_q)."""
        return self._with_cuts(
            self.beta, lambda cut: np.moveaxis(cut.accelerations(self.V, self.A, self.bracket), -1, 0)
        )

    def _with_cuts(self, tree: Array, own: Any) -> Array:
        """Numbers of all coordinates from those of the tree, and of each cut joint from its own two bodies."""
        found = tree + 0.0
        for cut in self.cuts:
            for column, x in zip(self.loops.lay.columns[cut.at.joint.name], own(cut), strict=True):
                found[..., column] = x
        return found
