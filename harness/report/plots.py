"""Draws the figures of the report: engines over each other, their differences below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.rotations import Array
from screwgauge.report.condition import draw_condition
from screwgauge.report.curves import bin_maxima, envelope
from screwgauge.report.drawing import (
    Panel,
    component_handles,
    difference_handles,
    draw_curves,
    draw_differences,
    engine_handles,
    make_panel,
)
from screwgauge.report.figures import drawable
from screwgauge.report.formatting import file_name, missing, number, unit_text
from screwgauge.report.sheet import Sheet, Strip, log_scale, style
from screwgauge.scene.figures import Figure
from screwgauge.solution import Values, common_rows
from screwgauge.study.comparison import Comparison

FLOOR = 1e-18  # where a difference of exactly zero is drawn if there is no other


@dataclass(frozen=True, slots=True)
class Plot:
    """A finished picture; `name` is its file name without ending."""

    name: str
    title: str
    svg: str


def make_plots(results: Comparison) -> list[Plot]:
    """All pictures of the report, in order."""
    plots: list[Plot] = []
    with style():
        for figure in drawable(tuple(results.scene.figures), results.solutions):
            name = f"{len(plots) + 1:02d}-{file_name(figure.title)}"
            plots.append(Plot(name, figure.title, _figure(figure, results)))
        if any(np.isfinite(s.condition).any() for s in results.solutions.values()):
            title = "Condition number of the closure along the path"
            plots.append(Plot(f"{len(plots) + 1:02d}-condition", title, draw_condition(title, results)))
    return plots


def _figure(figure: Figure, results: Comparison) -> str:
    # an engine that solved only some samples comes last: the first one is drawn as lines
    solutions = sorted(results.solutions.items(), key=lambda item: item[1].rows is not None)
    values = {e: s.values[figure.quantity] for e, s in solutions if figure.quantity in s.values}
    first, t = next(iter(values.values())), results.times
    panels = [make_panel(label, patterns, figure.unit, first) for label, patterns in figure.panels]
    rows = {engine: common_rows(len(t), results.solutions[engine]) for engine in values}
    arrays = {engine: _aligned(has, first.components) for engine, has in values.items()}
    keys = list(dict.fromkeys(name for panel in panels for name in panel.names))
    pairs = _compared(figure, results)
    drawn, others = _drawn(arrays, pairs)
    curves = {engine: (t[rows[engine]], array[rows[engine]]) for engine, array in arrays.items()}
    shared = [np.intersect1d(rows[a], rows[b]) for a, b in pairs]
    lines = [
        [
            (t[at], envelope(arrays[a][at][:, p.columns], arrays[b][at][:, p.columns]))
            for at, (a, b) in zip(shared, pairs, strict=True)
        ]
        for p in panels
    ]
    tolerance = _tolerance(figure, results) if pairs else None
    floor, top, zero = _bounds([line for panel in lines for _, line in panel], tolerance)
    sheet = Sheet(
        figure.title,
        [panel.label for panel in panels],
        [Strip(component_handles(keys)), Strip(engine_handles(list(drawn), len(t)))],
        notes=[*others, *_left_out(panels), *_gaps(curves, panels)],
        lower_strips=[Strip(difference_handles(pairs, tolerance, zero))] if pairs else (),
        lower=bool(pairs),
    )
    height = _height([array[:, p.drawn] for p in panels for array in drawn.values()])
    for ax, panel in zip(sheet.upper, panels, strict=True):
        draw_curves(ax, panel, {engine: curves[engine] for engine in drawn}, keys, height)
    sheet.upper[0].set_ylabel(f"{figure.quantity.replace('_', ' ')} [{unit_text(figure.unit)}]")
    for ax, panel_lines in zip(sheet.lower, lines, strict=False):
        draw_differences(ax, panel_lines, tolerance, floor, zero)
    if sheet.lower:
        log_scale(sheet.lower[0], floor / 10 if zero else floor, top)
        sheet.lower[0].set_ylabel(f"difference [{unit_text(figure.unit)}]")
    return sheet.svg()


def _compared(figure: Figure, results: Comparison) -> list[tuple[str, str]]:
    """Pairs of engines that were compared in the quantity of the figure, in their order there."""
    table = results.errors
    here = table[(table["quantity"] == figure.quantity) & (table["unit"] == figure.unit)]
    return list(dict.fromkeys(zip(here["a"], here["b"], strict=True)))


def _drawn(arrays: Mapping[str, Array], pairs: Sequence[tuple[str, str]]) -> tuple[dict[str, Array], list[str]]:
    """Engines to draw over each other, and a note on those that mean something else by these names.

    Joint forces of an open tree, for one, differ from cut to cut.
    """
    first = next(iter(arrays))
    drawn = {e: array for e, array in arrays.items() if e == first or {(first, e), (e, first)} & set(pairs)}
    others = [engine for engine in arrays if engine not in drawn]
    note = f"Not comparable with {first} here, so without curves: {', '.join(others)}."
    return drawn, [note] if others else []


def _aligned(values: Values, components: Sequence[str]) -> Array:
    """Columns in the order of the first engine; NaN for a component that this one lacks."""
    if values.components == tuple(components):
        return values.array
    place = {name: i for i, name in enumerate(values.components)}
    nothing = np.full(len(values.array), np.nan)
    return np.column_stack([values.array[:, place[n]] if n in place else nothing for n in components])


def _height(parts: list[Array]) -> float:
    """Range of all that is drawn."""
    numbers = np.concatenate([part[np.isfinite(part)] for part in parts])
    return float(np.ptp(numbers)) if len(numbers) else 1.0


def _tolerance(figure: Figure, results: Comparison) -> float | None:
    """Tolerance of the scaled error times its scale, if it is the same for every pair."""
    table = results.errors
    here = table[(table["quantity"] == figure.quantity) & (table["unit"] == figure.unit)]
    limits = {number(limit, 4) for limit in here["tolerance"] * here["scale"] if not missing(limit)}
    return float(limits.pop()) if len(limits) == 1 else None


def _bounds(lines: Sequence[Array], tolerance: float | None) -> tuple[float, float, bool]:
    """Lowest and highest value of the difference axis, and whether any difference is exactly zero."""
    numbers = np.concatenate([bin_maxima(line, line)[1] for line in lines]) if lines else np.empty(0)
    seen = numbers[numbers > 0]
    low = float(seen.min()) if len(seen) else FLOOR
    high = max(float(seen.max()) if len(seen) else 10 * FLOOR, tolerance or 0.0)
    zero = bool((numbers == 0).any())
    floor = 10.0 ** (np.floor(np.log10(low)) - (1 if zero and len(seen) else 0))
    return max(float(floor), 1e-300), 1.5 * high, zero


def _left_out(panels: Sequence[Panel]) -> list[str]:
    kept, total = sum(len(p.drawn) for p in panels), sum(len(p.columns) for p in panels)
    if kept == total:
        return []
    return [f"Curves: the {kept} of {total} components that move most. Differences: all {total}."]


def _gaps(curves: Mapping[str, tuple[Array, Array]], panels: Sequence[Panel]) -> list[str]:
    """A sentence for each engine that has gaps in this figure."""
    notes, columns = [], [i for panel in panels for i in panel.columns]
    for engine, (t, array) in curves.items():
        bad = np.flatnonzero(~np.isfinite(array[:, columns]).all(axis=1))
        if len(bad):
            span = f"t = {number(t[bad[0]])} s" + (f" to {number(t[bad[-1]])} s" if len(bad) > 1 else "")
            notes.append(f"Gap: {engine} has no number at {len(bad)} of {len(t)} samples ({span}).")
    return notes
