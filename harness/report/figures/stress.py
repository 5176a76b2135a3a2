"""One page of small plots: for each case the digits kept over its severity, a line per engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from screwgauge.quantities import MAX_DIGITS, digits
from screwgauge.report.blocks import Picture
from screwgauge.report.figures.page import arrange, log_scale, panels, power, saved
from screwgauge.report.figures.style import DOTTED, GREY, Look, by_camp, styled
from screwgauge.study.cases.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Case, Finding

if TYPE_CHECKING:
    from screwgauge.study.stress import Stress

TITLE = "Digits kept as scenes become extreme"
NOTE = (
    "Severity grows to the right, that of a ratio to both sides. "
    "In the shaded part, below nine digits, a result needs a warning."
)
COLUMNS, TALL = 3, 126.0
NARROW, WIDE = 660.0, 846.0  # of pages with less than `COLUMNS` cases, and others
RED, SHADE = "#b3202a", "#fbf3ef"
LOWEST, NO_NUMBER, APART = -2.6, -0.9, 0.55  # end of the axis; where crosses begin, a line of them for each camp
WORDS = {OK: "ok", DEGRADED: "degraded, and says so", REFUSED: "refused", SILENT: "silently wrong"}


@styled
def make_plots(stress: Stress) -> list[Picture]:
    """The page, if there is anything to draw."""
    results = {}
    for case in stress.cases:
        rows = [r for r in stress.rows if r.case == case.name and r.quantity in (case.drawn, "judge")]
        if rows:
            results[case] = rows
    if not results:
        return []
    common, own = inks([[row.engine for row in rows] for rows in results.values()])
    columns = min(COLUMNS, len(results))
    width = WIDE if columns == COLUMNS else NARROW
    page = panels(width, [TALL] * -(-len(results) // columns), columns, len(results))
    for ax, (case, rows), looks in zip(page.axes, results.items(), own, strict=True):
        _draw(ax, case, rows, {**looks, **common})
    for row in page.rows:
        row[0].set_ylabel("digits")
    verdicts = {words: mark(verdict, {"color": GREY, "marker": "o"}) for verdict, words in WORDS.items()}
    arrange(page, TITLE, [NOTE], above=[common, verdicts], under=own)
    return [saved(page, "01-digits")]


def inks(plots: Sequence[Sequence[str]]) -> tuple[dict[str, Look], list[dict[str, Look]]]:
    """Looks of bare engines, the same in all plots, and of engines with a setting, plot by plot.

    Args:
        plots: Names of the engines in each plot; what follows a blank is a setting.
    """
    common = by_camp(name for names in plots for name in names if " " not in name)
    own = [by_camp([n for n in names if n not in common], [n for n in names if n in common]) for names in plots]
    return common, own


def mark(verdict: str, look: Look) -> Look:
    """Full: ok; hollow: degraded; a cross below the axis: refused; in a red frame: silently wrong."""
    if verdict == SILENT:
        framed = {"marker": "s", "markerfacecolor": look["color"], "markersize": 6.0, "markeredgewidth": 1.4}
        return {"color": RED, "linestyle": "", **framed}
    marker = "x" if verdict == REFUSED else look["marker"]
    fill = "white" if verdict == DEGRADED else look["color"]
    return {**look, "linestyle": "", "marker": marker, "markersize": 4.5, "markerfacecolor": fill}


def _draw(ax: Axes, case: Case, rows: Sequence[Finding], looks: Mapping[str, Look]) -> None:
    """One case; `rows` are those of the quantity drawn."""
    severities = {row.severity for row in rows}
    zero = min((severity for severity in severities if severity > 0.0), default=1.0) / 10.0  # where severity 0 stands
    engines = list(dict.fromkeys(row.engine for row in rows))
    camps = list(dict.fromkeys(looks[engine]["color"] for engine in engines))
    for engine in engines:
        look = looks[engine]
        ladder = sorted((row for row in rows if row.engine == engine), key=lambda row: row.severity)
        x = np.array([row.severity or zero for row in ladder])
        y = np.array([digits(row.error) for row in ladder])
        ax.plot(x, y, **{**look, "marker": "", "linewidth": 1.1})
        y = np.where(np.isnan(y), NO_NUMBER - APART * (camps.index(look["color"]) % 3), y)
        for verdict in WORDS:
            has = np.array([row.verdict == verdict for row in ladder])
            ax.plot(x[has], y[has], zorder=3, **mark(verdict, look))
    limit = digits(GOOD)
    ax.axhspan(LOWEST, limit, color=SHADE, linewidth=0.0, zorder=0.0)
    ax.axhline(limit, **DOTTED)
    ax.set(title=case.title, xlabel=case.axis, ylim=(LOWEST, MAX_DIGITS + 0.6), yticks=range(0, 16, 3))
    log_scale(ax.xaxis)
    if 0.0 in severities:
        ticks = [tick for tick in ax.get_xticks() if 3.0 * zero < tick < ax.get_xlim()[1]]
        ax.set_xticks([zero, *ticks], ["0", *map(power, ticks)])
    if case.falling:
        ax.invert_xaxis()
