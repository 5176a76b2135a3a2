"""Cells of a pose grid that can be reached from the home pose, ordered so that each is adjacent to an earlier cell."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from screwgauge.models.home import check_home
from screwgauge.problem import Rows
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed.loops import LoopEquations
from screwgauge.reference.closed.newton import OPEN, newton, velocity_map
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array

#: Condition number of loops or actuators above which a cell is singular, because half of the digits are lost.
SINGULAR = 1e8
#: Largest deviation from the tangents at both ends, relative to the step; tolerance for rounding; and the longest step
#: [rad or lengths of the mechanism].
BEND, SLACK, LONGEST = 0.25, 1e-9, 0.5
#: Steps of Newton's method; pieces of the path between two cells, if a single step fails; and the finest subdivision.
NEWTON, PIECES, FINEST = 8, (1, 8), 64
#: Number of cells near home that are tried as the first cell.
FIRST = 20
NOT_REACHED = "the loops do not close in this cell, or a singular pose lies between this cell and the home pose"


Closed = tuple[Array, ...]
"""Closed poses of cells: dimensionless unknowns z, shape (n, n_z), the derivatives K = dz/dy, shape (n, n_z, k), and
the closing system, shape (n, m, n_z').
"""


def edges(counts: Sequence[int]) -> tuple[Rows, Rows]:
    """Return pairs of cells that are adjacent along an axis. `counts`: number of cells along each axis."""
    numbers = np.arange(int(np.prod(counts))).reshape(counts)
    first, second = [], []
    for axis in range(len(counts)):
        first.append(np.delete(numbers, -1, axis).ravel())
        second.append(np.delete(numbers, 0, axis).ravel())
    return np.concatenate(first), np.concatenate(second)


def examine(
    mechanism: Mechanism, y: Array, counts: Sequence[int], undriven: Collection[int]
) -> tuple[list[str], tuple[Rows, Rows], int]:
    """Close the loops at all cells that can be reached from the home pose, moving from cell to cell.

    Args:
        y: Independent coordinates of the cells, with the last axis varying fastest [rad or m]. Shape (n, k).
        counts: Number of cells along each axis.
        undriven: Indices of coordinates that actuators need not drive.

    Returns:
        For each cell, the reason why it has no results, or ""; pairs of connected cells; the first cell.
    """
    lay = check_home(mechanism)
    mode, sides = AssemblyMode(lay, strict=True), edges(counts)
    home, unit = mechanism.home[mechanism.independent_columns], np.maximum(np.ptp(y, axis=0), 1e-300)
    nearest = np.argsort(np.abs((y - home) / unit).sum(axis=1), kind="stable")
    if mode.in_closed_form(y) is not None:
        q = np.tile(mechanism.home, (len(y), 1))
        q[:, mode.columns] = y
        return _doubts(lay, q, None, undriven), sides, int(nearest[0])
    first = _first(mode, y, nearest)
    if first is None:
        return [NOT_REACHED] * len(y), (sides[0][:0], sides[1][:0]), int(nearest[0])
    known, (z, K, matrix), passed = _flood(mode.system, y / mode.unit, first, sides)
    reasons, rows = [NOT_REACHED] * len(y), np.flatnonzero(known)
    q = mode.system.coordinates(z[rows], np.tile(mechanism.home, (len(rows), 1)))
    for row, why in zip(rows.tolist(), _doubts(lay, q, matrix[rows], undriven), strict=True):
        reasons[row] = why
    known[rows] = linear.invert_along(matrix[rows])[1] <= SINGULAR
    ways = np.flatnonzero(known[sides[0]] & known[sides[1]])
    a, b = (side[ways] for side in sides)
    near = _is_linked(z[b] - z[a], [K[a], K[b]], (y[b] - y[a]) / mode.unit)
    passed = np.sort(passed[:, known[passed].all(axis=0)], axis=0)
    begin, end = np.unique(np.concatenate([np.stack([a[near], b[near]]), passed], axis=1), axis=1)
    return reasons, (begin, end), first[0]


def _first(mode: AssemblyMode, y: Array, nearest: Rows) -> tuple[int, Array] | None:
    """Find a cell that can be reached from the home pose; return its index and unknowns, shape (n_z,)."""
    for row in nearest[:FIRST].tolist():
        mode.restart()
        try:
            q = mode.motion(y[row][None], np.zeros(1))
        except ClosureError:
            continue
        return row, mode.system.unknowns(q[0])
    return None


def _flood(
    system: LoopEquations, y: Array, first: tuple[int, Array], sides: tuple[Rows, Rows]
) -> tuple[NDArray[np.bool_], Closed, Rows]:
    """Advance from the most recently reached cells to their neighbours until no more cells can be reached.

    Args:
        y: Dimensionless independent coordinates. Shape (n, k).
        first: The first cell and its unknowns.
        sides: Pairs of adjacent cells.

    Returns:
        Mask of the cells reached, their poses, and pairs of successive cells on the paths to them, shape (2, n_way).
    """
    start, n = _close(system, first[1][None], y[first[0]][None])[0], len(y)
    all_cells = tuple(np.full((n, *part.shape[1:]), np.nan) for part in start)
    known, wave, passed = np.zeros(n, dtype=bool), np.array([first[0]]), [np.zeros((2, 0), dtype=np.intp)]
    _keep(all_cells, wave, start)
    known[wave] = True
    ends = np.concatenate(sides), np.concatenate(sides[::-1])
    last = False
    while len(wave):
        out = np.flatnonzero((last | np.isin(ends[0], wave)) & known[ends[0]] & ~known[ends[1]])
        before = known.copy()
        for pieces in (FINEST,) if last else PIECES:
            out = out[~known[ends[1][out]]]
            a, b = ends[0][out], ends[1][out]
            found, good = _advance(system, _rows(all_cells, a), (y[a], y[b]), pieces)
            reached, at = np.unique(b[good], return_index=True)
            some = np.flatnonzero(good)[at]
            _keep(all_cells, reached, _rows(found, some))
            known[reached] = True
            passed.append(np.stack([a[some], reached]))
        wave = np.flatnonzero(known & ~before)
        if last := not len(wave) and not last:  # retry from all cells: the remaining cells are near singular poses
            wave = np.flatnonzero(known)
    return known, all_cells, np.concatenate(passed, axis=1)


def _keep(cells: Closed, rows: Rows, found: Closed) -> None:
    for part, new in zip(cells, found, strict=True):
        part[rows] = new


def _rows(cells: Closed, rows: Rows) -> Closed:
    """Copy the given rows of the cells."""
    return tuple(part[rows] for part in cells)


def _close(system: LoopEquations, z: Array, y: Array) -> tuple[Closed, NDArray[np.bool_]]:
    """Close the loops near predicted poses; return the poses, and True for each success. Shapes (n, n_z), (n, k)."""
    with np.errstate(all="ignore"):
        z, J, error, *more = newton(system.evaluate, z, y, most=NEWTON)
        K = velocity_map(J, y.shape[1])
    return (z, K, more[0] if more else J), (error < OPEN) & np.isfinite(K).all(axis=(1, 2))


def _advance(
    system: LoopEquations, at: Closed, way: tuple[Array, Array], pieces: int
) -> tuple[Closed, NDArray[np.bool_]]:
    """Move from cells straight to target cells in steps; return the poses, and True for each success. Shape (n, k)."""
    step, good = (way[1] - way[0]) / pieces, np.ones(len(way[0]), dtype=bool)
    for i in range(1, pieces + 1):
        rows = np.flatnonzero(good)
        if not len(rows):
            break
        z, K, _ = _rows(at, rows)
        ahead = z + (K @ step[rows][..., None])[..., 0]
        found, closes = _close(system, ahead, way[0][rows] + i * step[rows])
        good[rows] = closes & _is_linked(found[0] - z, [K, found[1]], step[rows])
        _keep(at, rows, found)
    return at, good


def _is_linked(step: Array, tangents: Sequence[Array], way: Array) -> NDArray[np.bool_]:
    """Return True for short steps along the tangents at both ends. Shapes (n, n_z), (n, n_z, k), (n, k)."""
    size = np.abs(step).max(axis=1, initial=0.0)
    good = size <= LONGEST
    for K in tangents:
        missed = np.abs(step - (K @ way[..., None])[..., 0]).max(axis=1, initial=0.0)
        good &= missed <= BEND * size + SLACK
    return np.asarray(good)


def _doubts(lay: Layout, q: Array, matrix: Array | None, undriven: Collection[int]) -> list[str]:
    """Return, for each closed pose, the reason why it has no results, or an empty string.

    Args:
        q: Joint coordinates. Shape (n, n_q).
        matrix: System matrix of the loop closure, if any. Shape (n, m, n_z).
    """
    mechanism, found = lay.mechanism, [""] * len(q)
    at, (low, high) = motion_at(lay, q, np.zeros((len(q), len(mechanism.independent)))), mechanism.limits.T
    sizes, conditions = at.loops.sizes, list[tuple[Array, str]]()
    if matrix is not None:
        conditions.append((linear.invert_along(matrix)[1], "the loops do not determine the motion"))
    given = [k for k in range(len(mechanism.independent)) if k not in undriven]
    if given and len(mechanism.actuators) >= len(given):
        driven = at.B * sizes[mechanism.independent_columns] / sizes[mechanism.actuated_columns, None]
        driven = driven[..., given]
        rates = np.linalg.svd(driven, compute_uv=False)  # compare a single rate with 1
        with np.errstate(divide="ignore"):
            share = np.maximum(rates[:, 0], 1.0) / rates[:, -1]
        conditions.append((share, "the actuators do not determine the motion"))
    for condition, why in conditions:
        for i in np.flatnonzero(~(condition <= SINGULAR)).tolist():
            found[i] = found[i] or f"the pose is singular: {why}"
    margin = SLACK * sizes  # exclude the limits themselves, where the result would depend on rounding
    for i, k in np.argwhere((q < low + margin) | (q > high - margin)).tolist():
        limits = f"[{low[k]:g}, {high[k]:g}]"
        found[i] = found[i] or f"'{mechanism.coordinates[k]}' is outside its limits {limits}"
    return found


def walk(
    counts: Sequence[int], wanted: NDArray[np.bool_], ways: tuple[Rows, Rows], first: int
) -> tuple[Rows, Rows, Rows]:
    """Order the cells so that each is adjacent to an earlier cell, moving along the last axis where possible.

    Args:
        wanted: True for cells that have results; the path may pass through other cells. Shape (n,).
        ways: Pairs of connected cells.
        first: Cell at which the path begins.

    Returns:
        The cells in order; the cells along the whole path, including backtracking; and the index on the path at which
        each cell is first reached.
    """
    beside: list[dict[int, int]] = [{} for _ in wanted]  # difference in index -> the adjacent cell
    for a, b in zip(*(side.tolist() for side in ways), strict=True):
        beside[a][b - a], beside[b][a - b] = b, a
    steps = [sign * int(np.prod(counts[axis + 1 :])) for axis in reversed(range(len(counts))) for sign in (1, -1)]
    path, stack, known, heading = [first], [first], {first}, steps[0]
    order, reached = ([first], [0]) if wanted[first] else (list[int](), list[int]())
    while stack:
        near = beside[stack[-1]]
        step = next((step for step in (heading, *steps) if step in near and near[step] not in known), None)
        if step is None:
            stack.pop()
            path += stack[-1:]
            continue
        heading = step if abs(step) == 1 else heading
        stack.append(near[step])
        known.add(stack[-1])
        path.append(stack[-1])
        if wanted[stack[-1]]:
            order.append(stack[-1])
            reached.append(len(path) - 1)
    return np.array(order, dtype=int), np.array(path[: max(reached, default=0) + 1]), np.array(reached, dtype=int)
