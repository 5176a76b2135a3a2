"""Actuator forces under either redundancy rule, and the motion of undriven coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.problem import given_columns
from screwgauge.reference import linear
from screwgauge.reference.rotations import Array


def min_norm(B: Array, Q: Array, idle: Sequence[int] = ()) -> tuple[Array, Array]:
    """Return the minimum-norm actuator forces f with ``B^T f = Q``.

    Args:
        B: Actuator rates per unit rate of y, d L / d y. Shape (n, n_actuator, k).
        Q: Generalised forces. Shape (n, k).
        idle: Indices of the coordinates that no actuator drives; their equations are already satisfied.

    Returns:
        Actuator forces, shape (n, n_actuator), and the condition number of B without its idle columns, (n,).
    """
    given = given_columns(B.shape[2], idle)
    back, condition = linear.invert(B[..., given])
    return (Q[:, None, given] @ back)[:, 0], condition


def idle_accelerations(B: Array, M: Array, Q: Array, idle: Sequence[int]) -> tuple[Array, Array]:
    """Solve for the accelerations x of undriven coordinates at which actuators can supply the remaining forces.

    Solves ``N^T (Q + M x) = 0``. The columns of N are rates of y at which no actuator moves; they eliminate the
    actuator forces.

    Args:
        B: Actuator rates per unit rate of y. Shape (n, n_actuator, k).
        M: Columns of the mass matrix that belong to the idle coordinates. Shape (n, k, m).
        Q: Generalised forces at x = 0. Shape (n, k).
        idle: Indices of the m undriven ("idle") coordinates in y.

    Returns:
        x, shape (n, m), and the condition number of these equations, (n,).
    """
    given, m = given_columns(B.shape[2], idle), len(idle)
    N = np.zeros((*B.shape[:1], B.shape[2], m))
    N[:, idle] = np.eye(m)
    N[:, given] = -linear.invert(B[..., given])[0] @ B[..., idle]
    back = N.swapaxes(1, 2)
    A = back @ M
    size = np.sqrt(np.abs(np.diagonal(A, axis1=1, axis2=2)))  # coordinates may be in rad and m
    inverse, condition = linear.invert(A / (size[:, :, None] * size[:, None, :]))
    forces = (back @ Q[..., None]) / size[..., None]
    return -(inverse @ forces)[..., 0] / size, condition


def along_line(drive: Array, G: Array, need: Array, line: Array, right: Array | float = 0.0) -> tuple[Array, Array]:
    """Solve for the actuator forces that keep a joint's force along its line (eq. 56).

    Args:
        drive: Rates of the actuated coordinates per unit rate of the engine's coordinates. Shape (n, n_actuator, n_x).
        G: Derivative of the constraints. Shape (n, m, n_x).
        need: Forces that actuators and constraints supply together. Shape (n, n_x).
        line: Joint force per unit multiplier in two directions perpendicular to the line. Shape (n, 2, m).
        right: Required joint force in these two directions. Shape (n, 2).

    Returns:
        Actuator forces, shape (n, n_actuator), and the condition number of the equations, (n,).
    """
    (n, actuators, n_x), m = drive.shape, G.shape[1]
    system = np.zeros((n, n_x + 2, actuators + m))
    system[:, :n_x, :actuators] = drive.swapaxes(1, 2)
    system[:, :n_x, actuators:] = G.swapaxes(1, 2)
    system[:, n_x:, actuators:] = line
    whole = np.concatenate([need, np.broadcast_to(right, (n, 2))], axis=1)
    return linear.solve(system, whole[..., None])[:, :actuators, 0], linear.condition(system)
