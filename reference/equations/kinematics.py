"""Kinematics of the spanning tree: poses, unit screws, twists and their biases (sections 2 to 4 of the paper).

`tree_pose` and what follows from it take any kind of number; `pose` and `gaps` are for arrays of given coordinates.
Closed loops are in `closure`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from screwgauge.reference.equations.joint_types import JointPose, Value, placed, unplaced
from screwgauge.reference.equations.ops import NUMPY, Ops
from screwgauge.reference.equations.screws import lie_bracket, power, rotation, scale, times, unit_screws
from screwgauge.reference.graph import Edge, Layout
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, vee, widest

Freedoms = Sequence[tuple[bool, Array]]
"""For each freedom of a joint: whether it turns, and its axis in the joint's frame."""


class Coordinates(NamedTuple):
    """Joint coordinates with the sines and cosines of the angles among them. Shape (..., n_q) each."""

    q: Array
    sine: Array
    cosine: Array


def coordinates(q: Array, ops: Ops) -> Coordinates:
    """Coordinates whose sines and cosines follow from them."""
    return Coordinates(q, ops.sin(q), ops.cos(q))


class Step(NamedTuple):
    """An edge of a spanning tree as it is walked from ground.

    Attributes:
        near, far: Bodies before and after the joint, 0 being ground.
        columns: Its coordinates.
        sign: -1 where the joint is entered from its child.
        freedoms: (turns, axis) of each.
    """

    edge: Edge
    near: int
    far: int
    columns: list[int]
    sign: float
    freedoms: Freedoms


def walk(lay: Layout) -> list[Step]:
    """The edges of the tree from ground outward."""
    if "walk" not in lay.kept:
        index = lay.mechanism.body_index
        lay.kept["walk"] = [
            Step(
                e,
                index[e.near],
                index[e.far],
                lay.columns[e.joint.name],
                -1.0 if e.reverse else 1.0,
                e.joint.freedoms,
            )
            for e in lay.edges
        ]
    steps: list[Step] = lay.kept["walk"]
    return steps


@dataclass(frozen=True, eq=False)
class TreePose:
    """Where all bodies are by the joints of the tree; body 0 is ground.

    Attributes:
        R, p: Orientation and origin of each body. Shapes (..., b, 3, 3), (..., b, 3).
        S: Unit screws of the tree's coordinates, eq. (5), child relative to parent; zero for those of cut joints.
            Shape (..., n_q, 6).
    """

    lay: Layout
    R: Array
    p: Array
    S: Array

    @cached_property
    def com(self) -> Array:
        """Centres of mass of the moving bodies. Shape (..., b - 1, 3)."""
        local = np.array([body.com for body in self.lay.mechanism.bodies])
        return self.p[..., 1:, :] + times(self.R[..., 1:, :, :], local)

    def joint(self, joint: Joint) -> JointPose:
        """The frames of a joint on its two bodies."""
        index = self.lay.mechanism.body_index
        sides = [
            placed(self.R[..., index[body], :, :], self.p[..., index[body], :], frame) for body, frame in joint.sides
        ]
        return JointPose(joint, *sides[0], *sides[1])


def zeros(like: Array, *shape: int) -> Array:
    """Zeros for each sample of vectors. Shape (..., n) -> (..., *shape)."""
    return np.zeros(like.shape[:-1] + shape, dtype=like.dtype)


def joint_values(freedoms: Freedoms, columns: Sequence[int], at: Coordinates) -> list[Value]:
    """The coordinates of one joint."""
    return [
        (at.sine[..., c], at.cosine[..., c]) if turns else (at.q[..., c], None)
        for c, (turns, _) in zip(columns, freedoms, strict=True)
    ]


def joint_axes(
    freedoms: Freedoms, R: Array, p: Array, values: Sequence[Value], *, reverse: bool = False
) -> tuple[list[Array], list[Array], Array, Array]:
    """Directions and points of the axes of a joint's freedoms, eqs. (18)-(20), and its frame beyond them, eq. (24).

    Args:
        R, p: Its frame on the side from which it is entered.
        values: Of each freedom.
        reverse: Whether it is entered from its child.
    """
    directions, points, steps = list[Array](), list[Array](), [*zip(freedoms, values, strict=True)]
    for (turns, axis), (value, cosine) in steps[::-1] if reverse else steps:
        e, value = times(R, axis), -value if reverse else value
        directions.append(e)
        points.append(p)
        if turns:
            R = R @ rotation(axis, value, cosine)
        else:
            p = p + scale(value, e)
    order = -1 if reverse else 1
    return directions[::order], points[::order], R, p


def joint_screws(joint: Joint, R: Array, p: Array, values: Sequence[Value]) -> tuple[Array, Array, Array]:
    """Unit screws of a joint's freedoms, eqs. (18)-(20), shape (..., f, 6), and its frame beyond, see `joint_axes`."""
    directions, points, R_end, p_end = joint_axes(joint.freedoms, R, p, values)
    turns = np.array([turns for turns, _ in joint.freedoms])
    lines = (np.stack(np.broadcast_arrays(*vectors), axis=-2) for vectors in (directions, points))
    return unit_screws(turns, *lines), R_end, p_end


