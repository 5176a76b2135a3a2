"""One page of small plots: for each case the digits kept over its severity, a line per engine."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from screwgauge.bench.looks import Look, looks
from screwgauge.report.formatting import MAX_DIGITS, digits, number
from screwgauge.report.plots import Plot
from screwgauge.report.sheet import GREY, style
from screwgauge.report.svg import tidy
from screwgauge.stress.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Case
from screwgauge.stress.run import Row, Stress

COLUMNS, WIDE, TALL = 3, 3.9, 2.75  # small plots side by side; inches of each
NO_NUMBER = -1.2  # where a row without a number stands
RED = "#a4262c"


def make_plots(found: Stress) -> list[Plot]:
    """The page, if there is anything to draw."""
    drawn = [case for case in found.cases if _points(found, case)]
    if not drawn:
        return []
    engines = dict.fromkeys((row.finding.engine, False) for case in drawn for row in _points(found, case))
    look = looks(list(engines))
    title = "Digits kept as scenes become extreme"
    lines = -(-len(drawn) // COLUMNS)
    columns = min(COLUMNS, len(drawn))
    legend = 0.3 + 0.24 * -(-(len(look) + 4) // (2 * columns))
    width, height = columns * WIDE + 0.2, lines * TALL + 0.75 + legend
    with style():
        canvas = Canvas(figsize=(width, height))
        canvas.text(0.1 / width, 1 - 0.1 / height, title, va="top", weight="bold", size=11.5)
        note = "Severity grows to the right; above the dotted line a result needs no warning."
        canvas.text(0.1 / width, 1 - 0.38 / height, note, va="top", color="#444444")
        _legend(canvas, look, columns)
        for i, case in enumerate(drawn):
            line, column = divmod(i, COLUMNS)
            left, top = 0.55 + column * WIDE, 0.75 + legend + line * TALL + 0.3
            box = (
                left / width,
                1 - (top + TALL - 0.95) / height,
                (WIDE - 0.75) / width,
                (TALL - 0.95) / height,
            )
            _small(canvas.add_axes(box), case, _points(found, case), look)
        text = StringIO()
        canvas.savefig(text, format="svg", metadata={"Date": None})
    return [Plot("01-digits", title, tidy(text.getvalue()))]


def _points(found: Stress, case: Case) -> list[Row]:
    return [
        row for row in found.rows if row.case == case.name and row.finding.quantity in (case.drawn, "judge")
    ]


def _small(ax: Any, case: Case, rows: Sequence[Row], look: dict[tuple[str, bool], Look]) -> None:
    severities = sorted({row.severity for row in rows})
    place = _places(severities)
    for engine in dict.fromkeys(row.finding.engine for row in rows):
        here = sorted((row for row in rows if row.finding.engine == engine), key=lambda row: row.severity)
        x = np.array([place[row.severity] for row in here])
        y = np.array([digits(row.finding.error) for row in here])
        colour = look[engine, False]
        ax.plot(x, y, color=colour.colour, linewidth=1.1, zorder=3)
        for row, u, v in zip(here, x, y, strict=True):
            height = NO_NUMBER if np.isnan(v) else v
            ax.plot([u], [height], **_mark(row.finding.verdict, colour), clip_on=False, zorder=4)
    ax.axhline(digits(GOOD), color=GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
    ax.set_ylim(-1.8, MAX_DIGITS + 0.4)
    ax.yaxis.set_major_locator(FixedLocator([0, 3, 6, 9, 12, 15]))
    ax.set_ylabel("digits", size=8.5, labelpad=2)
    _severity_axis(ax, case, severities, place)
    ax.set_title(case.title, size=9, loc="left", weight="bold")
    ax.tick_params(length=3, labelsize=8)


def _places(severities: Sequence[float]) -> dict[float, float]:
    """Decades; zero stands one decade before the smallest."""
    least = min((s for s in severities if s > 0), default=1.0)
    return {s: float(np.log10(s)) if s > 0 else float(np.log10(least)) - 1.0 for s in severities}


def _severity_axis(ax: Any, case: Case, severities: Sequence[float], place: dict[float, float]) -> None:
    low, high = min(place.values()), max(place.values())
    margin = 0.04 * max(high - low, 1.0)
    ax.set_xlim(*((high + margin, low - margin) if case.falling else (low - margin, high + margin)))
    step = max(1, int(np.ceil((high - low) / 6)))
    ticks = [float(k) for k in range(int(np.ceil(low)), int(np.floor(high)) + 1) if k % step == 0]
    zero = [place[0.0]] if 0.0 in place else []
    ticks = sorted({*zero, *(t for t in ticks if not zero or abs(t - zero[0]) > 0.6 * step)})
    names = {place[0.0]: "0"} if zero else {}
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda t, _: names.get(t, number(10.0**t, 2))))
    ax.set_xlabel(case.axis, size=8.5, labelpad=2)


def _mark(verdict: str, look: Look) -> dict[str, Any]:
    """Full: ok; hollow: degraded; a cross below the axis: refused; a red square: silently wrong."""
    common: dict[str, Any] = {"linestyle": "none", "markeredgecolor": look.colour, "markeredgewidth": 1.1}
    return {
        OK: {**common, "marker": look.marker, "markersize": 4.5, "markerfacecolor": look.colour},
        DEGRADED: {**common, "marker": look.marker, "markersize": 5, "markerfacecolor": "white"},
        REFUSED: {**common, "marker": "x", "markersize": 5},
        SILENT: {
            **common,
            "marker": "s",
            "markersize": 6.5,
            "markerfacecolor": look.colour,
            "markeredgecolor": RED,
            "markeredgewidth": 1.8,
        },
    }[verdict]


def _legend(canvas: Canvas, look: dict[tuple[str, bool], Look], columns: int) -> None:
    wide, tall = canvas.get_size_inches()
    plain = Look(GREY, "o", False)
    handles = [Line2D([], [], label=name, **value.style(4.5)) for (name, _), value in look.items()]
    words = {OK: "ok", DEGRADED: "degraded, and says so", REFUSED: "refused", SILENT: "silently wrong"}
    handles += [Line2D([], [], label=words[verdict], **_mark(verdict, plain)) for verdict in words]
    canvas.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.1 / wide, 1 - 0.62 / tall),
        ncols=2 * columns,
        frameon=False,
        borderaxespad=0.0,
        fontsize=8.5,
        handletextpad=0.5,
        columnspacing=1.4,
    )
