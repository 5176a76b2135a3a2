"""Twists and wrenches, see `equations.screws`, and what placements make of them."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.equations.screws import (
    acceleration_at,
    couple,
    force,
    lie_bracket,
    prismatic,
    revolute,
    velocity_at,
)
from screwgauge.reference.equations.screws import power as reciprocal_product
from screwgauge.reference.rotations import Array, skew

__all__ = ["acceleration_at", "adjoint", "couple", "force", "lie_bracket", "prismatic", "reciprocal_product"]
__all__ += ["revolute", "velocity_at"]


def adjoint(T: Array) -> Array:
    """What a placement makes of twists [angular; linear]. Shape (4, 4) -> (6, 6)."""
    R, out = T[:3, :3], np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[3:, :3] = skew(T[:3, 3]) @ R
    return out
