"""Closed-form inverse kinematics of U-P-S and U-P-U legs, for the pose of the body that they carry."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.graph import Edge, serial_chains
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.pose import Layout, place, unplace
from screwgauge.reference.rotations import Array, rotation, triad, triad_angles

#: Home is given to ten digits; another branch is farther away.
HOME = 1e-8


def closed_form(lay: Layout, y: Array) -> Array | None:
    """Joint coordinates where every chain has a closed form whose branch is that of home, else None.

    The output body is placed by the spherical joint that carries the independent coordinates, its remaining angle
    at its home value; where another chain forbids that (c(a, b) != 0), the loops stay open by that much and
    Newton's method goes on from here.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, n_independent).

    Returns:
        Shape (n, n_q), or None.
    """
    mechanism = lay.mechanism
    chains = serial_chains(mechanism)
    drivers = [chain for chain in chains if len(chain) == 1 and not chain[0].reverse]
    legs = [chain for chain in chains if chain not in drivers]
    if mechanism.couplings or len(drivers) != 1 or sum(len(chain) for chain in chains) != len(mechanism.joints):
        return None
    driver = drivers[0][0].joint
    if not set(mechanism.independent.values()) <= set(driver.coordinates) or not all(map(_has_closed_form, legs)):
        return None
    q = np.tile(mechanism.home, (len(y) + 1, 1))  # home itself comes first
    q[1:, mechanism.independent_columns] = y
    R, p = _from_ground(driver, q[:, lay.columns[driver.name]])
    for leg in legs:
        _leg(lay, leg, R, p, q)
    close = max(HOME, 64 * float(np.finfo(q.dtype).eps))  # single precision has no 1e-8
    return q[1:] if np.abs(q[0] - mechanism.home).max() < close else None


def _has_closed_form(chain: tuple[Edge, ...]) -> bool:
    """U-P-U or U-P-S with the slide through both centres, along the normal of the first U's axes."""
    kinds = "".join(edge.joint.kind for edge in chain)
    if kinds not in ("UPU", "UPS") or any(edge.reverse for edge in chain):
        return False
    base, slide, wrist = (edge.joint for edge in chain)
    coincide = (base.child_frame, slide.parent_frame, slide.child_frame, wrist.parent_frame)
    normal = np.cross(base.axes[0], base.axes[1])
    return all(frame.is_identity for frame in coincide) and bool(
        np.abs(slide.axes[0] - normal).max() <= 64 * np.finfo(normal.dtype).eps
    )


def _from_ground(joint: Joint, q: Array) -> tuple[Array, Array]:
    """Pose of the child of a joint whose parent is the ground. Shapes (n, 3, 3), (n, 3)."""
    R, p = place(np.tile(np.eye(3, dtype=q.dtype), (len(q), 1, 1)), np.zeros((len(q), 3), q.dtype), joint.parent_frame)
    for (turns, axis), value in zip(joint.freedoms, q.T, strict=True):
        R, p = (R @ rotation(axis, value), p) if turns else (R, p + R @ axis * value[:, None])
    return unplace(R, p, joint.child_frame)


def _leg(lay: Layout, chain: tuple[Edge, ...], R: Array, p: Array, q: Array) -> None:
    """Fills the coordinates of one leg. R, p: pose of the output body, shapes (n, 3, 3), (n, 3)."""
    base, slide, wrist = (edge.joint for edge in chain)
    x, yy = base.axes
    z = np.cross(x, yy)
    R_wrist, C = place(R, p, wrist.child_frame)
    AC = (C - base.parent_frame.p) @ base.parent_frame.R  # in the frame of the base joint
    u, v, w = AC @ x, AC @ yy, AC @ z
    q1, q2 = np.arctan2(-v, w), np.arctan2(u, np.hypot(v, w))
    q[:, lay.columns[base.name]] = np.stack([q1, q2], axis=1)
    q[:, lay.columns[slide.name][0]] = np.sqrt(u * u + v * v + w * w)
    R_leg = _from_ground(base, q[:, lay.columns[base.name]])[0]
    angles = triad_angles(R_leg.swapaxes(1, 2) @ R_wrist, triad(wrist.axes), few=len(wrist.axes) < 3)
    q[:, lay.columns[wrist.name]] = angles[:, : len(wrist.axes)]
