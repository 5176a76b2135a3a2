"""One page of small plots: for each case the digits kept over its severity, a line per engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.quantities import MAX_DIGITS, digits
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Spec, quantity, told
from screwgauge.report.figures.looks import CROSS, GREY, RED, by_camp
from screwgauge.study.cases.case import DEGRADED, GOOD, REFUSED, SILENT, Case, Finding

if TYPE_CHECKING:
    from screwgauge.study.stress import Stress

TITLE = "Digits kept as scenes become extreme"
NOTES = (
    "Severity grows to the right, that of a ratio to both sides. In the shaded part, below nine digits, a result "
    "needs a warning.",
    "Full: ok. Hollow: degraded, and says so. Cross below the axis: refused. Square in a red frame: silently wrong.",
)
WIDTH, HEIGHT, SHADE = 248, 105, "#fbf3ef"
LOWEST, NO_NUMBER, APART = -2.6, -0.9, 0.55  # end of the axis; where crosses begin, a line of them for each camp
DECADES = 5  # with a tick, at most


def make_plots(stress: Stress) -> list[Picture]:
    """The page, if there is anything to draw."""
    results = {}
    for case in stress.cases:
        rows = [r for r in stress.rows if r.case == case.name and r.quantity in (case.drawn, "judge")]
        if rows:
            results[case] = rows
    common = dict.fromkeys(row.engine for rows in results.values() for row in rows if " " not in row.engine)

    resolve = {"scale": dict.fromkeys(("color", "stroke", "strokeDash", "fill", "shape"), "independent")}

    def build(moving: bool) -> Spec:
        panels = [_panel(case, rows, list(common)) for case, rows in results.items()]
        return {"concat": panels, "columns": 2, "resolve": resolve}

    return [chart.picture("01-digits", TITLE, build, NOTES)] if results else []


def _panel(case: Case, rows: Sequence[Finding], common: Sequence[str]) -> Spec:
    """One case; `rows` are those of the quantity drawn, `common` engines without a setting, which look alike in all."""
    severities, engines = {row.severity for row in rows}, list(dict.fromkeys(row.engine for row in rows))
    zero = min((severity for severity in severities if severity > 0.0), default=1.0) / 10.0  # where severity 0 stands
    every = by_camp(common) | by_camp((e for e in engines if e not in common), (e for e in engines if e in common))
    looks = {engine: every[engine] for engine in engines}
    camps, points = list(dict.fromkeys(look.colour for look in looks.values())), list[Spec]()
    for row in sorted(rows, key=lambda row: row.severity):
        kept, below = digits(row.error), NO_NUMBER - APART * (camps.index(looks[row.engine].colour) % 3)
        drawn = {
            "x": row.severity or zero,
            "y": below if np.isnan(kept) else kept,
            "kept": None if np.isnan(kept) else kept,
        }
        points.append({"engine": row.engine, "severity": row.severity, "verdict": row.verdict, **drawn})
    low, high = (f([point["x"] for point in points]) for f in (min, max))
    decades = np.arange(np.ceil(np.log10(low)), np.floor(np.log10(high)) + 1)
    ticks = [10.0**k for k in decades[:: -(-len(decades) // DECADES) or 1]]
    ticks = [zero, *(tick for tick in ticks if tick > 3.0 * zero)] if 0.0 in severities else ticks
    x = chart.logarithm("x", case.axis)
    x["axis"] |= {
        "values": ticks,
        "labelExpr": f"datum.value < {1.5 * zero if 0.0 in severities else 0.0} ? '0' : {chart.TICKS['power']}",
    }
    x["scale"]["reverse"] = case.falling
    y = quantity("y", "digits", scale={"domain": [LOWEST, MAX_DIGITS + 0.6]}, axis={"values": list(range(0, 16, 3))})
    marks = told("engine", looks, "stroke", "shape", width=WIDTH)
    marks |= told("engine", looks, "fill", legend=False)
    for channel, values in {
        "stroke": {SILENT: RED},
        "fill": {DEGRADED: "white", REFUSED: "transparent"},
        "shape": {REFUSED: CROSS, SILENT: "square"},
    }.items():
        said = [{"test": {"field": "verdict", "equal": verdict}, "value": value} for verdict, value in values.items()]
        marks[channel]["condition"] = said
    asked = chart.hover(engine="engine", severity=case.axis, kept="digits []", verdict="verdict")
    limit = {"datum": digits(GOOD)}
    return {
        "title": {"text": case.title, "fontSize": 11, "frame": "group", "offset": 6},
        "width": WIDTH,
        "height": HEIGHT,
        "data": {"values": points},
        "layer": [
            {"mark": {"type": "rect", "color": SHADE}, "encoding": {"y": {"datum": LOWEST}, "y2": limit}},
            {"mark": {"type": "rule", "color": GREY, "strokeDash": [1, 2]}, "encoding": {"y": limit}},
            {
                "transform": [{"filter": "isValid(datum.kept)"}],
                "mark": {"type": "line", "strokeWidth": 1.1},
                "encoding": {"x": x, "y": y, **told("engine", looks, "color", "strokeDash", legend=False)},
            },
            {
                "mark": {"type": "point", "size": 28, "opacity": 1.0},
                "encoding": {"x": x, "y": y, **marks, **asked},
            },
        ],
    }
