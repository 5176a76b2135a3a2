"""Programs of forward dynamics: one that closes the loops, and one that answers to forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from screwgauge.reference.applied import Applied
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.forward import Forward as Response
from screwgauge.reference.equations.kinematics import coordinates
from screwgauge.reference.equations.ops import TRACE
from screwgauge.reference.equations.rounding import squares
from screwgauge.reference.equations.screws import Array
from screwgauge.reference.traced.program import Program, program
from screwgauge.reference.traced.trace import NotTraceableError, Trace
from screwgauge.reference.traced.tracing import dependent, sprung_cuts


@dataclass(frozen=True, slots=True)
class Forward:
    """Two programs and what their numbers mean. Inputs begin with the dependent coordinates and y.

    Attributes:
        close: One step of Newton's method along the dependent coordinates, then what `CLOSING` names.
        respond: Further inputs are yd and time. Outputs: ydd, power of all that stores no energy,
            what `RESPONSE` names, then the velocity map of the dependent coordinates row by row.
        dependent: Columns of the dependent coordinates.
    """

    close: Program
    respond: Program
    dependent: tuple[int, ...]


#: Squares of the length of a step of Newton's method and of the mean closure residual before it, without dimension.
CLOSING = ("moved", "residual")
#: Square of an estimate of the condition number of the closed loops, and what the inertia matrix was divided by.
RESPONSE = ("condition", "inertia")


def forward_programs(loops: Loops, applied: Applied, q: Array) -> Forward:
    """Traces both programs.

    Args:
        applied: What acts.
        q: Joint coordinates of closed poses where pivots are chosen. Shape (n, n_q).

    Raises:
        NotTraceableError: The mechanism or what acts on it is beyond this.
    """
    if sprung := sprung_cuts(loops, applied):
        name = loops.lay.mechanism.coordinates[sprung[0]]
        raise NotTraceableError("a spring acts on an angle of a joint that closes a loop", name, "use backend array")
    columns, folds = dependent(loops), [float(x.flat[0]) for x in loops.folds(q)]
    return Forward(_close(loops, q, columns, folds), _respond(loops, applied, q, columns, folds), tuple(columns))


def _inputs(trace: Trace, loops: Loops, q: Array, columns: list[int]) -> tuple[Array, Array]:
    """All coordinates, and those given."""
    x = loops.lay.mechanism.home.astype(object)
    for c in columns:
        x[c] = trace.input(q[:, c])
    y = np.array([trace.input(q[:, c]) for c in loops.y_columns], dtype=object)
    x[loops.y_columns] = y
    return x, y


def _close(loops: Loops, q: Array, columns: list[int], folds: list[float]) -> Program:
    trace = Trace()
    x, y = _inputs(trace, loops, q, columns)
    at = Closed(loops, coordinates(x, TRACE), folds, TRACE)
    step = at.newton_step(y) if columns else 0.0 * x
    residual = squares(at.residual(y), loops.unit) * (1.0 / max(1, loops.given.start))
    return program(len(trace.inputs), [*step[columns], squares(step, loops.sizes), residual])


def _respond(loops: Loops, applied: Applied, q: Array, columns: list[int], folds: list[float]) -> Program:
    trace = Trace()
    x, _ = _inputs(trace, loops, q, columns)
    yd = np.array([trace.input(0.0 * q[:, c] + 1.0) for c in loops.y_columns], dtype=object)
    t = trace.input(0.0 * q[:, 0])
    at = Response(loops, coordinates(x, TRACE), yd, None, folds, TRACE, applied)
    at.t = t
    K = at.K[..., columns].T
    answer = [*at.ydd, at.input_power, _condition(at), at.inertia_gain, *K.flat]
    return program(len(trace.inputs), answer)


def _condition(at: Closed) -> Any:
    """Square of an estimate of the condition number of the closed loops."""
    loops = at.loops
    if not at.cuts and not len(loops.couplings):
        return 1.0
    total: Any = 0.0
    for rows, columns, block in at.blocks:
        moving = [i for i, c in enumerate(columns) if c < loops.moving]
        scale = loops.size[[columns[i] for i in moving]] / loops.unit[rows, None]
        entries = block[:, moving] * scale
        total = total + (entries * entries).sum()
    inverse = at.system.response(loops.unit) / loops.size[: loops.moving] ** 2
    return total * inverse.sum()
