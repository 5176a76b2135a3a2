"""Poses of all bodies and unit screws of all joints, for whole trajectories of joint coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.crossing import Crossing, crossing
from screwgauge.reference.graph import Edge, SpanningTree, spanning_tree
from screwgauge.reference.mechanism import GROUND, Frame, Mechanism
from screwgauge.reference.rotations import Array, cross, skew, times, vee, widest


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where everything is, for n samples. Body 0 is ground.

    Attributes:
        q: Joint coordinates [rad or m]. Shape (n, n_q).
        R, p: Orientation and origin of each body in the world. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        S: Unit screws, child relative to parent, eqs. (18)-(20). Shape (n, n_q, 6).
        residual: Closure residual: for each cut joint, the small displacement (as a twist at O) from the child's pose
            as the tree gives it to the pose as the cut joint gives it. Zero where loops close. Shape (n, n_cut, 6).
    """

    q: Array
    R: Array
    p: Array
    S: Array
    residual: Array

    def rows(self, rows: Sequence[int] | NDArray[np.intp]) -> Pose:
        """The same for some of the samples."""
        at = np.asarray(rows)
        return Pose(self.q[at], self.R[at], self.p[at], self.S[at], self.residual[at])


@dataclass(frozen=True, eq=False)
class Layout:
    """A mechanism with its spanning tree and the paths that follow from it.

    The tree keeps the joints of the independent coordinates, so that these are unknowns of the tree itself.

    Attributes:
        path: +1 or -1 where a coordinate lies on the tree path from ground to a body. Shape (n_body + 1, n_q).
        loop: The same for the loop of each cut joint: parent's path + joint - child's path. (n_cut, n_q).
        kept: What was made of it once, as by `loops.loop_equations`.
        last: Coordinates of the tree, as bytes -> what `tree_pose` gave for these, of the last single pose.
    """

    mechanism: Mechanism
    tree: SpanningTree
    columns: dict[str, list[int]]
    path: Array
    loop: Array
    kept: dict[tuple[int, ...] | str, Any] = field(default_factory=dict)
    last: dict[bytes, tuple[Array, Array, Array]] = field(default_factory=dict)

    @cached_property
    def turns(self) -> NDArray[np.bool_]:
        """Which coordinates are angles. Shape (n_q,)."""
        return np.array([turn for joint in self.mechanism.joints for turn, _ in joint.freedoms])

    @cached_property
    def _turning(self) -> tuple[Array, Array]:
        axes = np.array([axis for joint in self.mechanism.joints for _, axis in joint.freedoms])
        K = skew(axes)
        return K, K @ K

    def moved(self, q: Array) -> tuple[Array, Array]:
        """Rotation by each angle about its own axis, see `rotation`, and way along each slide, as they are walked over.

        Args:
            q: Joint coordinates. Shape (n, n_q).

        Returns:
            Shapes (n, n_q, 3, 3), one for slides, and (n, n_q), zero for angles.
        """
        (K, K2), walked = self._turning, self._sign * q
        angle = np.where(self.turns, walked, 0.0)[..., None, None]
        turned = np.eye(3, dtype=K.dtype) + np.sin(angle) * K + 2.0 * np.sin(0.5 * angle) ** 2 * K2
        return turned, np.where(self.turns, 0.0, walked)

    @cached_property
    def _sign(self) -> Array:
        """-1 for the coordinates of joints that the tree walks over from child to parent. Shape (n_q,)."""
        sign = np.ones(len(self.turns), dtype=self.path.dtype)
        for edge in self.tree.edges:
            if edge.reverse:
                sign[self.columns[edge.joint.name]] = -1.0
        return sign

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """The joints of the tree, those first that are next to ground."""
        depth, levels = {GROUND: 0}, dict[int, list[Edge]]()
        for edge in self.tree.edges:
            depth[edge.far] = depth[edge.near] + 1
            levels.setdefault(depth[edge.far], []).append(edge)
        return tuple(self._crossing(levels[level]) for level in sorted(levels))

    @cached_property
    def cut_crossing(self) -> Crossing:
        """The cut joints."""
        return self._crossing([Edge(joint, joint.parent, joint.child, False) for joint in self.tree.cuts])

    def _crossing(self, edges: Sequence[Edge]) -> Crossing:
        return crossing(edges, self.mechanism.body_index, self.columns, self.turns)

    @cached_property
    def cut_columns(self) -> list[int]:
        """Coordinates of the cut joints, joint by joint."""
        return [column for joint in self.tree.cuts for column in self.columns[joint.name]]

    @cached_property
    def tree_columns(self) -> list[int]:
        """The other coordinates."""
        return [column for column in range(self.path.shape[1]) if column not in self.cut_columns]

    @cached_property
    def sides(self) -> tuple[Side, Side]:
        """Parent and child sides of the cut joints."""
        index, cuts = self.mechanism.body_index, self.tree.cuts
        return (
            _side([index[j.parent] for j in cuts], [j.parent_frame for j in cuts]),
            _side([index[j.child] for j in cuts], [j.child_frame for j in cuts]),
        )


