"""A page of panels: title, notes and legends above axes of the size asked for, saved as SVG. Lengths in points."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from typing import Any

from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from screwgauge.report.blocks import Picture
from screwgauge.report.figures.frame import Panel, draw_frame, room
from screwgauge.report.figures.style import SMALL, Look
from screwgauge.report.formatting import number

EDGE, GAP, LINE = 7.0, 22.0, 6.0  # beside the page, between columns of axes, between lines of text [points]
TITLE, FOOT, BARE = 12.0, 38.0, 10.0  # a line of the titles of axes; below a row of axes with a label, and without
NOTE, WARNING = "#444444", "#8a3b00"
Looks = Mapping[str, Look]
NARROWEST = 1e-6  # of the largest value: a linear axis shows no smaller range
FEW = 2  # decades below which 1, 2 and 5 times each of them are ticks


@dataclass(frozen=True, slots=True)
class Page:
    """A figure and its axes, row by row; each row will be so high."""

    figure: Figure
    axes: list[Panel]
    heights: Sequence[float]
    columns: int

    @property
    def rows(self) -> list[list[Panel]]:
        """The axes of each row."""
        return [self.axes[i : i + self.columns] for i in range(0, len(self.axes), self.columns)]


def panels(
    width: float,
    heights: Sequence[float],
    columns: int = 1,
    n: int | None = None,
    *,
    sharex: bool = False,
    sharey: bool = False,
) -> Page:
    """A page of `n` axes, by default as many as there is room for; all may share x, those of a row y."""
    figure, axes, n = Figure((width / 72.0, 1.0)), list[Panel](), n or len(heights) * columns
    for k in range(n):
        x, y = axes[0] if sharex and k else None, axes[k - k % columns] if sharey and k % columns else None
        ax = Panel(figure, (0.0, 0.0, 1.0, 1.0), sharex=x, sharey=y)
        ax.named = (not sharex or k + columns >= n, y is None)
        figure.add_axes(ax)
        axes.append(ax)
    return Page(figure, axes, heights, columns)


def linear_scale(axis: Axis) -> None:
    """Gives a linear axis, its limits known, few ticks with names of their own, and no range that is but rounding."""
    low, high = axis.get_view_interval()
    size = max(abs(low), abs(high))
    if high - low < NARROWEST * size:
        axis.set_view_interval((low + high - NARROWEST * size) / 2, (low + high + NARROWEST * size) / 2, ignore=True)
    axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    if not 1e-3 <= size < 1e5:
        axis.set_major_formatter(lambda value, _: number(value, 8).replace("-", "\N{MINUS SIGN}"))


def log_scale(axis: Axis, name: Callable[[float], str] | None = None) -> None:
    """Makes an axis, its data known, logarithmic, with ticks at decades or parts of them; `name` writes a tick."""
    (axis.axes.set_xscale if axis is axis.axes.xaxis else axis.axes.set_yscale)("log")
    low, high = axis.get_view_interval()
    parts = (1.0, 2.0, 5.0) if high < 10.0**FEW * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=parts, numticks=7))
    axis.set_major_formatter(lambda value, _: (name or power)(value))
    axis.set_minor_locator(NullLocator())


def power(value: float) -> str:
    """``0.01``, ``500``, ``1e4``."""
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{value:g}" if 1e-2 <= value <= 1e3 else f"{mantissa}e{int(exponent)}"


def handles(looks: Looks) -> list[Line2D]:
    """What stands in a legend."""
    return [Line2D([], [], label=name, **look) for name, look in looks.items()]


def arrange(
    page: Page,
    title: str,
    notes: Sequence[str] = (),
    warnings: Sequence[str] = (),
    above: Sequence[Looks] = (),
    side: Looks | None = None,
    under: Sequence[Looks] = (),
    below: Looks | None = None,
) -> None:
    """Writes what stands around the axes, gives everything its place, and the page the height that it needs.

    The constrained layout of matplotlib does the like, but takes longer than all the rest: 2.8 s instead of 1.3 s for
    each diagram of a run on a busy machine.

    Args:
        notes: How to read it.
        warnings: What it does not show.
        above, side, under, below: Legends; `under`: one for each axes.
    """
    figure, width = page.figure, 72.0 * page.figure.get_size_inches()[0]
    told = [*((note, NOTE) for note in notes), *((warning, WARNING) for warning in warnings)]
    around: list[Any] = [figure.text(0, 0, title, size=11.5, weight="bold", va="top")]
    around += [figure.text(0, 0, textwrap.fill(text, int(width / 5)), color=colour, va="top") for text, colour in told]
    around += [_legend(figure, looks, width - 2 * EDGE) for looks in above if looks]
    spots, y = [], EDGE
    for one in around:
        spots.append((EDGE, y))
        y += one.get_window_extent().height + LINE
    before, right = [EDGE + room(figure, page.axes[i :: page.columns]) for i in range(page.columns)], width
    if side:
        around.append(_legend(figure, side, 0.0))
        right -= around[-1].get_window_extent().width + EDGE
        spots.append((right, y + LINE))
    cell, boxes = (right - sum(before)) / page.columns, []
    for k, (row, height) in enumerate(zip(page.rows, page.heights, strict=True)):
        y += LINE + TITLE * max(len(ax.get_title(loc="left").splitlines()) for ax in row)
        foot, end = y + height + (FOOT if row[0].get_xlabel() else BARE), 0.0
        for i, _ in enumerate(row):
            left = sum(before[: i + 1]) + i * cell
            boxes.append((left, y + height, cell - GAP, height))
            if looks := under[k * page.columns + i] if under else None:
                around.append(_legend(figure, looks, cell, SMALL))
                spots.append((left - 12.0, foot))
                end = max(end, around[-1].get_window_extent().height + LINE)
        y = foot + end
    if below:
        around.append(_legend(figure, below, width - 2 * EDGE))
        spots.append((EDGE, y))
        y += around[-1].get_window_extent().height + LINE
    figure.set_size_inches(width / 72.0, y / 72.0)
    for ax, (left, bottom, wide, high) in zip(page.axes, boxes, strict=True):
        ax.set_position((left / width, 1.0 - bottom / y, wide / width, high / y))
    for k, ax in enumerate(page.axes):
        draw_frame(figure, ax, boxes[k][0] - before[k % page.columns] + EDGE)
    for one, (left, top) in zip(around, spots, strict=True):
        at = (left / width, 1.0 - top / y)
        one.set_bbox_to_anchor(at) if isinstance(one, Legend) else one.set_position(at)


def _legend(figure: Figure, looks: Looks, room: float, size: float | None = None) -> Legend:
    """A legend in as few lines as there is room for."""
    for lines in range(1, len(looks)):
        legend = figure.legend(handles=handles(looks), loc="upper left", fontsize=size, ncols=-(-len(looks) // lines))
        if legend.get_window_extent().width <= room:
            return legend
        legend.remove()
    return figure.legend(handles=handles(looks), loc="upper left", fontsize=size)


def saved(page: Page, name: str) -> Picture:
    """The picture of a page that is arranged, without a date, places to a hundredth of a point."""
    text = StringIO()
    FigureCanvasSVG(page.figure).print_svg(text, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    svg = re.sub(r'(?<= d=")[^"]*', lambda path: re.sub(r"(?<=\.\d\d)\d+", "", path[0]), text.getvalue())
    return Picture(name, page.figure.texts[0].get_text(), svg[svg.index("<svg ") :])
