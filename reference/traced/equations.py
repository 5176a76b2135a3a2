"""Inverse dynamics of any graph of joints, number by number: the one source of what is traced.

Everything follows the way of `screwgauge.reference`: positions in closed form or by Newton's method on the wrenches
reciprocal to the joints that close the loops, velocity map, accelerations, virtual power, and constraint forces from
the transposed closing system, whose factors are those of the velocities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.applied import Load
from screwgauge.reference.graph import Edge
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.pose import Layout
from screwgauge.reference.traced.closing import Row, along
from screwgauge.reference.traced.crossing import Coordinates, Motion, Wrench
from screwgauge.reference.traced.elimination import Entries, Factors, solve
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.tree import TreeAt, plus
from screwgauge.reference.traced.vectors import (
    Scalar,
    Vector,
    add,
    apply,
    cross,
    dot,
    matrix,
    product,
    scale,
    squares,
    sub,
    turn,
    turn_back,
    vector,
)


@dataclass(frozen=True, eq=False)
class Question:
    """What a program is made for.

    Attributes:
        fixed: Tree coordinates that never move.
        size: Unit of each joint coordinate: 1 for angles, the mechanism's length for distances. Shape (n_q,).
        open: Links of the open tree, for `tree_force`, each after the one before it: body, its share of that, and the
            edge that leads there.
    """

    lay: Layout
    fixed: tuple[int, ...]
    size: Sequence[float]
    length: float
    gravity: Vector
    loads: tuple[Load, ...]
    open: tuple[tuple[str, float, Edge], ...] = ()

    @cached_property
    def dependent(self) -> list[int]:
        """Tree coordinates that follow from the independent ones."""
        chosen = {*self.lay.mechanism.independent_columns, *self.fixed}
        return [column for column in self.lay.tree_columns if column not in chosen]


def coordinates(lay: Layout, q: Mapping[int, Scalar]) -> Coordinates:
    """Joint coordinates from their values."""
    turns = lay.turns
    angle = {i: (apply("sin", x), apply("cos", x)) for i, x in q.items() if turns[i]}
    return Coordinates({i: x for i, x in q.items() if not turns[i]}, angle, {}, {})


class Closed:
    """The closing system at one pose, factorised."""

    def __init__(self, question: Question, at: TreeAt) -> None:
        self.question, self.at = question, at
        self.rows: list[Row] = []
        self.owners: list[int] = []
        A: Entries = {}
        for c, cut in enumerate(at.cuts):
            for row in cut.rows():
                for column, power in at.row(cut, row.child, row.parent).items():
                    A[len(self.rows), column] = power
                self.rows.append(row)
                self.owners.append(c)
        self.A = A
        self.unit = [question.length if row.force else 1.0 for row in self.rows]

    @cached_property
    def factors(self) -> Factors:
        """Dependent coordinates first, then those that rest: these count for forces only."""
        question = self.question
        chosen = {*question.lay.mechanism.independent_columns}
        A = {key: x for key, x in self.A.items() if key[1] not in chosen}
        stages = [question.dependent, [*question.fixed]]
        return Factors(A, self.unit, question.size, stages)

    def follow(self, right: Sequence[Scalar]) -> dict[int, Scalar]:
        """Dependent coordinates of ``A x = right``."""
        return self.factors.solve(right, len(self.question.dependent))

    @cached_property
    def map(self) -> dict[int, list[Scalar]]:
        """Velocity map: tree column -> rate per rate of each independent coordinate."""
        chosen = self.question.lay.mechanism.independent_columns
        columns = [self.follow([-self.A.get((r, j), 0.0) for r in range(len(self.rows))]) for j in chosen]
        K = {i: [x[i] for x in columns] for i in self.question.dependent}
        K |= {i: [0.0] * len(chosen) for i in self.question.fixed}
        return K | {i: [float(j == i) for j in chosen] for i in chosen}

    def gains(self) -> tuple[Scalar, Scalar]:
        """Squares of estimates of the norm of the inverse, without dimension, from one probe and the pivots.

        Returns:
            Of the coordinates that move, and of those that rest, too, which count for constraint forces.
        """
        factors, size, unit = self.factors, self.question.size, self.unit
        probe = [u if (r * 5) % 7 < 4 else -u for r, u in enumerate(unit)]
        for k, column in enumerate(self.question.lay.mechanism.independent_columns):
            sign = size[column] if k % 2 else -size[column]
            probe = [x + sign * self.A.get((r, column), 0.0) for r, x in enumerate(probe)]
        found = measured(self.follow(probe), size) + float(len(self.question.lay.mechanism.independent_columns))
        pivots = [*zip(factors.pivots, factors.inverse, strict=True)]
        scales = {(r, c): size[c] / unit[r] for (r, c), _ in pivots}
        m = len(self.question.dependent)
        moving = found + measured(dict(pivots[:m]), scales)
        return moving, moving + measured(dict(pivots[m:]), scales)


def measured(x: Mapping[Any, Scalar], size: Any) -> Scalar:
    """Sum of the squares of numbers over their sizes."""
    by_size = dict[float, list[Scalar]]()
    for key, value in x.items():
        by_size.setdefault(size[key], []).append(value)
    return sum((squares(values) * unit**-2 for unit, values in by_size.items()), start=0.0)


def newton(question: Question, y: Mapping[int, Scalar], guess: Mapping[int, Scalar], steps: int) -> dict[int, Scalar]:
    """Tree coordinates after some steps of Newton's method on the rows that have pivots."""
    q = dict(guess) | dict(y)
    for _ in range(steps):
        at = Closed(question, TreeAt(question.lay, coordinates(question.lay, q), closed=False))
        step = at.follow([-row.residual for row in at.rows])
        q |= {i: q[i] + x for i, x in step.items()}
    return q


