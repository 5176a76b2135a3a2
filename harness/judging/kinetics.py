"""Motion of all bodies from joint coordinates by classical vector mechanics, for the judge alone.

Deliberately not the screw formulas of `screwgauge.reference`: moving points, ``w x (w x r)`` and ``2 w x v``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, lanes, product, rotation, times, vee

AT_ONCE = 4096  # samples walked together: a walk over few takes as long as one over many


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """A frame in motion, for n samples, world axes; samples lie side by side, see `lanes`.

    Attributes:
        R, p: Orientation (n, 3, 3) and origin [m] (n, 3).
        w, v: Angular velocity and velocity of the origin. Shape (n, 3).
        b, a: Angular acceleration and acceleration of the origin. Shape (n, 3).
    """

    R: Array
    p: Array
    w: Array
    v: Array
    b: Array
    a: Array

    def shifted(self, r: Array, R: Array | None = None) -> Moving:
        """A frame fixed in the same body, its origin displaced by `r` (world axes, shape (n, 3))."""
        v = cross(self.w, r)
        a = self.a + cross(self.b, r) + cross(self.w, v)
        return Moving(self.R if R is None else R, self.p + r, self.w, self.v + v, self.b, a)

    def part(self, rows: slice) -> Moving:
        """The same for some of the samples."""
        return Moving(*(getattr(self, name)[rows] for name in "Rpwvba"))

    def one(self, index: int) -> Moving:
        """One of several frames that stand side by side, see `beside`."""
        return Moving(*(getattr(self, name)[:, index] for name in "Rpwvba"))

    def frame(self, frame: Frame) -> Moving:
        """The frame that is placed in this body by `frame`."""
        return self._placed(frame.p, frame.R)

    def body_of(self, frame: Frame) -> Moving:
        """The body in which this frame is placed by `frame`."""
        return self._placed(-frame.R.T @ frame.p, frame.R.T)

    def _placed(self, p: Array, R: Array) -> Moving:
        turned = self.R if np.array_equal(R, np.eye(3)) else product(self.R, R)
        return self.shifted(times(self.R, p), turned) if p.any() else replace(self, R=turned)

    def turned(self, axis: Array, q: Array, qd: Array, qdd: Array) -> Moving:
        """After a rotation about an own axis through the origin."""
        e = times(self.R, axis)
        spin = e * qd[:, None]
        b = self.b + e * qdd[:, None] + cross(self.w, spin)
        return Moving(product(self.R, rotation(axis, q)), self.p, self.w + spin, self.v, b, self.a)

    def slid(self, axis: Array, q: Array, qd: Array, qdd: Array) -> Moving:
        """After a translation along an own axis; the second ``w x v`` is Coriolis' acceleration."""
        e = times(self.R, axis)
        there = self.shifted(e * q[:, None])
        speed = e * qd[:, None]
        a = there.a + 2.0 * cross(self.w, speed) + e * qdd[:, None]
        return Moving(there.R, there.p, there.w, there.v + speed, there.b, a)


def beside(frames: Sequence[Moving]) -> Moving:
    """Frames side by side, along the second axis."""

    def stacked(name: str) -> Array:
        first = getattr(frames[0], name)
        found = lanes(len(first), len(frames), *first.shape[1:])
        for i, frame in enumerate(frames):
            found[:, i] = getattr(frame, name)
        return found

    return Moving(*map(stacked, "Rpwvba"))


def across(joint: Joint, near: Moving, motion: Array, *, reverse: bool) -> Moving:
    """The body on the other side of a joint. Its coordinates and two derivatives: shape (3, n, n_freedom)."""
    start, end = (joint.child_frame, joint.parent_frame) if reverse else (joint.parent_frame, joint.child_frame)
    at = near.frame(start)
    freedoms = list(enumerate(joint.freedoms))
    for i, (turns, axis) in freedoms[::-1] if reverse else freedoms:
        step = at.turned if turns else at.slid
        at = step(axis, *(-motion[..., i] if reverse else motion[..., i]))
    return at.body_of(end)


