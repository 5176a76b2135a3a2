"""Poses of all bodies and unit screws of all joints, for whole trajectories of joint coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import screws
from screwgauge.reference.graph import Edge, SpanningTree, spanning_tree
from screwgauge.reference.mechanism import Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, rotation, vee


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where everything is, for n samples. Body 0 is ground.

    Attributes:
        q: Joint coordinates [rad or m]. Shape (n, n_q).
        R, p: Orientation and origin of each body in the world. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        S: Unit screws, child relative to parent, eqs. (18)-(20). Shape (n, n_q, 6).
        gap: For each cut joint, the small displacement (as a twist at O) from the child's pose as the tree gives
            it to the pose as the cut joint gives it. Zero where loops close. Shape (n, n_cut, 6).
    """

    q: Array
    R: Array
    p: Array
    S: Array
    gap: Array


@dataclass(frozen=True, eq=False)
class Layout:
    """A mechanism with its spanning tree and the paths that follow from it.

    Attributes:
        path: +1 or -1 where a coordinate lies on the tree path from ground to a body. Shape (n_body + 1, n_q).
        loop: The same for the loop of each cut joint: parent's path + joint - child's path. (n_cut, n_q).
    """

    mechanism: Mechanism
    tree: SpanningTree
    columns: dict[str, list[int]]
    path: Array
    loop: Array


def layout(mechanism: Mechanism) -> Layout:
    """Spanning tree, paths and loops of a mechanism."""
    tree, index = spanning_tree(mechanism), mechanism.body_index
    columns = {joint.name: mechanism.columns(joint.coordinates) for joint in mechanism.joints}
    path = np.zeros((len(index), len(mechanism.coordinates)), dtype=mechanism.home.dtype)
    for edge in tree.edges:
        path[index[edge.far]] = path[index[edge.near]]
        path[index[edge.far], columns[edge.joint.name]] = -1.0 if edge.reverse else 1.0
    loop = np.zeros((len(tree.cuts), path.shape[1]), dtype=path.dtype)
    for row, joint in zip(loop, tree.cuts, strict=True):
        row += path[index[joint.parent]] - path[index[joint.child]]
        row[columns[joint.name]] = 1.0
    return Layout(mechanism, tree, columns, path, loop)


def place(R: Array, p: Array, frame: Frame) -> tuple[Array, Array]:
    """Pose of a frame that is fixed in a body. Shapes (..., 3, 3), (..., 3)."""
    return R @ frame.R, p + R @ frame.p


def unplace(R: Array, p: Array, frame: Frame) -> tuple[Array, Array]:
    """Pose of the body in which a frame of known pose is fixed, the inverse of `place`."""
    R_body = R @ frame.R.T
    return R_body, p - R_body @ frame.p


def across(
    joint: Joint, q: Array, R: Array, p: Array, *, reverse: bool = False
) -> tuple[Array, Array, list[Array]]:
    """Walks over a joint from the pose of one body to that of the other (eq. 24, for any joint).

    Args:
        q: Its coordinates. Shape (n, n_freedom).
        R, p: Pose of its parent (of its child, if `reverse`). Shapes (n, 3, 3), (n, 3).

    Returns:
        Pose of the other body, and the unit screw of each freedom in the joint's own order, (n, 6) each.
    """
    start, end = (
        (joint.child_frame, joint.parent_frame) if reverse else (joint.parent_frame, joint.child_frame)
    )
    R, p = place(R, p, start)
    found: list[tuple[int, Array]] = []
    steps = list(enumerate(joint.freedoms))
    for i, (turns, axis) in reversed(steps) if reverse else steps:
        e = R @ axis
        found.append((i, screws.revolute(e, p) if turns else screws.prismatic(e)))
        amount = -q[:, i] if reverse else q[:, i]
        if turns:
            R = R @ rotation(axis, amount)
        else:
            p = p + e * amount[:, None]
    R, p = unplace(R, p, end)
    return R, p, [S for _, S in sorted(found, key=lambda item: item[0])]


def pose(lay: Layout, q: Array) -> Pose:
    """Poses and screws for joint coordinates `q`, shape (n, n_q); the loops need not be closed."""
    n, index = len(q), lay.mechanism.body_index
    R = np.empty((n, len(index), 3, 3), dtype=q.dtype)
    p = np.zeros((n, len(index), 3), dtype=q.dtype)
    S = np.empty((n, q.shape[1], 6), dtype=q.dtype)
    R[:, 0] = np.eye(3)
    for edge in lay.tree.edges:
        near, far, columns = index[edge.near], index[edge.far], lay.columns[edge.joint.name]
        R[:, far], p[:, far], found = across(
            edge.joint, q[:, columns], R[:, near], p[:, near], reverse=edge.reverse
        )
        S[:, columns] = np.stack(found, axis=1)
    gap = np.empty((n, len(lay.tree.cuts), 6), dtype=q.dtype)
    for c, joint in enumerate(lay.tree.cuts):
        parent, child, columns = index[joint.parent], index[joint.child], lay.columns[joint.name]
        R_via, p_via, found = across(joint, q[:, columns], R[:, parent], p[:, parent])
        S[:, columns] = np.stack(found, axis=1)
        turn = vee(R_via @ R[:, child].swapaxes(1, 2))
        # measured at the joint, where the lever arms are short, then moved to O
        at = p[:, child] + R[:, child] @ joint.child_frame.p
        shift = p_via + R_via @ joint.child_frame.p - at
        gap[:, c] = np.concatenate([turn, shift - np.cross(turn, at)], axis=1)
    return Pose(q, R, p, S, gap)


def loop_matrix(lay: Layout, at: Pose) -> Array:
    """Screws of all loops, six rows a loop: ``G w = 0`` closes them. Shape (n, 6 n_cut, n_q)."""
    G = at.S[:, None] * lay.loop[None, :, :, None]
    return np.asarray(G.transpose(0, 1, 3, 2).reshape(len(at.q), -1, at.q.shape[1]))


def chain_screws(lay: Layout, chain: tuple[Edge, ...], at: Pose) -> Array:
    """Screw matrix S of a serial chain, eqs. (5), (18)-(20). Shape (n, 6, n_chain)."""
    columns = [
        (column, -1.0 if edge.reverse else 1.0)
        for edge in chain
        for column in (lay.columns[edge.joint.name][::-1] if edge.reverse else lay.columns[edge.joint.name])
    ]
    return np.stack([sign * at.S[:, column] for column, sign in columns], axis=2)
