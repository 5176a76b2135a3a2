"""What stands at the edges of axes: their lines, ticks and grid as one path each, the names as text of the page.

Matplotlib makes several objects for each tick, which took half of the time of a report.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform

from screwgauge.reference.rotations import Array

TICK, PAD, AWAY = 3.5, 7.0, 20.0  # length of a tick; from an axis to the names of ticks, and below it to its own
LABEL = 13.0  # what the name of a y axis takes, with the gap beside it
INK, GRID = "#000000", "#e4e4e4"


class Panel(Axes):
    """Axes without ticks of their own: `draw_frame` draws them. `named`: whether ticks of x and of y have names."""

    named = (True, True)

    def _init_axis(self) -> None:
        super()._init_axis()  # type: ignore[misc]
        for axis in (self.xaxis, self.yaxis):
            vars(axis).update(set_clip_path=_nothing)

    def grid(self, *args: Any, **kwargs: Any) -> None:
        """Nothing: it would make ticks."""

    def tick_params(self, *args: Any, **kwargs: Any) -> None:
        """Nothing: it would make ticks."""


def _nothing(*args: Any, **kwargs: Any) -> None:
    """Instead of what would make ticks."""


def ticks(axis: Axis) -> tuple[Array, list[str]]:
    """Places on the page of the ticks within the limits [points], and their names."""
    ax, upright = axis.axes, axis is axis.axes.yaxis
    values = np.asarray(axis.get_majorticklocs(), dtype=float)
    corner = np.tile([ax.get_xlim()[0], ax.get_ylim()[0]], (len(values), 1))
    corner[:, int(upright)] = values
    at = ax.transData.transform(corner)[:, int(upright)]
    low, high = ax.bbox.intervaly if upright else ax.bbox.intervalx
    seen = (at > low - 1e-6) & (at < high + 1e-6)
    names = axis.get_major_formatter().format_ticks(values.tolist())
    return at[seen], [name for name, shown in zip(names, seen, strict=True) if shown]


def room(figure: Figure, column: Iterable[Panel]) -> float:
    """What is written to the left of axes is so wide."""
    names = [name for ax in column if ax.axison and ax.named[1] for name in ticks(ax.yaxis)[1]]
    said = any(ax.get_ylabel() for ax in column)
    return (PAD + _width(figure, names) if names else 0.0) + (LABEL if said else 0.0)


def draw_frame(figure: Figure, ax: Panel, left: float) -> None:
    """Draws lines, ticks and grid of axes that have their final place, and writes names; `left`: where that of y is."""
    if not ax.axison:
        return
    (x0, y0), (x1, y1) = ax.bbox.min, ax.bbox.max
    (across, x_names), (up, y_names) = ticks(ax.xaxis), ticks(ax.yaxis)
    grid = [*(((x, y0), (x, y1)) for x in across), *(((x0, y), (x1, y)) for y in up)]
    edge = [((x0, y0), (x0, y1)), ((x0, y0), (x1, y0))]
    edge += [*(((x, y0), (x, y0 - TICK)) for x in across), *(((x0, y), (x0 - TICK, y)) for y in up)]
    for lines, colour, wide, order in ((grid, GRID, 0.6, 0.5), (edge, INK, 0.7, 2.5)):
        path = Path(np.reshape(lines, (-1, 2)), [Path.MOVETO, Path.LINETO] * len(lines))
        look = {"color": colour, "linewidth": wide, "zorder": order, "fill": False, "clip_on": False}
        ax.add_artist(PathPatch(path, transform=IdentityTransform(), **look))
    write = partial(figure.text, transform=IdentityTransform(), ha="center", va="top")
    for x, name in zip(across, x_names, strict=True) if ax.named[0] else ():
        write(x, y0 - PAD, name)
    for y, name in zip(up, y_names, strict=True) if ax.named[1] else ():
        write(x0 - PAD, y, name, ha="right", va="center_baseline")
    write((x0 + x1) / 2, y0 - AWAY, ax.get_xlabel())
    write(left, (y0 + y1) / 2, ax.get_ylabel(), rotation=90.0, rotation_mode="anchor")
    ax.set_axis_off()


def _width(figure: Figure, lines: Sequence[str]) -> float:
    """Of the longest line [points]."""
    text = figure.text(0.0, 0.0, "\n".join(lines))
    wide: float = text.get_window_extent().width
    text.remove()
    return wide
