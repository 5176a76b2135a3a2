"""Coordinates of the joints that close the loops, read from the poses of their two bodies."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.equations.joint_types import JointPose
from screwgauge.reference.equations.kinematics import coordinates, tree_pose
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.equations.screws import dot, transpose
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import KINDS
from screwgauge.reference.rotations import Array, nearest_angles, triad, triad_angles


def read(lay: Layout, guess: Array, *, near: bool = True) -> Array:
    """Joint coordinates in which those of the cut joints are what the poses of the bodies by the tree say.

    Unlike `joint_types.cut_coordinates` this goes through gimbal lock: of all angles that mean the same, those
    nearest to a guess are taken, whichever triple they are of.

    Args:
        guess: Joint coordinates. Shape (n, n_q).
        near: Whether those of the cut joints are to be near the guess, else within half a turn.
    """
    q = guess.copy()
    if lay.cuts:
        at = tree_pose(lay, coordinates(guess, NUMPY))
        for joint in lay.cuts:
            columns = lay.columns[joint.name]
            q[:, columns] = _values(at.joint(joint), guess[:, columns], near=near)
    return q


def _values(at: JointPose, guess: Array, *, near: bool) -> Array:
    """Coordinates of one joint. Shape (n, f) -> (n, f)."""
    found, turns = guess.copy(), np.array(KINDS[at.joint.kind])
    if turns.any():
        few = at.joint.angles < 3
        angles = triad_angles(transpose(at.R_parent) @ at.R_child, triad(at.joint.axes), few=few)[..., : turns.sum()]
        found[:, turns] = nearest_angles(angles, guess[:, turns])[0] if near else angles
    if not turns.all():
        found[:, ~turns] = np.stack([dot(e, at.p_child - at.p_parent) for e in at.slides], axis=1)
    return found


def follow_cut_joints(lay: Layout, q: Array, near: Array) -> Array:
    """Joint coordinates along a way, those of each cut joint next to those of the pose before.

    Args:
        q: Joint coordinates, of which those of the tree are looked at. Shape (v, n_q).
        near: Those of the pose before the first. Shape (n_q,).
    """
    if not lay.cuts:
        return q
    q = read(lay, q, near=False)
    for joint in lay.cuts:
        turning = [c for c in lay.columns[joint.name] if lay.turns[c]]
        before = near[turning]
        for row in q:
            before = row[turning] = nearest_angles(row[turning], before)[0]
    return q
