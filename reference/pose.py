"""Poses of all bodies and unit screws of all joints by joint coordinates, whether or not these close the loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.equations.kinematics import TreePose, coordinates, joint_screws, joint_values, tree_pose
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.graph import Edge, Layout
from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, vee, widest


@dataclass(frozen=True, eq=False)
class Pose(TreePose):
    """Where everything is, for n samples. Body 0 is ground.

    Attributes:
        R, p: Orientation and origin of each body in the world. Shapes (n, b, 3, 3), (n, b, 3).
        S: Unit screws, child relative to parent, eqs. (18)-(20), those of cut joints by their own coordinates.
            Shape (n, n_q, 6).
        q: Joint coordinates [rad or m]. Shape (n, n_q).
        residual: Closure residual: for each cut joint, the small displacement (as a twist at O) from the child's pose
            as the tree gives it to the pose as the cut joint gives it. Zero where loops close. Shape (n, n_cut, 6).
    """

    q: Array
    residual: Array

    def rows(self, rows: Sequence[int] | NDArray[np.intp]) -> Pose:
        """The same for some of the samples."""
        at = np.asarray(rows)
        return Pose(self.lay, self.R[at], self.p[at], self.S[at], self.q[at], self.residual[at])

    @property
    def loop_matrix(self) -> Array:
        """Screws of all loops, six rows a loop: ``G w = 0`` closes them, eq. (15). Shape (n, 6 n_cut, n_q)."""
        G = self.S[:, None] * self.lay.loop[None, :, :, None]
        return np.asarray(G.transpose(0, 1, 3, 2).reshape(len(self.q), -1, self.q.shape[1]))

    @cached_property
    def constraint_matrix(self) -> Array:
        """The same over the rows of the couplings: what velocities satisfy. Shape (n, 6 n_cut + n_coupling, n_q)."""
        couplings = self.lay.mechanism.coupling_rows
        return np.concatenate([self.loop_matrix, couplings.matrix(self.q)], axis=1)

    @property
    def closing_matrix(self) -> Array:
        """The same over the selection of y, ``[G; E] w = [0; yd]``. Shape (n, 6 n_cut + n_coupling + k, n_q)."""
        selection = np.eye(self.q.shape[1], dtype=self.q.dtype)[self.lay.mechanism.independent_columns]
        E = np.broadcast_to(selection, (len(self.q), *selection.shape))
        return np.concatenate([self.constraint_matrix, E], axis=1)

    def chain_screws(self, chain: tuple[Edge, ...]) -> Array:
        """Screw matrix S of a serial chain, eqs. (5), (18)-(20). Shape (n, 6, n_chain)."""
        signs = [(edge, -1 if edge.reverse else 1) for edge in chain]
        screws = [sign * self.S[:, i] for edge, sign in signs for i in self.lay.columns[edge.joint.name][::sign]]
        return np.stack(screws, axis=2)


def pose(lay: Layout, q: Array) -> Pose:
    """Poses and screws for joint coordinates `q`, shape (n, n_q); the loops need not be closed."""
    at = tree_pose(lay, coordinates(q, NUMPY))
    residual = np.empty((len(q), len(lay.cuts), 6), dtype=q.dtype)
    for i, joint in enumerate(lay.cuts):
        residual[:, i], at.S[:, lay.columns[joint.name]] = _across(at, joint, q[:, lay.columns[joint.name]])
    return Pose(lay, at.R, at.p, at.S, q, residual)


def _across(at: TreePose, joint: Joint, q: Array) -> tuple[Array, Array]:
    """Closure residual and screws of a cut joint, see `Pose`. Shape (n, f) -> (n, 6), (n, f, 6)."""
    frames = at.joint(joint)
    values = joint_values(joint.freedoms, range(q.shape[1]), coordinates(q, NUMPY))
    screws, R_via, p_via = joint_screws(joint, frames.R_parent, frames.p_parent, values)
    turn = vee(R_via @ frames.R_child.swapaxes(-1, -2))
    # measured at the joint, where the lever arms are short, then moved to O
    shift = p_via - frames.p_child
    return np.concatenate([turn, shift - cross(turn, frames.p_child)], axis=-1), screws


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
