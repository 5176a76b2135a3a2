"""An engine's open tree with the loops that close it: what inverse dynamics, simulation and states share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.tree.closure import Loops, check_names, make_loops
from screwgauge.engines.tree.cut_joints import Chart
from screwgauge.engines.tree.protocol import BodyPoses, OpenTree
from screwgauge.models.urdf import LoopsFile
from screwgauge.reference.applied import Load
from screwgauge.reference.equations.joint_types import JointPose, placed
from screwgauge.reference.mechanism import KINDS, Joint, actuator_names
from screwgauge.reference.rotations import Array, cross, widest


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """What each number is divided by.

    Attributes:
        length: Largest distance between joint points and centres of mass at home [m].
        q: Unit of each tree coordinate, 1 rad or that length. Shape (n_v,).
        y: Unit of each independent coordinate. Shape (k,).
        rows: Unit of each closing row, those of y last. Shape (m + k,).
    """

    length: float
    q: Array
    y: Array
    rows: Array


def make_sizes(tree: OpenTree, file: LoopsFile, loops: Loops, home: Array) -> Sizes:
    """Units for a tree whose home pose is known. `home`: its coordinates there, shape (n_v,)."""
    at = tree.poses(home[None])
    sides = [(loops.index[body], frame.p) for joint in file.joints for body, frame in joint.sides]
    places = [*sides, *enumerate(tree.com, 1)]
    length = widest([at.p[0, body] + at.R[0, body] @ where for body, where in places]) or 1.0
    turns = {name: turn for j in file.joints for name, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}
    unit = {name: 1.0 if turn else length for name, turn in turns.items()}
    y = np.array([unit[name] for name in file.independent.values()])
    anchors = [1.0 if anchor.angular else length for anchor in loops.anchors for _ in range(3)]
    q = np.array([unit[name] for name in tree.coordinates])
    return Sizes(length, q, y, np.array([*anchors, *q[loops.couplings.columns], *y]))


Charts = dict[str, Chart]
"""Cut joint -> its coordinates at some poses."""


@dataclass(frozen=True, eq=False)
class ClosedTree:
    """A loaded tree, the joints that were cut, and the units in which its closing equations have no dimension."""

    tree: OpenTree
    file: LoopsFile
    loops: Loops

    @property
    def _at_home(self) -> dict[str, float]:
        return {name: x for joint in self.file.joints for name, x in zip(joint.coordinates, joint.home, strict=True)}

    @cached_property
    def home(self) -> Array:
        """Tree coordinates at home [rad or m]. Shape (n_v,)."""
        return np.array([self._at_home[name] for name in self.tree.coordinates])

    @cached_property
    def y_home(self) -> Array:
        """Independent coordinates at home [rad or m]. Shape (k,)."""
        return np.array([self._at_home[name] for name in self.file.independent.values()])

    @cached_property
    def angles(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which tree coordinates, and which independent ones, are angles. Shapes (n_v,), (k,)."""
        turns = {name: turn for j in self.file.joints for name, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}
        names = self.tree.coordinates, self.file.independent.values()
        tree, independent = (np.array([turns[name] for name in some], dtype=bool) for some in names)
        return tree, independent

    @cached_property
    def sizes(self) -> Sizes:
        return make_sizes(self.tree, self.file, self.loops, self.home)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All joint coordinates, in the order of the description."""
        return tuple(self._at_home)

    @cached_property
    def tree_names(self) -> tuple[str, ...]:
        """Coordinates of the tree, in the order of the description."""
        return tuple(name for name in self.names if name in self.tree.coordinates)

    @cached_property
    def order(self) -> list[int]:
        """Where `tree_names` stand among the tree's own coordinates."""
        return [self.tree.coordinates.index(name) for name in self.tree_names]

    @cached_property
    def driven(self) -> list[int]:
        """Columns of the actuated coordinates in the tree."""
        return [self.tree.coordinates.index(j.coordinates[0]) for j in self.file.joints if j.actuated]

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the actuators."""
        return actuator_names(self.file.joints)

    @cached_property
    def bodies(self) -> list[int]:
        """The bodies of the description among those of the tree, ground being 0."""
        return [self.loops.index[name] for name in self.file.bodies]

    def inwards(self, body: int) -> list[int]:
        """A body of the tree, those that carry it, and ground."""
        return [body, *self.inwards(self.loops.index[self.tree.parents[body - 1]])] if body else [0]

    def cut_joint(self, name: str) -> Joint:
        return next(joint for joint in self.loops.cut if joint.name == name)

    @cached_property
    def given(self) -> frozenset[str]:
        """Cut joints with independent coordinates."""
        return frozenset(name for column, name, _ in self.loops.independent if column is None)

    def joints(self, tree_values: Array, cut_values: dict[str, Array]) -> Array:
        """All joint coordinates, or their derivatives, in the order of the description.

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
        """Cut joint -> velocities of its coordinates, (n, m), for those of the bodies, (n, n_body + 1, 6)."""
        turns = {name: self.loops.relative(self.cut_joint(name), V)[..., None] for name in charts}
        return {name: chart.rates(turns[name])[..., 0] for name, chart in charts.items()}

    def cut_accelerations(self, charts: Charts, rates: dict[str, Array], V: Array, A: Array) -> dict[str, Array]:
        """Cut joint -> accelerations of its coordinates.

        Args:
            charts: Of the joints that are wanted.
            rates: Cut joint -> velocities. Shape (n, m).
            V, A: Velocities and accelerations of the bodies. Shape (n, n_body + 1, 6).
        """
        relative, found = self.loops.relative, {}
        for joint in (self.cut_joint(name) for name in charts):
            parent = V[:, self.loops.index[joint.parent], :3]
            found[joint.name] = charts[joint.name].bias(
                rates[joint.name], parent, relative(joint, V), relative(joint, A)
            )
        return found

    def gaps(self, q: Array, at: BodyPoses, ends: Array | None = None) -> Array:
        """Closure residuals, and below them those of the couplings, at tree coordinates q, their poses and the ends of
        closures there, see `Loops.ends`. Shape (n, m)."""
        gaps, couplings = self.loops.gaps(at, ends), self.loops.couplings
        return np.concatenate([gaps, couplings.residuals(q)], axis=1) if len(couplings) else gaps

    def jacobian(self, q: Array, at: BodyPoses, ends: Array | None = None) -> Array:
        """Derivative of the gaps. Shape (n, m, n_v)."""
        G, couplings = self.loops.jacobian(at, ends), self.loops.couplings
        return np.concatenate([G, couplings.matrix(q)], axis=1) if len(couplings) else G

    def gap_accelerations(self, motion: tuple[Array, Array, Array], at: BodyPoses, V: Array, A: Array) -> Array:
        """Second derivative of the gaps. Shape (n, m).

        Args:
            motion: Coordinates, velocities and accelerations of the tree. Shape (n, n_v) each.
            V, A: Velocities and accelerations of the bodies, see `Loops.bias`.
        """
        (q, v, a), couplings, bias = motion, self.loops.couplings, self.loops.bias(at, V, A)
        if not len(couplings):
            return bias
        along = (couplings.matrix(q) @ a[..., None])[..., 0] + couplings.bias(q, v)
        return np.concatenate([bias, along], axis=1)

    def closing_rows(self, q: Array, at: BodyPoses, charts: Charts, ends: Array | None = None) -> Array:
        """Derivative of the gaps over one row for each independent coordinate. (n, m + k, n_v)."""
        loops, rows, own = self.loops, [self.jacobian(q, at, ends)], np.eye(q.shape[1])
        sides = {joint.name: (loops.index[joint.parent], loops.index[joint.child]) for joint in loops.cut}
        cut = {name: charts[name].rates(loops.turning(at, *sides[name])) for name in self.given}
        for column, name, i in loops.independent:
            row = cut[name][:, i] if column is None else np.broadcast_to(own[column], q.shape)
            rows.append(row[:, None])
        return np.concatenate(rows, axis=1)

    def load_point(self, load: Load) -> Array:
        """Where a load acts, in its body [m]. Shape (3,)."""
        if load.point is not None:
            return load.point
        i = self.loops.index[load.body]
        return np.asarray(self.tree.com[i - 1]) if i else np.zeros(3)

    def joint_pose(self, joint: Joint, at: BodyPoses) -> JointPose:
        """The frames of a joint on its two bodies."""
        parent, child = self.loops.sides(joint)
        before = placed(at.R[:, parent], at.p[:, parent], joint.parent_frame)
        return JointPose(joint, *before, *placed(at.R[:, child], at.p[:, child], joint.child_frame))


def close_tree(tree: OpenTree, file: LoopsFile) -> ClosedTree:
    """Binds a tree to its loops file.

    Raises:
        ModelFileError: The model lacks what the file names, or has joints of which that knows nothing.
    """
    check_names(tree, file)
    return ClosedTree(tree, file, make_loops(tree, file))


def along_coordinates(at: BodyPoses, wrenches: Array) -> Array:
    """Forces along the tree's coordinates of wrenches on its bodies.

    Args:
        wrenches: Force and moment about the origin of each body. Shape (n, n_body + 1, 6).

    Returns:
        Shape (n, n_v).
    """
    force = wrenches[..., :3]
    about = np.concatenate([wrenches[..., 3:] + cross(at.p, force), force], axis=2)  # the world's origin
    return np.asarray(np.einsum("nxi,nix->ni", at.screws, at.moves.T @ about))
