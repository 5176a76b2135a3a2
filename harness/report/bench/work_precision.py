"""A work-precision diagram: error against time, a line for each family, a label for each setting."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.report.figures.axes import log
from screwgauge.report.figures.data import Guide, Label, Look, Panel, Series
from screwgauge.report.figures.looks import GREY, darker

ZERO = 1e-17  # where an error of exactly zero is drawn
HOLLOW = "white"
FILLED = Look(GREY, None, 1.1, "o", size=6.0)
STAR, DASHED = Look("#555555", None, 1.0, "*", size=8.0), Look("#555555", (6.0, 3.0), 1.0)


@dataclass(frozen=True, slots=True)
class Point:
    """One setting of a family, or a published result. `whole`: it ran to the end; others are hollow."""

    time_s: float
    error: float
    label: str
    whole: bool = True


def work_precision(
    axes: tuple[str, str],
    lines: Iterable[tuple[Look, Sequence[Point]]],
    name: Callable[[float], str],
    published: Iterable[Point] = (),
) -> Panel:
    """The panel.

    Args:
        axes: What the times and the errors are.
        lines: Families.
        name: Writes a time.
        published: Points of others; a line across where only the time or only the error is known.
    """
    series, first, between, guides = [], [], [], []
    for point in published:
        timed, known = np.isfinite([point.time_s, point.error])
        if timed and known:
            series.append(Series(np.array([point.time_s]), np.array([point.error]), STAR))
            first.append(Label(point.time_s, point.error, point.label, STAR.colour))
        elif timed or known:
            guides.append(Guide(point.time_s if timed else point.error, DASHED, point.label, upright=bool(timed)))
    for look, points in lines:
        x = np.array([point.time_s for point in points])
        y = np.array([max(point.error, ZERO) for point in points])
        short = np.array([not point.whole for point in points], dtype=bool)
        series += [Series(x, y, look), Series(x[short], y[short], replace(look, dash=None, fill=HOLLOW))]
        labels = [Label(u, v, p.label, darker(look.colour)) for u, v, p in zip(x, y, points, strict=True) if p.label]
        first += [*labels[:1], *labels[1:][-1:]]  # the ends of a line say most
        between += labels[1:-1]
    times = np.concatenate([*(one.x for one in series), [guide.at for guide in guides if guide.upright]])
    errors = np.concatenate([*(one.y for one in series), [guide.at for guide in guides if not guide.upright]])
    across, up = log(axes[0], [times / 1.5, times * 1.5], name), log(axes[1], [errors / 2, errors * 2])
    return Panel(across, up, tuple(series), guides=tuple(guides), labels=(*first, *between))
