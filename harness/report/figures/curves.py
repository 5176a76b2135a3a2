"""Curves thinned to what a screen shows, without losing a peak."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array

Index = NDArray[np.intp]

POINTS, CROWDED = 100, 500  # evenly spaced points to start from; how many may still be doubled
BINS = 250
MISS = 2e-3  # of the height of the panel: 0.3 points on paper


def thin(t: Array, v: Array, height: float) -> tuple[Array, Array]:
    """Samples whose straight lines miss no other sample by more than `MISS` of the height.

    Starts from evenly spaced samples and adds the worst sample of each gap: a smooth curve keeps about a
    hundred points, a fast one more until the strokes touch, and a peak of one sample stays.

    Args:
        t: Time [s]. Shape (n,).
        v: Values; not finite where the engine has none. Shape (n,).
        height: Range of the panel, in the unit of v.

    Returns:
        Times and values, NaN where a gap begins and ends. Shapes (n_kept,).
    """
    n, finite = len(t), np.isfinite(v)
    if n <= POINTS or not finite.any():
        return t, np.where(finite, v, np.nan)
    filled = np.interp(np.arange(n), np.flatnonzero(finite), v[finite])
    kept = np.linspace(0, n - 1, POINTS).round().astype(int)
    while len(kept) < CROWDED:
        miss = np.abs(np.interp(t, t[kept], filled[kept]) - filled)
        worst = _argmax(miss, kept[:-1])
        worst = worst[miss[worst] > MISS * height]
        if not len(worst):
            break
        kept = np.union1d(kept, worst)
    edges = np.flatnonzero(np.diff(finite.astype(int)))
    kept = np.union1d(kept, np.concatenate([edges, edges + 1]))
    return t[kept], np.where(finite[kept], v[kept], np.nan)


def _argmax(values: Array, starts: Index) -> Index:
    """Position of the first largest value of each stretch, which begins at `starts`. Shape (n_stretch,)."""
    stretch = np.repeat(np.arange(len(starts)), np.diff([*starts, len(values)]))
    hits = np.flatnonzero(values == np.maximum.reduceat(values, starts)[stretch])
    return hits[np.diff(stretch[hits], prepend=-1) > 0]


def bin_maxima(t: Array, v: Array, bins: int = BINS) -> tuple[Array, Array]:
    """The largest value of each of `bins` stretches, at its own time; NaN only where a stretch has no number.

    Args:
        t: Time [s]. Shape (n,).
        v: Values, at least 0 where they are numbers. Shape (n,).

    Returns:
        Times and maxima. Shapes (min(n, bins),).
    """
    if len(t) <= bins:
        return t, v
    at = _argmax(np.where(np.isnan(v), -1.0, v), np.arange(bins) * len(t) // bins)
    return t[at], v[at]


def sparse(n: int, slot: int, n_slots: int, marks: int = 9) -> Index:
    """About `marks` samples, staggered so that the marks of different engines do not hide each other."""
    if n <= 2 * marks:
        return np.arange(n)
    return np.unique(((np.arange(marks) + (slot + 0.5) / n_slots) * n / marks).astype(int))
