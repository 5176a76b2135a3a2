"""Compute joint reactions from constraint multipliers, for engines that use absolute body coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.engines.kit.closing import Placement
from screwgauge.engines.kit.poses import joint_frames
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Joint, Mechanism, by_role
from screwgauge.reference.rotations import Array, across_direction, skew

Rows = Sequence[int]
"""Indices of the gaps of a joint."""


def unit_wrenches(mechanism: Mechanism, joint: Joint, at: Placement, rows: Rows) -> Array:
    """Return a joint's wrench on its child per unit multiplier: force, then moment about the joint's child-side point.

    Args:
        rows: Indices of the joint's gaps. Each coordinate on which these gaps depend must move only one body.

    Returns:
        Wrenches in world axes. Shape (n, 6, m_joint).
    """
    parent, child = (mechanism.body_index[name] for name in joint.bodies)
    body, sign = (child, 1.0) if child else (parent, -1.0)
    twisted = np.linalg.pinv(at.T[:, body].swapaxes(1, 2))
    wrench = sign * (twisted @ at.G[:, [*rows]].swapaxes(1, 2))
    moment, force = wrench[:, :3], wrench[:, 3:]
    arm = joint_frames(mechanism, joint, at.R, at.p).p_child - at.p[:, body]
    return np.concatenate([force, moment - skew(arm) @ force], axis=1)


def joint_wrenches(mechanism: Mechanism, at: Placement, rows: Sequence[Rows], multipliers: Array) -> Array:
    """Return the wrenches of all joints on their children, see `reactions`.

    Args:
        rows: Indices of each joint's gaps, in the order of the description.
        multipliers: Multipliers of all gaps. Shape (n, m).

    Returns:
        Shape (n, n_joint, 6).
    """
    pairs = zip(mechanism.joints, rows, strict=True)
    parts = [(unit_wrenches(mechanism, j, at, own) @ multipliers[:, [*own], None])[..., 0] for j, own in pairs]
    return np.stack(parts, axis=1)


def axial_line(mechanism: Mechanism, at: Placement, rows: Sequence[Rows]) -> Array:
    """Return the joint force perpendicular to the line of the rule ``spherical_axial``, per unit multiplier.

    Args:
        rows: Indices of each joint's gaps, in the order of the description.

    Returns:
        Components in two directions. Shape (n, 2, m).

    Raises:
        ModelFileError: The description lacks the table ``[spherical_axial]``, which names the joint.
    """
    if mechanism.axial is None:
        raise ModelFileError("the description has no table [spherical_axial]", "rule spherical_axial", "add the table")
    name, direction = mechanism.axial
    number = next(i for i, joint in enumerate(mechanism.joints) if joint.name == name)
    joint, own, line = mechanism.joints[number], [*rows[number]], np.zeros((len(at.R), 2, at.gaps.shape[1]))
    across = across_direction(at.R[:, mechanism.body_index[joint.child]], direction)
    line[..., own] = across @ unit_wrenches(mechanism, joint, at, own)[:, :3]
    return line


def reactions(mechanism: Mechanism, R: Array, p: Array, wrenches: Array, couplings: Array | None = None) -> Array:
    """Compute reaction components in the order of `names` from joint wrenches.

    Args:
        R, p: Poses of the bodies, ground first. Shapes (n, n_body + 1, 3, 3), (n, n_body + 1, 3).
        wrenches: Wrench of each joint in description order: force of the parent on the child, then moment about the
            joint's child-side point, in world axes. Shape (n, n_joint, 6).
        couplings: Force of each coupling along its coordinate; none by default. Shape (n, n_coupling).

    Returns:
        Components [N or N m]. Shape (n, m).
    """
    order = {joint.name: i for i, joint in enumerate(mechanism.joints)}
    parts = list[Array]()
    for joint in by_role(mechanism.joints):
        frames, wrench = joint_frames(mechanism, joint, R, p), wrenches[:, order[joint.name], :, None]
        parts += [(frames.type.forces(frames) @ wrench[:, :3])[..., 0]]
        parts += [(frames.type.moments(frames) @ wrench[:, 3:])[..., 0]]
    return np.concatenate([*parts, *([] if couplings is None else [couplings])], axis=1)
