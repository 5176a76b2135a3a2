"""Velocities of bodies and named points per unit rate of each actuator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwgauge.problem import given_columns
from screwgauge.reference import linear
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import Array, cross, times


def per_actuator(
    twists: Array, R: Array, points: Sequence[Point], index: Mapping[str, int], B: Array, *, idle: Sequence[int] = ()
) -> tuple[Array, Array]:
    """Return the quantity `jacobian`, and the condition number of the actuator rates.

    Undriven coordinates are at rest. If there are more actuators than degrees of freedom, the pseudo-inverse is used;
    its transpose gives minimum-norm forces.

    Args:
        twists: Body twists per unit rate of y, ground first: angular velocity, then velocity of the body's origin.
            Shape (n, n_body + 1, 6, k).
        R: Orientations of the bodies. Shape (n, n_body + 1, 3, 3).
        points: Points whose velocities come after the body twists in the result.
        index: Body -> its index, 0 for ground.
        B: Rates of the actuators per unit rate of y. Shape (n, n_actuator, k).
        idle: Indices of the coordinates that no actuator drives.

    Returns:
        The quantity, shape (n, (6 n_body + 3 n_point) n_actuator), and the condition number, (n,).
    """
    driven = given_columns(B.shape[2], idle)
    twists, B, (n, k) = twists[..., driven], B[..., driven], (len(B), len(driven))
    rows = [twists[:, 1:].reshape(n, -1, k)]
    for one in points:
        T, arm = twists[:, index[one.body]].swapaxes(1, 2), times(R[:, index[one.body]], one.place)
        rows.append((T[..., 3:] + cross(T[..., :3], np.broadcast_to(arm[:, None], T[..., 3:].shape))).swapaxes(1, 2))
    back, condition = linear.invert(B)
    return (np.concatenate(rows, axis=1) @ back).reshape(n, -1), condition
