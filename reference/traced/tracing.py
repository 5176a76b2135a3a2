"""Traces equations of motion as programs: inverse dynamics for chosen quantities, forward dynamics for simulations.

The equations themselves are in the package `equations`; `program` and `native` run the programs.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.applied import Applied, JointSpring, Load
from screwgauge.reference.closed.newton import ROUNDING
from screwgauge.reference.equations.closed_form import closed_form
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.dynamics import QUANTITIES, Dynamics
from screwgauge.reference.equations.forward import Forward as Response
from screwgauge.reference.equations.kinematics import Coordinates, coordinates
from screwgauge.reference.equations.ops import NUMPY, TRACE
from screwgauge.reference.equations.rounding import chart_gain, drive_gain, gain, idle_gain, loop_sizes, squares
from screwgauge.reference.equations.screws import Array
from screwgauge.reference.points import Point
from screwgauge.reference.traced.program import Program, program
from screwgauge.reference.traced.trace import Node, NotTraceableError, Trace

#: Checks of every sample, as squares: gains of the closing system, without and with resting coordinates, and of the
#: actuators; distance covered by Newton's method; residuals of the loops and of the balance of all bodies; charts of
#: cut joints; rates; accelerations.
CHECKS = ("gain", "whole_gain", "drive", "moved", "closing", "balance", "charts", "speed", "rush")
NEWTON = 2
#: Largest number of programs for one motion; each has different pivots.
MOST_ARCS = 6
#: Squared ratio of pivot-based to exact gain up to which a pivot order is good for a sample.
GROWTH = 9.0
#: Quantities that depend on the charts of joints that close loops.
CHARTED = {"joint_position", "joint_velocity", "joint_acceleration", "tree_force", "tree_force_soft"}
#: Quantities that depend on the rates of the actuators.
DRIVEN = {"actuator_force", "axis_moment", "reaction", "jacobian"}
Further = Callable[[Mapping[str, Sequence[Any]]], Mapping[str, list[Any]]]
"""Additional outputs from the quantities and checks of a trace."""


@dataclass(frozen=True, slots=True)
class Traced:
    """A program and the meaning of its inputs and outputs.

    Inputs are y, yd, ydd, `predicted` coordinates, `near` angles and, if `timed`, time.

    Attributes:
        arcs: One program, or several programs with different pivots if no pivots are large along the whole motion; each
            with the largest value of the check ``gain`` where its pivots are large.
        places: Quantity, entry of `CHECKS`, or ``reached`` (corrected prediction and its rates) -> outputs.
        predicted: Tree coordinates from which Newton's method starts; empty in closed form.
        near: Angles of cut joints that must be known to within half a turn.
        timed: True if time is an input.
    """

    arcs: tuple[tuple[Program, float], ...]
    places: Mapping[str, slice]
    predicted: tuple[int, ...]
    near: tuple[int, ...]
    timed: bool

    @property
    def program(self) -> Program:
        """First of the programs in `arcs`."""
        return self.arcs[0][0]


@dataclass(frozen=True, slots=True, eq=False)
class TracedQuantities:
    """The requested outputs of a program.

    Attributes:
        quantities: Names of quantities.
        axial: True if redundant actuators follow the rule of eq. (56).
        shares: Fraction, with sign, of each body that each coordinate of the open tree carries. Shape (b, n_q).
        tree: Coordinates of the open tree.
        loaded: True if force and torque of each load are inputs, after all other inputs.
        points: Named points.
        idle, resting: Indices of the coordinates that no actuator drives, see `Dynamics`.
    """

    quantities: Collection[str]
    axial: bool = False
    shares: Array | None = None
    tree: Sequence[int] = ()
    loaded: bool = False
    points: tuple[Point, ...] = ()
    idle: tuple[int, ...] = ()
    resting: tuple[int, ...] = ()


def trace_dynamics(
    loops: Loops,
    applied: Applied,
    wanted: TracedQuantities,
    samples: tuple[Array, Array, Array, Array],
    further: Further = lambda outputs: {},
) -> Traced:
    """Trace inverse dynamics; trace again for samples at which the chosen pivots are not large.

    Args:
        samples: y, yd, ydd, shape (n, k) each, and all joint coordinates, shape (n, n_q), used to choose pivots.
        further: Function that returns additional outputs, which precede the checks; values under ``first`` are not
            outputs, but are computed before all others, in this order.

    Raises:
        NotTraceableError: Programs do not cover the mechanism or request.
    """
    folds, uncovered, parts = [float(x.flat[0]) for x in loops.folds(samples[3])], samples, list[Traced]()
    while len(uncovered[0]):
        if len(parts) == MOST_ARCS:
            raise NotTraceableError("pivots stay large only on short arcs", "closed loops", "use backend array")
        one, kept = _trace(loops, applied, wanted, uncovered, further, folds)
        y, yd, ydd, q = (x[~kept] for x in uncovered)
        uncovered = y, yd, ydd, q
        parts.append(one)
    return replace(parts[0], arcs=tuple(arc for one in parts for arc in one.arcs))


def _trace(
    loops: Loops,
    applied: Applied,
    wanted: TracedQuantities,
    samples: tuple[Array, Array, Array, Array],
    further: Further,
    folds: Sequence[float],
) -> tuple[Traced, NDArray[np.bool_]]:
    """Trace inverse dynamics with one choice of pivots; also flag samples at which the pivots are large. Shape (n,)."""
    trace = Trace()
    trace.kept = np.ones(len(samples[0]), dtype=bool)
    y, yd, ydd = (np.array([trace.input(x) for x in array.T], dtype=object) for array in samples[:3])
    at, guess = closed_form(loops.lay, y, TRACE, loops.fixed), dict[int, Any]()
    if at is None:
        guess = {c: trace.input(samples[3][:, c]) for c in dependent(loops)}
        at = _close(loops, y, guess, folds)
    near = {c: trace.input(samples[3][:, c]) for c in sprung_cuts(loops, applied)}
    timed = not all(motor.course.constant for motor in applied.motors)
    t = trace.input(np.zeros(len(samples[0]))) if timed else 0.0
    if wanted.loaded:
        loads = tuple(_input_load(trace, load, len(samples[0])) for load in applied.loads)
        applied = replace(applied, loads=loads)
    motion = Response(loops, at, yd, ydd, folds, TRACE, applied)
    motion.near, motion.t, motion.axial, motion.points = near, t, wanted.axial, wanted.points
    motion.idle, motion.resting = wanted.idle, wanted.resting
    reached = [at.q[c] for c in guess] + [motion.w[c] for c in guess]
    outputs = {"reached": reached} | quantities(motion, wanted)
    checks = _checks(motion, y, guess, outputs)
    more = dict(further({**outputs, **checks}))
    first = more.pop("first", [])
    places, flat = dict[str, slice](), list[Any]()
    for name, numbers in (outputs | more | checks).items():
        places[name] = slice(len(flat), len(flat) + len(numbers))
        flat += numbers
    kept, largest = _well_solved(loops, samples[3], checks["gain"][0], trace.kept)
    arc = program(len(trace.inputs), flat, len(CHECKS), first), largest
    return Traced((arc,), places, tuple(guess), tuple(near), timed), kept


def _well_solved(loops: Loops, q: Array, by_pivots: Any, kept: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], float]:
    """Flag samples at which the pivots amplify rounding little more than necessary; return their largest gain.

    Args:
        q: All joint coordinates. Shape (n, n_q).
        by_pivots: Squared gain, estimated from the pivots.
        kept: Flags of samples with large pivots. Shape (n,).
    """
    if not isinstance(by_pivots, Node):
        return kept, float(by_pivots)
    exact = gain(Closed(loops, coordinates(q, NUMPY), loops.folds(q), NUMPY))
    good = kept & (by_pivots.value <= GROWTH * exact)
    kept = good if good.any() else kept
    return kept, float(by_pivots.value[kept].max())


def sprung_cuts(loops: Loops, applied: Applied) -> list[int]:
    """Return the angles of cut joints with springs."""
    sprung = tuple(x.coordinate for x in applied.springs if isinstance(x, JointSpring))
    columns = loops.lay.mechanism.columns(sprung)
    return [c for c in dict.fromkeys(columns) if c in loops.owner and loops.lay.turns[c]]


def dependent(loops: Loops) -> list[int]:
    """Return the tree coordinates that depend on the independent coordinates."""
    return [c for c in loops.columns[: loops.moving] if c not in loops.y_columns]


def _close(loops: Loops, y: Array, guess: Mapping[int, Any], folds: Sequence[float]) -> Coordinates:
    """Return the coordinates after the steps of Newton's method."""
    q = loops.lay.mechanism.home.astype(object)
    for c, value in (*guess.items(), *zip(loops.y_columns, y, strict=True)):
        q[c] = value
    for _ in range(NEWTON if loops.cuts or len(loops.couplings) else 0):
        q = q + Closed(loops, coordinates(q, TRACE), folds, TRACE).newton_step(y)
    return coordinates(q, TRACE)


