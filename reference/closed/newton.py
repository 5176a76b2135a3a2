"""Numerical tools for continuation: Newton's method on stacks of poses, Hermite interpolation, Bezier curves.

Hermite interpolation between closed poses yields initial guesses; a Bezier curve of degree five lies within the convex
hull of its control points. This module does not depend on a mechanism.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array

#: Function that evaluates poses: (q (n, n_q), y (n, k)) -> closure residuals (n, m), their derivative (n, m, n_q), and
#: any further results, (n, ...) each.
Evaluation = Callable[[Array, Array], tuple[Array, ...]]

# Angles are in rad and distances in mechanism lengths wherever these constants are used.
#: Closure residual that is as small as float64 allows.
ROUNDING = 2 * linear.EPS
#: Residual that rounding in an engine may leave. A further step only follows noise, amplified by 1 / distance.
CLOSED = 4 * ROUNDING
#: Residual below which rounding may prevent a step from halving it.
NOISE = 1e-11
#: Closure residual above which a loop counts as open.
OPEN = 1e-10
#: Number of steps within which the residual must halve if a solution is near. At a double root, each step halves it.
PATIENCE = 12


def has_stalled(before: Array | float, after: Array | float) -> NDArray[np.bool_]:
    """Return True if a step did not halve closure residuals that are already near rounding level."""
    return np.logical_and(np.less(before, NOISE), ~np.less(after, 0.5 * np.asarray(before)))


def newton(
    evaluate: Evaluation, q: Array, y: Array, *, most: int = 60, begun: Sequence[Array] | None = None
) -> tuple[Array, ...]:
    """Run Newton's method; each sample takes as many steps as it needs.

    Args:
        q: Starting values. Shape (n, n_q).
        y: Independent coordinates. Shape (n, k).
        begun: Result of `evaluate` at the starting values, if known.

    Returns:
        Joint coordinates (n, n_q), the derivative of the closure residuals at these coordinates (n, m, n_q), the
        largest closure residual of each sample (n,) [rad or m], and further results of `evaluate`.
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
        idling = has_stalled(before, after)
        take = ~idling | (after < before)
        rows = active[take]
        pairs = (q, trial), (residual, residual_new), (matrix, matrix_new), (error, after)
        for kept, new in (*pairs, *zip(more, more_new, strict=True)):
            kept[rows] = new[take]
        halved = after <= goal[active]
        goal[active[halved]] = 0.5 * after[halved]
        idle[active] = np.where(halved, 0, idle[active] + 1)
        active = active[~idling & ~(after <= ROUNDING) & np.isfinite(after) & (idle[active] < PATIENCE)]
    return q, matrix, error, *more


def velocity_map(A: Array, k: int) -> Array:
    """Solve for the velocity map K, ``qd = K yd``; the last k rows of A select y. Shape (n, m, n_q) -> (n, n_q, k)."""
    right = np.zeros((*A.shape[:2], k), dtype=A.dtype)
    right[:, -k:] = np.eye(k)
    return linear.solve(A, right)


Rows = NDArray[np.intp]

EDGE = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0  # derivative, to fourth order, at the first of five samples
CACHED = 2**14  # number of array elements processed at a time
KNOTS = 4  # number of knots around a predicted sample, for a polynomial of degree seven


def knots(y: Array, every: int, step: float) -> Rows:
    """Choose the samples to follow: the first, the last, and enough in between to limit the distance between them.

    Args:
        y: Dimensionless independent coordinates. Shape (n, k).
        every: Largest number of samples from one chosen sample to the next.
        step: Largest step in y between chosen samples, unless samples are farther apart.
    """
    way = np.abs(np.diff(y, axis=0)).max(axis=1, initial=0.0)
    share = np.cumsum(np.maximum(way / step, 1.0 / every))
    chosen = np.ones(len(y), dtype=bool)
    chosen[1:-1] = np.diff(np.floor(share)) != 0.0
    return np.flatnonzero(chosen)


