"""How a tree moves: poses, velocities and accelerations of its links and of frames fixed to them, all samples at once.

Moving points: ``w x (w x r)`` is the acceleration towards the axis, ``2 w x u`` that of Coriolis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.reference.rotations import Array, cross, lanes, product, quaternion_rotation, skew, times
from screwgauge.witness.tree import FREEDOMS, Frames, States, Tree


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Frames in motion, n samples of m of them, world axes; samples lie side by side, see `lanes`.

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

    def shifted(self, r: Array) -> Moving:
        """The same bodies seen from other points of them, displaced by `r` (world axes, shape (n, m, 3))."""
        v = cross(self.w, r)
        return Moving(self.R, self.p + r, self.w, self.v + v, self.b, self.a + cross(self.b, r) + cross(self.w, v))

    def frames(self, at: Frames) -> Moving:
        """Frames fixed to some of these."""
        some = Moving(*(getattr(self, name)[:, at.link] for name in "Rpwvba"))
        there = some.shifted(times(some.R, at.p))
        return Moving(product(there.R, at.R), there.p, there.w, there.v, there.b, there.a)

    @property
    def velocity(self) -> Array:
        """Angular velocity over that of the origin. Shape (n, m, 6)."""
        return np.concatenate([self.w, self.v], axis=2)

    @property
    def acceleration(self) -> Array:
        """Angular acceleration over that of the origin. Shape (n, m, 6)."""
        return np.concatenate([self.b, self.a], axis=2)


@dataclass(frozen=True, eq=False)
class Motion:
    """A tree in motion.

    Attributes:
        links: Ground and the links.
        axes: Of the velocities, along which a unit one turns or slides. Shape (n, n_freedom, 3).
    """

    tree: Tree
    links: Moving
    axes: Array

    @cached_property
    def bodies(self) -> Moving:
        """Frames of the bodies."""
        return self.links.frames(self.tree.bodies)

    @cached_property
    def com(self) -> Moving:
        """The bodies at their centres of mass."""
        return self.bodies.shifted(times(self.bodies.R, self.tree.matter.com))

    def jacobian(self, frames: Frames, points: Array) -> Array:
        """Angular velocity over that of a point of each frame, at unit velocities.

        Args:
            points: In the world [m]. Shape (n, m, 3).

        Returns:
            Shape (n, m, 6, n_freedom).
        """
        number, _, turns = self.tree.velocity
        moved = self.tree.carries[frames.link][:, None]
        e = np.broadcast_to(self.axes[:, None], (*points.shape[:2], *self.axes.shape[1:]))
        lever = cross(e, points[:, :, None] - self.links.p[:, None, number])
        found = np.empty((*points.shape[:2], 6, len(number)))
        found[:, :, :3] = np.where(turns, np.swapaxes(e, 2, 3), 0.0) * moved
        found[:, :, 3:] = np.swapaxes(np.where(turns[:, None], lever, e), 2, 3) * moved
        return found


def move(tree: Tree, states: States) -> Motion:
    """Motion of everything."""
    R, p, r = _poses(tree, states.q)
    (spin, slide), (spin_rate, slide_rate) = (_relative(tree, R, rates) for rates in (states.qd, states.qdd))
    before = tree.starts.link
    w = _outward(tree, spin)
    near = w[:, before]
    b = _outward(tree, spin_rate + cross(near, spin))
    v = _outward(tree, cross(near, r) + slide)
    turned = cross(spin, slide)  # velocities of a free joint are counted along axes that it turns
    a = cross(b[:, before], r) + cross(near, cross(near, r)) + 2.0 * cross(near, slide) + slide_rate + turned
    number, axes, _ = tree.velocity
    return Motion(tree, Moving(R, p, w, v, b, _outward(tree, a)), times(R[:, number], axes))


def _poses(tree: Tree, q: Array) -> tuple[Array, Array, Array]:
    """Of ground and all links, and the way from the origin of the link before to each. (n, n_link + 1, ...)."""
    n, k = len(q), len(tree.links)
    turn, way = _joints(tree, q)
    R, p, r = lanes(n, k + 1, 3, 3), lanes(n, k + 1, 3), lanes(n, k, 3)
    R[:, 0], p[:, 0] = np.eye(3), 0.0
    start = tree.starts
    for level, before in tree.levels:
        own, near = level - 1, R[:, before]
        placed = product(near, start.R[own])
        r[:, own] = times(near, start.p[own]) + times(placed, way[:, own])
        R[:, level], p[:, level] = product(placed, turn[:, own]), p[:, before] + r[:, own]
    return R, p, r


def _joints(tree: Tree, q: Array) -> tuple[Array, Array]:
    """How each joint turns and displaces its link. Shapes (n, n_link, 3, 3), (n, n_link, 3)."""
    n, k = len(q), len(tree.links)
    R, p = lanes(n, k, 3, 3), lanes(n, k, 3)
    own, columns, zero, axes, turns, slides = tree.single
    gone, K = lanes(n, len(own), 1), skew(axes)
    gone[..., 0] = q[:, columns] - zero
    angle = gone[..., None]
    # 1 - cos as 2 sin^2 of the half angle: no cancellation at small angles
    sine, versine = np.sin(angle) * turns[..., None], 2.0 * np.sin(0.5 * angle) ** 2 * turns[..., None]
    R[:, own], p[:, own] = np.eye(3) + sine * K + versine * (K @ K), gone * (axes * slides)
    for i, link in enumerate(tree.links):
        if FREEDOMS[link.kind] > 1:
            end = link.coordinate + 7 if link.kind == "free" else link.coordinate + 4
            R[:, i] = quaternion_rotation(q[:, end - 4 : end])
            p[:, i] = q[:, end - 7 : end - 4] if link.kind == "free" else 0.0
    return R, p


def _relative(tree: Tree, R: Array, rates: Array) -> tuple[Array, Array]:
    """What rates of the joints add to the angular velocity and to that of the origin. Shape (n, n_link, 3) each."""
    number, axes, turns = tree.velocity
    parts, found = axes * rates[..., None], (lanes(len(R), len(tree.links), 3), lanes(len(R), len(tree.links), 3))
    for out, some in zip(found, (turns, ~turns), strict=True):
        out[:] = 0.0
        columns = np.flatnonzero(some & (number > 0))
        own, first = np.unique(number[columns], return_index=True)
        if own.size == columns.size:
            out[:, number[columns] - 1] = parts[:, columns]
        else:  # a ball has three of them
            out[:, own - 1] = np.add.reduceat(parts[:, columns], first, axis=1)
    return times(R[:, 1:], found[0]), times(R[:, 1:], found[1])


def _outward(tree: Tree, gained: Array) -> Array:
    """Sums what each link adds to the one before it, from the ground. Shape (n, n_link, 3) -> (n, n_link + 1, 3)."""
    whole = lanes(len(gained), gained.shape[1] + 1, 3)
    whole[:, 0], whole[:, 1:] = 0.0, gained
    for level, before in tree.levels:
        whole[:, level] += whole[:, before]
    return whole
