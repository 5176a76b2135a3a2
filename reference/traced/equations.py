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
from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.pose import Layout
from screwgauge.reference.reactions import reaction_components
from screwgauge.reference.traced import closing
from screwgauge.reference.traced.closing import Row
from screwgauge.reference.traced.crossing import Coordinates, Motion, Wrench
from screwgauge.reference.traced.elimination import Entries, Factors, solve
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.tree import NOTHING, TreeAt, plus
from screwgauge.reference.traced.vectors import (
    ZERO,
    Scalar,
    Vector,
    add,
    apply,
    cross,
    dot,
    matrix,
    rotation,
    scale,
    squares,
    sub,
    turn,
    turn_back,
    vector,
)

#: Redundant constraint forces times all of them: the smallest norm costs several operations for each pair.
MOST_REDUNDANT = 1500


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
    com, J = vector(body.com), matrix(body.inertia)
    force = scale(float(body.mass), sub(at.of_point(com), turn_back(at.R, question.gravity)))
    moment = add(turn(J, at.b), cross(at.w, turn(J, at.w)))
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
        axis = vector(cut.joint.axes[0])
        on_child = turn_back(cut.M, axis)
        powers = at.row(cut, (on_child, ZERO), (axis, cross(cut.d, axis)))
        return sum((x * self.v[i] for i, x in powers.items()), start=0.0)

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
            found.append(at.row(cut, *_along(cut)))
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

    @cached_property
    def constraints(self) -> Constraints:
        return Constraints(self)

    def bodies(self, what: str) -> list[Scalar]:
        """World components of a vector of each body: ``w``, ``b``, or ``a`` of the centre of mass."""
        found = list[Scalar]()
        for body in self.lay.mechanism.bodies:
            at = self.at.motions[body.name]
            own = at.of_point(vector(body.com)) if what == "a" else getattr(at, what)
            found += turn(at.R, own)
        return found


def _along(cut: closing.Cut) -> tuple[Wrench, Wrench]:
    """A unit of what acts along the freedom of a cut R or P joint, on child and on parent."""
    axis = vector(cut.joint.axes[0])
    on_child = turn_back(cut.M, axis)
    if cut.joint.kind == "R":
        return (ZERO, on_child), (ZERO, axis)
    return (on_child, ZERO), (axis, cross(cut.d, axis))


