"""One page of small plots: for each case the digits kept over its severity, a line per engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.quantities import MAX_DIGITS, digits
from screwgauge.report.figures.axes import log
from screwgauge.report.figures.data import Axis, Diagram, Guide, Look, Panel, Row, Series
from screwgauge.report.figures.looks import DOTTED, GREY, by_camp
from screwgauge.report.plots import Plot, drawn
from screwgauge.study.cases.case import DEGRADED, GOOD, OK, REFUSED, SILENT, Case

if TYPE_CHECKING:
    from screwgauge.study.stress import Row as Result
    from screwgauge.study.stress import Stress

TITLE = "Digits kept as scenes become extreme"
NOTE = (
    "Severity grows to the right, that of a ratio to both sides. "
    "In the shaded part, below nine digits, a result needs a warning."
)
COLUMNS, TALL = 3, 126.0
NARROW, WIDE = 660.0, 846.0  # of pages with less than `COLUMNS` cases, and others
RED = "#b3202a"
LOWEST, NO_NUMBER, APART = -2.6, -0.9, 0.55  # end of the axis; where crosses begin, a line of them for each camp
DIGITS = Axis("digits", LOWEST, MAX_DIGITS + 0.6, tuple((float(d), str(d)) for d in range(0, 16, 3)))
WORDS = {OK: "ok", DEGRADED: "degraded, and says so", REFUSED: "refused", SILENT: "silently wrong"}


def make_plots(stress: Stress) -> list[Plot]:
    """The page, if there is anything to draw."""
    results = {}
    for case in stress.cases:
        rows = [r for r in stress.rows if r.case == case.name and r.finding.quantity in (case.drawn, "judge")]
        if rows:
            results[case] = rows
    if not results:
        return []
    common, own = inks([[row.finding.engine for row in rows] for rows in results.values()])
    panels = [_panel(case, rows, common, looks) for (case, rows), looks in zip(results.items(), own, strict=True)]
    grid = tuple(Row(tuple(panels[i : i + COLUMNS]), TALL) for i in range(0, len(panels), COLUMNS))
    verdicts = {words: mark(verdict, Look(GREY, marker="o")) for verdict, words in WORDS.items()}
    width = WIDE if len(panels) >= COLUMNS else NARROW
    return drawn([("digits", Diagram(TITLE, grid, width, NOTE, legends=(common, verdicts)))])


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
        return Look(RED, None, 1.4, "s", look.colour, 6.0)
    marker = "x" if verdict == REFUSED else look.marker
    return replace(look, dash=None, marker=marker, size=4.5, fill="white" if verdict == DEGRADED else "")


def _panel(case: Case, rows: Sequence[Result], common: Mapping[str, Look], own: Mapping[str, Look]) -> Panel:
    """One case; `rows` are those of the quantity drawn."""
    least = min((row.severity for row in rows if row.severity > 0.0), default=1.0)
    zero = least / 10.0  # where severity 0 stands on its logarithmic axis
    looks = {engine: {**own, **common}[engine] for engine in dict.fromkeys(row.finding.engine for row in rows)}
    camps = list(dict.fromkeys(look.colour for look in looks.values()))
    lines, marks = [], []
    for engine, look in looks.items():
        ladder = sorted((row for row in rows if row.finding.engine == engine), key=lambda row: row.severity)
        x = np.array([row.severity or zero for row in ladder])
        y = np.array([digits(row.finding.error) for row in ladder])
        lines.append(Series(x, y, replace(look, marker="")))
        y = np.where(np.isnan(y), NO_NUMBER - APART * (camps.index(look.colour) % 3), y)
        for verdict in WORDS:
            has = np.array([row.finding.verdict == verdict for row in ladder])
            marks.append(Series(x[has], y[has], mark(verdict, look)))
    limit = digits(GOOD)
    guides, shade = (Guide(limit, DOTTED),), (LOWEST, limit)
    across = _severities(case, [row.severity for row in rows], zero)
    return Panel(across, DIGITS, (*lines, *marks), (case.title,), guides, (), shade, own)


def _severities(case: Case, severities: Sequence[float], zero: float) -> Axis:
    """A logarithmic axis on which 0 stands at `zero`, if it is one of the severities."""
    axis = log(case.axis, [np.array([severity or zero for severity in severities])], whole=False)
    if 0.0 in severities:
        axis = replace(axis, ticks=((zero, "0"), *(tick for tick in axis.ticks if tick[0] > 3.0 * zero)))
    return replace(axis, low=axis.high, high=axis.low) if case.falling else axis
