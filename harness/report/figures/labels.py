"""Finds places for short labels so that they cover neither points nor lines nor each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from screwgauge.report.figures.style import SMALL, Look

Spot = tuple[float, float, float, float]  # where it belongs on the axes; from there [points]
ROUND = (
    *((8, 0), (-8, 0), (0, -10), (0, 10), (8, -8), (8, 8), (-8, -8), (-8, 8)),
    *((12, -14), (12, 14), (-12, -14), (-12, 14)),
)
BEHIND = 1.5  # z order of guides, which labels may cross where nothing else is left


@dataclass(frozen=True, slots=True)
class Label:
    """A text and the spots where it may stand, the best first; a label that is not `needed` may be left out."""

    text: str
    colour: str
    spots: Sequence[Spot]
    coordinates: str | tuple[str, str] = "data"
    needed: bool = False


def beside(at: Iterable[float], text: str, colour: str, *, needed: bool = False) -> Label:
    """The label of a point."""
    x, y = at
    return Label(text, colour, [(x, y, dx, dy) for dx, dy in ROUND], needed=needed)


def guide(ax: Axes, at: float, text: str, look: Look, *, upright: bool = False) -> Label:
    """Draws a straight line across at one y, or at one x if `upright`; its label stands near its right end, or top."""
    (ax.axvline if upright else ax.axhline)(at, zorder=BEHIND, **look)
    if upright:
        spots = [(at, up, dx, 0.0) for up in np.linspace(0.97, 0.03, 12).tolist() for dx in (-3.0, 3.0)]
        return Label(text, look["color"], spots, ("data", "axes fraction"), needed=True)
    spots = [(across, at, -1e-9, dy) for across in np.linspace(1.0, 0.5, 6).tolist() for dy in (5.0, -5.5)]
    return Label(text, look["color"], spots, ("axes fraction", "data"), needed=True)


def place(ax: Axes, labels: Sequence[Label]) -> None:
    """Writes the labels, the most important first, onto axes that have their final size."""
    lines = [(line, line.get_transform().transform(line.get_xydata())) for line in ax.get_lines()]
    marks = np.vstack([np.empty((0, 2)), *(xy for line, xy in lines if line.get_marker() not in ("", "None", None))])
    paths = [(line, Path(xy).interpolated(200).vertices) for line, xy in lines if line.get_linestyle() != "None"]
    strokes, guides = (
        np.vstack([np.empty((0, 2)), *(xy for line, xy in paths if (line.get_zorder() == BEHIND) is side)])
        for side in (False, True)
    )
    taken: list[Bbox] = []
    for label in labels:
        fits, crossing = [], []
        for spot in label.spots:
            note = _written(ax, label, spot)
            box = note.get_window_extent().padded(1.5)
            inside = ax.bbox.padded(4.0).count_contains(box.corners()) == 4
            crowded = box.padded(3.0).count_contains(marks) or box.padded(1.0).count_contains(strokes)
            note.remove()
            if inside and not crowded and not box.count_overlaps(taken):
                crossing.append(spot)
                if not box.count_contains(guides):
                    fits.append(spot)
                    break
        if chosen := [*fits, *crossing, *(label.spots[:1] if label.needed else ())]:
            taken.append(_written(ax, label, chosen[0]).get_window_extent().padded(1.0))


def _written(ax: Axes, label: Label, spot: Spot) -> Annotation:
    x, y, dx, dy = spot
    side = "center" if dx == 0.0 else "left" if dx > 0.0 else "right"
    return ax.annotate(
        label.text, (x, y), (dx, dy), label.coordinates, "offset points",
        ha=side, va="center", size=SMALL, color=label.colour, annotation_clip=False,
    )  # fmt: skip
