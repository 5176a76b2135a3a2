"""Draws the figures of the report: engines over each other, their differences below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from matplotlib.lines import Line2D

from screwgauge.curves import bin_maxima, envelope, sparse, thin
from screwgauge.figures import Figure, drawable, select, short_labels
from screwgauge.formatting import file_name, number, unit_text
from screwgauge.reference.rotations import Array
from screwgauge.results import Results
from screwgauge.sheet import COLOURS, DASHES, GREY, MARKERS, Sheet, Strip, log_scale, style
from screwgauge.solution import Values

MAX_CURVES = 12  # in a panel; more cannot be told apart
FLOOR = 1e-18


@dataclass(frozen=True, slots=True)
class Plot:
    """A finished picture. `name` is its file name without ending."""

    name: str
    title: str
    svg: str


def make_plots(results: Results) -> list[Plot]:
    """All pictures of the report, in order."""
    plots: list[Plot] = []
    with style():
        for figure in drawable(tuple(results.scene.figures), results.solutions):
            name = f"{len(plots) + 1:02d}-{file_name(figure.title)}"
            plots.append(Plot(name, figure.title, _draw(figure, results)))
        if any(np.isfinite(s.condition).any() for s in results.solutions.values()):
            plots.append(Plot(f"{len(plots) + 1:02d}-condition", "Condition number", _condition(results)))
    return plots


@dataclass(frozen=True, slots=True, eq=False)
class _Panel:
    """The components of one panel and their legend labels."""

    label: str
    columns: list[int]
    drawn: list[int]
    names: list[str]


def _draw(figure: Figure, results: Results) -> str:
    values = {
        engine: solution.values[figure.quantity]
        for engine, solution in results.solutions.items()
        if figure.quantity in solution.values
    }
    first = next(iter(values.values()))
    panels = [_panel(label, select(first, figure.unit, patterns), first) for label, patterns in figure.panels]
    keys = list(dict.fromkeys(name for panel in panels for name in panel.names))
    pairs = list(combinations(values, 2))
    differences = _differences(panels, values, pairs, results.times)
    tolerance = _tolerance(figure, results)
    low, high, zero = _bounds(differences, tolerance)
    sheet = Sheet(
        figure.title,
        [panel.label for panel in panels],
        [Strip(_component_handles(keys)), Strip(_engine_handles(list(values)))],
        notes=[*_left_out(panels), *_gaps(values, panels, results.times)],
        lower_strips=[Strip(_difference_handles(pairs, tolerance, zero, low))] if pairs else (),
        lower=bool(pairs),
    )
    unit = unit_text(figure.unit)
    for ax, panel in zip(sheet.upper, panels, strict=True):
        _curves(ax, panel, values, keys, results.times)
    sheet.upper[0].set_ylabel(unit)
    for i, ax in enumerate(sheet.lower):
        _difference_lines(ax, [differences[pair][i] for pair in pairs], tolerance, low if zero else None)
    if sheet.lower:
        log_scale(sheet.lower[0], low, high)
        sheet.lower[0].set_ylabel(f"difference\n{unit}")
    return sheet.svg()


def _panel(label: str, columns: list[int], values: Values) -> _Panel:
    names = short_labels([values.components[i] for i in columns])
    drawn = list(range(len(columns)))
    if len(columns) > MAX_CURVES:
        span = np.ptp(np.nan_to_num(values.array[:, columns]), axis=0)
        drawn = sorted(np.argsort(-span, kind="stable")[:MAX_CURVES].tolist())
    return _Panel(label, columns, [columns[i] for i in drawn], [names[i] for i in drawn])


def _left_out(panels: list[_Panel]) -> list[str]:
    kept, total = sum(len(p.drawn) for p in panels), sum(len(p.columns) for p in panels)
    if kept == total:
        return []
    return [f"Curves: the {kept} of {total} components that move most; differences: all of them."]


def _gaps(values: Mapping[str, Values], panels: list[_Panel], t: Array) -> list[str]:
    notes, columns = [], [i for panel in panels for i in panel.columns]
    for engine, has in values.items():
        bad = np.flatnonzero(~np.isfinite(has.array[:, columns]).all(axis=1))
        if len(bad):
            at = f"t = {number(t[bad[0]])} s"
            span = at if len(bad) == 1 else f"{at} to {number(t[bad[-1]])} s"
            notes.append(f"Gap: {engine} has no number at {len(bad)} of {len(t)} samples ({span}).")
    return notes


def _curves(ax: object, panel: _Panel, values: Mapping[str, Values], keys: list[str], t: Array) -> None:
    """The first engine as lines, the others as sparse marks in the same colours."""
    axes: Any = ax
