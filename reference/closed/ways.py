"""Ways in the independent coordinates from one sample to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from screwgauge.reference.rotations import Array

Way = Callable[[float], Array]
"""Share of a way, 0 to 1, -> independent coordinates (k,)."""


def quintic(before: Sequence[Array], after: Sequence[Array]) -> Way:
    """The polynomial of degree five between two samples: time, values, first and second derivatives."""
    (t0, y0, v0, a0), (t1, y1, v1, a1) = before, after
    h = float(t1 - t0)
    v0, v1, a0, a1 = h * v0, h * v1, h * h * a0, h * h * a1

    def way(s: float) -> Array:
        r = y1 - y0 - v0 - 0.5 * a0
        v, a = v1 - v0 - a0, a1 - a0
        c3, c4, c5 = 10 * r - 4 * v + 0.5 * a, -15 * r + 7 * v - a, 6 * r - 3 * v + 0.5 * a
        return np.asarray(y0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5)))))

    return way


def straight_and_bent(origin: Array, target: Array) -> list[Way]:
    """The straight way, and two that bend to either side of it."""
    along = target - origin
    across = np.eye(len(along))[int(np.argmin(np.abs(along)))]
    across = across - along * (across @ along) / max(float(along @ along), np.finfo(float).tiny)
    bends = 0.3 * np.linalg.norm(along) * across

    def bent(sign: float) -> Way:
        return lambda s: np.asarray(origin + s * along + sign * np.sin(np.pi * s) * bends)

    return [bent(sign) for sign in ((0.0, 1.0, -1.0) if len(along) > 1 else (0.0,))]


def rest(way: Way, done: float) -> Way:
    """What is left of a way after a share of it."""
    return lambda s: way(done + s * (1.0 - done))
