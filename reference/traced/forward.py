"""The program of forward dynamics: closes the loops from a guess and answers to forces, for simulations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.newton import ROUNDING
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.forward import Forward as Response
from screwgauge.reference.equations.kinematics import Coordinates, coordinates
from screwgauge.reference.equations.ops import TRACE
from screwgauge.reference.equations.rounding import squares
from screwgauge.reference.equations.screws import Array
from screwgauge.reference.traced.program import Program, program
from screwgauge.reference.traced.trace import NotTraceableError, Trace
from screwgauge.reference.traced.tracing import dependent, sprung_cuts

#: Per-sample diagnostics, without dimension: squares of the last step of Newton's method, of the mean closure residual
#: after it, and of an estimate of the condition number of the closed loops, what the inertia matrix was divided by,
#: the square of the mean way to the prediction, and that of the correction over what it may be.
CHECKS = ("moved", "residual", "condition", "inertia", "far", "strayed")
#: Steps of Newton's method.
NEWTON = 2
#: Share of the way predicted by which a pose may miss its prediction, another branch lying farther, and rounding.
BEND, SLACK = 0.3, 1e-9


@dataclass(frozen=True, slots=True)
class ForwardTrace:
    """A program and what its numbers mean.

    Attributes:
        program: Inputs are a closed pose, that is d dependent coordinates, their velocity map row by row and y, then y,
            yd and time of a state nearby. Outputs: ydd, power of all that stores no energy, the closed pose of the
            state, and `CHECKS`.
        dependent: Columns of the dependent coordinates.
    """

    program: Program
    dependent: tuple[int, ...]


def forward_program(loops: Loops, applied: Applied, q: Array) -> ForwardTrace:
    """Traces forward dynamics.

    Args:
        applied: What acts.
        q: Joint coordinates of closed poses where pivots are chosen. Shape (n, n_q).

    Raises:
        NotTraceableError: The mechanism or what acts on it is beyond this.
    """
    if sprung := sprung_cuts(loops, applied):
        name = loops.lay.mechanism.coordinates[sprung[0]]
        raise NotTraceableError("a spring acts on an angle of a joint that closes a loop", name, "use backend array")
    columns, folds, trace = dependent(loops), [float(x.flat[0]) for x in loops.folds(q)], Trace()
    k, zero = len(loops.y_columns), 0.0 * q[:, 0]

    def inputs(*values: Array) -> Array:
        return np.array([trace.input(x) for x in values], dtype=object)

    z0, K = inputs(*q[:, columns].T), inputs(*[zero] * (len(columns) * k)).reshape(len(columns), k)
    y0, y, yd = (inputs(*(factor * q[:, c] + shift for c in loops.y_columns)) for factor, shift in PLACES)
    t = trace.input(zero)
    x, way = loops.lay.mechanism.home.astype(object), K @ (y - y0)
    x[loops.y_columns], x[columns] = y, z0 + way
    at, moved = _closed(loops, x, y, folds) if columns else (coordinates(x, TRACE), 0.0)
    found = Response(loops, at, yd, None, folds, TRACE, applied)
    found.t = t
    sizes = loops.sizes[columns]
    far, off = squares(way, sizes), squares(found.q[columns] - z0 - way, sizes)
    checks = [moved, _mean(found, y), _condition(found), found.inertia_gain]
    checks += [far * (1.0 / max(len(columns), 1)), off / (BEND**2 * far + SLACK**2)] if columns else [0.0, 0.0]
    answer = [*found.ydd, found.input_power, *found.q[columns], *found.K[..., columns].T.flat, *y]
    return ForwardTrace(program(len(trace.inputs), [*answer, *checks], len(CHECKS)), tuple(columns))


#: What y of the pose predicted from, y and yd are at the samples of a trace, of the coordinates there.
PLACES = ((1.0, 0.0), (1.0, 0.0), (0.0, 1.0))


def _mean(at: Closed, y: Array) -> Any:
    """Square of the mean closure residual."""
    return squares(at.residual(y), at.loops.unit) * (1.0 / max(1, at.loops.given.start))


def _closed(loops: Loops, x: Array, y: Array, folds: list[float]) -> tuple[Coordinates, Any]:
    """Coordinates after steps of Newton's method, and the square of the last one.

    Where only rounding is left a step would move the pose by that, magnified: it fades out there.
    """
    step: Any = 0.0 * x
    for _ in range(NEWTON):
        at = Closed(loops, coordinates(x, TRACE), folds, TRACE)
        share = TRACE.maximum(0.0, 1.0 - ROUNDING**2 / TRACE.maximum(_mean(at, y), 1e-300))
        step = share * at.newton_step(y)
        x = x + step
    return coordinates(x, TRACE), squares(step, loops.sizes)


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
