"""The pictures of a bench: error against run time, and error against parameter with the expected slopes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import INK, STAR, Look, Spec, by_camp, camp
from screwgauge.study.bench.tables import LEVELS, OK
from screwgauge.study.reference_values import QUANTITIES

if TYPE_CHECKING:
    from screwgauge.study.bench.run import Bench
    from screwgauge.study.bench.tables import BenchRow, SlopeFit

NAMES = ("joint positions", "joint velocities", "joint accelerations", "actuator forces")
WORDS = dict(zip(QUANTITIES, NAMES, strict=True))
ERROR = "largest scaled error [1]"
ZERO = 1e-17  # where an error of exactly zero is drawn
SENSELESS = 10.0  # scaled error from which a motion has nothing to do with the scene: it is in the table only
MEASURES = {"observable": "largest error of an observable [m or rad]", "energy": "energy not accounted for [J]"}
NOTES = (
    "Lower left is better. Each point is one setting; errors are against {}. T: duration of the motion.",
    "Filled: starts from y and its derivatives. Hollow: starts from given joint motion.",
)
SIMULATED = (
    "Lower left is better. Hollow: stopped before the end.",
    "Stars and dashed lines: published by others, measured on other machines.",
)
FITTED = ("Filled points are fitted; the line has the expected slope through them.",)
OTHERS = "published by others"


def make_plots(bench: Bench) -> list[Picture]:
    """All pictures of the report; none where there is nothing to draw."""
    drawn = _of_simulation(bench) if bench.scene.simulated else _of_given_motion(bench)
    return [replace(one, name=f"{i:02d}-{one.name}") for i, one in enumerate(drawn, 1)]


def _of_given_motion(bench: Bench) -> Iterator[Picture]:
    drawable = [r for r in bench.rows if r.contestant.drawn and np.isfinite(r.error) and bool(r.per_sample > 0)]
    looks, notes = by_camp(row.contestant.line for row in bench.rows), [note.format(bench.reference) for note in NOTES]
    for quantity in QUANTITIES[::-1]:
        points, rows = list[Spec](), [row for row in drawable if row.quantity == quantity]
        for row in rows:
            group = [other.contestant for other in rows if other.contestant.line == row.contestant.line]
            joined = any(other.parameter for other in group) or len({other.name for other in group}) == 1
            point = _point(row, row.contestant.line, row.per_sample, row.error)
            points.append(point | {"hollow": row.contestant.given, "joined": joined})
        axes = f"Error against run time: {WORDS[quantity]}", "run time for each sample delivered", ERROR
        if points:
            yield _error_and_time(quantity.replace("_", "-"), axes, points, looks, notes)
    if bench.fits:
        yield _slopes("slopes", bench.fits)


def _of_simulation(bench: Bench) -> Iterator[Picture]:
    """Error of the observables and of the energy against processor time."""
    sensible = {r.contestant for r in bench.rows if r.quantity == "observable" and r.error < SENSELESS}
    done = [row for row in bench.rows if row.contestant in sensible and row.work_s > 0.0]
    looks = by_camp(row.contestant.family for row in done)
    for measure, title in MEASURES.items():
        errors = [(row, max(row.largest.values(), default=np.nan)) for row in done if row.quantity == measure]
        found = [(row, _point(row, row.contestant.family, row.work_s, e)) for row, e in errors if np.isfinite(e)]
        points = [point | {"hollow": row.status != OK, "joined": True} for row, point in found]
        theirs = [item for item in bench.scene.published if item.measure == measure or np.isnan(item.accuracy)]
        others = [(item.cpu_s, item.accuracy, item.who.split(",")[0].split(":")[0]) for item in theirs]
        axes = f"Error against processor time: {measure}", "processor time of the integration", title
        if points:
            yield _error_and_time(measure, axes, points, looks, SIMULATED, others)


def _point(row: BenchRow, family: str, seconds: float, error: float) -> Spec:
    told = {"family": family, "contestant": row.contestant.name, "setting": row.contestant.setting}
    return {**told, "x": seconds, "y": max(error, ZERO), "label": row.contestant.label}


def _error_and_time(
    name: str,
    axes: tuple[str, str, str],
    points: Sequence[Spec],
    looks: dict[str, Look],
    notes: Sequence[str],
    others: Sequence[tuple[float, float, str]] = (),
) -> Picture:
    """Points of families, lines through them, and what others have published: a line where only one thing is known.

    Args:
        axes: Title, what is along x and along y.
    """
    title, across, up = axes
    lines = {family: [p for p in points if p["family"] == family] for family in looks}
    shown = {family: look for family, look in looks.items() if lines[family]}
    drawn: list[Spec] = [
        {"family": OTHERS, "x": x, "y": max(y, ZERO), "label": who} for x, y, who in others if np.isfinite(x * y)
    ]
    shown |= {OTHERS: Look(INK, shape=STAR)} if drawn else {}
    rows = [[p | {"i": i} for i, p in enumerate(line)] for line in lines.values()]
    # the ends of a line say most, and the first labels find a place
    drawn += [*(p for line in rows for p in (*line[:1], *line[1:][-1:])), *(p for line in rows for p in line[1:-1])]
    drawn = [p | {"colour": shown[p["family"]].colour, "dash": shown[p["family"]].dash} for p in drawn]
    errors = [p["y"] for p in points]
    level = [{"y": x, "text": f"{-np.log10(x):.0f} digits"} for x in LEVELS if min(errors) < x < max(errors)]
    level = [{"y": y, "text": who} for x, y, who in others if np.isnan(x)] + (level if up == ERROR else [])
    upright = [{"x": x, "text": who} for x, y, who in others if np.isnan(y)]
    values = {"across": across, "asked": f"{across} [s]", "up": up, "level": level, "upright": upright}
    values |= chart.logarithm("x", [p["x"] for p in [*drawn, *upright]], chart.TIME)
    values |= chart.logarithm("y", [p["y"] for p in [*drawn, *level]])
    spec = chart.filled("error-time", points=drawn, **values, **chart.ways("family", shown))
    spec["layer"] = [layer for layer in spec["layer"] if layer.get("data", spec["data"])["values"]]
    return chart.picture(name, title, lambda moving: spec, notes)


def _slopes(name: str, fits: Sequence[SlopeFit]) -> Picture:
    """Points over the parameter, and a line of the expected slope through the middle of those that were fitted."""

    def panel(fit: SlopeFit) -> Spec:
        x, error, line = fit.x[fit.used], fit.error[fit.used], list[Spec]()
        if len(x):
            level = np.mean(np.log10(error) - fit.rule.expected * np.log10(x))
            line = [{"x": end, "y": 10**level * end**fit.rule.expected} for end in (x.min() / 1.5, x.max() * 1.5)]
        points = [{"x": a, "y": b, "used": used} for a, b, used in zip(fit.x, fit.error, fit.used, strict=True)]
        slope = f"{WORDS[fit.rule.quantity]}: slope {fit.slope:.3f}, expected {fit.rule.expected:g}"
        head, colour = [fit.rule.line, slope], camp(fit.rule.line)
        scales = chart.logarithm("x", fit.x) | chart.logarithm("y", fit.error)
        return chart.filled("slope", head=head, name=fit.name, line=line, points=points, colour=colour, **scales)

    spec = {"concat": [panel(fit) for fit in fits], "columns": 2}
    return chart.picture(name, "Error against what is varied, with expected slopes", lambda moving: spec, FITTED)