def tree_pose(lay: Layout, at: Coordinates) -> TreePose:
    """The pose of all bodies by the joints of the tree, eq. (24)."""
    n = len(lay.mechanism.body_index)
    R, p = zeros(at.q, n, 3, 3), zeros(at.q, n, 3)
    e, r = zeros(at.q, at.q.shape[-1], 3), zeros(at.q, at.q.shape[-1], 3)
    R[..., 0, :, :] = np.eye(3)
    for edge, near, far, columns, _, freedoms in walk(lay):
        joint = edge.joint
        (_, start), (_, end) = joint.sides[::-1] if edge.reverse else joint.sides
        values = joint_values(freedoms, columns, at)
        entered = placed(R[..., near, :, :], p[..., near, :], start)
        directions, points, R_end, p_end = joint_axes(freedoms, *entered, values, reverse=edge.reverse)
        for c, direction, point in zip(columns, directions, points, strict=True):
            e[..., c, :], r[..., c, :] = direction, point
        R[..., far, :, :], p[..., far, :] = unplaced(R_end, p_end, end)
    return TreePose(lay, R, p, unit_screws(lay.turns, e, r))


def twists(at: TreePose, w: Array) -> Array:
    """Twists of the bodies, sums of ``S_i w_i`` along their paths, eqs. (4), (15). Shape (..., b, 6).

    Args:
        w: Rates of the tree's coordinates. Shape (..., n_q).
    """
    V = zeros(w, len(at.lay.mechanism.body_index), 6)
    for _, near, far, columns, sign, _ in walk(at.lay):
        V[..., far, :] = V[..., near, :] + times(sign * at.S[..., columns, :].swapaxes(-1, -2), w[..., columns])
    return V


def bias_screws(at: TreePose, w: Array, V: Array) -> Array:
    """Acceleration screws of the bodies without joint accelerations, ``w^T S_L w`` of eqs. (42)-(44), (48).

    The sum over i < j of [S_i w_i, S_j w_j] is the sum over j of [V before j, S_j w_j].

    Returns:
        Shape (..., b, 6).
    """
    A = zeros(w, V.shape[-2], 6)
    for edge, near, far, columns, sign, _ in walk(at.lay):
        terms = [scale(sign * w[..., c], at.S[..., c, :]) for c in columns]
        bias = joint_bias(V[..., near, :], terms[::-1] if edge.reverse else terms)
        A[..., far, :] = A[..., near, :] + bias
    return A


def joint_bias(V: Array, terms: Sequence[Array]) -> Any:
    """The part of one joint in that sum, by eq. (37) for each freedom.

    Args:
        V: Twist of the body before it. Shape (..., 6).
        terms: ``S_j w_j`` of its freedoms.
    """
    bias: Any = 0.0
    for term in terms:
        bias = bias + lie_bracket(V, term)
        V = V + term
    return bias


def transmitted(lay: Layout, wrenches: Array) -> dict[str, Array]:
    """Wrench of parent on child that each joint of the tree transmits: the left sides of eqs. (53)-(55).

    Args:
        wrenches: What each body needs. Shape (..., b, 6).

    Returns:
        Joint -> shape (..., 6).
    """
    total, through = wrenches.copy(), dict[str, Array]()
    for edge, near, far, _, sign, _ in reversed(walk(lay)):
        through[edge.joint.name] = sign * total[..., far, :]
        total[..., near, :] = total[..., near, :] + total[..., far, :]
    return through


def forces_along(at: TreePose, wrenches: Array) -> Array:
    """Forces along the tree that give bodies these wrenches, by virtual power. (..., b, 6) -> (..., n_q)."""
    tau = zeros(wrenches[..., 0], at.S.shape[-2])
    for name, W in transmitted(at.lay, wrenches).items():
        for c in at.lay.columns[name]:
            tau[..., c] = power(W, at.S[..., c, :])
    return tau


def pose(lay: Layout, q: Array) -> TreePose:
    """Poses by the joints of the tree, and screws of all joints, those of cut joints by their own coordinates.

    Args:
        q: Joint coordinates; the loops need not be closed. Shape (n, n_q).
    """
    at = tree_pose(lay, coordinates(q, NUMPY))
    for joint in lay.cuts:
        at.S[:, lay.columns[joint.name]] = _beyond(at, joint, q)[0]
    return at


def gaps(lay: Layout, q: Array) -> Array:
    """How far cut joints are from where their own coordinates have them: a check of coordinates that are given.

    Args:
        q: Joint coordinates. Shape (n, n_q).

    Returns:
        Small displacement, as a twist at O, from the child's pose by the tree to that by the cut joint. Shape
        (n, n_cut, 6).
    """
    at, found = tree_pose(lay, coordinates(q, NUMPY)), np.empty((len(q), len(lay.cuts), 6), dtype=q.dtype)
    for i, joint in enumerate(lay.cuts):
        (_, R, p), frames = _beyond(at, joint, q), at.joint(joint)
        turn = vee(R @ frames.R_child.swapaxes(-1, -2))
        # measured at the joint, where the lever arms are short, then moved to O
        found[:, i, :3], found[:, i, 3:] = turn, p - frames.p_child - cross(turn, frames.p_child)
    return found


def _beyond(at: TreePose, joint: Joint, q: Array) -> tuple[Array, Array, Array]:
    """Screws of a cut joint and its frame beyond them by its own coordinates, see `joint_screws`."""
    frames, columns = at.joint(joint), at.lay.columns[joint.name]
    return joint_screws(
        joint, frames.R_parent, frames.p_parent, joint_values(joint.freedoms, columns, coordinates(q, NUMPY))
    )


_lengths: WeakKeyDictionary[Mechanism, float] = WeakKeyDictionary()


def length(lay: Layout) -> float:
    """Largest distance [m] between joint points and centres of mass at the home pose, 1 if there is none."""
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
