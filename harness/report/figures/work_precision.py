"""A work-precision diagram: error against time, a line for each family, a label for each setting."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from screwgauge.report.figures.labels import Label, beside, guide
from screwgauge.report.figures.page import log_scale
from screwgauge.report.figures.style import GREY, Look, darker

ZERO = 1e-17  # where an error of exactly zero is drawn
FILLED: Look = {"color": GREY, "linestyle": "", "marker": "o", "markersize": 6.0}
HOLLOW: Look = {"linestyle": "", "markerfacecolor": "white"}
STAR: Look = {"color": "#555555", "linestyle": "", "marker": "*", "markersize": 9.0}
DASHED: Look = {"color": "#555555", "linestyle": (0, (6, 3)), "linewidth": 1.0}


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of a family, or a published result. `whole`: it ran to the end; others are hollow."""

    time_s: float
    error: float
    label: str
    whole: bool = True

    @property
    def at(self) -> tuple[float, float]:
        """Where it is drawn."""
        return self.time_s, max(self.error, ZERO)


def work_precision(
    ax: Axes,
    lines: Iterable[tuple[Look, Sequence[Point]]],
    name: Callable[[float], str],
    published: Iterable[Point] = (),
) -> list[Label]:
    """Draws points of families, and those of others.

    Args:
        name: Writes a time.
        published: Points of others; a line across where only the time or only the error is known.

    Returns:
        The labels wanted, the most important first.
    """
    guides, stars, ends, between = list[tuple[float, str, bool]](), list[Label](), list[Label](), list[Label]()
    for point in published:
        timed, known = np.isfinite([point.time_s, point.error])
        if timed and known:
            ax.plot(*point.at, **STAR)
            stars.append(beside(point.at, point.label, STAR["color"]))
        elif timed or known:
            guides.append((point.time_s if timed else point.error, point.label, bool(timed)))
    for look, points in lines:
        short = [point.at for point in points if not point.whole]
        for some, how in (([point.at for point in points], look), (short, look | HOLLOW)):
            ax.plot(*np.reshape(some, (-1, 2)).T, **how)
        labels = [beside(point.at, point.label, darker(look["color"])) for point in points if point.label]
        ends += [*labels[:1], *labels[1:][-1:]]  # the ends of a line say most
        between += labels[1:-1]
    drawn = [guide(ax, at, text, DASHED, upright=upright) for at, text, upright in guides]
    ax.margins(0.06)
    log_scale(ax.xaxis, name)
    log_scale(ax.yaxis)
    return [*drawn, *stars, *ends, *between]
