"""Traces a question: which quantities, as which outputs of a program."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.applied import Load
from screwgauge.reference.extent import extent
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.closing import Row
from screwgauge.reference.traced.constraints import Constraints
from screwgauge.reference.traced.crossing import Coordinates, Wrench
from screwgauge.reference.traced.equations import Closed, Dynamics, Question, coordinates, measured, newton
from screwgauge.reference.traced.legs import closed_coordinates, has_closed_form
from screwgauge.reference.traced.program import Program, program
from screwgauge.reference.traced.trace import Trace
from screwgauge.reference.traced.tree import NOTHING, TreeAt, plus
from screwgauge.reference.traced.vectors import Scalar, apply

#: Emitted with every sample, as squares: gain of the closing system, without and with coordinates that rest; what the
#: actuators' system was divided by; how far Newton's method went; residual of the loops, and of the balance of all
#: bodies; worst orientation of a cut joint; rates; accelerations.
CHECKS = ("gain", "whole_gain", "drive", "moved", "closing", "balance", "charts", "speed", "rush")
NEWTON = 2
Further = Callable[[Mapping[str, Sequence[Scalar]]], Mapping[str, list[Scalar]]]
"""Quantities and checks of a trace -> other outputs."""


@dataclass(frozen=True, slots=True)
class Traced:
    """A program and what its numbers mean.

    Attributes:
        places: Quantity, or one of `CHECKS`, -> its outputs; and those of ``reached``: what became of the prediction,
            and its rates.
        predicted: Tree coordinates that it starts from, inputs after y, yd and ydd; none in closed form.
    """

    program: Program
    places: Mapping[str, slice]
    predicted: tuple[int, ...]


def traced(
    question: Question,
    wanted: Collection[str],
    samples: tuple[Array, Array, Array, Array],
    *,
    loaded: bool = False,
    further: Further = lambda outputs: {},
) -> Traced:
    """Traces a question.

    Args:
        wanted: Names of quantities.
        loaded: Whether the loads are inputs, the last: force and torque of each.
        samples: y, yd, ydd, shape (n, k) each, and all joint coordinates, shape (n, n_q), where pivots are chosen.
        further: What else is to be put out, from all of it: it stands before the checks; ``first`` is only computed,
            in this order, before all others.

    Raises:
        NotTraceableError: The mechanism or the question is beyond this.
    """
    trace, lay = Trace(), question.lay
    y, yd, ydd = ([trace.input(column) for column in array.T] for array in samples[:3])
    given = dict(zip(lay.mechanism.independent_columns, y, strict=True))
    predicted: tuple[int, ...] = ()
    moved: Scalar = 0.0
    if has_closed_form(lay, question.fixed):
        q, pairs = closed_coordinates(lay, given)
        values = given | dict(q.slide) | pairs
    else:
        predicted = tuple(question.dependent)
        guess = {c: trace.input(samples[3][:, c]) for c in predicted}
        found = newton(question, given | rest(question), guess, NEWTON if lay.tree.cuts else 0)
        q, values = coordinates(lay, found | rest(question)), dict(found)
        moved = measured({c: found[c] - guess[c] for c in predicted}, extent(lay).size.tolist())
    if loaded:
        question = replace(question, loads=tuple(_given(trace, load, len(samples[0])) for load in question.loads))
    dynamics = Dynamics(question, q, yd, ydd)
    reached = [values[c] for c in predicted] + [dynamics.v[c] for c in predicted]
    outputs = {"reached": reached} | everything(dynamics, wanted, values | rest(question))
    residuals = Closed(question, TreeAt(lay, q, closed=not predicted)).rows
    left: Scalar = 0.0
    if "reaction" in wanted:
        constraints = Constraints(dynamics)
        outputs["reaction"], left = constraints.values, balance_left(dynamics, constraints)
    said = checks(dynamics, moved, left, residuals)
    more = dict(further({**outputs, **said}))
    first = more.pop("first", [])
    outputs |= more | said
    places, flat = dict[str, slice](), list[Scalar]()
    for name, numbers in outputs.items():
        places[name] = slice(len(flat), len(flat) + len(numbers))
        flat += numbers
    return Traced(program(len(trace.inputs), flat, len(CHECKS), first), places, predicted)


def rest(question: Question) -> dict[int, float]:
    """Coordinates that keep their home value."""
    return {c: float(question.lay.mechanism.home[c]) for c in question.fixed}


def _given(trace: Trace, load: Load, n: int) -> Load:
    """A load whose force and torque are inputs."""
    force, torque = ([trace.input(np.full(n, x)) for x in vector] for vector in (load.force, load.torque))
    return replace(load, force=force, torque=torque)  # type: ignore[arg-type]


def everything(found: Dynamics, wanted: Collection[str], tree: Mapping[int, Scalar]) -> dict[str, list[Scalar]]:
    """Quantity -> its numbers, in the order of its components; of constraint forces, see `Constraints`.

    Args:
        tree: Tree coordinates, or their (sine, cosine).
    """
    lay = found.lay
    count = range(len(lay.mechanism.coordinates))
    cut = found.cut_values if lay.tree.cuts else {}

    def position(c: int) -> Scalar:
        value = cut[c][0] if c in cut else tree[c]
        return apply("atan2", *value) if isinstance(value, tuple) else value

    made: dict[str, Callable[[], list[Scalar]]] = {
        "joint_position": lambda: [position(c) for c in count],
        "joint_velocity": lambda: [cut[c][1] if c in cut else found.v[c] for c in count],
        "joint_acceleration": lambda: [cut[c][2] if c in cut else found.a[c] for c in count],
        "body_angular_velocity": lambda: found.bodies("w"),
        "body_angular_acceleration": lambda: found.bodies("b"),
        "com_acceleration": lambda: found.bodies("a"),
        "tree_force": lambda: open_forces(found),
        "tree_force_soft": lambda: open_forces(found),
        "generalized_force": lambda: found.generalized,
        "actuator_force": lambda: found.forces,
    }
    return {name: numbers() for name, numbers in made.items() if name in wanted}


def balance_left(found: Dynamics, constraints: Constraints) -> Scalar:
    """Square of what is left along the tree's coordinates when actuators and constraint forces act."""
    left = dict(constraints.rest)
    for row, force in zip(found.drives, found.forces, strict=True):
        if len(row) == 1:
            (i,) = row
            left[i] = left[i] - force
    return measured(left, found.question.size)


