"""Convert between joint coordinates and body poses, and between their rates and accelerations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.reference.equations.joint_types import SURE, JointPose, dual_wrenches, locate, read_coordinates
from screwgauge.reference.equations.kinematics import coordinates, joint_bias, joint_screws, joint_values, pose
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.equations.screws import powers
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import KINDS, Joint, Mechanism
from screwgauge.reference.rotations import (
    Array,
    Flags,
    cross,
    follow,
    nearest_turn,
    other_triple,
    quaternion_rotation,
    skew,
    times,
    within_half_turn,
)


def body_poses(mechanism: Mechanism, q: Array) -> tuple[Array, Array]:
    """Compute the poses of all bodies at joint coordinates that close the loops, such as ``mechanism.home``.

    Args:
        q: Joint coordinates [rad or m]. Shape (n, n_q).

    Returns:
        R and p, ground first. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
    """
    at = pose(layout(mechanism), q)
    return at.R, at.p


def absolute_poses(x: Array) -> tuple[Array, Array, Array]:
    """Compute body poses and their derivatives from absolute coordinates.

    Args:
        x: Position and Euler parameters, a unit quaternion (w, x, y, z), of each body. Shape (n, n_body, 7).

    Returns:
        R, p, and the twist of each body (angular velocity, then velocity of its origin) per unit rate of x.
        Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3), (n, n_body + 1, 6, 7 n_body).
    """
    n, bodies, _ = x.shape
    R, p = np.tile(np.eye(3), (n, bodies + 1, 1, 1)), np.zeros((n, bodies + 1, 3))
    R[:, 1:], p[:, 1:] = quaternion_rotation(x[..., 3:]), x[..., :3]
    turning = 2.0 * np.concatenate([-x[..., 4:, None], x[..., 3, None, None] * np.eye(3) + skew(x[..., 4:])], axis=-1)
    T = np.zeros((n, bodies + 1, 6, bodies, 7))
    for i in range(bodies):
        T[:, i + 1, :3, i, 3:], T[:, i + 1, 3:, i, :3] = turning[:, i], np.eye(3)
    return R, p, T.reshape(n, bodies + 1, 6, 7 * bodies)


def joint_frames(mechanism: Mechanism, joint: Joint, R: Array, p: Array) -> JointPose:
    """Return a joint's frames on its parent and child, in world coordinates, at given body poses."""
    sides = [(mechanism.body_index[body], frame) for body, frame in joint.sides]
    (before, after) = (locate(R[:, i], p[:, i], frame) for i, frame in sides)
    return JointPose(joint, *before, *after)


@dataclass(frozen=True, eq=False)
class JointReading:
    """Joint coordinates read from body poses, with their derivatives with respect to body motion.

    Attributes:
        R, p: Poses of the bodies. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        q: Joint coordinates in the order of the description [rad or m]. Shape (n, n_q).
    """

    mechanism: Mechanism
    R: Array
    p: Array
    q: Array

    @cached_property
    def _screws(self) -> list[tuple[slice, int, int, Array, Array]]:
        """For each joint: columns, parent, child, unit screws of its motions about O, and their dual wrenches."""
        found, index = list[tuple[slice, int, int, Array, Array]](), self.mechanism.body_index
        for joint, columns in _columns(self.mechanism):
            frames = joint_frames(self.mechanism, joint, self.R, self.p)
            values = joint_values(joint.freedoms, range(len(joint.freedoms)), coordinates(self.q[:, columns], NUMPY))
            S = joint_screws(joint, frames.R_parent, frames.p_parent, values)[0]
            found.append((columns, index[joint.parent], index[joint.child], S, dual_wrenches(frames, S)))
        return found

    @cached_property
    def matrix(self) -> Array:
        """Rates of the coordinates per unit twist (angular, then linear part) of each body. (n, n_q, n_body + 1, 6)."""
        out = np.zeros((*self.q.shape, self.p.shape[1], 6))
        for columns, parent, child, _, duals in self._screws:
            for body, sign in ((child, 1.0), (parent, -1.0)):
                force, moment = duals[..., :3], duals[..., 3:]
                out[:, columns, body, :3] = sign * (moment - cross(self.p[:, body, None], force))
                out[:, columns, body, 3:] = sign * force
        return out

    @cached_property
    def condition(self) -> Array:
        """Largest condition number of any joint's angle rates, at least 1, see `angle_condition`. Shape (n,)."""
        worst = np.ones(len(self.q))
        for joint, columns in _columns(self.mechanism):
            worst = np.maximum(worst, angle_condition(self.q[:, columns][:, np.array(KINDS[joint.kind])]))
        return worst

    def rates(self, V: Array) -> Array:
        """Return the coordinate rates for given body twists. Shape (n, n_body + 1, 6) -> (n, n_q)."""
        at_origin = _at_origin(V, cross(self.p, V[..., :3]))
        parts = [powers(W, (at_origin[:, j] - at_origin[:, i])[:, None])[..., 0] for _, i, j, _, W in self._screws]
        return np.concatenate(parts, axis=1)

    def accelerations(self, V: Array, A: Array) -> Array:
        """Return the second derivatives of the coordinates for given body twists and accelerations.

        Args:
            V, A: Twist and acceleration of each body: angular part, then linear part at its origin.
                Shape (n, n_body + 1, 6).

        Returns:
            Shape (n, n_q).
        """
        w, qd, parts = V[..., :3], self.rates(V), list[Array]()
        moving = _at_origin(V, cross(self.p, w))
        changing = _at_origin(A, cross(self.p, A[..., :3]) - cross(w, V[..., 3:]))
        for columns, parent, child, S, duals in self._screws:
            terms = (S * qd[:, columns, None]).swapaxes(0, 1)
            left = changing[:, child] - changing[:, parent] - joint_bias(moving[:, parent], list(terms))
            parts.append(powers(duals, left[:, None])[..., 0])
        return np.concatenate(parts, axis=1)


