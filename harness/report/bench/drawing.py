"""The pictures of a bench: work-precision diagrams, and error against parameter with the expected slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.bench.work_precision import FILLED, HOLLOW, Point, work_precision
from screwgauge.report.figures.axes import log
from screwgauge.report.figures.data import Diagram, Guide, Look, Panel, Row, Series
from screwgauge.report.figures.looks import DOTTED, GREY, by_camp, camp
from screwgauge.report.plots import Plot, drawn
from screwgauge.study.bench.rows import LEVELS
from screwgauge.study.posed import QUANTITIES

if TYPE_CHECKING:
    from screwgauge.study.bench.rows import Row as Result
    from screwgauge.study.bench.run import Bench
    from screwgauge.study.bench.slopes import Fit

NAMES = ("joint positions", "joint velocities", "joint accelerations", "actuator forces")
WORDS = dict(zip(QUANTITIES, NAMES, strict=True))
WIDTH, COLUMNS = 800.0, 3
ERROR = "largest scaled error [1]"
STARTS = {
    "starts from y and its derivatives": FILLED,
    "starts from given joint motion": replace(FILLED, fill=HOLLOW),
}


def make_plots(bench: Bench) -> list[Plot]:
    """All pictures of the report."""
    looks = by_camp(row.contestant.line for row in bench.rows)
    diagrams = []
    for quantity in QUANTITIES[::-1]:
        rows = [row for row in bench.rows if row.quantity == quantity and _drawable(row)]
        groups = {name: [row for row in rows if row.contestant.line == name] for name in looks}
        lines = {name: (looks[name], group) for name, group in groups.items() if group}
        if lines:
            diagrams.append((quantity.replace("_", "-"), _work_precision(quantity, lines, bench.reference)))
    if bench.fits:
        diagrams.append(("slopes", _slopes(bench.fits)))
    return drawn(diagrams)


def _drawable(row: Result) -> bool:
    return row.contestant.drawn and np.isfinite(row.max_scaled) and bool(row.per_sample > 0)


def _work_precision(quantity: str, groups: Mapping[str, tuple[Look, list[Result]]], reference: str) -> Diagram:
    lines = {}
    for name, (look, rows) in groups.items():
        points = [Point(row.per_sample, row.max_scaled, row.contestant.label) for row in rows]
        joined = any(row.contestant.parameter for row in rows) or len({row.contestant.name for row in rows}) == 1
        fill = HOLLOW if rows[0].contestant.given else ""
        lines[name] = replace(look, dash=() if joined else None, fill=fill, size=6.0), points
    panel = work_precision(("run time for each sample delivered", ERROR), lines.values(), _duration)
    levels = [level for level in LEVELS if panel.y.low < level < panel.y.high]
    guides = tuple(Guide(level, DOTTED, f"{-np.log10(level):.0f} digits") for level in levels)
    note = (
        f"Lower left is better. Each point is one setting; errors are against {reference}. T: duration of the motion."
    )
    side = {name: look for name, (look, _) in lines.items()} | STARTS
    row = Row((replace(panel, guides=guides),), 378.0)
    return Diagram(f"Error against run time: {WORDS[quantity]}", (row,), WIDTH, note, side=side)


def _duration(seconds: float) -> str:
    """``10 µs``."""
    units = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9))
    unit, size = next((u for u in units if seconds >= 0.999 * u[1]), units[-1])
    return f"{seconds / size:.3g} {unit}"


def _slopes(fits: Sequence[Fit]) -> Diagram:
    panels = [_slope(fit) for fit in fits]
    rows = [Row(tuple(panels[i : i + COLUMNS]), 150.0) for i in range(0, len(panels), COLUMNS)]
    note = "Filled points are fitted; the line has the expected slope through them."
    return Diagram("Error against what is varied, with expected slopes", tuple(rows), WIDTH, note)


def _slope(fit: Fit) -> Panel:
    """Points over the parameter, and a line of the expected slope through the middle of those that were fitted."""
    point, x = Look(camp(fit.rule.line), None, 1.2, "o"), fit.x[fit.used]
    series = [Series(fit.x, fit.error, replace(point, fill=HOLLOW)), Series(x, fit.error[fit.used], point)]
    if len(x):
        level = np.mean(np.log10(fit.error[fit.used]) - fit.rule.expected * np.log10(x))
        ends = np.array([x.min() / 1.5, x.max() * 1.5])
        series.insert(0, Series(ends, 10**level * ends**fit.rule.expected, Look(GREY, width=1.0)))
    return Panel(
        log(fit.name, [one.x for one in series], whole=False),
        log(ERROR, [one.y for one in series]),
        tuple(series),
        (fit.rule.line, f"{WORDS[fit.rule.quantity]}: slope {fit.slope:.3f}, expected {fit.rule.expected:g}"),
    )
