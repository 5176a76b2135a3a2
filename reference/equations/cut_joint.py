"""A cut joint at a pose: rows of the closing system, coordinates and rates, and forces on its two bodies."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.equations.joint_types import (
    JointPose,
    Value,
    constraint_wrenches,
    cut_coordinates,
    dual_wrenches,
)
from screwgauge.reference.equations.kinematics import (
    joint_bias,
    joint_screws,
)
from screwgauge.reference.equations.ops import Ops, is_absent
from screwgauge.reference.equations.recursion import BodyAccelerations
from screwgauge.reference.equations.screws import (
    Array,
    cross,
    join,
    power,
    scale,
    times,
    transpose,
    unit_screws,
    velocity_at,
)
from screwgauge.reference.mechanism import Frame


class CutJoint:
    """A cut joint at a pose.

    Attributes:
        at: Frames of the joint.
        W: Constraint wrenches. Shape (..., m, 6).
        parent, child: Indices of the two bodies.
    """

    def __init__(self, at: JointPose, parent: int, child: int, fold: Any, ops: Ops) -> None:
        """Prepare the joint; for `fold` see `cut_coordinates`."""
        self.at, self.parent, self.child, self.fold, self.ops = at, parent, child, fold, ops
        self.W = constraint_wrenches(at)

    @cached_property
    def values(self) -> list[Value]:
        """Coordinates of the cut joint."""
        return cut_coordinates(self.at, self.fold, self.ops.sqrt)

    @cached_property
    def S(self) -> Array:
        """Unit screws of the cut joint; the first is fixed in the parent, the last in the child. Shape (..., f, 6)."""
        at, turns = self.at, np.array([turns for turns, _ in self.at.joint.freedoms])
        if len(turns) > 2 or at.joint.slides > 1:
            return joint_screws(at.joint, at.R_parent, at.p_parent, self.values)[0]
        axes = np.stack(np.broadcast_arrays(at.first, at.last)[: len(turns)], axis=-2)
        return unit_screws(turns, axes, np.broadcast_to(at.p_parent[..., None, :], axes.shape))

    @cached_property
    def D(self) -> Array:
        """Wrenches dual to the joint's screws, which yield its rates and transmit its forces. Shape (..., f, 6)."""
        return dual_wrenches(self.at, self.S)

    def rates(self, V: Array) -> Array:
        """Return the rates of the cut joint, given the twists of the bodies. Shape (..., b, 6) -> (..., f)."""
        return np.asarray(power(self.D, (V[..., self.child, :] - V[..., self.parent, :])[..., None, :]))

    def _angular(self, V: Array, moved: BodyAccelerations) -> Array:
        """Return the relative angular acceleration without ``w_parent x w_child``, eq. (44). Shape (..., 3)."""
        turning = cross(V[..., self.parent, :3], V[..., self.child, :3])
        return np.asarray(moved.angular(self.child) - moved.angular(self.parent) - turning)

    def _linear(self, V: Array, moved: BodyAccelerations) -> Array:
        """Return the relative linear acceleration of the joint's point on the child. Shape (..., 3)."""
        joint, (before, after) = self.at.joint, (V[..., body, :] for body in (self.parent, self.child))
        linear = moved.linear(self.child, joint.child_frame.p) - moved.linear(self.parent, joint.parent_frame.p)
        if self.at.slides:
            arm, w = self.at.p_child - self.at.p_parent, before[..., :3]
            sliding = cross(w + after[..., :3], velocity_at(after - before, self.at.p_child))
            linear = linear - cross(moved.angular(self.parent), arm) - cross(w, cross(w, arm)) - sliding
        return np.asarray(linear)

    def bias(self, V: Array, moved: BodyAccelerations) -> Array:
        """Return the velocity-dependent acceleration along each constraint wrench. Shape (..., m).

        Args:
            V: Twists of all bodies. Shape (..., b, 6).
            moved: Body accelerations at zero second derivatives of y.
        """
        kind = self.at.type
        bias = times(kind.forces(self.at), self._linear(V, moved))
        if kind.open is None:
            return bias
        bias = join(bias, times(kind.moments(self.at), self._angular(V, moved)))
        if kind.own is not None:
            bias[..., -1] = bias[..., -1] - kind.own(self.at, self.rates(V))
        return bias

    def accelerations(self, V: Array, moved: BodyAccelerations) -> Array:
        """Return the second derivatives of the joint's coordinates. Shape (..., f).

        Args:
            V: Twists of all bodies. Shape (..., b, 6).
            moved: Accelerations of all bodies.
        """
        w, angular = self.rates(V), self._angular(V, moved)
        first, *rest = [scale(w[..., i], self.S[..., i, :]) for i in range(w.shape[-1])]
        relative = join(angular, self._linear(V, moved) - cross(angular, self.at.p_child)) - joint_bias(first, rest)
        return np.asarray(power(self.D, relative[..., None, :]))

    def wrenches(self, x: Array, along: Array) -> list[tuple[int, Frame, Array, Array]]:
        """Return the forces on the joint's two bodies at the joint's point on each body, in world axes.

        Args:
            x: Forces along the constraint wrenches. Shape (..., m).
            along: Forces along the joint's coordinates. Shape (..., f).

        Returns:
            For each body: its index, the joint's frame on it, force and moment, shape (..., 3) each.
        """
        kind, joint = self.at.type, self.at.joint
        directions = kind.forces(self.at)
        n = directions.shape[-2]
        f = times(transpose(directions), x[..., :n])
        m = times(transpose(kind.moments(self.at)), x[..., n:])
        if not is_absent(along):
            driven = times(transpose(self.D), along)
            f, m = f + driven[..., :3], m + driven[..., 3:] - cross(self.at.p_child, driven[..., :3])
        across = m + cross(self.at.p_child - self.at.p_parent, f) if self.at.slides else m
        return [(self.child, joint.child_frame, f, m), (self.parent, joint.parent_frame, -f, -across)]
