"""Puts short labels beside points so that they cover neither points nor each other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

Label = tuple[float, float, str, str]
Lines = Sequence[Sequence[tuple[float, float]]]
SIZE = 7.5  # points
_LETTER, _LINE = 0.60, 1.25  # widths and heights of letters, in sizes
_PLACES = (
    (8, 0),
    (-8, 0),
    (0, 9),
    (0, -9),
    (8, 8),
    (8, -8),
    (-8, 8),
    (-8, -8),
    (12, 14),
    (12, -14),
    (-12, 14),
    (-12, -14),
)


def place(ax: Any, wanted: Sequence[Label], points: Sequence[tuple[float, float]], lines: Lines = ()) -> int:
    """Writes labels where there is room for them.

    Args:
        ax: Axes with their final limits and scales.
        wanted: (x, y, text, colour), the most important first.
        points: All points that must stay free, in data coordinates.
        lines: Polylines that labels must not cross, each a list of points.

    Returns:
        How many labels found no room.
    """
    scale = 72.0 / ax.figure.dpi

    def to_points(pairs: Sequence[tuple[float, float]]) -> Any:
        return ax.transData.transform(np.array(pairs, dtype=float).reshape(-1, 2)) * scale

    taken = [(x - 4.0, y - 4.0, x + 4.0, y + 4.0) for x, y in to_points(points)]
    for line in lines:
        taken += [(x - 1.0, y - 1.0, x + 1.0, y + 1.0) for x, y in _along(to_points(line))]
    (x0, y0), (x1, y1) = ax.transAxes.transform([(0, 0), (1, 1)]) * scale
    left_over = 0
    for x, y, text, colour in wanted:
        (px, py) = to_points([(x, y)])[0]
        for dx, dy in _PLACES:
            box = _box(px + dx, py + dy, dx, dy, text)
            inside = box[0] >= x0 and box[2] <= x1 and box[1] >= y0 and box[3] <= y1
            if inside and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                sides = {True: "left", False: "right"}
                ax.annotate(
                    text,
                    (x, y),
                    xytext=(dx, dy),
                    textcoords="offset points",
                    ha="center" if dx == 0 else sides[dx > 0],
                    va="center",
                    size=SIZE,
                    color=colour,
                )
                break
        else:
            left_over += 1
    return left_over


def _along(corners: Any) -> list[Any]:
    """Points on a polyline, as close together as a letter is small."""
    found: list[Any] = []
    for start, end in pairwise(corners):
        n = int(np.hypot(*(end - start)) / 3.0) + 2
        found += list(start + np.linspace(0.0, 1.0, n)[:, None] * (end - start))
    return found


def _box(x: float, y: float, dx: float, dy: float, text: str) -> tuple[float, float, float, float]:
    wide, tall = _LETTER * SIZE * len(text), _LINE * SIZE
    left = x - wide / 2 if dx == 0 else x if dx > 0 else x - wide
    return left, y - tall / 2, left + wide, y + tall / 2


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