def checks(found: Dynamics, moved: Scalar, left: Scalar, residuals: Sequence[Row]) -> dict[str, list[Scalar]]:
    """What every sample says of itself, see `CHECKS`."""
    size, by = found.question.size, extent(found.lay)
    charts = 0.0
    for cut in found.at.cuts:
        if cut.joint.kind == "S":
            c = cut.chart().pairs[1][1]
            charts = charts + 1.0 / (c * c)
    numbers = (
        *found.pose.gains(by),
        found.drive,
        moved,
        measured({i: row.residual for i, row in enumerate(residuals)}, found.pose.unit),
        left,
        charts,
        measured(found.v, size),
        measured(found.a, size),
    )
    return {name: [number] for name, number in zip(CHECKS, numbers, strict=True)}


def open_forces(found: Dynamics) -> list[Scalar]:
    """Forces along the coordinates of the open tree, from inertia and gravity alone."""
    question, lay = found.question, found.lay
    angle = dict(found.at.q.angle)
    slide = dict(found.at.q.slide)
    for cut in found.at.cuts:
        chart, columns = cut.chart(), lay.columns[cut.joint.name]
        angle |= dict(zip(columns, chart.pairs, strict=False))
        if cut.slides:
            slide[columns[-1]] = chart.slide()
    at = TreeAt(lay, Coordinates(slide, angle, {}, {}))
    total, torques = dict[str, Wrench](), dict[int, Scalar]()
    for body, share, edge in reversed(question.open):
        own = plus(total.get(edge.far, NOTHING), found.inertia[body], share)
        for step in reversed(at.across_joint(edge.joint, reverse=edge.reverse)):
            own = step.inward(own, torques)
        total[edge.near] = plus(total.get(edge.near, NOTHING), own)
    torques.pop(-1, None)
    return [torques[i] for i in sorted(torques)]
