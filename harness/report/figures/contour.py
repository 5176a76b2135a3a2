"""Contour plots: a component of a quantity over a grid of two coordinates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Spec
from screwgauge.scene.grid import GridMotion
from screwgauge.study.formatting import number, unit_text

LEVELS = 8  # approximate number of level lines
SEAM = 0.04  # overlap of adjacent cells, relative to their size, which hides seams
#: Share of cells at either end that the colour range omits if the remaining cells span less than `PART` of the range.
TAIL, PART = 0.02, 0.25


def contour_picture(name: str, title: str, grid: GridMotion, of: tuple[str, str, str], values: Array) -> Picture:
    """Draw a component over the two coordinates of a grid; cells without results are grey.

    Args:
        name: Name of the picture.
        of: Names of the engine, the component and the unit.
        values: Values of the cells in the order of `grid.cells`; NaN if missing. Shape (n,).
    """
    engine, component, unit = of
    table = np.full([len(axis) for axis in grid.axes], np.nan)
    table[tuple(grid.cells.T)] = values
    ends, cut = _ends(table)
    levels = _levels(*ends)
    units = [unit_text(each) for each in grid.units]

    def build(moving: bool) -> Spec:
        (x, y), edges = grid.axes, [_edges(axis) for axis in grid.axes]
        return chart.fill_template(
            "contour",
            cells=[_cell(grid, edges, at, v=float(f"{table[*at]:.6g}")) for at in np.argwhere(np.isfinite(table))],
            missing=[_cell(grid, edges, at, reason=_reason(grid, at)) for at in np.argwhere(np.isnan(table))],
            lines=[
                dict(zip(("x", "y", "x2", "y2"), (float(f"{c:.6g}") for c in one), strict=True))
                for one in lines(x, y, table, levels)
            ],
            ends=ends,
            title=f"{component} [{unit_text(unit)}]",
            **{f"{key}_title": f"{label} [{each}]" for key, label, each in zip("xy", grid.labels, units, strict=True)},
            **{f"{key}_ends": [float(some[0]), float(some[-1])] for key, some in zip("xy", edges, strict=True)},
        )

    notes = [f"Computed by {engine}."]
    if len(levels) > 1:
        notes.append(f"Lines every {number(float(levels[1] - levels[0]), 3)}.")
    if lost := int(np.isnan(table).sum()):
        notes.append(f"Grey: {lost} of {table.size} cells without values.")
    if cut:
        notes.append(f"The colour scale omits {TAIL:.0%} of the values at either end.")
    return chart.picture(name, title, build, notes)


def _cell(grid: GridMotion, edges: Sequence[Array], at: NDArray[np.intp], **more: Any) -> dict[str, Any]:
    i, j = (int(k) for k in at)
    x, y = edges
    place = ", ".join(f"{label} = {axis[k]:.6g}" for label, axis, k in zip(grid.labels, grid.axes, (i, j), strict=True))
    ends = {"x": x[i], "x2": x[i + 1] + SEAM * (x[1] - x[0]), "y": y[j], "y2": y[j + 1] + SEAM * (y[1] - y[0])}
    return {**{key: float(f"{value:.7g}") for key, value in ends.items()}, "at": place, **more}


def _reason(grid: GridMotion, at: NDArray[np.intp]) -> str:
    cell = tuple(int(k) for k in at)
    return next((one.reason for one in grid.missing if one.cell == cell), "the engine returned no value")


def _edges(axis: Array) -> Array:
    """Return cell edges around axis values. Shape (n,) -> (n + 1,)."""
    middle = 0.5 * (axis[1:] + axis[:-1])
    return np.concatenate([[2 * axis[0] - middle[0]], middle, [2 * axis[-1] - middle[-1]]])


def _ends(table: Array) -> tuple[list[float], bool]:
    """Return the range of the colour scale, and True if values lie outside it."""
    known = table[np.isfinite(table)]
    if not len(known):
        return [0.0, 1.0], False
    low, high = float(known.min()), float(known.max())
    inner = np.quantile(known, [TAIL, 1.0 - TAIL])
    if inner[1] - inner[0] < PART * (high - low):
        return [float(inner[0]), float(inner[1])], True
    return ([low, high] if high > low else [low - 0.5, low + 0.5]), False


def _levels(low: float, high: float) -> Array:
    """Return evenly spaced round numbers between two limits."""
    rough = (high - low) / LEVELS
    size = 10.0 ** np.floor(np.log10(rough))
    step = size * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * size >= rough)
    return np.asarray(np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step)


def lines(x: Array, y: Array, table: Array, levels: Array) -> Iterator[tuple[float, float, float, float]]:
    """Yield straight segments of the level lines of a function that is linear along cell sides.

    Args:
        x, y: Grid on which the function is known. Shapes (n,), (m,).
        table: Values of the function; squares with NaN at a corner get no line. Shape (n, m).
        levels: Values of the level lines.
    """
    for i, j in product(range(len(x) - 1), range(len(y) - 1)):
        corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        v = np.array([table[at] for at in corners])
        if not np.isfinite(v).all():
            continue
        for level in levels[(levels >= v.min()) & (levels <= v.max())].tolist():
            points = list[tuple[float, float]]()
            for (one, va), (other, vb) in pairwise([*zip(corners, v, strict=True), (corners[0], v[0])]):
                if (va < level) != (vb < level):
                    share = (level - va) / (vb - va)
                    ends = (axis[one[k]] + share * (axis[other[k]] - axis[one[k]]) for k, axis in enumerate((x, y)))
                    points.append((float(next(ends)), float(next(ends))))
            if len(points) == 4 and (v.mean() < level) != (v[0] < level):
                points = points[1:] + points[:1]  # at a saddle, connect adjacent corners on the same side of the level
            for (a, b), (c, d) in zip(points[::2], points[1::2], strict=True):
                yield a, b, c, d
