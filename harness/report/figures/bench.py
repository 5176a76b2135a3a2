"""The pictures of a bench: error against run time, and error against parameter with the expected slopes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import WIDTH, Spec, logarithm, told
from screwgauge.report.figures.looks import GREY, INK, STAR, Look, by_camp, camp
from screwgauge.study.bench.rows import LEVELS, OK
from screwgauge.study.posed import QUANTITIES

if TYPE_CHECKING:
    from screwgauge.study.bench.rows import Row
    from screwgauge.study.bench.run import Bench
    from screwgauge.study.bench.slopes import Fit

NAMES = ("joint positions", "joint velocities", "joint accelerations", "actuator forces")
WORDS = dict(zip(QUANTITIES, NAMES, strict=True))
ERROR = "largest scaled error [1]"
ZERO = 1e-17  # where an error of exactly zero is drawn
SENSELESS = 10.0  # scaled error from which a motion has nothing to do with the scene: it is in the table only
MEASURES = {"observable": "largest error of an observable [m or rad]", "energy": "energy not accounted for [J]"}
OTHERS = "published by others"


def make_plots(bench: Bench) -> list[Picture]:
    """All pictures of the report; none where there is nothing to draw."""
    return _of_simulation(bench) if bench.scene.simulated else _of_given_motion(bench)


def _of_given_motion(bench: Bench) -> list[Picture]:
    drawable = [r for r in bench.rows if r.contestant.drawn and np.isfinite(r.max_scaled) and bool(r.per_sample > 0)]
    looks, plots = by_camp(row.contestant.line for row in bench.rows), list[Picture]()
    for quantity in QUANTITIES[::-1]:
        lines: dict[str, list[Spec]] = {}
        for row in (row for row in drawable if row.quantity == quantity):
            point = _point(row, row.contestant.line, row.per_sample, row.max_scaled, hollow=row.contestant.given)
            lines.setdefault(row.contestant.line, []).append(point | {"varied": bool(row.contestant.parameter)})
        for points in lines.values():
            joined = any(p["varied"] for p in points) or len({p["contestant"] for p in points}) == 1
            points[:] = [point | {"joined": joined} for point in points]
        if lines:
            notes = (
                f"Lower left is better. Each point is one setting; errors are against {bench.reference}. "
                "T: duration of the motion.",
                "Filled: starts from y and its derivatives. Hollow: starts from given joint motion.",
            )
            name, axes = f"{len(plots) + 1:02d}-{quantity.replace('_', '-')}", ("run time of a sample", ERROR)
            plots.append(_error_and_time(name, f"Error against run time: {WORDS[quantity]}", axes, lines, looks, notes))
    return [*plots, _slopes(f"{len(plots) + 1:02d}-slopes", bench.fits)] if bench.fits else plots


def _of_simulation(bench: Bench) -> list[Picture]:
    """Error of the observables and of the energy against processor time."""
    sensible = {r.contestant for r in bench.rows if r.quantity == "observable" and r.max_scaled < SENSELESS}
    done = [row for row in bench.rows if row.contestant in sensible and row.work_s > 0.0]
    looks, plots = by_camp(row.contestant.family for row in done), list[Picture]()
    for measure, title in MEASURES.items():
        lines: dict[str, list[Spec]] = {}
        for row in done:
            error, family = max(row.largest.values(), default=np.nan), row.contestant.family
            if row.quantity == measure and np.isfinite(error):
                lines.setdefault(family, []).append(_point(row, family, row.work_s, error, hollow=row.status != OK))
        theirs = [item for item in bench.scene.published if item.measure == measure or np.isnan(item.accuracy)]
        others = [(item.cpu_s, item.accuracy, item.who.split(",")[0].split(":")[0]) for item in theirs]
        if lines:
            notes = (
                "Lower left is better. Hollow: stopped before the end. "
                "Stars and dashed lines: published by others, measured on other machines.",
            )
            axes = ("processor time of the integration", title)
            head = f"Error against processor time: {measure}"
            plots.append(_error_and_time(f"{len(plots) + 1:02d}-{measure}", head, axes, lines, looks, notes, others))
    return plots


def _point(row: Row, line: str, seconds: float, error: float, *, hollow: bool) -> Spec:
    told = {"family": line, "contestant": row.contestant.name, "setting": row.contestant.setting}
    drawn = {"x": seconds, "y": max(error, ZERO), "label": row.contestant.label, "hollow": hollow, "joined": True}
    return told | drawn


def _error_and_time(
    name: str,
    title: str,
    axes: tuple[str, str],
    lines: dict[str, list[Spec]],
    looks: dict[str, Look],
    notes: Sequence[str],
    others: Sequence[tuple[float, float, str]] = (),
) -> Picture:
    """Points of families, lines through them, and what others have published: a line where only one thing is known."""
    known = [item for item in others if np.isfinite(item[:2]).all()]
    stars = [{"family": OTHERS, "x": x, "y": max(y, ZERO), "label": who, "contestant": who} for x, y, who in known]
    guides = [
        {"x" if np.isfinite(x) else "y": x if np.isfinite(x) else y, "text": who, "dash": 4}
        for x, y, who in others
        if np.isfinite(x) != np.isfinite(y)
    ]
    drawn = [*chain.from_iterable(lines.values())]
    errors = [point["y"] for point in drawn]
    levels = [x for x in LEVELS if min(errors) < x < max(errors)]
    guides += [{"y": x, "text": f"{-np.log10(x):.0f} digits", "dash": 1} for x in levels]
    shown = {family: looks[family] for family in lines} | ({OTHERS: Look(INK, shape=STAR)} if stars else {})
    # labels of the ends of a line say most, and the first find a place
    ends = [point for points in lines.values() for point in (*points[:1], *points[1:][-1:])]
    points = [*stars, *ends, *(point for points in lines.values() for point in points[1:-1])]
    x, y = logarithm("x", axes[0], "time"), logarithm("y", axes[1])

    def build(moving: bool) -> Spec:
        seen = chart.switched("family", moving)
        fill = told("family", shown, "fill", legend=False)["fill"]
        fill["condition"] = {"test": "datum.hollow", "value": "white"}
        asked = chart.hover(contestant="contestant", setting="setting", x=f"{axes[0]} [s]", y=axes[1])
        upright, level = ({"data": {"values": [g for g in guides if axis in g]}} for axis in "xy")
        rule = {"mark": {"type": "rule", "color": GREY, "strokeDash": [4, 3]}}
        text = {"type": "text", "color": GREY, "dy": -5}
        layer = [
            {**upright, **rule, "encoding": {"x": x}},
            {**level, **rule, "encoding": {"y": y}},
            {
                **level,
                "mark": {**text, "align": "right"},
                "encoding": {"y": y, "x": {"value": WIDTH}, "text": {"field": "text"}},
            },
            {
                **upright,
                "mark": {**text, "align": "left", "angle": 90},
                "encoding": {"x": x, "y": {"value": 4}, "text": {"field": "text"}},
            },
            {
                "transform": [{"filter": "datum.joined"}],
                "mark": "line",
                "encoding": {
                    "x": x,
                    "y": y,
                    "order": {"field": "i"},
                    **told("family", shown, "stroke", "strokeDash", legend=False),
                    **seen,
                },
            },
            {
                "name": "points",
                "mark": {"type": "point", "size": 55, "opacity": 1.0},
                "encoding": {"x": x, "y": y, **told("family", shown, "color", "shape"), "fill": fill, **asked, **seen},
            },
            {"name": chart.LABELS, "mark": "text", "encoding": {"x": x, "y": y, "text": {"field": "label"}}},
        ]
        order = {id(point): i for i, point in enumerate(drawn)}
        rows = [point | {"i": order.get(id(point), 0)} for point in points]
        params = [*chart.switch("family", shown, "points", moving), *chart.zoom(["points"], moving, "x", "y")]
        return {"width": WIDTH, "height": 330, "data": {"values": rows}, "layer": layer, "params": params}

    return chart.picture(name, title, build, notes)


def _slopes(name: str, fits: Sequence[Fit]) -> Picture:
    """Points over the parameter, and a line of the expected slope through the middle of those that were fitted."""

    def panel(fit: Fit) -> Spec:
        x, error, colour = fit.x[fit.used], fit.error[fit.used], camp(fit.rule.line)
        both = {"x": logarithm("x", fit.name), "y": logarithm("y", ERROR)}
        level = np.mean(np.log10(error) - fit.rule.expected * np.log10(x)) if len(x) else np.nan
        ends = [x.min() / 1.5, x.max() * 1.5] if len(x) else []
        line = [{"x": end, "y": 10**level * end**fit.rule.expected} for end in ends]
        points = [{"x": a, "y": b, "used": used} for a, b, used in zip(fit.x, fit.error, fit.used, strict=True)]
        fill = {"condition": {"test": "datum.used", "value": colour}, "value": "white"}
        asked = chart.hover(x=f"{fit.name} []", y=ERROR)
        slope = f"{WORDS[fit.rule.quantity]}: slope {fit.slope:.3f}, expected {fit.rule.expected:g}"
        return {
            "title": {"text": [fit.rule.line, slope], "fontSize": 11, "fontWeight": "normal", "frame": "group"},
            "width": (WIDTH - 3 * chart.GAP) // 2,
            "height": 130,
            "encoding": both,
            "layer": [
                {"data": {"values": line}, "mark": {"type": "line", "color": GREY}},
                {"data": {"values": points}, "mark": {"type": "point", "size": 50, "opacity": 1.0, "color": colour},
                 "encoding": {"fill": fill, **asked}},
            ],
        }  # fmt: skip

    note = "Filled points are fitted; the line has the expected slope through them."
    title = "Error against what is varied, with expected slopes"
    return chart.picture(name, title, lambda moving: {"concat": [panel(fit) for fit in fits], "columns": 2}, [note])
