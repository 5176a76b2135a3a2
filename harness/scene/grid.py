"""A grid of poses as a motion: all cells reached from home, each at rest, in an order that keeps the assembly mode.

Reading a scene reports the cells that no engine could solve, because the loops do not close, the pose is singular, or a
joint exceeds its limits.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np

from screwgauge.problem import GivenMotion, Rows
from screwgauge.reference.applied import Applied
from screwgauge.reference.courses import Course
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.files import check_count
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys
from screwgauge.scene.cells import examine, walk
from screwgauge.scene.entries import Figure
from screwgauge.scene.idle import Followed, Freedom, undriven_labels
from screwgauge.scene.keys import read_keys
from screwgauge.scene.motion import Analytic, read_course

KEY = "grid"

Cell = tuple[int, ...]
"""Index of a cell along each axis."""


@dataclass(frozen=True, slots=True, eq=False)
class Missing:
    """Cell without results.

    Attributes:
        cell: Index along each axis.
        pose: Values of the coordinates, as text.
        reason: Reason why the cell has no results.
    """

    cell: Cell
    pose: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class GridMotion:
    """Walk over the cells of a grid as a function of time; it reaches the i-th cell, at rest, at t = i.

    Attributes:
        labels: Independent coordinates that the grid varies.
        units: Units of these coordinates, rad or m.
        axes: Values along each axis.
        cells: Indices of the cells in the order of the walk. Shape (n, n_axis).
        path: Independent coordinates of the cells along the walk, including backtracking. Shape (p, k).
        reached: Index on the path at which each cell is first reached. Shape (n,).
        missing: Cells without results.
        freedoms: Coordinates that the grid does not vary and that no actuator drives; they are at rest in each cell,
            but may accelerate.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    axes: tuple[Array, ...]
    cells: Rows
    path: Array
    reached: Rows
    missing: tuple[Missing, ...]
    freedoms: tuple[Freedom, ...] = ()

    def __call__(self, t: Array) -> GivenMotion:
        """Return the motion at times [s], from rest to rest between adjacent cells. Shape (n,)."""
        last = len(self.reached) - 1
        time = np.clip(np.asarray(t, dtype=float), 0.0, last)
        i = np.minimum(time.astype(np.intp), max(last - 1, 0))
        hops = np.diff(self.reached, append=self.reached[-1])[i]
        way = (time - i) * hops
        hop = np.minimum(way.astype(np.intp), np.maximum(hops - 1, 0))
        s, at = (way - hop)[:, None], self.reached[i] + hop
        begin, step = self.path[at], self.path[np.minimum(at + 1, len(self.path) - 1)] - self.path[at]
        hops = hops[:, None]
        y = begin + step * (s**3 * (10.0 - 15.0 * s + 6.0 * s * s))
        yd = step * (30.0 * s * s * (1.0 - s) ** 2) * hops
        ydd = step * (60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)) * hops**2
        return GivenMotion(t, y, yd, ydd, self, tuple(one.number for one in self.freedoms if not one.rests))

    @property
    def extent(self) -> str:
        """Sentence with the number of cells, and the assumptions about them."""
        n = len(self.missing) + len(self.cells)
        return f"{len(self.cells)} of {n} cells, each at rest; t numbers the cells along a walk from the home pose"

    @property
    def told(self) -> list[str]:
        """Lines that list every cell without results, grouped by reason."""
        poses = dict[str, list[str]]()
        for one in self.missing:
            poses.setdefault(one.reason, []).append(one.pose)
        return [f"{reason} ({len(some)}): {'; '.join(some)}" for reason, some in poses.items()]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warning about cells without results; empty if all cells have results."""
        if not self.missing:
            return ()
        first, n = self.missing[0], len(self.missing) + len(self.cells)
        told = f"{len(self.missing)} of {n} cells of the grid have no values (the report lists them all); the first is"
        return (f"{told} {first.pose}: {first.reason}",)


def is_grid(table: Any, mechanism: Mechanism) -> bool:
    """Return True if ``[motion]`` is a grid."""
    return isinstance(table, Mapping) and KEY in table and KEY not in mechanism.independent


def read_grid_motion(table: dict[str, Any], mechanism: Mechanism, where: str) -> GridMotion:
    """Read ``[motion.grid]``; all remaining coordinates keep a constant ``offset`` or their home value.

    Raises:
        ScrewgaugeError: The grid cannot be read, or none of its cells can be reached from the home pose.
    """
    every, entries = [*mechanism.independent], table[KEY]
    check_keys(table, [*every, KEY], where)
    check_keys(entries, every, f"{where}.{KEY}")
    if not entries:
        raise DescriptionError("has no coordinate", f"{where}.{KEY}", "write LABEL = { from, to, count }")
    axes = {label: _axis(entry, f"{where}.{KEY}.{label}") for label, entry in entries.items()}
    check_count(prod(map(len, axes.values())), "samples", f"{where}.{KEY}", "use fewer cells")
    rest = mechanism.home[mechanism.independent_columns].copy()
    for label in every:
        if label in table:
            if label in axes or not (course := read_course(table[label], f"{where}.{label}")).constant:
                raise DescriptionError(
                    "must not move in a scene with a grid", f"{where}.{label}", "use a constant offset"
                )
            rest[every.index(label)] = course(0.0)
    places = [every.index(label) for label in axes]
    cells = np.array([*product(*(range(len(values)) for values in axes.values()))])
    y = np.tile(rest, (len(cells), 1))
    y[:, places] = np.stack([values[row] for values, row in zip(axes.values(), cells.T, strict=True)], axis=1)
    counts, freedoms = [*map(len, axes.values())], _free_coordinates(mechanism, axes)
    reasons, ways, first = examine(mechanism, y, counts, [one.number for one in freedoms])
    order, path, reached = walk(counts, np.array([not why for why in reasons]), ways, first)
    for row in {*range(len(y))} - {*order.tolist()}:
        reasons[row] = reasons[row] or "the cell cannot be reached from the home pose through neighbouring cells"
    if not len(order):
        what = (
            f"no cell has values; for the cell nearest to home, {mechanism.pose_text(y[first])}, "
            f"the reason is: {reasons[first]}"
        )
        raise DescriptionError(what, f"{where}.{KEY}", "move or refine the grid")
    lost = [
        Missing(tuple(cells[row].tolist()), mechanism.pose_text(y[row]), why) for row, why in enumerate(reasons) if why
    ]
    units = tuple(mechanism.units[mechanism.independent_columns[k]] for k in places)
    return GridMotion(tuple(axes), units, tuple(axes.values()), cells[order], y[path], reached, tuple(lost), freedoms)


def _free_coordinates(mechanism: Mechanism, axes: Collection[str]) -> tuple[Freedom, ...]:
    """Return the coordinates that the grid does not vary and that no actuator drives."""
    undriven = {*undriven_labels(mechanism)} - {*axes}
    if not undriven:
        return ()
    home = zip(mechanism.independent, mechanism.home[mechanism.independent_columns], strict=True)
    driven = {label: Course.of(value) for label, value in home if label not in undriven}
    still = Analytic(tuple(driven.values()), KEY)
    return Followed(still, tuple(driven), {}, 0.0, mechanism, Applied()).freedoms


def check_contours(figures: Sequence[Figure], grid: GridMotion | None, where: str) -> None:
    """Reject contour plots in a scene without a grid over two coordinates."""
    if any(one.contour for one in figures) and (grid is None or len(grid.axes) != 2):
        what = "a contour plot needs a grid of two coordinates"
        raise DescriptionError(what, f"{where}, figures", "add a [motion.grid] of two coordinates, or remove contour")


def check_timeless(data: Collection[str], applied: Applied, where: str) -> None:
    """Reject entries that depend on time in the file of a scene with a grid.

    Args:
        data: Keys in the file.
    """
    timed = [key for key in ("time", "idle") if key in data]
    timed += ["motors"] * any(not motor.course.constant for motor in applied.motors)
    timed += ["loads"] * any(load.courses for load in applied.loads)
    if timed:
        raise DescriptionError(f"'{timed[0]}' depends on time, but a grid has no time", where, "remove it")


def _axis(entry: Any, where: str) -> Array:
    begin, end, count = read_keys("grid", entry, where).values()
    if begin == end:
        raise DescriptionError("'from' and 'to' are equal", where, "write motion.LABEL = { offset }")
    return np.linspace(begin, end, count)
