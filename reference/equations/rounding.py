"""By how much the equations of a pose amplify rounding, without dimension."""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np

from screwgauge.reference.equations.closure import Closed, CutJoint
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.screws import Array
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
    if not at.system.exact:
        K = at.K[..., columns] * by.size[loops.y_columns][:, None]
        squares = squares + (K * K).sum(-2)
    squares = squares * by.size[columns] ** -2.0
    owners = by.owner[columns]
    return reduce(at.ops.maximum, [squares[..., owners == loop].sum(-1) for loop in dict.fromkeys(owners.tolist())])


def drive_gain(at: Dynamics) -> Any:
    """Square of the norm of what solves for the actuator forces, coordinates in their units. Shape (...)."""
    m = min(len(at.mechanism.actuators), len(at.mechanism.independent)) if at.surplus else len(at.mechanism.actuators)
    squares = at.drive.response(np.ones(m)).sum(-1)
    return at.ops.sqrt(squares) if at.surplus else squares


def chart_condition(cut: CutJoint) -> Any:
    """Condition number of the angles of a cut joint, 1 where they are good, infinite in gimbal lock. Shape (...)."""
    if cut.at.joint.angles < 3:
        return 1.0
    cosine = cut.values[1][1]
    return np.sqrt((1.0 + 2.0 / (cosine * cosine)) / 3.0)


def chart_gain(at: Closed) -> Any:
    """Square of the condition of the angles of cut joints, one each where they are good. Shape (...)."""
    middle = [cut.values[1][1] for cut in at.cuts if cut.at.joint.angles == 3]
    return sum((1.0 / (c * c) for c in middle), start=0.0)


def squares(x: Array, sizes: Array) -> Any:
    """Sum of the squares of numbers over their sizes. Shape (..., m) -> (...)."""
    scaled = x * (1.0 / sizes)
    return (scaled * scaled).sum(-1)
