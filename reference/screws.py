"""Twists, wrenches, Lie bracket and reciprocal product (section 2.1 of the paper).

A twist is ``[angular; linear]`` of the body point at the world origin O; a wrench is ``[force; moment about O]``
(eq. 9), so that their reciprocal product is the power. All functions take arrays of any leading shape.
"""

from __future__ import annotations

import numpy as np

from screwgauge.reference.rotations import Array, cross, skew


def revolute(e: Array, r: Array) -> Array:
    """Unit screw of a rotation about the axis `e` through the point `r`, eq. (2). Shape (..., 6)."""
    return np.concatenate([e, cross(r, e)], axis=-1)


def prismatic(e: Array) -> Array:
    """Unit screw of a translation along `e`, the third column of eq. (18). Shape (..., 6)."""
    return np.concatenate([np.zeros_like(e), e], axis=-1)


def force(f: Array, r: Array) -> Array:
    """Wrench of a force `f` acting at the point `r`. Shape (..., 6)."""
    return np.concatenate([f, cross(r, f)], axis=-1)


def couple(m: Array) -> Array:
    """Wrench of a pure moment `m`. Shape (..., 6)."""
    return np.concatenate([np.zeros_like(m), m], axis=-1)


def lie_bracket(first: Array, second: Array) -> Array:
    """Lie bracket of two twists, eq. (36) with its first row mended: ``[w1 x w2; w1 x v2 - w2 x v1]``.

    The paper prints ``w1 x (w2 x r) - w2 x (w1 x r)`` in the first row, which is not an angular quantity.

    Args:
        first: Twist. Shape (..., 6).
        second: Twist. Shape (..., 6).

    Returns:
        Twist. Shape (..., 6).
    """
    w1, v1, w2, v2 = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
    return np.concatenate([cross(w1, w2), cross(w1, v2) - cross(w2, v1)], axis=-1)


def reciprocal_product(wrench: Array, twist: Array) -> Array:
    """Power of a wrench on a twist, eq. (8): force times linear plus moment times angular. Shape (...)."""
    return np.asarray(np.sum(wrench[..., :3] * twist[..., 3:] + wrench[..., 3:] * twist[..., :3], axis=-1))


def velocity_at(twist: Array, r: Array) -> Array:
    """Velocity [m/s] of the body point at `r`. Shape (..., 3)."""
    return twist[..., 3:] + cross(twist[..., :3], r)


def acceleration_at(twist: Array, acceleration: Array, r: Array) -> Array:
    """Acceleration [m/s^2] of the body point at `r`, eq. (49) with ``v_C = v_O + w x r_C``.

    The paper's ``v_C = w x r_C`` holds only for a body that turns about O.

    Args:
        twist: Twist of the body. Shape (..., 6).
        acceleration: Acceleration screw, the time derivative of the twist at O (eq. 44). Shape (..., 6).
        r: World position of the point [m]. Shape (..., 3).
    """
    w, beta = twist[..., :3], acceleration[..., :3]
    return acceleration[..., 3:] + cross(beta, r) + cross(w, velocity_at(twist, r))


def adjoint(T: Array) -> Array:
    """What a placement makes of twists [angular; linear]. Shape (4, 4) -> (6, 6)."""
    R, out = T[:3, :3], np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[3:, :3] = skew(T[:3, 3]) @ R
    return out
