"""Poses of all bodies and unit screws of all joints, for whole trajectories of joint coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.equations.kinematics import TreePose, coordinates, joint_screws, joint_values, tree_pose
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.graph import Edge
from screwgauge.reference.layout import Layout
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, times, vee, widest


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


def pose(lay: Layout, q: Array) -> Pose:
    """Poses and screws for joint coordinates `q`, shape (n, n_q); the loops need not be closed."""
    at = tree_pose(lay, coordinates(q, NUMPY))
    residual = np.empty((len(q), len(lay.tree.cuts), 6), dtype=q.dtype)
    for i, joint in enumerate(lay.tree.cuts):
        residual[:, i], at.S[:, lay.columns[joint.name]] = _across(at, joint, q[:, lay.columns[joint.name]])
    return Pose(q, at.R, at.p, at.S, residual)


def _across(at: TreePose, joint: Joint, q: Array) -> tuple[Array, Array]:
    """Closure residual and screws of a cut joint, see `Pose`. Shape (n, f) -> (n, 6), (n, f, 6)."""
    frames = at.joint(joint)
    values = joint_values(joint.freedoms, range(q.shape[1]), coordinates(q, NUMPY))
    screws, R_via, p_via = joint_screws(joint, frames.R_parent, frames.p_parent, values)
    turn = vee(R_via @ frames.R_child.swapaxes(-1, -2))
    # measured at the joint, where the lever arms are short, then moved to O
    shift = p_via - frames.p_child
    return np.concatenate([turn, shift - cross(turn, frames.p_child)], axis=-1), screws


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
    at = tree_pose(lay, coordinates(mechanism.home[None], NUMPY))
    index, R, p = mechanism.body_index, at.R, at.p
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
