"""Initial guesses for poses of a motion between closed ones, by Hermite interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array

Rows = NDArray[np.intp]

EDGE = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0  # derivative at the first of five samples, of fourth order
CACHED = 2**14  # numbers worked on at a time
KNOTS = 4  # around a sample that it is predicted from: a polynomial of degree seven


def knots(y: Array, every: int, step: float) -> Rows:
    """Samples that are followed: the first, the last, and of the others so many that none is far from the next.

    Args:
        y: Independent coordinates without dimension. Shape (n, k).
        every: Samples from one to the next, at most.
        step: Way in y from one to the next, at most, unless samples are farther apart.
    """
    way = np.abs(np.diff(y, axis=0)).max(axis=1, initial=0.0)
    share = np.cumsum(np.maximum(way / step, 1.0 / every))
    chosen = np.ones(len(y), dtype=bool)
    chosen[1:-1] = np.diff(np.floor(share)) != 0.0
    return np.flatnonzero(chosen)


def predicted(y: Array, rows: Rows, z: Array, K: Array) -> Array:
    """Unknowns of all samples by Hermite's interpolation over the number of the sample. Shape (n, n_z).

    What the samples differ from the interpolated motion is made up for to first order, so that they need not be evenly
    spread; where they jump, the prediction is bad.

    Args:
        y: Independent coordinates. Shape (n, k).
        rows: Samples whose poses are known, the first and the last among them. Shape (m,).
        z, K: Unknowns there, shape (m, n_z), and their velocity map, (m, n_z, k).
    """
    slope = slopes(y)[rows]
    value = interpolated(len(y), rows, np.hstack([y[rows], z]), np.hstack([slope, (K @ slope[..., None])[..., 0]]))
    at = np.arange(len(y))
    i = _interval(at, rows)
    share = ((at - rows[i]) / (rows[i + 1] - rows[i]))[:, None]
    away = (y - value[:, : y.shape[1]])[..., None]
    return np.asarray(
        value[:, y.shape[1] :] + (1.0 - share) * (K[i] @ away)[..., 0] + share * (K[i + 1] @ away)[..., 0]
    )


def slopes(y: Array) -> Array:
    """Derivative of a motion by the number of the sample, of fourth order. Shape (n, k) -> (n, k)."""
    slope = np.gradient(y, axis=0)
    if len(y) > len(EDGE):
        slope[2:-2] -= np.diff(slope[1:-1], 2, axis=0) / 6.0
        slope[0], slope[-1] = EDGE @ y[: len(EDGE)], -EDGE @ y[: -len(EDGE) - 1 : -1]
    return np.asarray(slope)


def interpolated(n: int, rows: Rows, values: Array, rates: Array) -> Array:
    """Numbers at n samples from those at some, see `predicted`, and their derivatives. Shapes (m, d) -> (n, d)."""
    x, c = _differences(rows.astype(float), values, rates)
    found, some = np.empty((n, values.shape[1])), max(1, CACHED // values.shape[1])
    for first in range(0, n, some):
        at = np.arange(first, min(first + some, n))
        i = _interval(at, rows)
        value = c[i, -1]
        for j in reversed(range(x.shape[1] - 1)):
            value *= (at - x[i, j])[:, None]
            value += c[i, j]
        found[at] = value
    return found


def _interval(at: Rows, rows: Rows) -> Rows:
    return np.minimum(np.searchsorted(rows, at, side="right") - 1, len(rows) - 2)


def _differences(at: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Newton's divided differences for each interval, from up to `KNOTS` knots around it, each of which counts twice.

    Args:
        at: Of the knots. Shape (m,).
        values, rates: There. Shape (m, d).

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
