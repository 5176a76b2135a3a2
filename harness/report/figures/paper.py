"""The pictures of ``screwgauge paper``: what the printed scheme and the rule of eq. (56) do over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from screwgauge.report.blocks import Picture
from screwgauge.report.figures.page import arrange, log_scale, panels, saved
from screwgauge.report.figures.style import COLOURS, DASHES, DOTTED, MARKERS, Look, styled

if TYPE_CHECKING:
    from screwgauge.study.paper.dynamics import AxialRule
    from screwgauge.study.paper.scheme import SchemeRuns

LINES: list[Look] = [{"color": colour, "linestyle": dash} for colour, dash in zip(COLOURS, DASHES, strict=False)]
FLOOR = 1e-16  # m: gaps below the rounding of lengths of about 1 m
TALL = 165.0


@styled
def make_plots(runs: SchemeRuns, axial: AxialRule) -> list[Picture]:
    """All pictures, in the order of the report."""
    return [_steps(runs), _over_time(runs), _axial(axial)]


def _steps(runs: SchemeRuns) -> Picture:
    page = panels(576.0, [TALL])
    (ax,) = page.axes
    looks = {name: {**look, "marker": m} for name, look, m in zip(runs.ladders, LINES, MARKERS, strict=False)}
    for name, (steps, errors) in runs.ladders.items():
        ax.plot(steps, errors, **looks[name])
    ax.set(xlabel="step [s]", ylabel="largest gap of a leg [m]")
    log_scale(ax.xaxis)
    log_scale(ax.yaxis)
    arrange(page, "The paper's scheme: a shorter step does not mend the printed twist", above=[looks])
    return saved(page, "paper-scheme-steps")


def _over_time(runs: SchemeRuns) -> Picture:
    page = panels(720.0, [TALL], 2, sharey=True)
    looks = {run.label: look for run, look in zip(runs.over_time, LINES, strict=False)}
    sides = (("leg 1 (UPU)", slice(0, 1)), ("legs 2 to 4 (UPS), the largest", slice(1, 4)))
    for ax, (title, legs) in zip(page.axes, sides, strict=True):
        for run in runs.over_time:
            ax.plot(run.t, np.maximum(run.gap[:, legs].max(axis=1), FLOOR), **looks[run.label])
        ax.set(title=title, xlabel="t [s]")
    page.axes[0].set_ylabel("gap [m]")
    log_scale(page.axes[0].yaxis)
    arrange(page, "Gap between leg and platform over time, joint angles by eq. (27)", above=[looks])
    return saved(page, "paper-scheme-time")


def _axial(axial: AxialRule) -> Picture:
    page = panels(576.0, [TALL])
    (ax,) = page.axes
    looks = {"eq. (56): F_S along O P": LINES[0], "minimum norm": LINES[1], "t = k pi: eq. (56) is singular": DOTTED}
    for size, look in zip((axial.size, axial.least), looks.values(), strict=False):
        ax.plot(axial.t, size, **look)
    for k in range(4):
        ax.axvline(k * np.pi, **DOTTED)
    ax.set(xlabel="t [s]", ylabel="largest driving force [N]")
    log_scale(ax.yaxis)
    arrange(page, "Largest driving force: eq. (56) against the smallest possible", above=[looks])
    return saved(page, "paper-axial-rule")
