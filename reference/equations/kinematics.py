"""Kinematics of the spanning tree: poses, unit screws, twists and biases (sections 2 to 4 of the paper).

`tree_pose` and the functions that use it take any scalar type; `pose` and `gaps` take arrays of given coordinates.
`closure` treats closed loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from screwgauge.reference.equations.joint_types import JointPose, Value, locate
from screwgauge.reference.equations.ops import NUMPY, Ops
from screwgauge.reference.equations.screws import lie_bracket, rotation, scale, times, transpose, unit_screws
from screwgauge.reference.graph import Edge, Layout
from screwgauge.reference.mechanism import Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, vee, widest

Freedoms = Sequence[tuple[bool, Array]]
"""For each degree of freedom of a joint: True for a rotation, and the axis in the joint's frame."""


class Coordinates(NamedTuple):
    """Joint coordinates, and sines and cosines of the angles. Shape (..., n_q) each."""

    q: Array
    sine: Array
    cosine: Array


def coordinates(q: Array, ops: Ops) -> Coordinates:
    """Add sines and cosines to joint coordinates."""
    return Coordinates(q, ops.sin(q), ops.cos(q))


class Crossing(NamedTuple):
    """Transition from a frame to the next frame, which is fixed in it or moves along one degree of freedom.

    Attributes:
        R: Orientation of the next frame in this frame; None if they are parallel.
        p: Origin of the next frame if it is fixed in this frame; None if it moves or the origins coincide.
        axis: Axis of the degree of freedom, with equal components in both frames; None if the next frame is fixed.
        travel: Displacement along that axis; None for a rotation.
        column, sign: Column of the coordinate, and -1 if it is measured from the next frame to this frame, else 1.
    """

    R: Array | None
    p: Array | None = None
    axis: Array | None = None
    travel: Any = None
    column: int = -1
    sign: float = 1.0

    @property
    def arm(self) -> Array | None:
        """Vector from this frame's origin to the next frame's origin; None if they coincide. Shape (..., 3)."""
        return self.p if self.travel is None or self.axis is None else scale(self.travel, self.axis)


class Step(NamedTuple):
    """An edge of a spanning tree, walked from the ground outwards.

    Attributes:
        near, far: Bodies before and after the joint; 0 is the ground.
        columns: Columns of the joint's coordinates.
        sign: -1 if the joint is entered from its child, else 1.
        start, end: Transitions from the near body to the joint, and from the joint to the far body.
    """

    edge: Edge
    near: int
    far: int
    columns: list[int]
    sign: float
    start: tuple[Crossing, ...]
    end: tuple[Crossing, ...]


def walk(lay: Layout) -> list[Step]:
    """Return the edges of the tree in outward order, starting at the ground."""
    if "walk" not in lay.kept:
        lay.kept["walk"] = [_step(lay, edge) for edge in lay.edges]
    steps: list[Step] = lay.kept["walk"]
    return steps


def _step(lay: Layout, edge: Edge) -> Step:
    index, joint = lay.mechanism.body_index, edge.joint
    (_, near), (_, far) = joint.sides[::-1] if edge.reverse else joint.sides
    start, end, sign = transition(near, leave=False), transition(far, leave=True), -1.0 if edge.reverse else 1.0
    return Step(edge, index[edge.near], index[edge.far], lay.columns[joint.name], sign, start, end)


def crossings(freedoms: Freedoms, columns: Sequence[int], values: Sequence[Value], sign: float = 1.0) -> list[Crossing]:
    """List the transitions across a joint's degrees of freedom, in reverse if it is entered from its child."""
    found = list[Crossing]()
    for column, (turns, axis), (value, cosine) in zip(columns, freedoms, values, strict=True):
        value = sign * value
        R, travel = (rotation(axis, value, cosine), None) if turns else (None, value)
        found.append(Crossing(R, None, axis, travel, column, sign))
    return found if sign > 0.0 else found[::-1]


@lru_cache(maxsize=4096)
def transition(frame: Frame, *, leave: bool) -> tuple[Crossing, ...]:
    """Return the transition between a body and a frame fixed in the body; empty if they coincide."""
    R, p = (frame.R.T, -frame.p) if leave else (frame.R, frame.p)
    turn = () if np.array_equal(R, np.eye(3)) else (Crossing(R),)
    shift = (Crossing(None, p),) if p.any() else ()
    return (*turn, *shift) if leave else (*shift, *turn)


