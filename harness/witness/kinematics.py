"""Kinematics of a tree: poses, velocities and accelerations of links and fixed frames, vectorised over samples.

For moving points, ``w x (w x r)`` is the centripetal acceleration and ``2 w x u`` the Coriolis acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from screwgauge.reference.rotations import Array, cross, product, quaternion_rotation, skew, times
from screwgauge.witness.tree import FREEDOMS, FixedFrame, Rows, SpanningTree, TreeStates

#: Number of links times samples processed at once.
AT_ONCE = 16384

Tree = TypeVar("Tree", bound=SpanningTree)
AnyTree = TypeVar("AnyTree", bound=SpanningTree, covariant=True)


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Motion of m frames at n samples, in world axes; samples are contiguous in memory.

    Attributes:
        R, p: Orientation (n, m, 3, 3) and origin [m] (n, m, 3).
        w, v: Angular velocity and velocity of the origin. Shape (n, m, 3).
        b, a: Angular acceleration and acceleration of the origin. Shape (n, m, 3).
    """

    R: Array
    p: Array
    w: Array
    v: Array
    b: Array
    a: Array

    def shift(self, r: Array) -> Moving:
        """Return the motion of the same bodies at points displaced by `r` (world axes, shape (n, m, 3))."""
        v = cross(self.w, r)
        return Moving(self.R, self.p + r, self.w, self.v + v, self.b, self.a + cross(self.b, r) + cross(self.w, v))

    def part(self, some: slice) -> Moving:
        """Select frames."""
        return Moving(*(getattr(self, name)[:, some] for name in "Rpwvba"))

    def poses(self, at: FixedFrame) -> tuple[Array, Array]:
        """Return orientation and origin of fixed frames. Shapes (n, k, 3, 3), (n, k, 3)."""
        R = pick_links(self.R, at.link)
        return turn_frames(R, at.R), pick_links(self.p, at.link) + times(R, at.p)

    def frames(self, at: FixedFrame) -> Moving:
        """Return the motion of fixed frames."""
        some = Moving(*(pick_links(getattr(self, name), at.link) for name in "Rpwvba"))
        there = some.shift(times(some.R, at.p))
        return replace(there, R=turn_frames(there.R, at.R))

    @property
    def velocity(self) -> Array:
        """Angular velocity, then velocity of the origin. Shape (n, m, 6)."""
        return np.concatenate([self.w, self.v], axis=2)

    @property
    def acceleration(self) -> Array:
        """Angular acceleration, then acceleration of the origin. Shape (n, m, 6)."""
        return np.concatenate([self.b, self.a], axis=2)


@dataclass(frozen=True, eq=False)
class TreeMotion(Generic[AnyTree]):
    """Motion of a tree at samples.

    Attributes:
        states: Coordinates, velocities and their derivatives at the samples.
        links: Motion of ground and the links.
        axes: Axis of each velocity, in world axes. Shape (n, n_freedom, 3).
    """

    tree: AnyTree
    states: TreeStates
    links: Moving
    axes: Array

    @cached_property
    def bodies(self) -> Moving:
        """Motion of the body frames."""
        return self.links.frames(self.tree.bodies)

    @cached_property
    def com(self) -> Moving:
        """Motion of the bodies at their centres of mass."""
        at = self.tree.bodies
        return self.links.frames(at._replace(p=at.p + (at.R @ self.tree.com[..., None])[..., 0]))

    @cached_property
    def closures(self) -> Moving:
        """Motion of the first frames of all closures, then of the second frames."""
        return self.links.frames(self.tree.ends)

    def jacobian(self, frames: FixedFrame, points: Array) -> Array:
        """Return each frame's angular velocity, then the velocity of a point on it, per unit velocity.

        Args:
            points: World points [m]. Shape (n, m, 3).

        Returns:
            Shape (n, m, 6, n_freedom).
        """
        number, _, turns = self.tree.velocity
        moved = self.tree.carries[frames.link][:, None]
        e = np.broadcast_to(self.axes[:, None], (*points.shape[:2], *self.axes.shape[1:]))
        lever = cross(e, points[:, :, None] - self.links.p[:, None, number])
        J = np.empty((*points.shape[:2], 6, len(number)))
        J[:, :, :3] = np.where(turns, np.swapaxes(e, 2, 3), 0.0) * moved
        J[:, :, 3:] = np.swapaxes(np.where(turns[:, None], lever, e), 2, 3) * moved
        return J