#: Bodies of some joints, and the joints' frames in them: indices (c,), rotations (c, 3, 3), points (c, 3).
Side = tuple[list[int], Array, Array]


def _side(bodies: list[int], frames: Sequence[Frame]) -> Side:
    R, p = np.array([f.R for f in frames]), np.array([f.p for f in frames])
    return bodies, R.reshape(-1, 3, 3), p.reshape(-1, 3)


def side_frames(side: Side, R: Array, p: Array) -> tuple[Array, Array]:
    """World frames of the cut joints on one of their sides. Shapes (n, n_cut, 3, 3), (n, n_cut, 3)."""
    body, R_joint, p_joint = side
    R = np.asarray(R[:, body])
    return R @ R_joint, p[:, body] + times(R, p_joint)


def layout(mechanism: Mechanism, tree: SpanningTree | None = None) -> Layout:
    """Spanning tree, paths and loops of a mechanism.

    Args:
        tree: Another one than that which keeps the joints of the independent coordinates.
    """
    if tree is None:
        chosen = {*mechanism.independent.values()}
        tree = spanning_tree(mechanism, [j.name for j in mechanism.joints if chosen & {*j.coordinates}])
    index = mechanism.body_index
    columns = {joint.name: mechanism.columns(joint.coordinates) for joint in mechanism.joints}
    path = tree_path(mechanism, tree)
    loop = np.zeros((len(tree.cuts), path.shape[1]), dtype=path.dtype)
    for row, joint in zip(loop, tree.cuts, strict=True):
        row += path[index[joint.parent]] - path[index[joint.child]]
        row[columns[joint.name]] = 1.0
    return Layout(mechanism, tree, columns, path, loop)


def tree_path(mechanism: Mechanism, tree: SpanningTree) -> Array:
    """+1 or -1 where a coordinate lies on the way from ground to a body. Shape (n_body + 1, n_q)."""
    index = mechanism.body_index
    path = np.zeros((len(index), len(mechanism.coordinates)), dtype=mechanism.home.dtype)
    for edge in tree.edges:
        path[index[edge.far]] = path[index[edge.near]]
        path[index[edge.far], mechanism.columns(edge.joint.coordinates)] = -1.0 if edge.reverse else 1.0
    return path


def place(R: Array, p: Array, frame: Frame) -> tuple[Array, Array]:
    """Pose of a frame that is fixed in a body. Shapes (..., 3, 3), (..., 3)."""
    return R @ frame.R, p + R @ frame.p


def unplace(R: Array, p: Array, frame: Frame) -> tuple[Array, Array]:
    """Pose of the body in which a frame of known pose is fixed, the inverse of `place`."""
    R_body = R @ frame.R.T
    return R_body, p - R_body @ frame.p


def tree_pose(lay: Layout, q: Array) -> tuple[Array, Array, Array]:
    """Orientations, origins and screws (see `Pose`) by the joints of the tree; screws of cut joints are zero.

    Of a single pose they are kept: where Newton's method ends, velocities and accelerations are asked for next.
    """
    if len(q) > 1:
        return _tree_pose(lay, q)
    key = q[:, lay.tree_columns].tobytes()
    made = lay.last.get(key)
    if made is None:
        made = _tree_pose(lay, q)
        for array in made:
            array.setflags(write=False)
        lay.last.clear()
        lay.last[key] = made
    return made


def _tree_pose(lay: Layout, q: Array) -> tuple[Array, Array, Array]:
    n, n_body = len(q), len(lay.mechanism.body_index)
    R = np.empty((n, n_body, 3, 3), dtype=q.dtype)
    p = np.zeros((n, n_body, 3), dtype=q.dtype)
    directions, points = np.zeros((2, n, q.shape[1], 3), dtype=q.dtype)
    R[:, 0] = np.eye(3)
    moved = lay.moved(q)
    for joints in lay.crossings:
        R[:, joints.far], p[:, joints.far] = joints.walk(R, p, moved, directions, points)
    return R, p, _screws(lay, directions, points)