@dataclass(frozen=True, slots=True, eq=False)
class Motions:
    """What joint coordinates make of a mechanism.

    Attributes:
        bodies: Frames of the bodies side by side, by the spanning tree, ground first. Shape (n, n_body + 1, ...).
        com: Their centres of mass, without ground. Shape (n, n_body, ...).
        cuts: Ground and the children of the cut joints side by side, by the tree and by these joints: one motion where
            the loop is closed. Shape (n, n_cut + 1, ...).
    """

    bodies: Moving
    com: Moving
    cuts: tuple[Moving, Moving]

    def part(self, rows: slice) -> Motions:
        """The same for some of the samples."""
        tree, cut = self.cuts
        return Motions(self.bodies.part(rows), self.com.part(rows), (tree.part(rows), cut.part(rows)))

    @property
    def velocities(self) -> Array:
        """Velocity of each centre of mass over the angular velocity. Shape (n, n_body, 6)."""
        return np.concatenate([self.com.v, self.com.w], axis=2)

    def closure_residual(self, order: int) -> Array:
        """How the joint's motion differs from the tree's, in position (order 0), velocity or acceleration.

        Returns:
            For each cut joint an angular and a linear part in world axes. Shape (n, n_cut, 2, 3).
        """
        tree, cut = self.cuts
        linear = getattr(cut, "pva"[order]) - getattr(tree, "pva"[order])
        turn = "Rwb"[order]
        angular = getattr(cut, turn) - getattr(tree, turn) if order else vee(product(cut.R, tree.R.swapaxes(2, 3)))
        return np.stack([angular, linear], axis=2)[:, 1:]


def walk(mechanism: Mechanism, tree: Layout, q: Array, qd: Array, qdd: Array) -> Motions:
    """Motion of everything from joint coordinates and their derivatives. Shape (n, n_q) each."""
    motion, zero, index = np.stack([q.T, qd.T, qdd.T]), lanes(len(q), 3), mechanism.body_index
    zero[:], upright = 0.0, lanes(len(q), 3, 3)
    upright[:] = np.eye(3)
    bodies = [Moving(upright, zero, zero, zero, zero, zero)] * len(index)

    def over(joint: Joint, near: str, *, reverse: bool = False) -> Moving:
        return across(joint, bodies[index[near]], motion[:, tree.columns[joint.name]].swapaxes(1, 2), reverse=reverse)

    for edge in tree.edges:
        bodies[index[edge.far]] = over(edge.joint, edge.near, reverse=edge.reverse)
    every = beside(bodies)
    com = Moving(*(getattr(every, name)[:, 1:] for name in "Rpwvba"))
    com = com.shifted(times(com.R, np.stack([body.com for body in mechanism.bodies])))
    by_tree = beside([bodies[0], *(bodies[index[joint.child]] for joint in tree.cuts)])
    by_joint = beside([bodies[0], *(over(joint, joint.parent) for joint in tree.cuts)])
    return Motions(every, com, (by_tree, by_joint))


def unit_motions(mechanism: Mechanism, tree: Layout, q: Array, columns: Iterable[int]) -> Iterator[Motions]:
    """Motions at joint coordinates, shape (n, n_q), while each of some columns in turn has the velocity 1."""
    n, moved = len(q), [*columns]
    most = max(1, AT_ONCE // max(1, n))
    for some in (moved[i : i + most] for i in range(0, len(moved), most)):
        k = len(some)
        qd = np.zeros((k, *q.shape))
        qd[np.arange(k), :, some] = 1.0
        qd = qd.reshape(k * n, -1)
        together = walk(mechanism, tree, np.tile(q, (k, 1)), qd, np.zeros_like(qd))
        yield from (together.part(slice(i * n, (i + 1) * n)) for i in range(k))