def predict_unknowns(y: Array, rows: Rows, z: Array, K: Array) -> Array:
    """Interpolate the unknowns of all samples with Hermite's formula over the sample index. Shape (n, n_z).

    Deviations of samples from the interpolated motion are corrected to first order; therefore, samples need not be
    evenly spaced. Where samples jump, the prediction is poor.

    Args:
        y: Independent coordinates. Shape (n, k).
        rows: Samples with known poses, including the first and the last. Shape (m,).
        z, K: Unknowns, shape (m, n_z), and velocity maps, (m, n_z, k), of these samples.
    """
    slope = slopes(y)[rows]
    value = interpolate(len(y), rows, np.hstack([y[rows], z]), np.hstack([slope, (K @ slope[..., None])[..., 0]]))
    at = np.arange(len(y))
    i = _interval(at, rows)
    share = ((at - rows[i]) / (rows[i + 1] - rows[i]))[:, None]
    away = (y - value[:, : y.shape[1]])[..., None]
    return np.asarray(
        value[:, y.shape[1] :] + (1.0 - share) * (K[i] @ away)[..., 0] + share * (K[i + 1] @ away)[..., 0]
    )


def slopes(y: Array) -> Array:
    """Return the derivative of a motion with respect to the sample index, to fourth order. Shape (n, k) -> (n, k)."""
    slope = np.gradient(y, axis=0)
    if len(y) > len(EDGE):
        slope[2:-2] -= np.diff(slope[1:-1], 2, axis=0) / 6.0
        slope[0], slope[-1] = EDGE @ y[: len(EDGE)], -EDGE @ y[: -len(EDGE) - 1 : -1]
    return np.asarray(slope)


