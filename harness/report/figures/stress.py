"""One page of small plots: for each case the digits kept over its severity, a line per engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.quantities import digits
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Look, Spec, by_camp
from screwgauge.study.cases.question import GOOD, VERDICTS, Finding
from screwgauge.study.stress import StressCase

if TYPE_CHECKING:
    from screwgauge.study.stress import Stress

TITLE = "Digits kept as scenes become extreme"
NOTES = (
    "Severity grows to the right, that of a ratio to both sides.",
    "In the shaded part, below nine digits, a result needs a warning.",
    "Full: ok. Hollow: degraded, and says so. Cross below the axis: refused. Square in a red frame: silently wrong.",
)
WORST = ("Of each case the worst that an engine did, in any setting, quantity and rung.",)
NO_NUMBER, APART = -0.9, 0.55  # where crosses begin, a line of them for each camp


def make_plots(stress: Stress) -> list[Picture]:
    """The page, if there is anything to draw."""
    drawn = {
        case: [r for r in stress.rows if r.case == case.name and r.quantity in (case.drawn, "judge")]
        for case in stress.cases
    }
    looks = inks([[row.engine for row in rows] for rows in drawn.values()])
    panels = [_panel(case, rows, own) for (case, rows), own in zip(drawn.items(), looks, strict=True) if rows]
    resolve = {"scale": dict.fromkeys(("color", "stroke", "strokeDash", "fill", "shape"), "independent")}
    spec = {"concat": panels, "columns": 2, "resolve": resolve}
    if not panels:
        return []
    rows = [{"who": row.engine.split()[0], "case": row.case, "k": VERDICTS.index(row.verdict)} for row in stress.rows]
    worst = chart.filled("worst", rows=rows, engines=list(dict.fromkeys(row["who"] for row in rows)))
    return [
        chart.picture("01-worst", "Cases by what became of them", lambda moving: worst, WORST),
        chart.picture("02-digits", TITLE, lambda moving: spec, NOTES),
    ]


def inks(plots: Sequence[Sequence[str]]) -> list[dict[str, Look]]:
    """Looks of engines, plot by plot: bare ones look the same in all plots.

    Args:
        plots: Names of the engines in each plot; what follows a blank is a setting.
    """
    common = by_camp(name for names in plots for name in names if " " not in name)
    own = [by_camp([n for n in names if n not in common], [n for n in names if n in common]) for names in plots]
    return [{n: (common | some)[n] for n in names} for names, some in zip(plots, own, strict=True)]


def _panel(case: StressCase, rows: Sequence[Finding], looks: dict[str, Look]) -> Spec:
    """One case; `rows` are those of the quantity drawn."""
    severities = sorted({row.severity for row in rows})
    zero = next((severity for severity in severities if severity > 0.0), 1.0) / 10.0  # where severity 0 stands
    camps, points = list(dict.fromkeys(look.colour for look in looks.values())), list[Spec]()
    for row in sorted(rows, key=lambda row: row.severity):
        kept, look = digits(row.error), looks[row.engine]
        below = NO_NUMBER - APART * (camps.index(look.colour) % 3)
        drawn = {"x": row.severity or zero, "y": below if np.isnan(kept) else kept, "kept": kept}
        said = {name: getattr(row, name) for name in ("engine", "severity", "verdict", "reason")}
        points.append({**said, **drawn, "colour": look.colour, "dash": look.dash})
    scales = chart.logarithm("x", severities, most=5)
    scales["x_scale"]["reverse"] = case.falling
    if severities[0] == 0.0:
        ticks = [zero, *(tick for tick in scales["x_axis"]["values"] if tick > 3.0 * zero)]
        scales["x_axis"] = {"values": ticks, "labelExpr": f"datum.value < {1.5 * zero} ? '0' : {chart.POWER}"}
    values = {"head": case.title, "across": case.axis, "limit": digits(GOOD), "points": points}
    return chart.filled("ladder", **values, **scales, **chart.ways("engine", looks))
