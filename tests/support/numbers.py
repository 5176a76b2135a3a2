"""The equations over several kinds of number, and the spanning trees over which they may be written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from screwgauge import Scene
from screwgauge.engines.screw.model import ScrewModel
from screwgauge.problem import GivenMotion, Problem
from screwgauge.reference.applied import Applied, JointSpring, Load, Motor, PointSpring
from screwgauge.reference.closed.loops import home_equations
from screwgauge.reference.courses import Course
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.dynamics import QUANTITIES, Dynamics
from screwgauge.reference.equations.forward import Forward
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.equations.kinematics import coordinates
from screwgauge.reference.equations.ops import NUMPY, TRACE, Ops, Sparse, vectorize
from screwgauge.reference.graph import Layout, coupled_joints, layout, spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.precision import in_precision, round_to
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Lanes, Program, program
from screwgauge.reference.traced.trace import OPERATIONS, Trace

#: What `Forward` adds.
FORWARD, POWER = "forward_acceleration", "input_power"
#: Time that motors go by [s].
T = 0.3
#: Roundings that the few hundred operations between a coordinate and a quantity add up to, over the condition number
#: of what is solved; forces are sums of which parts cancel. Up to 40 are seen.
ROUNDINGS = 100.0
#: Bits of the balls that are the measure of all others. Turning a vector into the axes of a body and back makes balls
#: wider, up to a thousandfold along eleven joints: 200 bits leave 32 digits of their reactions, 256 leave 49.
BITS = 256
#: Steps of Newton's method, each of which squares the rounding of a double, by which poses are open.
STEPS: dict[Any, int] = {np.float32: 0, np.float64: 1, np.longdouble: 2, "arb": 3}


def objects(sin: Any, cos: Any, sqrt: Any, atan2: Any, maximum: Any) -> Ops:
    return Ops(vectorize(sin), vectorize(cos), vectorize(sqrt), vectorize(atan2, 2), vectorize(maximum, 2), Sparse)


#: NumPy's longest floats one by one: LAPACK has none of them.
LONG = objects(np.sin, np.cos, np.sqrt, np.arctan2, np.maximum)


def balls() -> Ops:
    from flint import arb

    def of(name: str) -> Callable[..., Any]:
        return lambda *x: getattr(arb, name)(*map(arb, x))

    return objects(of("sin"), of("cos"), of("sqrt"), of("atan2"), of("max"))


@contextmanager
def precision(bits: int) -> Iterator[None]:
    from flint import ctx

    before, ctx.prec = ctx.prec, bits
    try:
        yield
    finally:
        ctx.prec = before


@dataclass(frozen=True)
class State:
    """A mechanism in motion under forces, with the tree in which its equations are written.

    Attributes:
        lay: Mechanism and tree.
        loops: Its loops.
        applied: What acts.
        axial: Whether the rule of eq. (56) holds.
        q: Joint coordinates, closed to the rounding of a double. Shape (n, n_q).
        y, yd, ydd: Shape (n, k).
    """

    lay: Layout
    loops: Loops
    applied: Applied
    axial: bool
    q: Array
    y: Array
    yd: Array
    ydd: Array

    @property
    def fixed(self) -> list[int]:
        return self.loops.fixed

    def units(self, quantity: str) -> list[str]:
        """Of each component; derivatives in time apart, units of one column are compared with each other."""
        mechanism, drives = self.lay.mechanism, len(self.lay.mechanism.actuator_names)
        return {
            "joint_position": [*mechanism.units],
            "joint_velocity": [*mechanism.units],
            "joint_acceleration": [*mechanism.units],
            "axis_moment": [*mechanism.units],
            "resistance": [one.unit for one in mechanism.resistances],
            FORWARD: [mechanism.units[c] for c in mechanism.independent_columns],
            "generalized_force": [mechanism.units[c] for c in mechanism.independent_columns],
            "actuator_force": [*mechanism.actuator_units],
            POWER: ["W"],
            "reaction": [*reaction_names(mechanism.joints, mechanism.couplings)[1]],
            "jacobian": [*["rad"] * 3 * drives, *["m"] * 3 * drives] * len(mechanism.bodies),
        }.get(quantity, [""] * 3 * len(mechanism.bodies))

    def row(self, i: int) -> State:
        """One sample."""
        some = slice(i, i + 1)
        return replace(self, q=self.q[some], y=self.y[some], yd=self.yd[some], ydd=self.ydd[some])

    def over(self, tree: Sequence[str]) -> State:
        lay = spanning_tree(self.lay.mechanism, tree)
        return replace(self, lay=lay, loops=Loops(lay, [c for c in self.fixed if c in lay.tree_columns]))


def acting(mechanism: Mechanism) -> Applied:
    first, last, body = mechanism.coordinates[0], mechanism.coordinates[-1], mechanism.bodies[-1].name
    return Applied(
        gravity=np.array([1.0, -2.0, -9.0]),
        loads=(Load(body, np.array([0.1, 0.2, 0.3]), np.array([3.0, -4.0, 5.0]), np.array([0.3, 0.2, -0.1])),),
        springs=(
            JointSpring(first, 3.0, 0.2, 0.7),
            JointSpring(last, 5.0, -0.3, 0.4),
            PointSpring("ground", np.array([2.0, 1.0, 3.0]), body, np.array([0.1, 0.0, 0.2]), 50.0, 1.0, 4.0),
        ),
        motors=tuple(Motor(q, Course(np.array([1.0, -2.0]), np.array([[3.0, 0.4, -0.7]]))) for q in (first, last)),
    )


def state(scene: Scene, n: int = 3) -> State:
    some = scene.at(np.linspace(scene.t[0] + 0.13 * np.ptp(scene.t), scene.t[-1], n))
    return _state(scene.mechanism, scene.applied, some.motion, scene.rule == "spherical_axial")


def swinging(mechanism: Mechanism, applied: Applied, n: int = 3) -> State:
    home = mechanism.home[mechanism.independent_columns]
    t, w = np.linspace(0.2, 1.0, n)[:, None], 3.0 - 0.5 * np.arange(len(home))
    y, yd, ydd = (0.05 * x for x in (np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)))
    return _state(mechanism, applied, GivenMotion(t[:, 0], home + y, yd, ydd))


def _state(mechanism: Mechanism, applied: Applied, motion: GivenMotion, axial: bool = False) -> State:
    lay = layout(mechanism)
    q = ScrewModel(lay).solve(Problem(applied, motion, frozenset(["joint_position"]))).assembly
    return State(lay, home_equations(lay), applied, axial, q, motion.y, motion.yd, motion.ydd)


def trees(mechanism: Mechanism) -> list[tuple[str, ...]]:
    must = coupled_joints(mechanism) | {joint.name for joint in mechanism.joints if joint.kind == "F"}
    others, index = [joint for joint in mechanism.joints if joint.name not in must], mechanism.body_index
    first = [joint for joint in mechanism.joints if joint.name in must]
    return [
        tuple(joint.name for joint in (*first, *chosen))
        for chosen in combinations(others, len(index) - 1 - len(first))
        if _spans([(index[joint.parent], index[joint.child]) for joint in (*first, *chosen)], len(index))
    ]


def _spans(edges: Sequence[tuple[int, int]], n: int) -> bool:
    group = [*range(n)]
    for a, b in edges:
        if group[a] == group[b]:
            return False
        group = [group[a] if x == group[b] else x for x in group]
    return True


def quantities(
    at: State, of: type[Dynamics], ops: Ops, q: Array, yd: Array, ydd: Array, t: Any = T
) -> dict[str, Array]:
    found = equations(at, of, ops, q, yd, ydd, t)
    if isinstance(found, Forward):
        return {FORWARD: found.ydd, POWER: np.asarray(found.input_power)[..., None]}
    return {name: compute(found) for name, compute in QUANTITIES.items()}


def equations(at: State, of: type[Dynamics], ops: Ops, q: Array, yd: Array, ydd: Array, t: Any = T) -> Dynamics:
    """The equations at a pose; of all angles of a cut joint that mean the same, those next to the ones given."""
    found = of(at.loops, coordinates(q, ops), yd, ydd, at.loops.folds(at.q[0]), ops, at.applied)
    found.axial, found.t = at.axial, t
    found.near = {c: q[..., c] for c in at.lay.cut_columns if at.lay.turns[c]}
    return found


def conditions(at: State) -> list[float]:
    found = equations(at, Dynamics, NUMPY, at.q, at.yd, at.ydd)
    driven = [found.drive.condition] if at.lay.mechanism.actuators else []
    return [float(np.max(x)) for x in (found.system.whole_condition, *driven)]


def closer(at: State, ops: Ops, q: Array, y: Array, steps: int) -> Array:
    for _ in range(steps):
        q = q + Closed(at.loops, coordinates(q, ops), at.loops.folds(at.q[0]), ops).newton_step(y)
    return q


def in_floats(at: State, dtype: Any, of: type[Dynamics] = Dynamics, steps: int | None = None) -> dict[str, Array]:
    """Over arrays of floats, all samples at once; those longer than a double one by one.

    Args:
        steps: Of Newton's method, see `STEPS`.
    """
    steps = STEPS[dtype] if steps is None else steps
    if dtype is np.longdouble:
        return _one_by_one(at, LONG, of, dtype, steps)
    if dtype is not np.float64:  # of the numbers of the mechanism, too
        lay = layout(in_precision(at.lay.mechanism, dtype))
        names = [edge.joint.name for edge in at.lay.edges]
        at = replace(at, lay=lay, loops=Loops(lay, at.fixed), applied=_in_precision(at.applied, dtype)).over(names)
    q, y, yd, ydd = (x.astype(dtype) for x in (at.q, at.y, at.yd, at.ydd))
    return quantities(at, of, NUMPY, closer(at, NUMPY, q, y, steps), yd, ydd, dtype(T))


def _in_precision(applied: Applied, dtype: Any) -> Applied:
    each = {name: tuple(round_to(x, dtype) for x in getattr(applied, name)) for name in ("loads", "springs", "motors")}
    return replace(round_to(applied, dtype), **each)


def in_balls(at: State, of: type[Dynamics] = Dynamics) -> dict[str, Array]:
    """Over balls of `BITS`, sample by sample, from the doubles as they stand, poses closed further."""
    from flint import arb

    with precision(BITS):
        return _one_by_one(at, balls(), of, arb, STEPS[arb.__name__])


def around(at: State, ulps: float) -> dict[str, Array]:
    """Over balls of the precision of a double that hold all numbers next to the doubles, poses left as they are."""
    from flint import arb

    def ball(x: float) -> Any:
        return arb(float(x), ulps * float(np.spacing(max(abs(float(x)), 1.0))))

    with precision(53):
        return _one_by_one(at, balls(), Dynamics, ball, 0)


def _one_by_one(
    at: State, ops: Ops, of: type[Dynamics], number: Callable[[float], Any], steps: int
) -> dict[str, Array]:
    found = []
    for one in map(at.row, range(len(at.q))):
        q, y, yd, ydd = (_numbers(number, x[0]) for x in (one.q, one.y, one.yd, one.ydd))
        if steps:  # what is closed to that many digits is taken for closed
            q = _numbers(lambda x: getattr(x, "mid", lambda x=x: x)(), closer(one, ops, q, y, steps))
        found.append(quantities(one, of, ops, q, yd, ydd, number(T)))
    return {name: np.array([row[name] for row in found]) for name in found[0]}


def _numbers(number: Callable[[Any], Any], values: Array) -> Array:
    return np.array([number(x) for x in values], dtype=object)


def traced(at: State, of: type[Dynamics] = Dynamics) -> tuple[Program, dict[str, slice]]:
    trace = Trace()
    q, y, yd, ydd = (_numbers(trace.input, rows.T) for rows in (at.q, at.y, at.yd, at.ydd))
    t = trace.input(np.full(len(at.q), T))
    found, flat, places = quantities(at, of, TRACE, closer(at, TRACE, q, y, 1), yd, ydd, t), list[Any](), {}
    for name, numbers in found.items():
        places[name] = slice(len(flat), len(flat) + len(numbers))
        flat += [*numbers]
    return program(len(trace.inputs), flat), places


def inputs(at: State) -> Array:
    return np.concatenate([at.q, at.y, at.yd, at.ydd, np.full((len(at.q), 1), T)], axis=1).T.copy()


def run(made: Program, backend: str, given: Array) -> Array:
    out = np.empty((len(made.outputs), given.shape[1]))
    if backend == "llvm":
        from screwgauge.reference.traced.native import Native, machine_code

        Native(made, machine_code(made)).bind([given], [out])()
    else:
        Lanes(made, 16).bind([given], [out])()
    return out


def run_in(made: Program, dtype: Any, given: Array) -> Array:
    values = [*given.astype(dtype)]

    def operand(x: int | float) -> Any:
        return values[x] if isinstance(x, int) else dtype(x)

    for op, args in made.code:
        values.append(OPERATIONS[op](*map(operand, args)))
    return np.stack([np.broadcast_to(operand(x), given.shape[1:]) for x in made.outputs])


def parts(out: Array, places: Mapping[str, slice]) -> dict[str, Array]:
    """Quantity -> its numbers. Shape (n, m) each."""
    return {name: out[rows].T for name, rows in places.items()}


def middles(x: Array) -> Array:
    return np.frompyfunc(lambda ball: float(getattr(ball, "mid", lambda: ball)()), 1, 1)(x).astype(float)


def difference(a: Array, b: Array) -> Array:
    """a - b where b are doubles or balls, these exactly: digits beyond those of a double count."""
    if b.dtype != object:
        return a - b
    from flint import arb

    def of(x: Any, y: Any) -> float:
        value = sum((arb(float(part)) for part in _split(x)), start=arb(0))
        return float((value - y).mid())

    with precision(BITS):
        return np.frompyfunc(of, 2, 1)(a, b).astype(float)


def _split(x: Any) -> list[Any]:
    high = float(x)
    return [high, x - type(x)(high)] if isinstance(x, np.longdouble) else [high]


def contained(values: Array, enclosures: Array) -> Array:
    """Which doubles lie in balls; of a number that is exact by structure they may miss the product of two roundings."""
    least = np.finfo(float).eps ** 2

    def held(x: float, ball: Any) -> bool:
        return bool(ball.contains(float(x))) if hasattr(ball, "contains") else abs(x - ball) <= least

    return np.frompyfunc(held, 2, 1)(values, enclosures).astype(bool)


def errors_of(at: State, found: Mapping[str, Array], right: Mapping[str, Array]) -> dict[str, float]:
    """Largest error of each quantity in each unit, over its largest number there.

    Where that is no more than rounding, as moments in a plane are, over a millionth of the largest in any unit.
    """
    errors = {}
    for name, values in right.items():
        units, size, wrong = at.units(name), np.abs(middles(values)), np.abs(difference(found[name], values))
        for unit in dict.fromkeys(units):
            columns = [i for i, each in enumerate(units) if each == unit]
            scale = max(size[:, columns].max(initial=0.0), 1e-6 * size.max(initial=0.0))
            errors[f"{name} [{unit}]"] = wrong[:, columns].max(initial=0.0) / (scale or 1.0)
    return errors


def widest(found: Mapping[str, Array]) -> float:
    """Largest radius of balls."""
    return max(float(x.rad()) for values in found.values() for x in values.flat if hasattr(x, "rad"))