class Constraints:
    """Constraint forces of all joints."""

    def __init__(self, dynamics: Dynamics) -> None:
        self.dynamics, self.pose, self.at = dynamics, dynamics.pose, dynamics.at
        self.question, cuts = dynamics.question, self.at.cuts
        self.between = [(cuts[c], row) for c, row in zip(self.pose.owners, self.pose.rows, strict=True)]
        mechanism, n = self.question.lay.mechanism, len(self.question.lay.mechanism.joints)
        eye = [np.eye(3)[None]] * n
        with np.errstate(invalid="ignore"):  # of a pose that is none: names are wanted, no directions
            self.components = reaction_components(mechanism.joints, eye, eye, [np.zeros((1, 3))] * n)
        self.amounts = self._amounts()
        self.values, self.rest = self._read(self.amounts, particular=True)

    def _amounts(self) -> list[Scalar]:
        """Of the wrenches of the cut joints; where more than one answer is right, that of smallest norm of all."""
        dynamics, factors = self.dynamics, self.pose.factors
        tau = dict(dynamics.torques)
        for row, force in zip(dynamics.drives, dynamics.forces, strict=True):
            for i, x in row.items():
                tau[i] = tau.get(i, 0.0) - x * force
        columns = [column for _, column in factors.pivots]
        found = factors.solve_transposed({i: tau[i] for i in columns})
        if not factors.spare:
            return found
        redundant = len(factors.spare) * len(self.components.names)
        if redundant > MOST_REDUNDANT:
            what = f"{len(factors.spare)} of its constraint forces are redundant"
            raise NotTraceableError(what, self.question.lay.mechanism.name, "use backend array")
        size = [self.question.length if unit == "N m" else 1.0 for unit in self.components.units]
        own = [x * (1.0 / s) for x, s in zip(self._read(found, particular=True)[0], size, strict=True)]
        zero = dict.fromkeys(columns, 0.0)
        spaces = [factors.solve_transposed(zero, {row: 1.0}) for row in factors.spare]
        null = [
            [x * (1.0 / s) for x, s in zip(self._read(space, particular=False)[0], size, strict=True)]
            for space in spaces
        ]
        inner = [[sum((x * y for x, y in zip(a, b, strict=True)), start=0.0) for b in [*null, own]] for a in null]
        _, shares = solve([row[:-1] for row in inner], [row[-1] for row in inner])
        for share, space in zip(shares, spaces, strict=True):
            found = [x - share * y for x, y in zip(found, space, strict=True)]
        return found

    def _read(self, amounts: Sequence[Scalar], *, particular: bool) -> tuple[list[Scalar], dict[int, Scalar]]:
        """All reaction components, and what is left along the tree's coordinates."""
        external = self.at.between(self.between, amounts)
        if particular:
            cuts = self.at.cuts
            driven = [(cuts[self.question.lay.tree.cuts.index(j)], f) for j, f in self._cut_drives()]
            pulls = [(cut, Row(False, ZERO, *_along(cut), 0.0)) for cut, _ in driven]
            for body, wrench in self.at.between(pulls, [f for _, f in driven]).items():
                external[body] = plus(external.get(body, NOTHING), wrench)
        wrenches = dict(self.dynamics.required) if particular else {}
        for body, wrench in external.items():
            if body != GROUND:
                wrenches[body] = plus(wrenches.get(body, NOTHING), wrench, -1.0)
        joints = dict[str, Wrench]()
        rest = self.at.inward(wrenches, joints)
        cut_values = dict[str, list[Scalar]]()
        for (cut, _), amount in zip(self.between, amounts, strict=True):
            cut_values.setdefault(cut.joint.name, []).append(amount)
        each = {j.name: iter(self._components(j, joints, cut_values)) for j in self.question.lay.mechanism.joints}
        mechanism = self.question.lay.mechanism
        return [next(each[mechanism.joints[i].name]) for i in self.components.joints], rest

    def _cut_drives(self) -> list[tuple[Joint, Scalar]]:
        mechanism = self.question.lay.mechanism
        pairs = zip(mechanism.actuators, self.dynamics.forces, strict=True)
        return [(joint, force) for joint, force in pairs if joint in self.question.lay.tree.cuts]

    def _components(
        self, joint: Joint, joints: Mapping[str, Wrench], amounts: Mapping[str, Sequence[Scalar]]
    ) -> list[Scalar]:
        """Components of one joint, in the order of `reactions`.

        Args:
            joints: Wrench of parent on child of each tree joint, in its frame of the child.
            amounts: Of the wrenches of each cut joint.
        """
        if joint.kind == "F":
            return []
        axis = vector(joint.axes[0])
        if joint.name in joints:
            (force, moment), world, normal = self._of_tree(joint, joints[joint.name])
        else:
            (force, moment), world, normal = self._of_cut(joint, amounts[joint.name])
        forces = [dot(u, force) for u in closing.across(axis)] if joint.kind in "PC" else [*world]
        moments = {"U": [dot(normal, moment)], "P": [*moment], "S": []}
        return forces + moments.get(joint.kind, [dot(u, moment) for u in closing.across(axis)])

    def _of_tree(self, joint: Joint, wrench: Wrench) -> tuple[Wrench, Vector, Vector]:
        """Wrench in the joint's frame of the child, its force in the world, and the direction of a U joint's moment."""
        world = turn(self.at.motions[joint.child].R, turn(matrix(joint.child_frame.R), wrench[0]))
        if joint.kind != "U":
            return wrench, world, ZERO
        s, c = self.at.q.angle[self.question.lay.columns[joint.name][1]]
        first, second = (vector(axis) for axis in joint.axes)
        return wrench, world, turn_back(rotation(second, s, c), cross(first, second))

    def _of_cut(self, joint: Joint, amounts: Sequence[Scalar]) -> tuple[Wrench, Vector, Vector]:
        """The same of a cut joint."""
        c = self.question.lay.tree.cuts.index(joint)
        cut, (force, moment) = self.at.cuts[c], NOTHING
        rows = [row for other, row in self.between if other is cut]
        for row, amount in zip(rows, amounts, strict=True):
            if row.force:
                force = add(force, scale(amount, row.u))
            else:
                moment = add(moment, scale(amount, row.u))
        world = turn(self.at.sides[c][cut.outer].R, force)
        if joint.kind == "U":  # its direction is a unit vector where the loop is closed
            return ((force, (amounts[-1], 0.0, 0.0)), world, (1.0, 0.0, 0.0))
        wrench = (force, moment) if cut.outer else (turn_back(cut.M, force), turn_back(cut.M, moment))
        return wrench, world, ZERO
