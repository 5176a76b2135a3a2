"""Draws a bench: work-precision diagrams, and error against parameter with the fitted slopes."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from screwgauge.report.bench.labels import Label, place
from screwgauge.report.bench.looks import Look, looks
from screwgauge.report.plots import Plot
from screwgauge.report.sheet import GREY, log_scale, style
from screwgauge.report.svg import tidy
from screwgauge.study.bench.contestant import QUANTITIES
from screwgauge.study.bench.rows import LEVELS, Row
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import Fit

WIDTH, HEIGHT = 11.0, 6.6  # inches
ZERO = 1e-17  # where an error of exactly zero is drawn
WORDS = dict(
    zip(
        QUANTITIES,
        ("joint positions", "joint velocities", "joint accelerations", "actuator forces"),
        strict=True,
    )
)


def make_plots(bench: Bench) -> list[Plot]:
    """All pictures of the report."""
    lines = dict.fromkeys((row.contestant.line, row.contestant.given) for row in bench.rows)
    look = looks(list(lines))
    plots: list[Plot] = []
    with style():
        for quantity in QUANTITIES[::-1]:
            rows = [row for row in bench.rows if row.quantity == quantity and _drawable(row)]
            if rows:
                title = f"Error against run time: {WORDS[quantity]}"
                name = f"{len(plots) + 1:02d}-{quantity.replace('_', '-')}"
                plots.append(Plot(name, title, _work_precision(title, rows, look, bench.reference)))
        if bench.fits:
            title = "Error against what is varied, with expected slopes"
            plots.append(Plot(f"{len(plots) + 1:02d}-slopes", title, _slopes(title, bench.fits, look)))
    return plots


def _drawable(row: Row) -> bool:
    return row.contestant.drawn and np.isfinite(row.max_scaled) and bool(row.per_sample > 0)


def _work_precision(title: str, rows: Sequence[Row], look: dict[tuple[str, bool], Look], reference: str) -> str:
    canvas = Canvas(figsize=(WIDTH, HEIGHT))
    ax: Any = canvas.add_axes((0.75 / WIDTH, 0.55 / HEIGHT, 7.3 / WIDTH, (HEIGHT - 1.35) / HEIGHT))
    _heading(
        canvas,
        title,
        f"Lower left is better. Each point is one setting; errors are against {reference}. T: duration of the motion.",
    )
    groups: dict[tuple[str, bool], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.contestant.line, row.contestant.given), []).append(row)
    points = [(1e6 * row.per_sample, max(row.max_scaled, ZERO)) for row in rows]
    x, y = np.array(points).T
    _axes(ax, x, y)
    lines: list[list[tuple[float, float]]] = []
    for key, group in groups.items():
        at = np.array([(1e6 * r.per_sample, max(r.max_scaled, ZERO)) for r in group])
        joined = any(r.contestant.parameter for r in group) or len({r.contestant.name for r in group}) == 1
        ax.plot(
            *at.T,
            **{**look[key].style(), **({} if joined else {"linestyle": "none"})},
            zorder=3,
            clip_on=False,
        )
        if joined:
            lines.append([(float(a), float(b)) for a, b in at])
    place(ax, _wanted(groups, look), points, lines)
    handles = [Line2D([], [], label=name, **look[name, given].style()) for name, given in groups]
    _legend(canvas, handles)
    return _svg(canvas)


def _heading(canvas: Canvas, title: str, note: str) -> None:
    wide, tall = canvas.get_size_inches()
    canvas.text(0.1 / wide, 1 - 0.08 / tall, title, va="top", ha="left", weight="bold", size=11.5)
    canvas.text(0.1 / wide, 1 - 0.36 / tall, note, va="top", ha="left", color="#444444")


def _axes(ax: Any, x: Any, y: Any) -> None:
    ax.set_xscale("log")
    low, high = 10 ** np.floor(np.log10(x.min() / 1.5)), 10 ** np.ceil(np.log10(x.max() * 1.5))
    ax.set_xlim(low, high)
    ax.xaxis.set_major_locator(LogLocator(numticks=99))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _duration(value)))
    log_scale(ax, y.min() / 2, y.max() * 2)
    ax.set_xlabel("run time for each sample delivered")
    ax.set_ylabel("largest scaled error")
    for level in LEVELS:
        ax.axhline(level, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)), zorder=1)
        if y.min() / 2 <= level <= y.max() * 2:
            words, place_ = f"{-np.log10(level):.0f} digits", ax.get_yaxis_transform()
            ax.text(0.995, level, words, transform=place_, ha="right", va="bottom", size=7.5, color=GREY)
    ax.tick_params(length=3)


def _duration(microseconds: float) -> str:
    for unit, size in (("s", 1e6), ("ms", 1e3), ("µs", 1.0), ("ns", 1e-3)):
        if microseconds >= size * 0.999:
            return f"{microseconds / size:.0f} {unit}"
    return f"{microseconds:g} µs"


def _wanted(groups: dict[tuple[str, bool], list[Row]], look: dict[tuple[str, bool], Look]) -> list[Label]:
    """Labels: the ends of each line first, then what lies between."""
    ends: list[Label] = []
    between: list[Label] = []
    for key, group in groups.items():
        for i, row in enumerate(group):
            if row.contestant.label:
                label = (
                    1e6 * row.per_sample,
                    max(row.max_scaled, ZERO),
                    row.contestant.label,
                    look[key].ink,
                )
                (ends if i in (0, len(group) - 1) else between).append(label)
    return ends + between


def _legend(canvas: Canvas, handles: Sequence[Line2D]) -> None:
    wide, tall = canvas.get_size_inches()
    legend = canvas.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(8.25 / wide, 1 - 0.75 / tall),
        borderaxespad=0.0,
        frameon=False,
        handlelength=2.2,
        labelspacing=0.7,
        title="filled: starts from y and its derivatives\nhollow: starts from given joint motion",
        title_fontsize=8.5,
        alignment="left",
    )
    legend.get_title().set_color("#444444")


def _slopes(title: str, fits: Sequence[Fit], look: dict[tuple[str, bool], Look]) -> str:
    columns = min(3, len(fits))
    lines = -(-len(fits) // columns)
    wide, tall = 11.0, 0.75 + 3.0 * lines
    canvas = Canvas(figsize=(wide, tall))
    _heading(canvas, title, "Filled points are fitted; the line has the expected slope through them.")
    for i, fit in enumerate(fits):
        row, column = divmod(i, columns)
        left, top = 0.75 + column * (wide - 0.2) / columns, 0.98 + 3.0 * row
        ax = canvas.add_axes((left / wide, 1 - (top + 2.1) / tall, ((wide - 0.2) / columns - 0.95) / wide, 2.1 / tall))
        _slope(ax, fit, next(value.colour for (name, _), value in look.items() if name == fit.rule.line))
    return _svg(canvas)


def _slope(ax: Any, fit: Fit, colour: str) -> None:
    ax.set_xscale("log")
    ax.xaxis.set_minor_locator(NullLocator())
    ax.plot(fit.x, fit.error, "o", markersize=5, markerfacecolor="white", markeredgecolor=colour, linestyle="none")
    ax.plot(fit.x[fit.used], fit.error[fit.used], "o", markersize=5, color=colour, linestyle="none")
    if fit.used.any():
        x = fit.x[fit.used]
        level = np.mean(np.log10(fit.error[fit.used]) - fit.rule.expected * np.log10(x))
        ends = np.array([x.min() / 2, x.max() * 2])
        ax.plot(ends, 10**level * ends**fit.rule.expected, color=GREY, linewidth=1.0, zorder=1)
    log_scale(ax, float(fit.error.min()) / 2, float(fit.error.max()) * 2)
    words = WORDS[fit.rule.quantity]
    ax.set_title(
        f"{fit.rule.line}\n{words}: slope {fit.slope:.3f}, expected {fit.rule.expected:g}",
        size=8.5,
        loc="left",
    )
    ax.set_xlabel(fit.name, size=8.5, labelpad=2)
    ax.tick_params(length=3, labelsize=8)


def _svg(canvas: Canvas) -> str:
    text = StringIO()
    canvas.savefig(text, format="svg", metadata={"Date": None})
    return tidy(text.getvalue())