def interpolate(n: int, rows: Rows, values: Array, rates: Array) -> Array:
    """Interpolate known values and derivatives at n samples, see `predict_unknowns`. Shapes (m, d) -> (n, d)."""
    x, c = _differences(rows.astype(float), values, rates)
    result, some = np.empty((n, values.shape[1])), max(1, CACHED // values.shape[1])
    for first in range(0, n, some):
        at = np.arange(first, min(first + some, n))
        i = _interval(at, rows)
        value = c[i, -1]
        for j in reversed(range(x.shape[1] - 1)):
            value *= (at - x[i, j])[:, None]
            value += c[i, j]
        result[at] = value
    return result


def _interval(at: Rows, rows: Rows) -> Rows:
    return np.minimum(np.searchsorted(rows, at, side="right") - 1, len(rows) - 2)


def _differences(at: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Compute Newton's divided differences for each interval from up to `KNOTS` surrounding double knots.

    Args:
        at: Positions of the knots. Shape (m,).
        values, rates: Values and derivatives at the knots. Shape (m, d).

    Returns:
        Nodes, shape (m - 1, 2 KNOTS), and coefficients, (m - 1, 2 KNOTS, d).
    """
    most = min(KNOTS, len(at))
    first = np.clip(np.arange(len(at) - 1) - (most - 1) // 2, 0, len(at) - most)
    window = np.repeat(first[:, None] + np.arange(most), 2, axis=1)
    x, c = at[window], values[window]
    for order in range(1, 2 * most):
        width = x[:, order:] - x[:, :-order]
        c[:, order:] = (c[:, order:] - c[:, order - 1 : -1]) / np.where(width == 0.0, 1.0, width)[..., None]
        if order == 1:
            c[:, 1::2] = rates[window[:, ::2]]
    return x, c


State = tuple[Array, Array, Array]
"""Independent coordinates and their first and second derivatives. Shape (..., k) each."""
Rates = tuple[Array, Array]
"""First and second derivatives of the independent coordinates. Shape (n, k) each."""
Drive = Callable[[Array], State]
"""Times (n,) -> the state at each time."""
Motion = Callable[[Array], Any]
"""Times (n,) -> an object with y, yd and ydd at these times [rad or m]."""

#: Derivatives are consistent with a motion if they predict each step with a relative error below this value.
CONSISTENT = 0.1
#: Weights that map control points to control points of both halves (de Casteljau), and to the midpoint. Shapes
#: (2, 6, 6), (6,).
_LEFT = np.array([[math.comb(i, j) / 2.0**i for j in range(6)] for i in range(6)])
HALVES = np.stack([_LEFT, _LEFT[::-1, ::-1]])
HALF = _LEFT[-1]


def hermite(h: Array, before: State, after: State) -> Array:
    """Return control points of quintic polynomials with given values and derivatives at both ends.

    Args:
        h: Duration [s]. Shape (...).
        before, after: Values and derivatives at the ends. Shape (..., k) each.

    Returns:
        Shape (..., 6, k).
    """
    h = np.asarray(h)[..., None]
    (y0, v0, a0), (y1, v1, a1) = before, after
    first, last = y0 + h * v0 / 5.0, y1 - h * v1 / 5.0
    second, third = 2.0 * first - y0 + h * h * a0 / 20.0, 2.0 * last - y1 + h * h * a1 / 20.0
    return np.stack([y0, first, second, third, last, y1], axis=-2)


def straight_path(y0: Array, y1: Array) -> Array:
    """Return control points of straight paths. Shapes (..., k) -> (..., 6, k)."""
    share = np.linspace(0.0, 1.0, 6)[:, None]
    return np.asarray(y0[..., None, :] * (1.0 - share) + y1[..., None, :] * share)


def bent_paths(y0: Array, y1: Array) -> list[Array]:
    """Return control points, (6, k), of two paths bent to either side of the straight path, or none if k = 1."""
    way = y1 - y0
    if len(way) < 2:
        return []
    across = np.eye(len(way))[int(np.argmin(np.abs(way)))]
    across = across - way * (across @ way) / max(float(way @ way), np.finfo(float).tiny)
    bend = 0.4 * np.linalg.norm(way) * np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.0])[:, None] * across
    return [straight_path(y0, y1) + sign * bend for sign in (1.0, -1.0)]


def are_consistent(h: Array, before: State, after: State) -> Array:
    """Return True where values and derivatives fit one motion rather than a mere list of poses. Shape (...)."""
    h = h[..., None]
    (y0, v0, a0), (y1, v1, a1) = before, after
    miss = y1 - y0 - 0.5 * h * (v0 + v1) + h * h * (a1 - a0) / 12.0
    size = np.maximum(np.abs(y1 - y0), np.abs(h) * np.maximum(np.abs(v0), np.abs(v1)))
    return np.asarray((np.abs(miss).max(-1) <= CONSISTENT * size.max(-1)) & (h[..., 0] > 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A piece of a motion.

    Attributes:
        points: Control points. Shape (6, k).
        t: Start and end time [s].
        drive: The motion itself, if known; if None, the curve is the motion.
    """

    points: Array
    t: tuple[float, float] = (0.0, 1.0)
    drive: Drive | None = None

    def at(self, share: float) -> Array:
        """Return the independent coordinates at a fraction of the duration. Shape (k,)."""
        t0, t1 = self.t
        if self.drive is not None:
            return np.asarray(self.drive(np.array([t0 + share * (t1 - t0)]))[0][0])
        weights = [math.comb(5, i) * share**i * (1.0 - share) ** (5 - i) for i in range(6)]
        return np.asarray(weights @ self.points)

    def halves(self) -> tuple[Curve, Curve, Array]:
        """Split the curve in two; also return the deviation of the motion from the curve at half time, shape (k,)."""
        (t0, t1), p = self.t, self.points
        middle = 0.5 * (t0 + t1)
        if self.drive is None:
            pieces, miss = HALVES @ p, 0.0 * p[0]
        else:
            y, yd, ydd = self.drive(np.array([t0, middle, t1]))
            half = np.full(2, middle - t0)
            pieces = hermite(half, (y[:2], yd[:2], ydd[:2]), (y[1:], yd[1:], ydd[1:]))
            miss = y[1] - HALF @ p
        return Curve(pieces[0], (t0, middle), self.drive), Curve(pieces[1], (middle, t1), self.drive), miss