def _input_load(trace: Trace, load: Load, n: int) -> Load:
    """Turn a load's force and torque into inputs."""
    force, torque = (
        np.array([trace.input(np.full(n, x)) for x in np.ravel(vector)], dtype=object)
        for vector in (load.force, load.torque)
    )
    return replace(load, force=force, torque=torque, courses=())


def quantities(at: Dynamics, wanted: TracedQuantities) -> dict[str, list[Any]]:
    """Return the components of each quantity in order."""
    outputs = {}
    for name in wanted.quantities:
        if name in QUANTITIES:
            outputs[name] = [*QUANTITIES[name](at)]
        elif wanted.shares is not None:
            outputs[name] = [*at.open_tree_force(wanted.shares)[[*wanted.tree]]]
    return outputs


def _checks(
    at: Response, y: Array, guess: Mapping[int, Any], outputs: Mapping[str, Sequence[Any]]
) -> dict[str, list[Any]]:
    """Return the diagnostics of each sample, see `CHECKS`."""
    loops = at.loops
    driven, reacted = DRIVEN & outputs.keys(), "reaction" in outputs
    charted = CHARTED & outputs.keys()
    moved = np.array([at.q[c] - x for c, x in guess.items()], dtype=object)
    moving = loops.columns[: loops.moving]
    numbers = {
        "gain": gain(at),
        "whole_gain": gain(at, whole=True) if reacted and loops.fixed else gain(at),
        "drive": drive_gain(at) if driven and at.mechanism.actuator_names else 0.0,
        "moved": squares(moved, loop_sizes(loops.lay)[[*guess]]),
        "closing": squares(at.residual(y), loops.unit) if guess else 0.0,
        "balance": squares(at.imbalance, loops.size) if reacted else 0.0,
        "charts": chart_gain(at) if charted else 1.0,
        "speed": squares(at.w[moving], loops.sizes[moving]),
        "rush": squares(at.beta[moving], loops.sizes[moving]),
    }
    if at.idle:
        numbers["drive"] = TRACE.maximum(numbers["drive"], idle_gain(at))
    return {name: [numbers[name]] for name in CHECKS}


