"""Curves in the independent coordinates: Bezier curves of degree five, which lie within the hull of their points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.rotations import Array

State = tuple[Array, Array, Array]
"""Independent coordinates and their first and second derivatives. Shape (..., k) each."""
Drive = Callable[[Array], State]
"""Times (n,) -> the motion there."""

#: A motion and its derivatives belong together if these miss a step by less than this share of it.
CONSISTENT = 0.1
#: Weights of the points that make those of both halves (de Casteljau), and the point half-way. Shape (2, 6, 6), (6,).
_LEFT = np.array([[math.comb(i, j) / 2.0**i for j in range(6)] for i in range(6)])
HALVES = np.stack([_LEFT, _LEFT[::-1, ::-1]])
HALF = _LEFT[-1]


def hermite(h: Array, before: State, after: State) -> Array:
    """Control points of the polynomials of degree five that have given values and derivatives at their ends.

    Args:
        h: Duration [s]. Shape (...).
        before, after: Shape (..., k) each.

    Returns:
        Shape (..., 6, k).
    """
    h = np.asarray(h)[..., None]
    (y0, v0, a0), (y1, v1, a1) = before, after
    first, last = y0 + h * v0 / 5.0, y1 - h * v1 / 5.0
    second, third = 2.0 * first - y0 + h * h * a0 / 20.0, 2.0 * last - y1 + h * h * a1 / 20.0
    return np.stack([y0, first, second, third, last, y1], axis=-2)


def straight(y0: Array, y1: Array) -> Array:
    """Control points of straight ways. Shapes (..., k) -> (..., 6, k)."""
    share = np.linspace(0.0, 1.0, 6)[:, None]
    return np.asarray(y0[..., None, :] * (1.0 - share) + y1[..., None, :] * share)


def bent(y0: Array, y1: Array) -> list[Array]:
    """Control points of two ways that bend to either side of the straight one; none with one coordinate. (6, k)."""
    way = y1 - y0
    if len(way) < 2:
        return []
    across = np.eye(len(way))[int(np.argmin(np.abs(way)))]
    across = across - way * (across @ way) / max(float(way @ way), np.finfo(float).tiny)
    bend = 0.4 * np.linalg.norm(way) * np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.0])[:, None] * across
    return [straight(y0, y1) + sign * bend for sign in (1.0, -1.0)]


def consistent(h: Array, before: State, after: State) -> Array:
    """Whether derivatives belong to a motion through both values: a list of poses may have any. Shape (...)."""
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
        t: Its ends [s].
        drive: The motion itself, where it is known; else the curve is the motion.
    """

    points: Array
    t: tuple[float, float] = (0.0, 1.0)
    drive: Drive | None = None

    def at(self, share: float) -> Array:
        """Where the motion is after a share of the time. Shape (k,)."""
        t0, t1 = self.t
        if self.drive is not None:
            return np.asarray(self.drive(np.array([t0 + share * (t1 - t0)]))[0][0])
        weights = [math.comb(5, i) * share**i * (1.0 - share) ** (5 - i) for i in range(6)]
        return np.asarray(weights @ self.points)

    def halves(self) -> tuple[Curve, Curve, Array]:
        """Both halves, and by how much the motion half-way differs from this curve, shape (k,)."""
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
