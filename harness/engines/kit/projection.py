"""Actuator forces from what a motion needs, by either rule of redundancy."""

from __future__ import annotations

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array


def min_norm(B: Array, Q: Array) -> tuple[Array, Array]:
    """The actuator forces of smallest norm with ``B^T f = Q``.

    Args:
        B: Actuator rates per rate of y, d L / d y. Shape (n, n_actuator, k).
        Q: Generalised forces. Shape (n, k).

    Returns:
        Shape (n, n_actuator), and the condition number of B, (n,).
    """
    back, condition = linear.inverted(B)
    return (Q[:, None] @ back)[:, 0], condition


def along_line(drive: Array, G: Array, need: Array, line: Array, right: Array | float = 0.0) -> tuple[Array, Array]:
    """Actuator forces for which a joint's force lies along its line (eq. 56), multipliers being solved beside them.

    Args:
        drive: Rates of the actuated coordinates per rate of the engine's. Shape (n, n_actuator, n_x).
        G: Derivative of the constraints. Shape (n, m, n_x).
        need: What actuators and constraints deliver together. Shape (n, n_x).
        line: What unit multipliers make of that force in two directions across the line. Shape (n, 2, m).
        right: What those two parts of it have to be. Shape (n, 2).

    Returns:
        Shape (n, n_actuator), and the condition number of the equations, (n,).
    """
    (n, actuators, n_x), m = drive.shape, G.shape[1]
    system = np.zeros((n, n_x + 2, actuators + m))
    system[:, :n_x, :actuators] = drive.swapaxes(1, 2)
    system[:, :n_x, actuators:] = G.swapaxes(1, 2)
    system[:, n_x:, actuators:] = line
    whole = np.concatenate([need, np.broadcast_to(right, (n, 2))], axis=1)
    return linear.solve(system, whole[..., None])[:, :actuators, 0], linear.condition(system)
