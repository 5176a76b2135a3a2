"""The pictures of the report on the paper: what the printed scheme and the rule of eq. (56) do over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import DASHES, GREY, Curve, Look, Spec, numbered_look, thin

if TYPE_CHECKING:
    from paper.page import Paper
    from paper.scheme import Runs

FLOOR = 1e-16  # m: gaps below the rounding of lengths of about 1 m
STRETCHES = {False: 120, True: 400}  # drawn: still, and moving
LEGS = {"leg 1 (UPU)": slice(0, 1), "legs 2 to 4 (UPS), the largest": slice(1, 4)}
SINGULAR = "t = k pi: eq. (56) is singular"


def make_plots(paper: Paper) -> list[Picture]:
    runs, axial = paper.runs, paper.axial
    gaps = [
        ({"panel": side, "name": label}, run.t, np.maximum(run.gap[:, legs].max(axis=1), FLOOR))
        for side, legs in LEGS.items()
        for label, run in runs.over_time.items()
    ]
    sizes = {"eq. (56): F_S along O P": axial.size, "minimum norm": axial.least}
    forces = [({"panel": "", "name": name}, axial.case.t, size) for name, size in sizes.items()]
    low, high = (float(f([f(size) for size in sizes.values()])) for f in (np.nanmin, np.nanmax))
    upright = np.repeat(np.pi * np.arange(4), 3), np.tile([low, high, np.nan], 4)
    forces.append(({"panel": "", "name": SINGULAR}, *upright))
    title = "Gap between leg and platform over time, joint angles by eq. (27)"
    axial_title = "Largest driving force: eq. (56) against the smallest possible"
    return [
        _steps(runs),
        chart.picture("paper-scheme-time", title, lambda moving: _lines(gaps, "gap [m]", moving)),
        chart.picture(
            "paper-axial-rule", axial_title, lambda moving: _lines(forces, "largest driving force [N]", moving)
        ),
    ]


def _steps(runs: Runs) -> Picture:
    pairs = ((name, *pair) for name, ladder in runs.ladders.items() for pair in zip(*ladder, strict=True))
    points = [{"name": name, "x": step, "y": error} for name, step, error in pairs]
    values = chart.ways("name", {name: numbered_look(i) for i, name in enumerate(runs.ladders)})
    for axis, title in (("x", "step [s]"), ("y", "largest gap of a leg [m]")):
        values |= chart.logarithm(axis, [point[axis] for point in points]) | {f"{axis}_title": title}
    spec = chart.fill_template("points", points=points, height=165, **values)
    title = "The paper's scheme: a shorter step does not mend the printed twist"
    return chart.picture("paper-scheme-steps", title, lambda moving: spec)


def _lines(curves: Sequence[Curve], title: str, moving: bool) -> Spec:
    names = dict.fromkeys(keys["name"] for keys, _, _ in curves)
    looks = {name: Look(GREY, DASHES[2]) if name == SINGULAR else numbered_look(i) for i, name in enumerate(names)}
    thinned = [(keys, thin(v, STRETCHES[moving]), t, v) for keys, t, v in curves]
    series = [(keys, t[at], v[at]) for keys, at, t, v in thinned]
    values = chart.columns(len({keys["panel"] for keys, _, _ in curves})) | chart.ways("name", looks)
    values |= chart.logarithm("y", np.concatenate([v for _, _, v in curves]))
    return chart.fill_template("lines", **chart.curves(series, moving), **values, title=title)
