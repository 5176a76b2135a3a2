"""Curves thinned to what a screen shows, without losing a peak."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array

Index = NDArray[np.intp]

POINTS = 100  # evenly spaced points to start from
BINS = 250
MISS = 2e-3  # of the height of the panel: 0.3 points on paper
ROUNDS = 12
CROWDED = 800  # from here on the strokes touch


def thin(t: Array, v: Array, height: float) -> tuple[Array, Array]:
    """Samples whose straight lines miss no other sample by more than `MISS` of the height.

    Starts from evenly spaced samples and adds the worst sample of each gap: a smooth curve keeps about a
    hundred points, a fast one more, and a peak of one sample stays.

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
    kept = np.unique(np.linspace(0, n - 1, POINTS).round().astype(int))
    for _ in range(ROUNDS):
        miss = np.abs(np.interp(t, t[kept], filled[kept]) - filled)
        worst = _argmax_between(miss, kept)
        worst = worst[miss[worst] > MISS * height]
        if not len(worst):
            break
        kept = np.union1d(kept, worst)
    if len(kept) > CROWDED:
        kept = _extremes(filled, CROWDED // 4)
    edges = np.flatnonzero(np.diff(finite.astype(int)))
    kept = np.union1d(kept, np.concatenate([edges, edges + 1]))
    return t[kept], np.where(finite[kept], v[kept], np.nan)


def _argmax_between(miss: Array, kept: Index) -> Index:
    """Position of the largest value from each kept sample to the next. Shape (n_kept - 1,)."""
    largest = np.maximum.reduceat(miss, kept[:-1])
    segment = np.searchsorted(kept[:-1], np.arange(len(miss)), side="right") - 1
    hits = np.flatnonzero(miss == largest[segment])
    _, first = np.unique(segment[hits], return_index=True)
    return hits[first]


def _extremes(v: Array, bins: int) -> Index:
    """Position of the lowest and the highest sample of each stretch, and both ends."""
    parts = np.array_split(np.arange(len(v)), bins)
    lows, highs = ([part[pick(v[part])] for part in parts] for pick in (np.argmin, np.argmax))
    return np.unique([0, *lows, *highs, len(v) - 1])


def bin_maxima(t: Array, v: Array, bins: int = BINS) -> tuple[Array, Array]:
    """The largest value of each of `bins` stretches, at its own time; NaN only where a stretch has no number.

    Args:
        t: Time [s]. Shape (n,).
        v: Values, at least 0 where they are numbers. Shape (n,).

    Returns:
        Times and maxima. Shapes (min(n, bins),).
    """
    n = len(t)
    if n <= bins:
        return t, v
    at = []
    for part in np.array_split(np.arange(n), bins):
        at.append(part[np.argmax(np.where(np.isnan(v[part]), -1.0, v[part]))])
    return t[at], v[at]


def envelope(a: Array, b: Array) -> Array:
    """Largest difference over the components; NaN as soon as one side is not a number. (n, k) -> (n,)."""
    difference = np.abs(a - b)
    largest: Array = np.where(np.isfinite(difference), difference, np.nan).max(axis=1)
    return largest


def sparse(n: int, slot: int, n_slots: int, marks: int = 9) -> Index:
    """About `marks` samples, staggered so that the marks of different engines do not hide each other."""
    if n <= 2 * marks:
        return np.arange(n)
    return np.unique(((np.arange(marks) + (slot + 0.5) / n_slots) * n / marks).astype(int))