def traverse(way: Sequence[Crossing], R: Array, p: Array) -> tuple[list[tuple[Array, Array]], Array, Array]:
    """Traverse an edge; return directions and points of axes, eqs. (18)-(20), and the end frame, eq. (24)."""
    lines = list[tuple[Array, Array]]()
    for crossing in way:
        if crossing.axis is not None:
            lines.append((times(R, crossing.axis), p))
        if crossing.travel is not None:
            p = p + scale(crossing.travel, lines[-1][0])
        elif crossing.p is not None:
            p = p + times(R, crossing.p)
        if crossing.R is not None:
            R = R @ crossing.R
    return lines, R, p


@dataclass(frozen=True, eq=False)
class TreePose:
    """Poses of all bodies, computed from the tree joints; body 0 is the ground.

    Attributes:
        R, p: Orientation and origin of each body. Shapes (..., b, 3, 3), (..., b, 3).
        S: Unit screws of the tree coordinates, eq. (5), child relative to parent; zero for coordinates of cut joints.
            Shape (..., n_q, 6).
        crossings: Degrees of freedom crossed by each step of `walk`.
    """

    lay: Layout
    R: Array
    p: Array
    S: Array
    crossings: list[list[Crossing]]

    @cached_property
    def com(self) -> Array:
        """Centres of mass of the moving bodies. Shape (..., b - 1, 3)."""
        return self.p[..., 1:, :] + times(self.R[..., 1:, :, :], self.lay.mechanism.mass_centres)

    def to_world(self, v: Array, body: int | slice) -> Array:
        """Rotate vectors from the axes of one or several bodies to world axes. Shape (..., 3)."""
        return times(self.R[..., body, :, :], v)

    def to_body(self, v: Array, body: int | slice) -> Array:
        """Rotate world vectors to the axes of one or several bodies. Shape (..., 3)."""
        return times(transpose(self.R[..., body, :, :]), v)

    def joint(self, joint: Joint) -> JointPose:
        """Return the frames of a joint on its two bodies."""
        index = self.lay.mechanism.body_index
        sides = [
            locate(self.R[..., index[body], :, :], self.p[..., index[body], :], frame) for body, frame in joint.sides
        ]
        return JointPose(joint, *sides[0], *sides[1])


def zeros(like: Array, *shape: int) -> Array:
    """Return zeros with the leading shape of given vectors. Shape (..., n) -> (..., *shape)."""
    return np.zeros(like.shape[:-1] + shape, dtype=like.dtype)


def joint_values(freedoms: Freedoms, columns: Sequence[int], at: Coordinates) -> list[Value]:
    """Return the coordinate values of one joint."""
    return [
        (at.sine[..., c], at.cosine[..., c]) if turns else (at.q[..., c], None)
        for c, (turns, _) in zip(columns, freedoms, strict=True)
    ]


def joint_screws(joint: Joint, R: Array, p: Array, values: Sequence[Value]) -> tuple[Array, Array, Array]:
    """Return unit screws of a joint, eqs. (18)-(20), shape (..., f, 6), and the frame beyond them, eq. (24).

    Args:
        R, p: Joint frame on the parent.
        values: Value of each coordinate of the joint.
    """
    lines, R_end, p_end = traverse(crossings(joint.freedoms, range(len(values)), values), R, p)
    directions, points = (np.stack(np.broadcast_arrays(*vectors), axis=-2) for vectors in zip(*lines, strict=True))
    return unit_screws(np.array([turns for turns, _ in joint.freedoms]), directions, points), R_end, p_end


