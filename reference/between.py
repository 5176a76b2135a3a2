"""Poses of a motion between closed ones, predicted from these by Hermite's interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array

Rows = NDArray[np.intp]


def knots(y: Array, every: int, step: float) -> Rows:
    """Samples that are followed: the first, the last, and of the others so many that none is far from the next.

    Args:
        y: Independent coordinates without dimension. Shape (n, k).
        every: Samples from one to the next, at most.
        step: Way in y from one to the next, at most, unless samples are farther apart.
    """
    way = np.abs(np.diff(y, axis=0)).max(axis=1, initial=0.0)
    share = np.cumsum(np.maximum(way / step, 1.0 / every))
    new = np.flatnonzero(np.diff(np.floor(np.concatenate([[0.0], share]))))
    return np.asarray(np.unique([0, *new, len(y) - 1]))


def predicted(y: Array, rows: Rows, z: Array, K: Array) -> Array:
    """Unknowns of all samples by Hermite's interpolation over the number of the sample. Shape (n, n_z).

    What the samples differ from the interpolated motion is made up for to first order, so that they need not be evenly
    spread; where they jump, the prediction is bad.

    Args:
        y: Independent coordinates. Shape (n, k).
        rows: Samples whose poses are known, the first and the last among them. Shape (m,).
        z, K: Unknowns there, shape (m, n_z), and their velocity map, (m, n_z, k).
    """
    n, some, slope = len(y), y[rows], np.gradient(y, axis=0)[rows]
    i = np.minimum(np.searchsorted(rows, np.arange(n), side="right") - 1, len(rows) - 2)
    width = (rows[i + 1] - rows[i])[:, None].astype(float)
    s = (np.arange(n) - rows[i])[:, None] / width
    left, right, part = s * (1.0 - s) ** 2 * width, s * s * (s - 1.0) * width, s * s * (3.0 - 2.0 * s)

    def between(x: Array, rate: Array) -> Array:
        return np.asarray(x[i] + part * (x[i + 1] - x[i]) + left * rate[i] + right * rate[i + 1])

    away = (y - between(some, slope))[..., None]
    turned = (1.0 - s) * (K[i] @ away)[..., 0] + s * (K[i + 1] @ away)[..., 0]
    return np.asarray(between(z, (K @ slope[..., None])[..., 0]) + turned)
