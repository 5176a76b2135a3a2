"""Rows that close the loops of an engine's open tree, from the poses that the engine gives."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.engines.tree.cut_joints import Chart, read_chart
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree, shifted
from screwgauge.models.layout import Closure
from screwgauge.models.urdf import LoopsFile
from screwgauge.reference.couplings import CouplingRows, bind
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.linear import blocks
from screwgauge.reference.mechanism import GROUND, POINTS, Joint
from screwgauge.reference.rotations import Array, cross, times, vee


@dataclass(frozen=True, slots=True, eq=False)
class AnchorPair:
    """One constraint of a closure: two points that coincide, or (`angular`) two frames that keep their attitude."""

    joint: str
    angular: bool
    parent: int
    child: int
    at_parent: Array  # point (3,) or attitude (3, 3) in the body
    at_child: Array

    @property
    def sides(self) -> tuple[tuple[int, Array], tuple[int, Array]]:
        """Body and point or attitude in it, of the child and of the parent."""
        return (self.child, self.at_child), (self.parent, self.at_parent)


@dataclass(frozen=True, eq=False)
class Loops:
    """The closing rows of a tree: anchors first, then couplings, then one row for each independent coordinate."""

    anchors: tuple[AnchorPair, ...]
    couplings: CouplingRows  # in the coordinates of the tree
    cut: tuple[Joint, ...]  # joints that are in no tree
    index: dict[str, int]
    independent: tuple[tuple[int | None, str, int], ...]  # tree column, or None with cut joint and its coordinate

    @cached_property
    def _points(self) -> tuple[list[int], Array]:
        """Bodies and places in them of the child sides of all anchors, then of the parent sides; angular ones at 0."""
        sides = [(*anchor.sides[side], anchor.angular) for side in (0, 1) for anchor in self.anchors]
        places = [np.zeros(3) if angular else where for _, where, angular in sides]
        return [body for body, *_ in sides], np.array(places).reshape(-1, 3)

    def ends(self, at: BodyPoses) -> Array:
        """Points of all anchors in the world, child sides first. Shape (n, 2 n_anchor, 3)."""
        return at.points(*self._points)

    def gaps(self, at: BodyPoses, ends: Array | None = None) -> Array:
        """Child side less parent side of each anchor [m or rad], for its `ends`. Shape (n, 3 n_anchor)."""
        m, ends = len(self.anchors), self.ends(at) if ends is None else ends
        out = ends[:, :m] - ends[:, m:]
        for k, anchor in enumerate(self.anchors):
            if anchor.angular:
                child, parent = (at.R[:, body] @ where for body, where in anchor.sides)
                out[:, k] = vee(child @ parent.swapaxes(1, 2))
        return out.reshape(len(out), 3 * m)

    def jacobian(self, at: BodyPoses, ends: Array | None = None) -> Array:
        """Derivative of the gaps, each side at its own of the `ends`. Shape (n, 3 n_anchor, n_v).

        Taken at one point for both, it is off by the gap: at a lock of a joint, where rates grow without bound, even a
        gap of rounding then costs the accelerations all their digits.
        """
        (n, _, n_v), m, moves = at.screws.shape, len(self.anchors), at.moves[self._points[0]]
        out, ends = np.empty((n, m, 3, n_v)), self.ends(at) if ends is None else ends
        for rows in blocks(n):
            J = at.jacobian(moves, ends[rows], rows)
            np.subtract(J[:, :m], J[:, m:], out=out[rows])
        for k, anchor in enumerate(self.anchors):
            if anchor.angular:
                out[:, k] = self.turning(at, anchor.parent, anchor.child)
        return out.reshape(n, 3 * m, n_v)

    def turning(self, at: BodyPoses, parent: int, child: int) -> Array:
        """Angular velocity of the child less that of the parent by the coordinates. Shape (n, 3, n_v)."""
        return np.asarray(at.screws[:, :3] * (at.moves[child] - at.moves[parent]))

    def bias(self, at: BodyPoses, V: Array, A: Array) -> Array:
        """Second derivative of the gaps for body velocities V and accelerations A, shape (n, n_body + 1, 6)."""

        m, (bodies, places) = len(self.anchors), self._points
        ends = shifted(V[:, bodies], A[:, bodies], times(at.R[:, bodies], places))
        out = ends[:, :m] - ends[:, m:]
        for k, anchor in enumerate(self.anchors):
            if anchor.angular:
                out[:, k] = A[:, anchor.child, :3] - A[:, anchor.parent, :3]
        return out.reshape(len(out), 3 * m)

    def charts(self, at: BodyPoses, only: Collection[str] | None = None) -> dict[str, Chart]:
        """Coordinates of the cut joints, or of some of them."""
        return {
            joint.name: read_chart(joint, at.R[:, self.index[joint.parent]], at.R[:, self.index[joint.child]])
            for joint in self.cut
            if only is None or joint.name in only
        }

    def sides(self, joint: Joint) -> tuple[int, int]:
        """Parent and child of a joint in the tree, where a copy stands for the body if the joint has its own."""
        parent, child = (self.index.get(f"{x}@{joint.name}", self.index[x]) for x in (joint.parent, joint.child))
        return parent, child

    def begin(self, joint: Joint, y: Array) -> Array:
        """Where the angles of a cut joint begin: at home, its independent ones at their values. Shape (k,) -> (m,)."""
        angles = joint.home.copy()
        for value, (_, name, i) in zip(y, self.independent, strict=True):
            if name == joint.name:
                angles[i] = value
        return angles

    def relative(self, joint: Joint, values: Array) -> Array:
        """Angular part of the child's `values` less the parent's. Shape (n, n_body + 1, 6, ...) -> (n, 3, ...)."""
        return np.asarray(values[:, self.index[joint.child], :3] - values[:, self.index[joint.parent], :3])

    def wrenches(self, at: BodyPoses, forces: Array) -> Array:
        """External wrench on each body, about its origin, of the multipliers of all anchors.

        Args:
            forces: Multipliers, on the child side [N or N m]; couplings' after them count for nothing here.
                Shape (n, 3 n_anchor or more).

        Returns:
            Force, then moment. Shape (n, n_body + 1, 6).
        """
        out = np.zeros((*at.p.shape[:2], 6))
        for k, anchor in enumerate(self.anchors):
            f = forces[:, 3 * k : 3 * k + 3]
            for sign, (body, where) in zip((1.0, -1.0), anchor.sides, strict=True):
                if not anchor.angular:
                    out[:, body, :3] += sign * f
                out[:, body, 3:] += sign * (f if anchor.angular else cross(at.R[:, body] @ where, f))
        return out


def check_names(tree: OpenTree, file: LoopsFile) -> None:
    """Refuses a model that lacks what its loops file names, or has joints of which that knows nothing."""
    closed = [side for closure in tree.closures for side in (closure.parent, closure.child)]
    differences = (
        ("has no body", {*file.bodies, *closed} - {GROUND, *tree.bodies}),
        ("has no joint coordinate", set(file.tree) - set(tree.coordinates)),
        ("has an unknown joint coordinate", set(tree.coordinates) - set(file.tree)),
        ("has no closure of joint", {c.joint for c in file.closures} - {c.joint for c in tree.closures}),
        ("closes an unknown joint", {c.joint for c in tree.closures} - {j.name for j in file.joints}),
        ("has no coupling", {c.name for c in file.couplings} - {c.name for c in tree.couplings}),
        ("has an unknown coupling", {c.name for c in tree.couplings} - {c.name for c in file.couplings}),
    )
    for what, names in differences:
        if names:
            where = f"model of {tree.engine}"
            raise ModelFileError(f"{what} '{min(names)}'", where, "keep the names of the loops file")


def make_loops(tree: OpenTree, file: LoopsFile) -> Loops:
    """Binds the closures and the independent coordinates to the bodies and coordinates of a tree.

    Raises:
        ModelFileError: The model lacks one of them, or a joint that only a tree can hold.
    """
    index = {name: i for i, name in enumerate([GROUND, *tree.bodies])}
    anchors = [anchor for closure in tree.closures for anchor in _anchors(closure, index)]
    cut = tuple(j for j in file.joints if not set(j.coordinates) <= set(tree.coordinates))
    for joint in cut:
        if joint.kind not in POINTS or joint.actuated:
            what = f"joint '{joint.name}' is not in the tree"
            raise ModelFileError(what, f"model of {tree.engine}", "leave out R and S joints without actuator only")
    rows: list[tuple[int | None, str, int]] = []
    for name in file.independent.values():
        if name in tree.coordinates:
            rows.append((tree.coordinates.index(name), "", 0))
            continue
        owner = next((joint for joint in cut if name in joint.coordinates), None)
        if owner is None:
            raise ModelFileError(f"has no coordinate '{name}'", f"model of {tree.engine}", "keep the generated names")
        rows.append((None, owner.name, owner.coordinates.index(name)))
    own = {coupling.name: coupling for coupling in tree.couplings}
    couplings = bind([own[coupling.name] for coupling in file.couplings], tree.coordinates)
    return Loops(tuple(anchors), couplings, cut, index, tuple(rows))


def _anchors(closure: Closure, index: dict[str, int]) -> list[AnchorPair]:
    parent, child = index[closure.parent], index[closure.child]
    if closure.type == "weld":
        here, there = closure.parent_frame, closure.child_frame
        sides = [(False, here.p, there.p), (True, here.R, there.R)]
    else:
        sides = [(False, *points) for points in zip(closure.parent_points, closure.child_points, strict=True)]
    return [AnchorPair(closure.joint, angular, parent, child, *points) for angular, *points in sides]