def tree_pose(lay: Layout, at: Coordinates) -> TreePose:
    """Compute the poses of all bodies from the tree joints, eq. (24)."""
    n, m, crossed = len(lay.mechanism.body_index), at.q.shape[-1], list[list[Crossing]]()
    R, p, e, r = zeros(at.q, n, 3, 3), zeros(at.q, n, 3), zeros(at.q, m, 3), zeros(at.q, m, 3)
    R[..., 0, :, :] = np.eye(3)
    for step in walk(lay):
        freedoms, here = step.edge.joint.freedoms, (R[..., step.near, :, :], p[..., step.near, :])
        crossed.append(crossings(freedoms, step.columns, joint_values(freedoms, step.columns, at), step.sign))
        way = [*step.start, *crossed[-1], *step.end]
        lines, R[..., step.far, :, :], p[..., step.far, :] = traverse(way, *here)
        for crossing, (direction, place) in zip(crossed[-1], lines, strict=True):
            e[..., crossing.column, :], r[..., crossing.column, :] = direction, place
    return TreePose(lay, R, p, unit_screws(lay.turns, e, r), crossed)


def twists(at: TreePose, w: Array) -> Array:
    """Compute body twists: sums of ``S_i w_i`` along the paths from the ground, eqs. (4), (15). Shape (..., b, 6).

    Args:
        w: Rates of the tree coordinates. Shape (..., n_q).
    """
    V = zeros(w, len(at.lay.mechanism.body_index), 6)
    for _, near, far, columns, sign, *_ in walk(at.lay):
        V[..., far, :] = V[..., near, :] + times(sign * at.S[..., columns, :].swapaxes(-1, -2), w[..., columns])
    return V


def joint_bias(V: Array, terms: Sequence[Array]) -> Any:
    """Sum the Lie brackets of one joint's screws in eq. (44), using eq. (37) for each screw.

    Args:
        V: Twist of the body before the joint. Shape (..., 6).
        terms: ``S_j w_j`` for each screw of the joint.
    """
    bias: Any = 0.0
    for term in terms:
        bias = bias + lie_bracket(V, term)
        V = V + term
    return bias


def pose(lay: Layout, q: Array) -> TreePose:
    """Compute poses from the tree joints, and screws of cut joints from their given coordinates.

    Args:
        q: Joint coordinates; the loops need not be closed. Shape (n, n_q).
    """
    at = tree_pose(lay, coordinates(q, NUMPY))
    for joint in lay.cuts:
        at.S[:, lay.columns[joint.name]] = _cross_cut_joint(at, joint, q)[0]
    return at


def gaps(lay: Layout, q: Array) -> Array:
    """Return how far the tree deviates at each cut joint from the joint's given coordinates.

    Args:
        q: Joint coordinates. Shape (n, n_q).

    Returns:
        Small displacement, as a twist at O, from the child's pose in the tree to the pose that the cut joint defines.
        Shape (n, n_cut, 6).
    """
    at, found = tree_pose(lay, coordinates(q, NUMPY)), np.empty((len(q), len(lay.cuts), 6), dtype=q.dtype)
    for i, joint in enumerate(lay.cuts):
        (_, R, p), frames = _cross_cut_joint(at, joint, q), at.joint(joint)
        turn = vee(R @ frames.R_child.swapaxes(-1, -2))
        # measured at the joint, where the lever arms are short, then moved to O
        found[:, i, :3], found[:, i, 3:] = turn, p - frames.p_child - cross(turn, frames.p_child)
    return found


def _cross_cut_joint(at: TreePose, joint: Joint, q: Array) -> tuple[Array, Array, Array]:
    """Return the screws of a cut joint and the frame beyond them, given its coordinates, see `joint_screws`."""
    frames, columns = at.joint(joint), at.lay.columns[joint.name]
    return joint_screws(
        joint, frames.R_parent, frames.p_parent, joint_values(joint.freedoms, columns, coordinates(q, NUMPY))
    )


_lengths: WeakKeyDictionary[Mechanism, float] = WeakKeyDictionary()


def length(lay: Layout) -> float:
    """Return the largest distance [m] between joint points and centres of mass at home, or 1 if it is zero."""
    if lay.mechanism not in _lengths:
        _lengths[lay.mechanism] = _length(lay)
    return _lengths[lay.mechanism]


def _length(lay: Layout) -> float:
    mechanism = lay.mechanism
    at = tree_pose(lay, coordinates(mechanism.home[None], NUMPY))
    index, R, p = mechanism.body_index, at.R, at.p
    places = [(b.name, b.com) for b in mechanism.bodies]
    places += [(body, frame.p) for joint in mechanism.joints for body, frame in joint.sides]
    return widest([p[0, index[body]] + R[0, index[body]] @ point for body, point in places]) or 1.0
