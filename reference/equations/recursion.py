"""Recursion along the tree: body accelerations outwards, forces inwards (eqs. (36), (44), (49)-(55)).

Accelerations and wrenches refer to the origin of each body and are expressed in body axes, where centres of mass, axes
and tensors are constant; therefore, constant folding removes most operations of a program. Screws at O, as in eq. (44),
yield the same result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import chain
from typing import NamedTuple

import numpy as np

from screwgauge.reference.equations.joint_types import JointPose
from screwgauge.reference.equations.kinematics import Crossing, TreePose, walk, zeros
from screwgauge.reference.equations.screws import Array, cross, dot, join, scale, times, transpose
from screwgauge.reference.graph import Edge

#: All bodies except the ground.
MOVING = slice(1, None)


@dataclass(frozen=True, eq=False)
class Turning:
    """Angular velocity and angular acceleration of frames that rotate together. Shape (..., 3)."""

    w: Array
    b: Array

    @cached_property
    def E(self) -> Array:
        """``[b x] + [w x]^2``, eq. (49): ``E r`` is the relative acceleration of two points. Shape (..., 3, 3)."""
        E = np.empty((*self.b.shape, 3), dtype=self.b.dtype)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            (x, y, z), b = (self.w[..., n] for n in (i, j, k)), self.b[..., k]
            E[..., i, i], xy = -(y * y + z * z), x * y
            E[..., i, j], E[..., j, i] = xy - b, xy + b
        return E


class FrameMotion(NamedTuple):
    """Rotation of a frame and acceleration of its origin. Shape (..., 3)."""

    turning: Turning
    a: Array

    def at(self, r: Array) -> Array:
        """Return the acceleration of a point of the frame, eqs. (29), (49). Shape (..., 3)."""
        return np.asarray(self.a + times(self.turning.E, r))


def next_motion(crossing: Crossing, m: FrameMotion, w: Array, beta: Array) -> FrameMotion:
    """Return the motion of the next frame; the cross product is the Lie bracket of eq. (36) in eqs. (42), (43), (48).

    Args:
        w, beta: Rates and second derivatives of all coordinates. Shape (..., n_q).
    """
    arm = crossing.arm
    turning, a = m.turning, m.a if arm is None else m.at(arm)
    if crossing.R is not None:
        back = transpose(crossing.R)
        turning, a = Turning(times(back, turning.w), times(back, turning.b)), times(back, a)
    if crossing.axis is not None:
        rate, change = (scale(crossing.sign * x[..., crossing.column], crossing.axis) for x in (w, beta))
        bracket = cross(turning.w, rate)
        if crossing.travel is None:
            turning = Turning(turning.w + rate, turning.b + bracket + change)
        else:
            a = a + 2.0 * bracket + change
    return FrameMotion(turning, a)


def previous_wrench(crossing: Crossing, f: Array, m: Array, tau: Array) -> tuple[Array, Array]:
    """Transfer force and moment from the next frame to this frame; write the force along the coordinate into tau."""
    if crossing.axis is not None:
        tau[..., crossing.column] = crossing.sign * dot(crossing.axis, m if crossing.travel is None else f)
    if crossing.R is not None:
        f, m = times(crossing.R, f), times(crossing.R, m)
    arm = crossing.arm
    return f, m if arm is None else m + cross(arm, f)


def body_accelerations(pose: TreePose, w: Array, beta: Array) -> BodyAccelerations:
    """Compute body accelerations, eqs. (38)-(44), given rates and second derivatives of coordinates, (..., n_q)."""
    rest = np.zeros(3, dtype=w.dtype)
    each = [FrameMotion(Turning(rest, rest), rest)] * len(pose.lay.mechanism.body_index)
    for step, freedoms in zip(walk(pose.lay), pose.crossings, strict=True):
        motion = each[step.near]
        for crossing in chain(step.start if step.near else (), freedoms, step.end):  # the ground is at rest
            motion = next_motion(crossing, motion, w, beta)
        each[step.far] = motion
    return BodyAccelerations(pose, each)


def inward(pose: TreePose, wrenches: Array) -> tuple[Array, dict[str, tuple[Array, Array]]]:
    """Compute the forces along the tree coordinates that produce given wrenches on the bodies, eqs. (53)-(55).

    Args:
        wrenches: Wrenches about the origins of the bodies, in body axes. Shape (..., b, 6).

    Returns:
        The forces, shape (..., n_q), and, for each joint, the force and moment that the parent exerts on the
        child, in the child frame of the joint, shape (..., 3).
    """
    total = [(W[..., :3], W[..., 3:]) for W in np.moveaxis(wrenches, -2, 0)]
    tau, through = zeros(wrenches[..., 0], len(pose.lay.turns)), dict[str, tuple[Array, Array]]()
    for step, freedoms in reversed([*zip(walk(pose.lay), pose.crossings, strict=True)]):
        f, m = total[step.far]
        for crossing in step.end[::-1]:
            f, m = previous_wrench(crossing, f, m, tau)
        through[step.edge.joint.name] = f, m
        for crossing in freedoms[::-1]:
            f, m = previous_wrench(crossing, f, m, tau)
        if step.edge.reverse:
            through[step.edge.joint.name] = -f, -m
        for crossing in step.start[::-1] if step.near else ():  # no balance for the ground
            f, m = previous_wrench(crossing, f, m, tau)
        total[step.near] = total[step.near][0] + f, total[step.near][1] + m
    return tau, through


def wrench(pose: TreePose, body: int, place: Array, force: Array, moment: Array) -> Array:
    """Return the wrench about a body's origin in body axes, given force and moment in world axes. Shape (..., 6).

    Args:
        place: Point of application, in body axes. Shape (3,).
    """
    f = pose.to_body(force, body)
    return join(f, pose.to_body(moment, body) + cross(place, f))


def at_origin(pose: TreePose, wrenches: Array) -> Array:
    """Transform wrenches about body origins in body axes to wrenches about O in world axes. Shape (..., b, 6)."""
    f, m = (pose.to_world(part, slice(None)) for part in (wrenches[..., :3], wrenches[..., 3:]))
    return join(f, m + cross(pose.p, f))


def on_child(pose: TreePose, edge: Edge, freedoms: Sequence[Crossing]) -> JointPose:
    """Express a tree joint in the axes of its child frame, given the degrees of freedom crossed from its near body."""
    world = pose.joint(edge.joint)
    eye, zero = np.eye(3, dtype=pose.lay.path.dtype), np.zeros(3)
    R = reduce(np.matmul, (crossing.R for crossing in freedoms if crossing.R is not None), eye)
    return JointPose(world.joint, R if edge.reverse else transpose(R), zero, eye, zero, world.R_child)


@dataclass(frozen=True, eq=False)
class BodyAccelerations:
    """Motion of all bodies, each in its own axes.

    Attributes:
        each: Motion of each body; the ground comes first.
    """

    pose: TreePose
    each: Sequence[FrameMotion]

    @cached_property
    def bodies(self) -> FrameMotion:
        """Motion of all bodies except the ground. Shape (..., b - 1, 3)."""
        vectors = zip(*((one.turning.w, one.turning.b, one.a) for one in self.each[1:]), strict=True)
        w, b, a = (np.stack(np.broadcast_arrays(*each), axis=-2) for each in vectors)
        return FrameMotion(Turning(w, b), a)

    @cached_property
    def of_com(self) -> Array:
        """Accelerations of the centres of mass. Shape (..., b - 1, 3)."""
        return self.bodies.at(self.pose.lay.mechanism.mass_centres)

    def angular(self, body: int) -> Array:
        """Return the angular acceleration of a body in world axes. Shape (..., 3)."""
        return self.pose.to_world(self.each[body].turning.b, body)

    def linear(self, body: int, place: Array) -> Array:
        """Return the world acceleration of a body-fixed point. Shape (..., 3)."""
        return self.pose.to_world(self.each[body].at(place), body)

    def needs(self, g: Array) -> Array:
        """Return the wrenches about body origins that inertia and gravity require for this motion, eqs. (51)-(55).

        Euler's equations, eq. (52), use the second moments of mass P: ``J b + w x J w`` is the axial vector of
        ``E P - (E P)^T``.

        Returns:
            Wrenches in body axes. Shape (..., b, 6).
        """
        mechanism = self.pose.lay.mechanism
        f = mechanism.masses[:, None] * (self.of_com - self.pose.to_body(g, MOVING))
        J, com = mechanism.inertias, mechanism.mass_centres
        P = 0.5 * np.trace(J, axis1=1, axis2=2)[:, None, None] * np.eye(3, dtype=J.dtype) - J
        EP = self.bodies.turning.E @ P
        euler = np.stack([EP[..., j, i] - EP[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
        needs = zeros(f[..., 0], f.shape[-2] + 1, 6)
        needs[..., MOVING, :] = join(f, euler + cross(com, f))
        return needs
