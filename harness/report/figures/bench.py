"""The pictures of a bench: work-precision diagrams, and error against parameter with the expected slopes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import labels
from screwgauge.report.figures.page import arrange, log_scale, panels, saved
from screwgauge.report.figures.style import DOTTED, GREY, by_camp, camp, styled
from screwgauge.report.figures.work_precision import FILLED, HOLLOW, Point, work_precision
from screwgauge.report.formatting import duration
from screwgauge.study.bench.rows import LEVELS
from screwgauge.study.posed import QUANTITIES

if TYPE_CHECKING:
    from screwgauge.study.bench.rows import Row
    from screwgauge.study.bench.run import Bench
    from screwgauge.study.bench.slopes import Fit

NAMES = ("joint positions", "joint velocities", "joint accelerations", "actuator forces")
WORDS = dict(zip(QUANTITIES, NAMES, strict=True))
WIDTH, COLUMNS = 800.0, 3
FITTED = "Filled points are fitted; the line has the expected slope through them."
ERROR = "largest scaled error [1]"
STARTS = {"starts from y and its derivatives": FILLED, "starts from given joint motion": {**FILLED, **HOLLOW}}


@styled
def make_plots(bench: Bench) -> list[Picture]:
    """All pictures of the report."""
    drawable = [r for r in bench.rows if r.contestant.drawn and np.isfinite(r.max_scaled) and bool(r.per_sample > 0)]
    by_quantity = {quantity: [row for row in drawable if row.quantity == quantity] for quantity in QUANTITIES[::-1]}
    families, plots = list(dict.fromkeys(row.contestant.line for row in bench.rows)), list[Picture]()
    for quantity, rows in by_quantity.items():
        if rows:
            name = f"{len(plots) + 1:02d}-{quantity.replace('_', '-')}"
            plots.append(_work_precision(name, WORDS[quantity], rows, families, bench.reference))
    return [*plots, _slopes(f"{len(plots) + 1:02d}-slopes", bench.fits)] if bench.fits else plots


def _work_precision(name: str, what: str, rows: Sequence[Row], families: Sequence[str], reference: str) -> Picture:
    looks, lines = {}, []
    for family, look in by_camp(families).items():
        if group := [row for row in rows if row.contestant.line == family]:
            joined = any(row.contestant.parameter for row in group) or len({row.contestant.name for row in group}) == 1
            hollow = {"markerfacecolor": "white"} if group[0].contestant.given else {}
            looks[family] = {**look, **hollow, "linestyle": "-" if joined else "", "markersize": 6.0}
            lines.append((looks[family], [Point(r.per_sample, r.max_scaled, r.contestant.label) for r in group]))
    page = panels(WIDTH, [378.0])
    (ax,) = page.axes
    wanted = work_precision(ax, lines, duration)
    ax.set(xlabel="run time for each sample delivered", ylabel=ERROR)
    low, high = ax.get_ylim()
    guides = [labels.guide(ax, x, f"{-np.log10(x):.0f} digits", DOTTED) for x in LEVELS if low < x < high]
    note = f"Each point is one setting; errors are against {reference}. T: duration of the motion."
    arrange(page, f"Error against run time: {what}", [f"Lower left is better. {note}"], side={**looks, **STARTS})
    labels.place(ax, [*guides, *wanted])
    return saved(page, name)


def _slopes(name: str, fits: Sequence[Fit]) -> Picture:
    page = panels(WIDTH, [150.0] * -(-len(fits) // COLUMNS), COLUMNS, len(fits))
    for ax, fit in zip(page.axes, fits, strict=True):
        _slope(ax, fit)
    for row in page.rows:
        row[0].set_ylabel(ERROR)
    arrange(page, "Error against what is varied, with expected slopes", [FITTED])
    return saved(page, name)


def _slope(ax: Axes, fit: Fit) -> None:
    """Points over the parameter, and a line of the expected slope through the middle of those that were fitted."""
    x, error, look = fit.x[fit.used], fit.error[fit.used], {**FILLED, "color": camp(fit.rule.line), "markersize": 5.5}
    if len(x):
        level = np.mean(np.log10(error) - fit.rule.expected * np.log10(x))
        ends = np.array([x.min() / 1.5, x.max() * 1.5])
        ax.plot(ends, 10**level * ends**fit.rule.expected, color=GREY, linewidth=1.0)
    ax.plot(fit.x, fit.error, **{**look, **HOLLOW})
    ax.plot(x, error, **look)
    ax.set_xlabel(fit.name)
    log_scale(ax.xaxis)
    log_scale(ax.yaxis)
    slope = f"{WORDS[fit.rule.quantity]}: slope {fit.slope:.3f}, expected {fit.rule.expected:g}"
    ax.set_title(f"{fit.rule.line}\n{slope}", weight="normal")
