"""States at which the loops of a tree are closed, and the velocities that its loops leave there.

Which rows state a loop is a choice (a weld, three points, another order); what they leave is none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from screwgauge.diagnosis.mechanics.lines import size
from screwgauge.models.kinematics.closing import equations
from screwgauge.models.kinematics.tree import States, Tree, draw, home, moved
from screwgauge.reference.rotations import Array

#: Newton's steps, and how far one goes at most [rad or m]; gaps that are rounding [rad or lengths of
#: the machine, or m where it is smaller].
STEPS, FAR, CLOSED = 40, 0.5, 1e-11
#: Singular values below this share of the largest are those of rows that follow from others.
DEPENDENT = 1e-8
#: Singular values between these shares are of a singular pose, found to the square root of rounding or so.
UNCLEAR = 1e-11, 1e-5
#: How far states near home are from it [rad or lengths of the machine].
BESIDE = 0.05


def closed(tree: Tree, states: States) -> tuple[States, NDArray[np.bool_]]:
    """Closes the loops at states by Newton's method; velocities and accelerations then keep them closed.

    Returns:
        The states that could be closed; and which they are, shape (n,).
    """
    q, length, todo = states.q.copy(), max(size(tree.reading), 1.0), np.arange(len(states.q))
    for _ in range(STEPS):
        at = equations(tree, replace(states.at(todo), q=q[todo]))
        far = np.abs(at.gap).max(axis=1, initial=0.0) > 0.01 * CLOSED * length
        if not far.any():
            break
        todo = todo[far]
        step = -(np.linalg.pinv(at.rows[far], rcond=DEPENDENT) @ at.gap[far][..., None])[..., 0]
        step *= np.minimum(1.0, FAR / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
        q[todo] = moved(tree, q[todo], step)
    at = equations(tree, replace(states, q=q))
    fits = np.abs(at.gap).max(axis=1, initial=0.0) <= CLOSED * length
    there, rows = replace(states, q=q).at(fits), at.rows[fits]
    back = np.linalg.pinv(rows, rcond=DEPENDENT)
    there = replace(there, qd=there.qd - (back @ (rows @ there.qd[..., None]))[..., 0])
    rest = rows @ there.qdd[..., None] + equations(tree, there).bias[..., None]
    return replace(there, qdd=there.qdd - (back @ rest)[..., 0]), fits


def near_home(tree: Tree, n: int, units: Array, seed: int) -> States:
    """So many random states near home, where loops close that do not close anywhere.

    Args:
        units: What counts as 1 of each velocity. Shape (n_freedom,).
    """
    there, drawn = np.repeat(home(tree.reading).q, n, axis=0), draw(tree.reading, n, seed)
    step = BESIDE * units * np.random.default_rng(seed).normal(size=drawn.qd.shape)
    return replace(drawn, q=moved(tree, there, step))


def clear(rows: Array) -> NDArray[np.bool_]:
    """States at which the rank of the rows is clear; shape (n, m, n_freedom) -> (n,).

    Newton's method ends beside a singular pose with half the digits, and with singular values that are neither.
    """
    s = np.linalg.svd(rows, compute_uv=False)
    s = s / np.maximum(s.max(axis=1, initial=0.0, keepdims=True), 1e-300)
    return np.asarray(~((s > UNCLEAR[0]) & (s < UNCLEAR[1])).any(axis=1))


def left(rows: Array, slides: Array, length: float) -> tuple[Array, Array]:
    """Velocities that rows leave.

    Args:
        rows: Shape (n, m, n_freedom).
        slides: Which velocities are linear. Shape (n_freedom,).
        length: What counts as 1 rad [m].

    Returns:
        What is left of each unit velocity, a projector, shape (n, n_freedom, n_freedom); and how well the rows tell,
        the smallest singular value over the largest, shape (n,).
    """
    _, s, V = np.linalg.svd(rows * np.where(slides, length, 1.0), full_matrices=True)
    s = s / np.maximum(s.max(axis=1, initial=0.0, keepdims=True), 1e-300)
    rank = (s > DEPENDENT).sum(axis=1)
    V = V * (np.arange(V.shape[1]) >= rank[:, None])[..., None]
    return np.swapaxes(V, 1, 2) @ V, np.where(s > DEPENDENT, s, 1.0).min(axis=1, initial=1.0)
