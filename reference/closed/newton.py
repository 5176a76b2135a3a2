"""Newton's method on stacks of poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array

#: Evaluates poses: (q (n, n_q), y (n, k)) -> closure residuals (n, m), their derivative (n, m, n_q), and what else is
#: to be known of the poses that are found, (n, ...) each.
Evaluation = Callable[[Array, Array], tuple[Array, ...]]

# Angles are in rad, distances in lengths of the mechanism wherever these are used.
#: A closure residual below this is as small as float64 can make it.
ROUNDING = 2 * linear.EPS
#: A loop whose closure residual stays above this does not close.
OPEN = 1e-10
#: Steps in which the residual has to halve at least once: else no solution is near. At a double root it does in each.
PATIENCE = 12


def newton(
    evaluate: Evaluation, q: Array, y: Array, *, most: int = 60, begun: Sequence[Array] | None = None
) -> tuple[Array, ...]:
    """Newton's method, sample by sample as far as each needs.

    Args:
        q: Starting values. Shape (n, n_q).
        y: Independent coordinates. Shape (n, k).
        begun: What `evaluate` gives there, if it is known.

    Returns:
        Joint coordinates (n, n_q), the derivative of the closure residuals there (n, m, n_q), the largest closure
        residual of each sample (n,) [rad or m], and what else `evaluate` gives.
    """
    q = q.copy()
    residual, matrix, *more = evaluate(q, y) if begun is None else (array.copy() for array in begun)
    error = np.abs(residual).max(axis=1, initial=0.0)
    active = np.flatnonzero(~(error <= ROUNDING))
    goal, idle = 0.5 * error, np.zeros(len(q), dtype=np.intp)
    for _ in range(most):
        if not active.size:
            break
        step = linear.solve(matrix[active], -residual[active][..., None])[..., 0]
        # long steps leave the region where Newton's method converges
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
        trial = q[active] + step
        residual_new, matrix_new, *more_new = evaluate(trial, y[active])
        after = np.abs(residual_new).max(axis=1)
        before = error[active]
        stalled = (before < 1e-11) & ~(after < 0.5 * before)  # as small as rounding lets it be
        take = ~stalled | (after < before)
        rows = active[take]
        pairs = (q, trial), (residual, residual_new), (matrix, matrix_new), (error, after)
        for kept, new in (*pairs, *zip(more, more_new, strict=True)):
            kept[rows] = new[take]
        halved = after <= goal[active]
        goal[active[halved]] = 0.5 * after[halved]
        idle[active] = np.where(halved, 0, idle[active] + 1)
        active = active[~stalled & ~(after <= ROUNDING) & np.isfinite(after) & (idle[active] < PATIENCE)]
    return q, matrix, error, *more


def velocity_map(A: Array, k: int) -> Array:
    """Velocity map K, ``qd = K yd``, the last k rows of A selecting y. Shape (n, m, n_q) -> (n, n_q, k)."""
    right = np.zeros((*A.shape[:2], k), dtype=A.dtype)
    right[:, -k:] = np.eye(k)
    return linear.solve(A, right)