def _columns(mechanism: Mechanism) -> Iterator[tuple[Joint, slice]]:
    """Yield each joint with the columns of its coordinates."""
    first = 0
    for joint in mechanism.joints:
        yield joint, slice(first, first := first + len(joint.coordinates))


def _at_origin(V: Array, added: Array) -> Array:
    """Add `added` to the linear part of twists. Shapes (n, b, 6), (n, b, 3)."""
    return np.concatenate([V[..., :3], V[..., 3:] + added], axis=-1)


def read_joints(mechanism: Mechanism, R: Array, p: Array, near: Array | None = None) -> JointReading:
    """Read joint coordinates from body poses.

    Args:
        R, p: Orientations and origins, ground first. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        near: Reference values: of all equivalent angles, the angles nearest to these values are chosen. Where a value
            is NaN, the angle is within half a turn. Shape (n, n_q).
    """
    parts = list[Array]()
    for joint, columns in _columns(mechanism):
        q, turns = read_coordinates(joint_frames(mechanism, joint, R, p)), np.array(KINDS[joint.kind])
        if near is not None:
            q[:, turns] = _choose_nearest(q[:, turns], near[:, columns][:, turns])
        parts.append(q)
    return JointReading(mechanism, R, p, np.concatenate(parts, axis=1))


def _choose_nearest(angles: Array, near: Array) -> Array:
    """Choose the equivalent angles nearest to `near`, where `near` is not NaN. Shape (n, m)."""
    known, goal = ~np.isnan(near), np.nan_to_num(near)
    one = np.where(known, nearest_turn(angles, goal), angles)
    if angles.shape[1] < 3 or not known.any():
        return one
    other = np.where(known, nearest_turn(other_triple(angles), goal), within_half_turn(other_triple(angles)))
    away, farther = (np.abs(known * (triple - goal)).sum(axis=1) for triple in (other, one))
    return np.where((away < farther)[:, None], other, one)


def follow_joints(mechanism: Mechanism, R: Array, p: Array, near: Array, before: Array | None = None) -> JointReading:
    """Read joint coordinates along a motion, tracking unknown full turns from sample to sample.

    Args:
        R, p: Body poses at successive samples, see `read_joints`.
        near: As in `read_joints`; values of independent coordinates must not be NaN.
        before: Joint coordinates at the preceding sample, by default the home pose. Shape (n_q,).
    """
    read = read_joints(mechanism, R, p, near)
    known: Flags = np.asarray(np.isfinite(near).all(axis=0))
    q = read.q.copy()
    start = mechanism.home if before is None else before
    begin = np.where(known & (before is None), near[:1], start)[0] if len(near) else start
    for joint, columns in _columns(mechanism):
        at = np.arange(columns.start, columns.stop)[np.array(KINDS[joint.kind])]
        if not known[at].all():
            q[:, at] = counted_turns(begin[at], q[:, at], bool(known[at].any()))
    return JointReading(mechanism, R, p, q)


def com_accelerations(mechanism: Mechanism, R: Array, V: Array, A: Array) -> Array:
    """Compute the accelerations of the centres of mass, without gravity.

    Args:
        R: Orientations of the bodies, ground first. Shape (n, n_body + 1, 3, 3).
        V, A: Twist and acceleration of each body: angular part, then linear part at its origin.
            Shape (n, n_body + 1, 6).

    Returns:
        Shape (n, n_body, 3).
    """
    return shifted(V[:, 1:], A[:, 1:], times(R[:, 1:], mechanism.mass_centres))


def shifted(V: Array, A: Array, arms: Array) -> Array:
    """Return the accelerations of points at `arms` (n, m, 3) from origins with twist V and acceleration A (n, m, 6)."""
    w = V[..., :3]
    return np.asarray(A[..., 3:] + cross(A[..., :3], arms) + cross(w, cross(w, arms)))


def angle_condition(angles: Array) -> Array:
    """Return the condition number of a joint's angle rates, which is 1 for one or two axes. (n, m) -> (n,)."""
    if angles.shape[1] < 3:
        return np.ones(len(angles))
    return np.asarray(np.sqrt((1.0 + 2.0 / np.cos(angles[:, 1]) ** 2) / 3.0))


def counted_turns(begin: Array, angles: Array, given: bool) -> Array:
    """Unwrap angles along the samples of a given motion. Shape (n, m).

    Args:
        begin: As in `follow`.
        given: True if some angles are independent and thus select one of the equivalent triples of angles. Otherwise
            the triple that was read is kept, as if the poses had been computed in closed form, without a path.
    """
    if given:
        return follow(begin, angles, angle_condition(angles) < SURE)
    return np.asarray(np.unwrap(np.vstack([begin, angles]), axis=0)[1:])