def move(tree: Tree, states: TreeStates) -> TreeMotion[Tree]:
    """Compute the motion of all links, in blocks of samples that stay in the cache."""
    n, at_once = len(states.q), AT_ONCE // (len(tree.links) + 1) + 1
    if n <= at_once:
        return _move(tree, states)
    parts = [_move(tree, states.at(slice(i, i + at_once))) for i in range(0, n, at_once)]
    fields = [_join([getattr(part.links, name) for part in parts]) for name in "Rpwvba"]
    return TreeMotion(tree, states, Moving(*fields), _join([part.axes for part in parts]))


def _join(parts: Sequence[Array]) -> Array:
    return _first(np.concatenate([_last(part) for part in parts], axis=-1))


def _move(tree: Tree, states: TreeStates) -> TreeMotion[Tree]:
    R, p, r = _poses(tree, states.q)
    number, axes, _ = tree.velocity
    e = times(pick_links(R, number), axes)
    (spin, slide), (spin_rate, slide_rate) = (_relative(tree, R, e, rates) for rates in (states.qd, states.qdd))
    before = tree.starts.link
    w = _accumulate(tree, spin)
    near = pick_links(w, before)
    b = _accumulate(tree, spin_rate + cross(near, spin))
    toward = cross(near, r)
    v = _accumulate(tree, toward + slide)
    a = cross(pick_links(b, before), r) + cross(near, toward + 2.0 * slide) + slide_rate
    a += cross(spin, slide)  # velocities of a free joint are along axes that the joint itself rotates
    return TreeMotion(tree, states, Moving(R, p, w, v, b, _accumulate(tree, a)), e)


def unit_twists(motion: TreeMotion[SpanningTree]) -> Array:
    """Return the twist about the world origin due to each unit velocity, angular part first. (n, f, 6)."""
    number, _, turns = motion.tree.velocity
    lever = cross(motion.links.p[:, number], motion.axes)
    spins = turns[:, None]
    return np.concatenate([np.where(spins, motion.axes, 0.0), np.where(spins, lever, motion.axes)], axis=2)


def velocity_products(motion: TreeMotion[SpanningTree]) -> dict[str, Array]:
    """Return the velocity products of eq. (36) that each joint adds to the accelerations of all links that it moves.

    The first factor is a part of the twist before the joint, the second a part of the twist that the joint adds. Both
    twists are about the world origin, and all joints must be hinges or slides.

    Returns:
        Term -> angular acceleration, then acceleration of the point at the world origin. Shape (n, n_freedom, 6).
    """
    links, before = motion.links, motion.tree.starts.link[motion.tree.velocity[0] - 1]
    w1, v1 = links.w[:, before], (links.v - cross(links.w, links.p))[:, before]
    w2, v2 = np.split(unit_twists(motion) * motion.states.qd[..., None], 2, axis=2)
    none = np.zeros_like(w2)
    return {
        "w1 x w2": np.concatenate([cross(w1, w2), none], axis=2),
        "w1 x v2": np.concatenate([none, cross(w1, v2)], axis=2),
        "w2 x v1": np.concatenate([none, -cross(w2, v1)], axis=2),
    }


def _last(x: Array) -> Array:
    """Move samples to the last axis, where they are contiguous."""
    return x.transpose(*range(1, x.ndim), 0)


def _first(x: Array) -> Array:
    """Move samples to the first axis."""
    return x.transpose(-1, *range(x.ndim - 1))


