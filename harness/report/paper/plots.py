"""The pictures of ``screwgauge paper``: what the printed scheme and the rule of eq. (56) do over time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.figures.axes import linear, log
from screwgauge.report.figures.curves import thin
from screwgauge.report.figures.data import Diagram, Guide, Look, Panel, Row, Series
from screwgauge.report.figures.looks import COLOURS, DASHES, DOTTED, MARKERS
from screwgauge.report.figures.render import render
from screwgauge.report.plots import Plot

if TYPE_CHECKING:
    from screwgauge.study.paper.dynamics import AxialRule
    from screwgauge.study.paper.scheme import SchemeRuns

LINES = [Look(colour, dash) for colour, dash in zip(COLOURS, DASHES, strict=False)]
FLOOR = 1e-16  # m: gaps below the rounding of lengths of about 1 m
TALL = 165.0


def make_paper_plots(runs: SchemeRuns, axial: AxialRule) -> list[Plot]:
    """All pictures, in the order of the report."""
    diagrams = {"scheme-steps": _steps(runs), "scheme-time": _over_time(runs), "axial-rule": _axial(axial)}
    return [Plot(f"paper-{name}", diagram.title, render(diagram)) for name, diagram in diagrams.items()]


def _steps(runs: SchemeRuns) -> Diagram:
    looks = {
        label: replace(look, marker=marker) for label, look, marker in zip(runs.ladders, LINES, MARKERS, strict=False)
    }
    series = tuple(Series(steps, errors, looks[label]) for label, (steps, errors) in runs.ladders.items())
    across = log("step [s]", [one.x for one in series], whole=False)
    panel = Panel(across, log("largest gap of a leg [m]", [one.y for one in series]), series)
    title = "The paper's scheme: a shorter step does not mend the printed twist"
    return Diagram(title, (Row((panel,), TALL),), 576.0, legends=(looks,))


def _over_time(runs: SchemeRuns) -> Diagram:
    looks = {run.label: look for run, look in zip(runs.over_time, LINES, strict=False)}
    time = linear("t [s]", [run.t for run in runs.over_time], 6, 0.02)
    up = log("gap [m]", [np.maximum(run.gap, FLOOR) for run in runs.over_time])
    panels = []
    for title, legs in (("leg 1 (UPU)", slice(0, 1)), ("legs 2 to 4 (UPS), the largest", slice(1, 4))):
        series = []
        for run in runs.over_time:
            t, size = thin(run.t, np.log10(np.maximum(run.gap[:, legs].max(axis=1), FLOOR)), np.log10(up.high / up.low))
            series.append(Series(t, 10.0**size, looks[run.label]))
        panels.append(Panel(time, up, tuple(series), (title,)))
    title = "Gap between leg and platform over time, joint angles by eq. (27)"
    return Diagram(title, (Row(tuple(panels), TALL),), 720.0, legends=(looks,))


def _axial(axial: AxialRule) -> Diagram:
    looks = {"eq. (56): F_S along O P": LINES[0], "minimum norm": LINES[1], "t = k pi: eq. (56) is singular": DOTTED}
    sizes = (axial.size, axial.least)
    series = tuple(Series(axial.t, size, look) for size, look in zip(sizes, looks.values(), strict=False))
    guides = tuple(Guide(k * np.pi, DOTTED, upright=True) for k in range(4))
    up = log("largest driving force [N]", sizes)
    panel = Panel(linear("t [s]", [axial.t], 6, 0.02), up, series, guides=guides)
    title = "Largest driving force: eq. (56) against the smallest possible"
    return Diagram(title, (Row((panel,), TALL),), 576.0, legends=(looks,))
