"""Forward dynamics, number by number: two programs, one that closes the loops and one that answers to forces.

The first is a step of Newton's method, repeated as often as a state needs it. The second is `reference.forward`,
``M ydd = Q - h``, on the velocity map of the closed pose: columns of M are the forces along the tree for a unit
acceleration of each independent coordinate, h those for none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from screwgauge.reference.applied import Applied, JointSpring, Load, Motor, PointSpring
from screwgauge.reference.extent import whole
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.closing import along
from screwgauge.reference.traced.crossing import Coordinates, Wrench
from screwgauge.reference.traced.elimination import solve
from screwgauge.reference.traced.equations import (
    Closed,
    Dynamics,
    Question,
    coordinates,
    measured,
    wrench_of_inertia,
    wrench_of_load,
)
from screwgauge.reference.traced.program import Program, program
from screwgauge.reference.traced.trace import NotTraceableError, Trace
from screwgauge.reference.traced.tracing import rest
from screwgauge.reference.traced.tree import TreeAt
from screwgauge.reference.traced.vectors import (
    ZERO,
    Scalar,
    Vector,
    add,
    apply,
    cross,
    dot,
    scale,
    sqrt,
    sub,
    turn,
    turn_back,
)
from screwgauge.reference.traced.vectors import vector as numbers


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


def forward_programs(question: Question, applied: Applied, q: Array) -> Forward:
    """Traces both programs.

    Args:
        question: Of the mechanism under its gravity, without loads.
        applied: What acts besides gravity.
        q: Joint coordinates of closed poses where pivots are chosen. Shape (n, n_q).

    Raises:
        NotTraceableError: The mechanism, or what acts on it, is beyond this.
    """
    lay, dependent = question.lay, tuple(question.dependent)
    places = (*dependent, *lay.mechanism.independent_columns)
    close, respond = Trace(), Trace()
    x = {c: close.input(q[:, c]) for c in places} | rest(question)
    at = Closed(question, TreeAt(lay, coordinates(lay, x), closed=False))
    step = at.follow([-row.residual for row in at.rows]) if lay.tree.cuts else {}
    residual = measured({i: row.residual for i, row in enumerate(at.rows)}, at.unit)
    closed = [*(step[c] for c in dependent), measured(step, question.size), residual * (1.0 / max(1, len(at.rows)))]

    x = {c: respond.input(q[:, c]) for c in places} | rest(question)
    yd = [respond.input(0.0 * q[:, c] + 1.0) for c in lay.mechanism.independent_columns]
    t = respond.input(0.0 * q[:, 0])
    dynamics = Dynamics(question, coordinates(lay, x), yd, [0.0] * len(yd))
    acting = Acting(dynamics, x)
    for motor in applied.motors:
        acting.motor(motor, t)
    for spring in applied.springs:
        acting.spring(spring)
    for load in applied.loads:
        acting.load(load)
    ydd, inertia = _response(dynamics, acting.tau)
    K = dynamics.pose.map
    answer = [*ydd, acting.power, _condition(dynamics.pose), inertia, *(k for c in dependent for k in K[c])]
    return Forward(program(len(close.inputs), closed), program(len(respond.inputs), answer), dependent)


class Acting:
    """What acts besides gravity, as forces along the coordinates of the tree.

    Attributes:
        tau: Tree column -> force [N or N m].
        power: Of all that stores no energy [W].
    """

    def __init__(self, dynamics: Dynamics, x: Mapping[int, Scalar]) -> None:
        """Begins with nothing. `x`: tree coordinates."""
        self.at, self.v, self.x, self.lay, self.question = dynamics.at, dynamics.v, x, dynamics.lay, dynamics.question
        self.tau: dict[int, Scalar] = {}
        self.power: Scalar = 0.0

    def _act(self, force: Scalar, per_rate: Mapping[int, Scalar], lost: Scalar | None = None) -> None:
        """Adds a force by its power at a unit rate of each coordinate.

        Args:
            lost: The part of it whose power is not stored; all of it by default.
        """
        for column, power in per_rate.items():
            self.tau[column] = self.tau.get(column, 0.0) + force * power
        self.power = self.power + (force if lost is None else lost) * self._rate(per_rate)

    def _rate(self, per_rate: Mapping[int, Scalar]) -> Scalar:
        return sum((x * self.v[i] for i, x in per_rate.items()), start=0.0)

    def motor(self, motor: Motor, t: Scalar) -> None:
        """A force along a joint coordinate."""
        column, force = self.lay.mechanism.coordinates.index(motor.coordinate), _at_time(motor, t)
        if column not in self.lay.cut_columns:
            self._act(force, {column: 1.0})
            return
        (c,) = (c for c, joint in enumerate(self.lay.tree.cuts) if column in self.lay.columns[joint.name])
        cut = self.at.cuts[c]
        if cut.joint.kind not in "RP":
            what = "a motor acts on a joint of several freedoms that closes a loop"
            raise NotTraceableError(what, motor.coordinate, "use backend array")
        self._act(force, self.at.row(cut, *along(cut)))

    def spring(self, spring: JointSpring | PointSpring) -> None:
        if isinstance(spring, PointSpring):
            self._line(spring)
            return
        column = self.lay.mechanism.coordinates.index(spring.coordinate)
        if column in self.lay.cut_columns:
            raise NotTraceableError(
                "a spring acts on a joint that closes a loop", spring.coordinate, "use backend array"
            )
        damper = -(spring.damping * self.v[column])
        self._act(damper - spring.stiffness * (self.x[column] - spring.rest), {column: 1.0}, damper)

    def _line(self, spring: PointSpring) -> None:
        """A spring between points: its tension shortens the line."""
        ends = [(body, numbers(point), self.at.motions[body]) for body, point in spring.ends]
        (first, a, at_a), (second, b, at_b) = ends
        line = sub(add(at_b.p, turn(at_b.R, b)), add(at_a.p, turn(at_a.R, a)))
        length = sqrt(dot(line, line))
        unit = scale(1.0 / length, line)
        longer = self.at.work(second, _at_point(turn_back(at_b.R, unit), b), first)
        for column, power in self.at.work(first, _at_point(turn_back(at_a.R, unit), a), second).items():
            longer[column] = longer.get(column, 0.0) - power
        damper = -(spring.damping * self._rate(longer))
        self._act(damper - spring.stiffness * (length - spring.rest), longer, damper)

    def load(self, load: Load) -> None:
        if load.body != GROUND:
            wrench = wrench_of_load(self.question, load, self.at.motions[load.body])
            self._act(1.0, self.at.work(load.body, wrench, GROUND))


def _at_time(motor: Motor, t: Scalar) -> Scalar:
    force: Scalar = 0.0
    for coefficient in motor.polynomial[::-1].tolist():
        force = force * t + coefficient
    for omega, c, s in motor.harmonics.tolist():
        force = force + c * apply("cos", omega * t) + s * apply("sin", omega * t)
    return force


def _at_point(force: Vector, point: Vector) -> Wrench:
    return force, cross(point, force)


def _response(dynamics: Dynamics, tau: Mapping[int, Scalar]) -> tuple[list[Scalar], Scalar]:
    """Accelerations of the independent coordinates, and an estimate of what they were divided by."""
    K, q = dynamics.pose.map, dynamics.at.q
    k = len(dynamics.columns)
    columns = [_inertia_forces(dynamics.question, replace(q, v={}, a={i: K[i][j] for i in K})) for j in range(k)]
    M = [[_along(K, columns[max(i, j)], min(i, j)) for j in range(k)] for i in range(k)]
    left = {i: tau.get(i, 0.0) - x for i, x in dynamics.torques.items()}
    Q = [_along(K, left, j) for j in range(k)]
    if k == 1:  # against all mass at the mechanism's length
        question, column = dynamics.question, dynamics.columns[0]
        mass = sum(float(body.mass) for body in dynamics.lay.mechanism.bodies)
        return [Q[0] / M[0][0]], mass * (question.length / question.size[column]) ** 2 / M[0][0]
    d = [1.0 / sqrt(M[j][j]) for j in range(k)]  # coordinates may be in rad and m
    scaled = [[M[i][j] * d[i] * d[j] if i != j else 1.0 for j in range(k)] for i in range(k)]
    divisor, found = solve(scaled, [x * y for x, y in zip(Q, d, strict=True)])
    return [x * y for x, y in zip(found, d, strict=True)], divisor


def _inertia_forces(question: Question, q: Coordinates) -> dict[int, Scalar]:
    """Forces along the tree for some accelerations from rest, without gravity."""
    at, floating = TreeAt(question.lay, q), replace(question, gravity=ZERO)
    bodies = question.lay.mechanism.bodies
    return at.inward({b.name: wrench_of_inertia(floating, b.name, at.motions[b.name]) for b in bodies})


def _along(K: Mapping[int, Sequence[Scalar]], tau: Mapping[int, Scalar], j: int) -> Scalar:
    return sum((K[i][j] * x for i, x in tau.items()), start=0.0)


def _condition(pose: Closed) -> Scalar:
    """Square of an estimate of the condition number of the closed loops over the independent coordinates."""
    if not pose.rows:
        return 1.0
    size = pose.question.size
    entries = {key: x for key, x in pose.A.items() if key[1] not in pose.question.fixed}
    scales = {(r, c): pose.unit[r] / size[c] for r, c in entries}
    return (measured(entries, scales) + float(len(pose.question.lay.mechanism.independent_columns))) * pose.gains(
        whole(pose.question.lay)
    )[0]
