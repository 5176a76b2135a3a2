"""The pictures of ``screwgauge paper``: what the printed scheme and the rule of eq. (56) do over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import WIDTH, Curve, Spec, logarithm, thin, told
from screwgauge.report.figures.looks import GREY, numbered

if TYPE_CHECKING:
    from screwgauge.study.paper.dynamics import AxialRule
    from screwgauge.study.paper.scheme import SchemeRuns

FLOOR = 1e-16  # m: gaps below the rounding of lengths of about 1 m
HEIGHT, STRETCHES = 165, {False: 120, True: 400}


def make_plots(runs: SchemeRuns, axial: AxialRule) -> list[Picture]:
    """All pictures, in the order of the report."""
    return [_steps(runs), _over_time(runs), _axial(axial)]


def _steps(runs: SchemeRuns) -> Picture:
    title, looks = "largest gap of a leg [m]", {name: numbered(i) for i, name in enumerate(runs.ladders)}
    pairs = ((name, *pair) for name, ladder in runs.ladders.items() for pair in zip(*ladder, strict=True))
    view = {
        "data": {"values": [{"scheme": name, "x": step, "y": error} for name, step, error in pairs]},
        "width": WIDTH,
        "height": HEIGHT,
        "mark": {"type": "line", "point": {"size": 45}},
        "encoding": {
            "x": logarithm("x", "step [s]"),
            "y": logarithm("y", title),
            **told("scheme", looks, "color", "strokeDash", "shape"),
            **chart.hover(scheme="scheme", x="step [s]", y=title),
        },
    }
    head = "The paper's scheme: a shorter step does not mend the printed twist"
    return chart.picture("paper-scheme-steps", head, lambda moving: view)


def _over_time(runs: SchemeRuns) -> Picture:
    sides = {"leg 1 (UPU)": slice(0, 1), "legs 2 to 4 (UPS), the largest": slice(1, 4)}
    found = [
        ({"scheme": run.label, "panel": side}, run.t, np.maximum(run.gap[:, legs].max(axis=1), FLOOR))
        for side, legs in sides.items()
        for run in runs.over_time
    ]

    def build(moving: bool) -> Spec:
        return chart.faceted(_lines(found, "scheme", "gap [m]", moving), 2)

    return chart.picture("paper-scheme-time", "Gap between leg and platform over time, joint angles by eq. (27)", build)


def _axial(axial: AxialRule) -> Picture:
    sizes = {"eq. (56): F_S along O P": axial.size, "minimum norm": axial.least}
    found = [({"scheme": name}, axial.t, size) for name, size in sizes.items()]
    singular = [{"x": k * np.pi} for k in range(4)]

    def build(moving: bool) -> Spec:
        view = _lines(found, "scheme", "largest driving force [N]", moving)
        mark = {"type": "rule", "color": GREY, "strokeDash": [1, 3]}
        rules = {"data": {"values": singular}, "mark": mark, "encoding": {"x": chart.quantity("x", "t [s]")}}
        return view | {"layer": [rules, *view["layer"]]}

    notes = ["Dotted: t = k pi, where eq. (56) is singular."]
    head = "Largest driving force: eq. (56) against the smallest possible"
    return chart.picture("paper-axial-rule", head, build, notes)


def _lines(found: list[Curve], field: str, title: str, moving: bool) -> Spec:
    """Curves over time on a logarithmic axis."""
    looks = {name: numbered(i) for i, name in enumerate(dict.fromkeys(said[field] for said, _, _ in found))}
    thinned = [(said, thin(values, STRETCHES[moving]), t, values) for said, t, values in found]
    kinds = ("line", "mark") if moving else ("line",)
    series = [({**said, "kind": kind}, t[at], values[at]) for said, at, t, values in thinned for kind in kinds]
    view = chart.panel(series, field, looks, chart.hover(t="t [s]", v=title, **{field: field}), moving)
    view["encoding"] |= {"y": logarithm("v", title)}
    return view | {"height": HEIGHT, "params": [*view["params"], *chart.zoom(["lower"], moving)]}
