"""Pictures of ``screwgauge paper``: what the printed scheme and the rule of eq. (56) do over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from screwgauge.reference.rotations import Array
from screwgauge.report.plots import Plot
from screwgauge.report.sheet import COLOURS, DASHES, GREY, MARKERS, Sheet, Strip, log_scale, style
from screwgauge.study.paper.axial import AxialRule
from screwgauge.study.paper.scheme import SchemeRuns

FLOOR = 1e-16  # m: gaps below the rounding of lengths of about 1 m


def make_paper_plots(runs: SchemeRuns, axial: AxialRule) -> list[Plot]:
    """All pictures, in the order of the report."""
    with style():
        return [
            Plot("paper-scheme-steps", *_steps(runs)),
            Plot("paper-scheme-time", *_over_time(runs)),
            Plot("paper-axial-rule", *_axial(axial)),
        ]


def _handle(label: str, i: int, marker: str = "") -> Line2D:
    return Line2D([], [], color=COLOURS[i], linestyle=DASHES[i], marker=marker, label=label, markersize=4)


def _steps(runs: SchemeRuns) -> tuple[str, str]:
    title = "The paper's scheme: a shorter step does not mend the printed twist"
    handles = [_handle(label, i, MARKERS[i]) for i, label in enumerate(runs.ladders)]
    sheet = Sheet(title, [""], [Strip(handles)], lower=False)
    ax = sheet.upper[0]
    for i, (steps, gaps) in enumerate(runs.ladders.values()):
        ax.plot(steps, gaps, color=COLOURS[i], linestyle=DASHES[i], marker=MARKERS[i], markersize=4)
    ax.set_xscale("log")
    steps = np.unique(np.concatenate([steps for steps, _ in runs.ladders.values()]))
    ax.set_xticks(steps, minor=False)
    ax.set_xticks([], minor=True)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_xlabel("step [s]")
    _log(ax, [gaps for _, gaps in runs.ladders.values()])
    ax.set_ylabel("largest gap of a leg [m]")
    return title, sheet.svg()


def _over_time(runs: SchemeRuns) -> tuple[str, str]:
    title = "Gap between leg and platform over time, joint angles by eq. (27)"
    sheet = Sheet(
        title,
        ["leg 1 (UPU)", "legs 2 to 4 (UPS), the largest"],
        [Strip([_handle(run.label, i) for i, run in enumerate(runs.over_time)])],
        lower=False,
    )
    for ax, legs in zip(sheet.upper, (slice(0, 1), slice(1, 4)), strict=True):
        for i, run in enumerate(runs.over_time):
            stride = max(1, len(run.t) // 250)
            gap = np.maximum(run.gap[::stride, legs].max(axis=1), FLOOR)
            ax.plot(run.t[::stride], gap, color=COLOURS[i], linestyle=DASHES[i], linewidth=1.2)
    _log(sheet.upper[0], [np.maximum(run.gap, FLOOR) for run in runs.over_time])
    sheet.upper[0].set_ylabel("gap [m]")
    return title, sheet.svg()


def _axial(axial: AxialRule) -> tuple[str, str]:
    title = "Largest driving force: eq. (56) against the smallest possible"
    labels = ("eq. (56): F_S along O P", "minimum norm")
    mark = Line2D([], [], color=GREY, linestyle=(0, (1, 2)), label="t = k pi: eq. (56) is singular")
    handles = [*(_handle(label, i) for i, label in enumerate(labels)), mark]
    sheet = Sheet(title, [""], [Strip(handles)], lower=False)
    ax = sheet.upper[0]
    for k in range(4):
        ax.axvline(k * np.pi, color=GREY, linestyle=(0, (1, 2)), linewidth=1.0)
    for i, size in enumerate((axial.size, axial.least)):
        ax.plot(axial.t, size, color=COLOURS[i], linestyle=DASHES[i], linewidth=1.2)
    _log(ax, [axial.size, axial.least])
    ax.set_ylabel("largest driving force [N]")
    return title, sheet.svg()


def _log(ax: Any, arrays: Sequence[Array]) -> None:
    numbers = np.concatenate([array.ravel() for array in arrays])
    numbers = numbers[np.isfinite(numbers) & (numbers > 0)]
    log_scale(ax, float(numbers.min()), float(numbers.max()))
