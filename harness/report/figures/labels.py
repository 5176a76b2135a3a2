"""Finds places for short labels so that they cover neither points nor lines nor each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.report.svg import text_width

Spot = tuple[float, float, str]  # x, y of the middle of the text's height; its anchor: start, middle or end
SIZE = 7.5  # of the letters
TALL, ASIDE = 1.25 * SIZE, 1.5  # height of a label; what stays free beside it
ROUND = (
    *((8, 0), (-8, 0), (0, -10), (0, 10), (8, -8), (8, 8), (-8, -8), (-8, 8)),
    *((12, -14), (12, 14), (-12, -14), (-12, 14)),
)


def around(x: float, y: float) -> list[Spot]:
    """Spots for the label of a point, the best first."""
    return [(x + dx, y + dy, "middle" if dx == 0 else "start" if dx > 0 else "end") for dx, dy in ROUND]


def boxes(x: Array, y: Array, reach: float) -> Array:
    """Squares about points: left, top, right, bottom. Shape (n,) -> (n, 4)."""
    return np.column_stack([x - reach, y - reach, x + reach, y + reach])


def along(x: Array, y: Array) -> Array:
    """Small boxes along a polyline, as close together as a letter is small. Shape (n_box, 4)."""
    parts = [np.empty((0, 4))]
    for start, end in pairwise(np.column_stack([x, y])):
        if np.isfinite([start, end]).all():
            steps = np.linspace(start, end, int(np.hypot(*(end - start)) / 3.0) + 2)
            parts.append(boxes(steps[:, 0], steps[:, 1], 1.0))
    return np.vstack(parts)


def place(
    wanted: Iterable[tuple[str, Sequence[Spot]]], taken: Iterable[Array], avoid: Iterable[Array], area: Array
) -> list[Spot | None]:
    """A spot for each label, or None where there is no room.

    Args:
        wanted: Texts and the spots where each may stand; the most important text first.
        taken: Boxes that must stay free. Shapes (n, 4).
        avoid: Boxes that are covered only if nothing else is left. Shapes (n, 4).
        area: The box where labels may be. Shape (4,).
    """
    full, lines = (np.vstack([np.empty((0, 4)), *them]) for them in (taken, avoid))
    spots: list[Spot | None] = []
    for text, choices in wanted:
        fits = [(spot, box) for spot in choices if _inside(box := _box(spot, text), area) and _free(box, full)]
        fits.sort(key=lambda fit: not _free(fit[1], lines))
        spots.append(fits[0][0] if fits else None)
        full = np.vstack([full, *(box for _, box in fits[:1])])
    return spots


def _box(spot: Spot, text: str) -> Array:
    wide, (x, y, anchor) = text_width(text, SIZE), spot
    left = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * wide
    return np.array([left - ASIDE, y - TALL / 2, left + wide + ASIDE, y + TALL / 2])


def _inside(box: Array, area: Array) -> bool:
    return bool((box[:2] >= area[:2]).all() and (box[2:] <= area[2:]).all())


def _free(box: Array, others: Array) -> bool:
    return not ((box[:2] < others[:, 2:]) & (others[:, :2] < box[2:])).all(axis=1).any()