#: Dimensionless diagnostics of each sample: squares of the last step of Newton's method, of the mean closure residual
#: after that step, and of an estimate of the condition number of the closed loops; the divisor of the inertia matrix;
#: the squared mean distance to the prediction; and the square of the correction divided by its limit.
FORWARD_CHECKS = ("moved", "residual", "condition", "inertia", "far", "strayed")
#: Number of steps of Newton's method.
FORWARD_STEPS = 2
#: Largest distance of a pose from its prediction, relative to the predicted step (other branches are farther away),
#: and rounding error.
BEND, SLACK = 0.3, 1e-9


def forward_program(loops: Loops, applied: Applied, q: Array) -> tuple[Program, list[int]]:
    """Trace forward dynamics.

    Args:
        applied: Applied forces.
        q: Joint coordinates of closed poses where pivots are chosen. Shape (n, n_q).

    Returns:
        The program, and the columns of the dependent coordinates. Inputs are a closed pose (d dependent coordinates,
        their velocity map row by row, and y), followed by y, yd and time of a nearby state. Outputs are ydd, the power
        of all elements that do not store energy, the closed pose of the state, and `FORWARD_CHECKS`.

    Raises:
        NotTraceableError: Programs do not cover the mechanism or its applied forces.
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
    at, moved = _correct(loops, x, y, folds) if columns else (coordinates(x, TRACE), 0.0)
    motion = Response(loops, at, yd, None, folds, TRACE, applied)
    motion.t = t
    sizes = loops.sizes[columns]
    far, off = squares(way, sizes), squares(motion.q[columns] - z0 - way, sizes)
    checks = [moved, _mean(motion, y), _condition(motion), motion.inertia_gain]
    checks += [far * (1.0 / max(len(columns), 1)), off / (BEND**2 * far + SLACK**2)] if columns else [0.0, 0.0]
    answer = [*motion.ydd, motion.input_power, *motion.q[columns], *motion.K[..., columns].T.flat, *y]
    return program(len(trace.inputs), [*answer, *checks], len(FORWARD_CHECKS)), columns


#: Factors and shifts that yield y of the prediction, and y and yd, from the coordinates at the samples of a trace.
PLACES = ((1.0, 0.0), (1.0, 0.0), (0.0, 1.0))


def _mean(at: Closed, y: Array) -> Any:
    """Return the squared mean closure residual."""
    return squares(at.residual(y), at.loops.unit) * (1.0 / max(1, at.loops.given.start))


def _correct(loops: Loops, x: Array, y: Array, folds: list[float]) -> tuple[Coordinates, Any]:
    """Return the coordinates after the steps of Newton's method, and the square of the last step.

    If only rounding errors remain, a step would move the pose by amplified rounding; therefore, the step fades out.
    """
    step: Any = 0.0 * x
    for _ in range(FORWARD_STEPS):
        at = Closed(loops, coordinates(x, TRACE), folds, TRACE)
        share = TRACE.maximum(0.0, 1.0 - ROUNDING**2 / TRACE.maximum(_mean(at, y), 1e-300))
        step = share * at.newton_step(y)
        x = x + step
    return coordinates(x, TRACE), squares(step, loops.sizes)


def _condition(at: Closed) -> Any:
    """Return an estimate of the squared condition number of the closed loops."""
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