def turn_frames(R: Array, by: Array) -> Array:
    """Multiply orientations by fixed rotations; skip this if all are the identity. Shapes (n, m, 3, 3), (m, 3, 3)."""
    return R if (by == np.eye(3)).all() else product(R, by)


def pick_links(x: Array, which: Rows) -> Array:
    """Return ``x[:, which]``, but faster if samples are contiguous."""
    return _first(_last(x)[which])


def _poses(tree: SpanningTree, q: Array) -> tuple[Array, Array, Array]:
    """Compute poses of ground and all links, and vectors from the parents' origins.

    Shapes (n, n_link + 1, 3, 3), (n, n_link + 1, 3), (n, n_link, 3).
    """
    n, k = len(q), len(tree.links)
    turn, way = _joints(tree, q)
    R, p, r = np.empty((k + 1, 3, 3, n)), np.empty((k + 1, 3, n)), np.empty((k, 3, n))
    R[0], p[0] = np.eye(3)[..., None], 0.0
    whole, start = _first(R), tree.starts
    for level, before in tree.levels:
        own, near = level - 1, pick_links(whole, before)
        placed = turn_frames(near, start.R[own])
        r[own] = _last(times(near, start.p[own]) + times(placed, pick_links(way, own)))
        R[level], p[level] = _last(product(placed, pick_links(turn, own))), p[before] + r[own]
    return whole, _first(p), _first(r)


def _joints(tree: SpanningTree, q: Array) -> tuple[Array, Array]:
    """Return rotation and displacement of each link due to its joint. Shapes (n, n_link, 3, 3), (n, n_link, 3)."""
    n, k = len(q), len(tree.links)
    R, p = np.empty((k, 3, 3, n)), np.empty((k, 3, n))
    own, columns, _, zero, axes, turns = tree.single
    gone, K = q.T[columns] - zero[:, None], skew(axes)
    angle = (gone * turns)[:, None, None]
    # 1 - cos as 2 sin^2 of the half angle avoids cancellation at small angles
    turn = np.sin(angle) * K[..., None]
    turn += 2.0 * np.sin(0.5 * angle) ** 2 * (K @ K)[..., None]
    turn += np.eye(3)[..., None]
    R[own], p[own] = turn, (gone * (1.0 - turns))[:, None] * axes[..., None]
    for i, link in enumerate(tree.links):
        if FREEDOMS[link.kind] > 1:
            end = link.coordinate + 7 if link.kind == "free" else link.coordinate + 4
            R[i] = _last(quaternion_rotation(q[:, end - 4 : end]))
            p[i] = q.T[end - 7 : end - 4] if link.kind == "free" else 0.0
    return _first(R), _first(p)


def _relative(tree: SpanningTree, R: Array, e: Array, rates: Array) -> tuple[Array, Array]:
    """Return the parts of the links' angular and linear velocities due to joint rates. Shape (n, n_link, 3) each."""
    own, _, velocities, _, _, turns = tree.single
    single, hinges = _last(e)[velocities] * rates.T[velocities, None], turns[..., None] > 0.0
    spin, slide = np.zeros((2, len(tree.links), 3, len(e)))
    spin[own], slide[own] = np.where(hinges, single, 0.0), np.where(hinges, 0.0, single)
    for i, link in enumerate(tree.links):
        if FREEDOMS[link.kind] > 1:
            turn, way = (slice(link.velocity + k, link.velocity + k + 3) for k in (0, 3))
            spin[i] = (R[:, i + 1] @ rates[:, turn, None])[..., 0].T
            if link.kind == "free":
                slide[i] = (R[:, i + 1] @ rates[:, way, None])[..., 0].T
    return _first(spin), _first(slide)


def _accumulate(tree: SpanningTree, gained: Array) -> Array:
    """Accumulate each link's increment from the ground outward. Shape (n, n_link, 3) -> (n, n_link + 1, 3)."""
    whole = np.zeros((gained.shape[1] + 1, 3, len(gained)))
    whole[1:] = _last(gained)
    for level, before in tree.levels[1:]:
        whole[level] += whole[before]
    return _first(whole)