def _screws(lay: Layout, directions: Array, points: Array) -> Array:
    """Unit screws, eqs. (2), (18). Shapes (n, n_q, 3), (n, n_q, 3) -> (n, n_q, 6)."""
    turns = lay.turns[None, :, None]
    S = np.zeros((*directions.shape[:2], 6), dtype=directions.dtype)
    S[..., :3] = np.where(turns, directions, 0.0)
    S[..., 3:] = np.where(turns, cross(points, directions), directions)
    return S


def pose(lay: Layout, q: Array) -> Pose:
    """Poses and screws for joint coordinates `q`, shape (n, n_q); the loops need not be closed."""
    return whole_pose(lay, q, *tree_pose(lay, q))


def whole_pose(lay: Layout, q: Array, R: Array, p: Array, S: Array) -> Pose:
    """The same from what `tree_pose` gives, if that is known: adds the cut joints."""
    n = len(q)
    residual = np.empty((n, len(lay.tree.cuts), 6), dtype=q.dtype)
    if not lay.tree.cuts:
        return Pose(q, R, p, S, residual)
    directions, points = np.zeros((2, n, q.shape[1], 3), dtype=q.dtype)
    R_via, p_via = lay.cut_crossing.walk(R, p, lay.moved(q), directions, points)
    cut = lay.cut_columns
    S = S.copy()
    S[:, cut] = _screws(lay, directions, points)[:, cut]
    child, at_child = lay.sides[1][:3:2]
    turn = vee(R_via @ R[:, child].swapaxes(-1, -2))
    # measured at the joint, where the lever arms are short, then moved to O
    at = p[:, child] + times(R[:, child], at_child)
    shift = p_via + times(R_via, at_child) - at
    residual[..., :3], residual[..., 3:] = turn, shift - cross(turn, at)
    return Pose(q, R, p, S, residual)


def centres_of_mass(lay: Layout, at: Pose) -> Array:
    """Where the bodies' centres of mass are [m]. Shape (n, n_body, 3)."""
    com = np.stack([body.com for body in lay.mechanism.bodies])
    return np.asarray(at.p[:, 1:] + times(at.R[:, 1:], com))


_lengths: WeakKeyDictionary[Mechanism, float] = WeakKeyDictionary()


def length(lay: Layout) -> float:
    """Largest distance [m] between joint points and centres of mass at the home pose, 1 if there is none."""
    if lay.mechanism not in _lengths:
        _lengths[lay.mechanism] = _length(lay)
    return _lengths[lay.mechanism]


def _length(lay: Layout) -> float:
    mechanism = lay.mechanism
    R, p, _ = tree_pose(lay, mechanism.home[None])
    index = mechanism.body_index
    places = [(b.name, b.com) for b in mechanism.bodies]
    places += [(body, frame.p) for joint in mechanism.joints for body, frame in joint.sides]
    return widest([p[0, index[body]] + R[0, index[body]] @ point for body, point in places]) or 1.0


def loop_matrix(lay: Layout, at: Pose) -> Array:
    """Screws of all loops, six rows a loop: ``G w = 0`` closes them. Shape (n, 6 n_cut, n_q)."""
    G = at.S[:, None] * lay.loop[None, :, :, None]
    return np.asarray(G.transpose(0, 1, 3, 2).reshape(len(at.q), -1, at.q.shape[1]))


def constraint_matrix(lay: Layout, at: Pose) -> Array:
    """The same over the rows of the couplings: what velocities must satisfy. Shape (n, 6 n_cut + n_coupling, n_q)."""
    G, couplings = loop_matrix(lay, at), lay.mechanism.coupling_rows
    return np.concatenate([G, couplings.matrix(at.q)], axis=1) if len(couplings) else G


def chain_screws(lay: Layout, chain: tuple[Edge, ...], at: Pose) -> Array:
    """Screw matrix S of a serial chain, eqs. (5), (18)-(20). Shape (n, 6, n_chain)."""
    signs = [(edge, -1 if edge.reverse else 1) for edge in chain]
    screws = [sign * at.S[:, i] for edge, sign in signs for i in lay.columns[edge.joint.name][::sign]]
    return np.stack(screws, axis=2)
