"""An engine's open tree with its cut joints, and the rows that close its loops, computed from its poses."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.kit.poses import shifted
from screwgauge.engines.tree.cut_joints import Chart, read_chart
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree
from screwgauge.models.files.loops import LoopsFile
from screwgauge.models.layout import Closure
from screwgauge.reference.applied import Load
from screwgauge.reference.couplings import CouplingRows, bind
from screwgauge.reference.equations.joint_types import JointPose, locate
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.linear import blocks
from screwgauge.reference.mechanism import GROUND, KINDS, POINTS, Joint, actuator_names, driven_coordinates
from screwgauge.reference.rotations import Array, cross, times, vee, widest


@dataclass(frozen=True, slots=True, eq=False)
class AnchorPair:
    """Constraint of a closure: two coincident points, or (`angular`) two frames of equal orientation."""

    joint: str
    angular: bool
    parent: int
    child: int
    at_parent: Array  # point (3,) or orientation (3, 3) in the body
    at_child: Array

    @property
    def sides(self) -> tuple[tuple[int, Array], tuple[int, Array]]:
        """The child's index and the point or orientation in the child, then the same for the parent."""
        return (self.child, self.at_child), (self.parent, self.at_parent)


@dataclass(frozen=True, eq=False)
class TreeLoops:
    """Closing rows of a tree: rows of anchors, rows of couplings, then one row per independent coordinate."""

    anchors: tuple[AnchorPair, ...]
    couplings: CouplingRows  # in the coordinates of the tree
    cut: tuple[Joint, ...]  # joints outside the tree
    index: dict[str, int]
    independent: tuple[tuple[int | None, str, int], ...]  # tree column, or None with cut joint and its coordinate

    @cached_property
    def _points(self) -> tuple[list[int], Array]:
        """Bodies and body points of all anchors, child sides first; points of angular anchors are zero."""
        sides = [(*anchor.sides[side], anchor.angular) for side in (0, 1) for anchor in self.anchors]
        places = [np.zeros(3) if angular else where for _, where, angular in sides]
        return [body for body, *_ in sides], np.array(places).reshape(-1, 3)

    def ends(self, at: BodyPoses) -> Array:
        """Return the world points of all anchors, child sides first. Shape (n, 2 n_anchor, 3)."""
        return at.points(*self._points)

    def gaps(self, at: BodyPoses, ends: Array | None = None) -> Array:
        """Return each anchor's child side minus its parent side [m or rad], given all `ends`. Shape (n, 3 n_anchor)."""
        m, ends = len(self.anchors), self.ends(at) if ends is None else ends
        out = ends[:, :m] - ends[:, m:]
        for k, anchor in enumerate(self.anchors):
            if anchor.angular:
                child, parent = (at.R[:, body] @ where for body, where in anchor.sides)
                out[:, k] = vee(child @ parent.swapaxes(1, 2))
        return out.reshape(len(out), 3 * m)

    def jacobian(self, at: BodyPoses, ends: Array | None = None) -> Array:
        """Return the derivative of the gaps, with each side evaluated at its own end. Shape (n, 3 n_anchor, n_v).

        If both sides were evaluated at one point, the error would be proportional to the gap. At gimbal lock, where
        rates grow without bound, even a gap of rounding size would then destroy all digits of the accelerations.
        """
        (n, _, n_v), m, moves = at.screws.shape, len(self.anchors), at.moves[self._points[0]]
        out, ends = np.empty((n, m, 3, n_v)), self.ends(at) if ends is None else ends
        for rows in blocks(n):
            J = at.jacobian(moves, ends[rows], rows)
            np.subtract(J[:, :m], J[:, m:], out=out[rows])
        for k, anchor in enumerate(self.anchors):
            if anchor.angular:
                out[:, k] = self.angular_jacobian(at, anchor.parent, anchor.child)
        return out.reshape(n, 3 * m, n_v)

    def angular_jacobian(self, at: BodyPoses, parent: int, child: int) -> Array:
        """Return the child's angular velocity relative to the parent, per unit coordinate rate. Shape (n, 3, n_v)."""
        return np.asarray(at.screws[:, :3] * (at.moves[child] - at.moves[parent]))

    def bias(self, at: BodyPoses, V: Array, A: Array) -> Array:
        """Return the gaps' second derivative at body velocities V and accelerations A, shape (n, n_body + 1, 6)."""

        m, (bodies, places) = len(self.anchors), self._points
        ends = shifted(V[:, bodies], A[:, bodies], times(at.R[:, bodies], places))
        out = ends[:, :m] - ends[:, m:]
        for k, anchor in enumerate(self.anchors):
            if anchor.angular:
                out[:, k] = A[:, anchor.child, :3] - A[:, anchor.parent, :3]
        return out.reshape(len(out), 3 * m)

    def charts(self, at: BodyPoses, only: Collection[str] | None = None) -> dict[str, Chart]:
        """Read the coordinates of all cut joints, or of those named in `only`."""
        return {
            joint.name: read_chart(joint, at.R[:, self.index[joint.parent]], at.R[:, self.index[joint.child]])
            for joint in self.cut
            if only is None or joint.name in only
        }

    def sides(self, joint: Joint) -> tuple[int, int]:
        """Return a joint's parent and child bodies in the tree; either may be a copy made for this joint."""
        parent, child = (self.index.get(f"{x}@{joint.name}", self.index[x]) for x in (joint.parent, joint.child))
        return parent, child

    def begin(self, joint: Joint, y: Array) -> Array:
        """Return initial angles of a cut joint: the home angles, with independent angles set from y. (k,) -> (m,)."""
        angles = joint.home.copy()
        for value, (_, name, i) in zip(y, self.independent, strict=True):
            if name == joint.name:
                angles[i] = value
        return angles

    def relative(self, joint: Joint, values: Array) -> Array:
        """Subtract the parent's angular values from the child's. Shape (n, n_body + 1, 6, ...) -> (n, 3, ...)."""
        return np.asarray(values[:, self.index[joint.child], :3] - values[:, self.index[joint.parent], :3])

    def wrenches(self, at: BodyPoses, forces: Array) -> Array:
        """Return the external wrench on each body, about its origin, given the multipliers of all anchors.

        Args:
            forces: Multipliers on the child side [N or N m]; the multipliers of couplings, which follow, are ignored.
                Shape (n, 3 n_anchor or more).

        Returns:
            Force, then moment, of each body. Shape (n, n_body + 1, 6).
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
    """Reject a model that lacks names of its loops file, or has joints unknown to that file."""
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


def make_loops(tree: OpenTree, file: LoopsFile) -> TreeLoops:
    """Bind closures and independent coordinates to the bodies and coordinates of a tree.

    Raises:
        ModelFileError: The model lacks a coordinate, or its tree lacks a joint that cannot be cut.
    """
    index = {name: i for i, name in enumerate([GROUND, *tree.bodies])}
    anchors = [anchor for closure in tree.closures for anchor in _anchors(closure, index)]
    cut = tuple(j for j in file.joints if not set(j.coordinates) <= set(tree.coordinates))
    for joint in cut:
        if joint.kind not in POINTS or joint.actuated or joint.rotor.any():
            what, remedy = f"joint '{joint.name}' is not in the tree", "cut only R and S joints without motor or rotor"
            raise ModelFileError(what, f"model of {tree.engine}", remedy)
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
    return TreeLoops(tuple(anchors), couplings, cut, index, tuple(rows))


def _anchors(closure: Closure, index: dict[str, int]) -> list[AnchorPair]:
    parent, child = index[closure.parent], index[closure.child]
    if closure.type == "weld":
        here, there = closure.parent_frame, closure.child_frame
        sides = [(False, here.p, there.p), (True, here.R, there.R)]
    else:
        sides = [(False, *points) for points in zip(closure.parent_points, closure.child_points, strict=True)]
    return [AnchorPair(closure.joint, angular, parent, child, *points) for angular, *points in sides]


Charts = dict[str, Chart]
"""Cut joint -> chart of its coordinates at n poses."""


@dataclass(frozen=True, eq=False)
class ClosedTree:
    """A loaded tree with its cut joints, and the units of its dimensionless closing equations."""

    tree: OpenTree
    file: LoopsFile
    loops: TreeLoops

    @property
    def _at_home(self) -> dict[str, float]:
        return {name: x for joint in self.file.joints for name, x in zip(joint.coordinates, joint.home, strict=True)}

    @cached_property
    def home(self) -> Array:
        """Tree coordinates at the home pose [rad or m]. Shape (n_v,)."""
        return np.array([self._at_home[name] for name in self.tree.coordinates])

    @cached_property
    def y_home(self) -> Array:
        """Independent coordinates at the home pose [rad or m]. Shape (k,)."""
        return np.array([self._at_home[name] for name in self.file.independent.values()])

    @cached_property
    def angles(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Flags that mark angles among tree coordinates and among independent coordinates. Shapes (n_v,), (k,)."""
        turns = {name: turn for j in self.file.joints for name, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}
        names = self.tree.coordinates, self.file.independent.values()
        tree, independent = (np.array([turns[name] for name in some], dtype=bool) for some in names)
        return tree, independent

    @cached_property
    def length(self) -> float:
        """Largest distance between joint points and centres of mass in the home pose [m]; the unit of lengths."""
        at, loops = self.tree.poses(self.home[None]), self.loops
        sides = [(loops.index[body], frame.p) for joint in self.file.joints for body, frame in joint.sides]
        places = [*sides, *enumerate(self.tree.com, 1)]
        return widest([at.p[0, body] + at.R[0, body] @ where for body, where in places]) or 1.0

    @cached_property
    def units(self) -> Array:
        """Unit of each tree coordinate: 1 rad or the `length`. Shape (n_v,)."""
        return np.where(self.angles[0], 1.0, self.length)

    @cached_property
    def y_units(self) -> Array:
        """Unit of each independent coordinate. Shape (k,)."""
        return np.where(self.angles[1], 1.0, self.length)

    @cached_property
    def row_units(self) -> Array:
        """Unit of each closing row, with the rows of y last. Shape (m + k,)."""
        anchors = [1.0 if anchor.angular else self.length for anchor in self.loops.anchors for _ in range(3)]
        return np.array([*anchors, *self.units[self.loops.couplings.columns], *self.y_units])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All joint coordinates in description order."""
        return tuple(self._at_home)

    @cached_property
    def tree_names(self) -> tuple[str, ...]:
        """Tree coordinates in description order."""
        return tuple(name for name in self.names if name in self.tree.coordinates)

    @cached_property
    def order(self) -> list[int]:
        """Indices of `tree_names` among the tree's own coordinates."""
        return [self.tree.coordinates.index(name) for name in self.tree_names]

    @cached_property
    def driven(self) -> list[int]:
        """Columns of the actuated coordinates in the tree."""
        return [self.tree.coordinates.index(name) for name in driven_coordinates(self.file.joints)]

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the actuators."""
        return actuator_names(self.file.joints)

    @cached_property
    def bodies(self) -> list[int]:
        """Indices of the description's bodies in the tree, ground being 0."""
        return [self.loops.index[name] for name in self.file.bodies]

    def ancestry(self, body: int) -> list[int]:
        """Return a body of the tree, its ancestors, and ground."""
        return [body, *self.ancestry(self.loops.index[self.tree.parents[body - 1]])] if body else [0]

    def cut_joint(self, name: str) -> Joint:
        return next(joint for joint in self.loops.cut if joint.name == name)

    @cached_property
    def given(self) -> frozenset[str]:
        """Names of the cut joints that have independent coordinates."""
        return frozenset(name for column, name, _ in self.loops.independent if column is None)

    def joints(self, tree_values: Array, cut_values: dict[str, Array]) -> Array:
        """Assemble all joint coordinates, or their derivatives, in description order.

        Args:
            tree_values: Shape (n, n_v).
            cut_values: Cut joint -> shape (n, m).

        Returns:
            Shape (n, n_q).
        """
        columns = dict(zip(self.tree.coordinates, tree_values.T, strict=True))
        for joint in self.loops.cut:
            columns |= zip(joint.coordinates, cut_values[joint.name].T, strict=True)
        return np.stack([columns[name] for name in self.names], axis=1)

    def cut_velocities(self, charts: Charts, V: Array) -> dict[str, Array]:
        """Compute coordinate velocities of cut joints, (n, m), from body velocities, (n, n_body + 1, 6)."""
        turns = {name: self.loops.relative(self.cut_joint(name), V)[..., None] for name in charts}
        return {name: chart.rates(turns[name])[..., 0] for name, chart in charts.items()}

    def cut_accelerations(self, charts: Charts, rates: dict[str, Array], V: Array, A: Array) -> dict[str, Array]:
        """Compute coordinate accelerations of cut joints.

        Args:
            charts: Charts of the requested joints.
            rates: Cut joint -> velocities. Shape (n, m).
            V, A: Velocities and accelerations of the bodies. Shape (n, n_body + 1, 6).
        """
        relative, accelerations = self.loops.relative, {}
        for joint in (self.cut_joint(name) for name in charts):
            parent = V[:, self.loops.index[joint.parent], :3]
            accelerations[joint.name] = charts[joint.name].bias(
                rates[joint.name], parent, relative(joint, V), relative(joint, A)
            )
        return accelerations

    def gaps(self, q: Array, at: BodyPoses, ends: Array | None = None) -> Array:
        """Return the residuals of closures, then of couplings; for `ends` see `TreeLoops.ends`. Shape (n, m)."""
        gaps, couplings = self.loops.gaps(at, ends), self.loops.couplings
        return np.concatenate([gaps, couplings.residuals(q)], axis=1) if len(couplings) else gaps

    def jacobian(self, q: Array, at: BodyPoses, ends: Array | None = None) -> Array:
        """Return the derivative of the gaps. Shape (n, m, n_v)."""
        G, couplings = self.loops.jacobian(at, ends), self.loops.couplings
        return np.concatenate([G, couplings.matrix(q)], axis=1) if len(couplings) else G

    def gap_accelerations(self, motion: tuple[Array, Array, Array], at: BodyPoses, V: Array, A: Array) -> Array:
        """Return the second derivative of the gaps. Shape (n, m).

        Args:
            motion: Coordinates, velocities and accelerations of the tree. Shape (n, n_v) each.
            V, A: Velocities and accelerations of the bodies, see `TreeLoops.bias`.
        """
        (q, v, a), couplings, bias = motion, self.loops.couplings, self.loops.bias(at, V, A)
        if not len(couplings):
            return bias
        along = (couplings.matrix(q) @ a[..., None])[..., 0] + couplings.bias(q, v)
        return np.concatenate([bias, along], axis=1)

    def closing_rows(self, q: Array, at: BodyPoses, charts: Charts, ends: Array | None = None) -> Array:
        """Return the derivative of the gaps, followed by one row per independent coordinate. Shape (n, m + k, n_v)."""
        loops, rows, own = self.loops, [self.jacobian(q, at, ends)], np.eye(q.shape[1])
        sides = {joint.name: (loops.index[joint.parent], loops.index[joint.child]) for joint in loops.cut}
        cut = {name: charts[name].rates(loops.angular_jacobian(at, *sides[name])) for name in self.given}
        for column, name, i in loops.independent:
            row = cut[name][:, i] if column is None else np.broadcast_to(own[column], q.shape)
            rows.append(row[:, None])
        return np.concatenate(rows, axis=1)

    def load_point(self, load: Load) -> Array:
        """Return the body point at which a load acts [m]. Shape (3,)."""
        if load.point is not None:
            return load.point
        i = self.loops.index[load.body]
        return np.asarray(self.tree.com[i - 1]) if i else np.zeros(3)

    def joint_pose(self, joint: Joint, at: BodyPoses) -> JointPose:
        """Return the world frames of a joint on its two bodies."""
        parent, child = self.loops.sides(joint)
        before = locate(at.R[:, parent], at.p[:, parent], joint.parent_frame)
        return JointPose(joint, *before, *locate(at.R[:, child], at.p[:, child], joint.child_frame))


def close_tree(tree: OpenTree, file: LoopsFile) -> ClosedTree:
    """Bind a tree to its loops file.

    Raises:
        ModelFileError: The model lacks names of the file, or has joints unknown to the file.
    """
    check_names(tree, file)
    return ClosedTree(tree, file, make_loops(tree, file))