def wrench_of_inertia(question: Question, name: str, at: Motion) -> Wrench:
    """What a body needs for its motion and against gravity, about its origin, in its axes."""
    body = question.lay.mechanism.body(name)
    com, J = vector(body.com), body.inertia
    force = scale(float(body.mass), sub(at.of_point(com), turn_back(at.R, question.gravity)))
    E = product(at.acceleration_matrix, matrix(0.5 * np.trace(J) * np.eye(3) - J))  # by its second moments
    moment = E[2][1] - E[1][2], E[0][2] - E[2][0], E[1][0] - E[0][1]
    return force, add(moment, cross(com, force))


def wrench_of_load(question: Question, load: Load, at: Motion) -> Wrench:
    """A load in the axes of its body."""
    force, torque = turn_back(at.R, tuple(load.force)), turn_back(at.R, tuple(load.torque))
    point = question.lay.mechanism.body(load.body).com if load.point is None else load.point
    return force, add(torque, cross(vector(point), force))


class Dynamics:
    """Motion and forces at one pose."""

    def __init__(self, question: Question, q: Coordinates, yd: Sequence[Scalar], ydd: Sequence[Scalar]) -> None:
        self.question, self.lay = question, question.lay
        self.drive: Scalar = 0.0  # sum of the squares of what the actuators' system was divided by
        self.columns = self.lay.mechanism.independent_columns
        self.pose = Closed(question, TreeAt(self.lay, q))
        self.v = {i: sum((k * r for k, r in zip(K, yd, strict=True)), start=0.0) for i, K in self.pose.map.items()}
        known = replace(q, v=self.v, a=dict(zip(self.columns, ydd, strict=True)))
        self.a = {**dict.fromkeys(question.fixed, 0.0), **known.a, **self._accelerations(known)}
        self.at = TreeAt(self.lay, replace(known, a=self.a))

    def _slide(self, at: TreeAt, c: int) -> Scalar:
        """Rate of the slide of a cut joint, zero if it has none."""
        cut = at.cuts[c]
        if not cut.slides:
            return 0.0
        return sum((x * self.v[i] for i, x in at.row(cut, *along(cut)).items()), start=0.0)

    def _accelerations(self, known: Coordinates) -> dict[int, Scalar]:
        """Accelerations of the dependent coordinates."""
        at = TreeAt(self.lay, known)
        right = list[Scalar]()
        for c, cut in enumerate(at.cuts):
            parent, child = at.sides[c]
            right += [-x for x in cut.biases(child, parent, self._slide(at, c))]
        return self.pose.follow(right)

    @cached_property
    def cut_values(self) -> dict[int, tuple[Scalar, Scalar, Scalar]]:
        """Column of a cut joint -> coordinate, rate and acceleration."""
        found = dict[int, tuple[Scalar, Scalar, Scalar]]()
        for c, cut in enumerate(self.at.cuts):
            parent, child = self.at.sides[c]
            columns, chart = self.lay.columns[cut.joint.name], cut.chart()
            rates = chart.rates(child, parent)
            found |= dict(zip(columns, zip(chart.angles(), *rates, strict=True), strict=False))
            if cut.slides:
                rate, axis = self._slide(self.at, c), vector(cut.joint.axes[0])
                linear = sub(turn(cut.M, child.a), parent.of_point(cut.d))
                linear = sub(linear, scale(2.0 * rate, cross(parent.w, axis)))
                found[columns[-1]] = (chart.slide(), rate, dot(axis, linear))
        return found

    @cached_property
    def inertia(self) -> dict[str, Wrench]:
        """What each body needs for its motion and against gravity."""
        bodies = self.lay.mechanism.bodies
        return {body.name: wrench_of_inertia(self.question, body.name, self.at.motions[body.name]) for body in bodies}

    @cached_property
    def required(self) -> dict[str, Wrench]:
        """What joints and actuators must exert on each body."""
        found = dict(self.inertia)
        for load in self.question.loads:
            if load.body != GROUND:
                acting = wrench_of_load(self.question, load, self.at.motions[load.body])
                found[load.body] = plus(found[load.body], acting, -1.0)
        return found

    @cached_property
    def torques(self) -> dict[int, Scalar]:
        """Along each tree coordinate, the loops being open."""
        return self.at.inward(self.required)

    @cached_property
    def generalized(self) -> list[Scalar]:
        """By virtual power."""
        K = self.pose.map
        return [sum((K[i][k] * x for i, x in self.torques.items()), start=0.0) for k in range(len(self.columns))]

    @cached_property
    def drives(self) -> list[dict[int, Scalar]]:
        """Tree column -> power of a unit of each actuator per rate."""
        found, at = list[dict[int, Scalar]](), self.pose.at
        for joint, column in zip(self.lay.mechanism.actuators, self.lay.mechanism.actuated_columns, strict=True):
            if joint not in self.lay.tree.cuts:
                found.append({column: 1.0})
                continue
            cut = at.cuts[self.lay.tree.cuts.index(joint)]
            found.append(at.row(cut, *along(cut)))
        return found

    @cached_property
    def forces(self) -> list[Scalar]:
        """Actuator forces of smallest norm."""
        K, k = self.pose.map, len(self.columns)
        if len(self.drives) < k:
            raise NotTraceableError("it has fewer actuators than freedoms", "actuators", "use backend array")
        B = [[sum((x * K[i][j] for i, x in row.items()), start=0.0) for j in range(k)] for row in self.drives]
        if len(B) == k:
            self.drive, amounts = solve([[row[j] for row in B] for j in range(k)], self.generalized)
            return amounts
        gram = [[sum((row[i] * row[j] for row in B), start=0.0) for j in range(k)] for i in range(k)]
        self.drive, amounts = solve(gram, self.generalized)
        return [sum((x * amount for x, amount in zip(row, amounts, strict=True)), start=0.0) for row in B]

    def bodies(self, what: str) -> list[Scalar]:
        """World components of a vector of each body: ``w``, ``b``, or ``a`` of the centre of mass."""
        found = list[Scalar]()
        for body in self.lay.mechanism.bodies:
            at = self.at.motions[body.name]
            own = at.of_point(vector(body.com)) if what == "a" else getattr(at, what)
            found += turn(at.R, own)
        return found
