"""Forces along joint coordinates, as what they exert on the two bodies of each joint."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.layout import Layout
from screwgauge.reference.pose import Pose
from screwgauge.reference.reactions import joint_point
from screwgauge.reference.rotations import Array, cross


def joint_wrenches(lay: Layout, at: Pose, com: Array, tau: Array) -> Array:
    """What forces along the joint coordinates exert on each body (force; moment about its centre of mass).

    A composite joint's force acts along the screw reciprocal to its other freedoms: its power on them is zero.

    Args:
        com: Position of the centres of mass [m]. Shape (n, n_body, 3).
        tau: Forces [N or N m]. Shape (n, n_q).

    Returns:
        Shape (n, 6 n_body).
    """
    index, n = lay.mechanism.body_index, len(tau)
    W = np.zeros((n, len(lay.mechanism.bodies) + 1, 6))
    for joint in lay.mechanism.joints:
        columns = lay.columns[joint.name]
        if not tau[:, columns].any():
            continue
        point = joint_point(joint, at.R[:, index[joint.child]], at.p[:, index[joint.child]])
        turns = np.array([turn for turn, _ in joint.freedoms])
        S = at.S[:, columns]
        axes = np.where(turns[None, :, None], S[..., :3], S[..., 3:])
        moment = _dual(axes[:, turns], tau[:, columns][:, turns])
        force = _dual(axes[:, ~turns], tau[:, columns][:, ~turns])
        for body, sign in ((index[joint.child], 1.0), (index[joint.parent], -1.0)):
            if body:
                W[:, body, :3] += sign * force
                W[:, body, 3:] += sign * (moment + cross(point - com[:, body - 1], force))
    return W[:, 1:].reshape(n, -1)


def _dual(axes: Array, amount: Array) -> Array:
    """The smallest vector whose components along the axes are given. (n, m, 3), (n, m) -> (n, 3)."""
    if not axes.shape[1]:
        return np.zeros((len(axes), 3))
    return (np.linalg.pinv(axes) @ amount[..., None])[..., 0]
