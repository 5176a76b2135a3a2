"""By how much the equations of a pose amplify rounding, without dimension."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from typing import Any

import numpy as np

from screwgauge.reference.equations.closure import Closed
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.screws import Array, stack, transpose
from screwgauge.reference.extent import extent


def gain(at: Closed, *, whole: bool = False) -> Any:
    """Square of the norm of the inverse of M over its worst loop, each loop counting in its own length. Shape (...).

    Args:
        whole: Whether coordinates at rest count, as they do for constraint forces.
    """
    loops, by = at.loops, extent(at.loops.lay)
    lengths = by.loops[[j for j, _ in enumerate(loops.cuts) for _ in range(*loops.ends[j : j + 2])]]
    of_cuts = [length if unit == "N" else 1.0 for length, (_, unit) in zip(lengths, loops.names, strict=True)]
    chosen = [*loops.couplings.columns, *loops.y_columns]
    squares = at.system.response(np.concatenate([of_cuts, by.size[chosen]]), whole=whole)
    columns = loops.columns[: squares.shape[-1]]
    squares = squares * by.size[columns] ** -2.0
    owners = by.owner[columns]
    return reduce(at.ops.maximum, [squares[..., owners == loop].sum(-1) for loop in dict.fromkeys(owners.tolist())])


def drive_gain(at: Dynamics) -> Any:
    """Square of the norm of what solves for the actuator forces, without dimension. Shape (...)."""
    sizes, mechanism = at.loops.sizes, at.mechanism
    BT = transpose(at.B) * (sizes[mechanism.independent_columns][:, None] / sizes[mechanism.actuated_columns])
    if at.line is None:  # the trace of the inverse of B^T B is the square of the norm of its pseudo-inverse
        return sum(x[..., i] for i, x in enumerate(_columns(at, BT @ transpose(BT))))
    return sum((x * x).sum(-1) for x in _columns(at, stack(BT, at.line[0])))


def _columns(at: Dynamics, A: Array) -> Iterator[Array]:
    """Columns of the inverse of a square matrix."""
    return (at.ops.solve(A, np.broadcast_to(row, A.shape[:-1])) for row in np.eye(A.shape[-1], dtype=float))


def chart_gain(at: Closed) -> Any:
    """Square of the condition of the angles of cut joints, one each where they are good. Shape (...)."""
    middle = [cut.values[1][1] for cut in at.cuts if len(cut.at.type.freedoms) == sum(cut.at.type.freedoms) == 3]
    return sum((1.0 / (c * c) for c in middle), start=0.0)


def squares(x: Array, sizes: Array) -> Any:
    """Sum of the squares of numbers over their sizes. Shape (..., m) -> (...)."""
    scaled = x * (1.0 / sizes)
    return (scaled * scaled).sum(-1)
