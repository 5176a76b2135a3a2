"""Newton's method on stacks of poses, and the path of poses from home to every sample.

Following the path keeps every sample on the branch that the home pose is on.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array

#: Corrects one pose: (q0 (n_q,), y (k,)) -> (q (n_q,), dq/dy (n_q, k)) or None where it does not converge.
Corrector = Callable[[Array, Array], tuple[Array, Array] | None]

#: Evaluates poses: (q (n, n_q), y (n, k)) -> closure residuals (n, m) and their derivative (n, m, n_q).
Evaluation = Callable[[Array, Array], tuple[Array, Array]]

# Angles are in rad, distances in lengths of the mechanism wherever these are used.
#: A closure residual below this is as small as float64 can make it.
ROUNDING = 2 * linear.EPS
#: A loop whose closure residual stays above this does not close.
OPEN = 1e-10
STEP = 0.1  # Newton from a first-order prediction this far away converges in two or three steps
SMALLEST = 1e-5
FARTHEST = 1.0  # no coordinate is predicted farther away
REMEDY = "shorten the motion or check the geometry"
LONGEST = 1e3  # what is further away is not reached by following a path


def newton(evaluate: Evaluation, q: Array, y: Array, *, most: int = 60) -> tuple[Array, Array, Array]:
    """Newton's method, sample by sample as far as each needs.

    Args:
        q: Starting values. Shape (n, n_q).
        y: Independent coordinates. Shape (n, k).

    Returns:
        Joint coordinates (n, n_q), the derivative of the closure residuals there (n, m, n_q), and the largest
        closure residual of each sample (n,) [rad or m].
    """
    q = q.copy()
    residual, matrix = evaluate(q, y)
    error = np.abs(residual).max(axis=1, initial=0.0)
    active = np.flatnonzero(~(error <= ROUNDING))
    for _ in range(most):
        if not active.size:
            break
        step = linear.solve(matrix[active], -residual[active][..., None])[..., 0]
        # long steps leave the region where Newton's method converges
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
        trial = q[active] + step
        residual_new, matrix_new = evaluate(trial, y[active])
        after = np.abs(residual_new).max(axis=1)
        before = error[active]
        stalled = (before < 1e-11) & ~(after < 0.5 * before)  # as small as rounding lets it be
        take = ~stalled | (after < before)
        rows = active[take]
        pairs = (q, trial), (residual, residual_new), (matrix, matrix_new), (error, after)
        for kept, new in pairs:
            kept[rows] = new[take]
        active = active[~stalled & ~(after <= ROUNDING) & np.isfinite(after)]
    return q, matrix, error


def check_closed(error: Array, y: Array, t: Array) -> None:
    """Raises ClosureError at the first sample whose loops stay open. Shapes (n,), (n, k), (n,)."""
    bad = np.flatnonzero(~(error < OPEN))
    if bad.size:
        i = bad[0]
        what = f"the loops stay open by {error[i]:.3g} at y = {np.array2string(y[i], precision=6)}"
        raise ClosureError(what, f"t = {t[i]:g} s", REMEDY)


def corrector(evaluate: Evaluation) -> Corrector:
    """Newton's method for one pose, with the velocity map dq/dy that predicts the next one."""

    def correct(q: Array, y: Array) -> tuple[Array, Array] | None:
        found, matrix, error = newton(evaluate, q[None], y[None])
        if not error[0] < OPEN:
            return None
        return found[0], velocity_map(matrix, len(y))[0]

    return correct


def velocity_map(A: Array, k: int) -> Array:
    """Velocity map K, ``qd = K yd``, the last k rows of A selecting y. Shape (n, m, n_q) -> (n, n_q, k)."""
    right = np.zeros((*A.shape[:2], k), dtype=A.dtype)
    right[:, -k:] = np.eye(k)
    return linear.solve(A, right)


def follow(correct: Corrector, q_home: Array, y_home: Array, y: Array, t: Array, *, size: Array | float = 1.0) -> Array:
    """Starting values for all samples: each is predicted from a corrected pose at most `STEP` away.

    Args:
        correct: Newton's method for one pose.
        q_home, y_home: Home pose. Shapes (n_q,), (k,).
        y: Independent coordinates of all samples. Shape (n, k).
        t: Their times [s], for messages. Shape (n,).
        size: What y is divided by, for messages. Shape (k,).

    Returns:
        Predicted joint coordinates. Shape (n, n_q).

    Raises:
        ClosureError: The path leads to where the loops cannot close.
    """
    start = np.empty((len(y), len(q_home)))
    home, remedy = correct(q_home, y_home), "correct the placements or the home coordinates"
    if home is None:
        raise ClosureError("the loops do not close there", "home pose", remedy)
    (q, K), at = home, y_home
    for i, target in enumerate(y):
        if np.abs(target - at).max(initial=0.0) > STEP or i == 0:
            q, K = _walk(correct, q, K, at, target, size, f"t = {t[i]:g} s")
            at = target
        start[i] = _predicted(q, K, target - at)
    return start


def cannot_pass(y: Array, where: str) -> ClosureError:
    """The error where a path of poses ends at independent coordinates `y`. Shape (k,)."""
    what = f"the loops cannot close beyond y = {np.array2string(y, precision=6)}, or the pose there is singular"
    return ClosureError(what, where, REMEDY)


def _predicted(q: Array, K: Array, way: Array) -> Array:
    """First-order prediction; near gimbal lock it would turn a joint round thousands of times."""
    return np.asarray(q + np.clip(K @ way, -FARTHEST, FARTHEST))


def _walk(
    correct: Corrector, q: Array, K: Array, y: Array, target: Array, size: Array | float, where: str
) -> tuple[Array, Array]:
    """Walks on a straight line from y to target, halving the step where the correction fails."""
    length = max(float(np.abs(target - y).max(initial=0.0)), SMALLEST)
    if not length <= LONGEST:
        what = f"the motion jumps by {length:.3g} (rad, or lengths of the mechanism) from one sample to the next"
        raise ClosureError(what, where, "give samples closer to each other")
    done, step = 0.0, min(1.0, STEP / length)
    while done < 1.0:
        share = min(1.0, done + step)
        goal = y + share * (target - y)
        corrected = correct(_predicted(q, K, (share - done) * (target - y)), goal)
        if corrected is not None:
            (q, K), done = corrected, share
        elif step * length <= SMALLEST:
            raise cannot_pass(goal * size, where)
        else:
            step *= 0.5
    return q, K
