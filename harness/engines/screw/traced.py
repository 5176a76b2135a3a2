"""Given motions by a traced program, with the guard of the array solver, which takes what the program cannot answer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from screwgauge import __version__
from screwgauge.engines.estimate import CLEAR, CLEAR_FORCES, Part, Trust
from screwgauge.engines.parts import assemble
from screwgauge.engines.screw.inverse import Work
from screwgauge.engines.screw.prediction import Predictor
from screwgauge.models.layout import lay_out
from screwgauge.problem import GivenMotion, Problem, Progress, Rows
from screwgauge.quantities import GIVEN
from screwgauge.reference import linear
from screwgauge.reference.graph import Edge
from screwgauge.reference.pose import Layout
from screwgauge.reference.resting import home_equations
from screwgauge.reference.rotations import Array, nearest_angles, nearest_turn
from screwgauge.reference.traced.equations import Question
from screwgauge.reference.traced.lanes import Lanes
from screwgauge.reference.traced.program import Program
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.tracing import CHECKS, Traced, traced
from screwgauge.reference.traced.vectors import vector
from screwgauge.solution import Clock, Solution
from screwgauge.truth import cache

#: Samples of the motion at which pivots are chosen, and the cheap bounds compared with what the array solver says.
ANCHORS = 16
#: Worst case over these samples.
SAFETY = 1.5
#: Closure residual beyond which Newton's method has not arrived, for one row; what all bodies' balance may leave.
ARRIVED, BALANCED = 32 * linear.EPS, 1e-9
#: How far Newton's method may go, times the gain: as long as that is small, no other assembly lies between.
NEAR = 0.2


class Runner(Protocol):
    """What runs a program."""

    def bind(self, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], None]:
        """What runs the samples of some arrays. Shapes (m, n) each, in the order of the program."""

    def again(self) -> Runner:
        """One that may run at the same time."""


def runner(program: Program, backend: str) -> tuple[Runner, str]:
    """A program ready to run, and what is to be said about that."""
    if backend == "numpy":
        return Lanes(program), ""
    try:
        from screwgauge.reference.traced import native

        version = cache.code_version(Path(native.__file__).parent, extra=f"{__version__} {native.cpu()}")
    except ImportError:
        return Lanes(program), "llvmlite is not installed (extra 'fast'): the program runs with NumPy"
    key = cache.digest("program", program.inputs, program.code, program.outputs, version)
    stored, said = cache.read(key, version)
    if stored is not None:
        return native.Native(program, stored["code"].tobytes()), said
    code = native.machine_code(program)
    failed = cache.write(key, version, {"code": np.frombuffer(code, dtype=np.uint8)})
    return native.Native(program, code), "; ".join(filter(None, (said, failed)))


def check_traceable(lay: Layout, problem: Problem) -> None:
    """Refuses what is beyond the traced equations.

    Raises:
        NotTraceableError: With the reason.
    """
    mechanism, wanted = lay.mechanism, problem.wanted
    forces = {"actuator_force", "reaction", "generalized_force"} & wanted
    reasons = {
        "coordinates are coupled": bool(getattr(mechanism, "couplings", ())),
        "an independent coordinate belongs to a joint that closes a loop": bool(
            {*mechanism.independent_columns} & {*lay.cut_columns}
        ),
        "springs, dampers or motors act": bool(forces and (problem.applied.springs or problem.applied.motors)),
        "the rule is spherical_axial": bool(forces and problem.rule == "spherical_axial"),
        "there are fewer actuators than freedoms": bool(
            {"actuator_force", "reaction"} & wanted and len(mechanism.actuators) < len(mechanism.independent)
        ),
    }
    for reason, applies in reasons.items():
        if applies:
            raise NotTraceableError(reason, mechanism.name, "the array solver answers it")


@dataclass(frozen=True, slots=True)
class Anchor:
    """Ratios that turn the cheap bounds of a program into what the array solver says, at worst over some samples."""

    gain: float
    condition: float
    reaction: float
    drive: float
    load: float


_NONE: Rows = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """What a program says of its samples, see `CHECKS`: roots of the squares that it emits. Shape (n_check, n)."""

    checks: Array

    def __getitem__(self, name: str) -> Array:
        return np.asarray(np.sqrt(self.checks[CHECKS.index(name)]))


def columns(n: int, m: int) -> Array:
    """An array of shape (n, m) in which the numbers of one column lie side by side.

    Columns are not a whole number of pages apart: these would share the same few lines of the cache.
    """
    return np.empty((m, n + 8))[:, :n].T


def under(problem: Problem, loads: Array | None) -> Problem:
    """A problem under loads that change from sample to sample, force and torque of each. Shape (m, n)."""
    if loads is None:
        return problem
    each = np.split(loads.T, len(loads) // 3, axis=1)
    some = tuple(
        replace(load, force=force, torque=torque)
        for load, force, torque in zip(problem.applied.loads, each[::2], each[1::2], strict=True)
    )
    return replace(problem, applied=replace(problem.applied, loads=some))


class ArrayWork:
    """The array solver in the place of a program."""

    def __init__(self, lay: Layout, problem: Problem, motion: GivenMotion, reason: str) -> None:
        self.lay, self.problem, self.reason, self.said = (
            lay,
            problem,
            reason,
            f"all samples by the array solver: {reason}",
        )
        self.length, self.by_array = home_equations(lay).length, Counter[str]()
        self.part(motion.part(slice(0, 1)))

    def part(self, motion: GivenMotion, loads: Array | None = None, into: Mapping[str, Array] | None = None) -> Part:
        """As `TracedWork.part`."""
        work = Work(under(self.problem, loads), motion, self.lay)
        found = work.part(slice(None))
        self.names = work.names
        self.by_array[self.reason] += len(motion)
        for name, array in (into or {}).items():
            array[:] = found.values[name]
        return found

    def fill(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> bool:
        """As `TracedWork.fill`."""
        return False

    def again(self) -> ArrayWork:
        """The same for another thread."""
        return copy(self)


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A program bound to arrays that are used again.

    Attributes:
        key, values: Which arrays these are; they are kept, so that no others can take their place.
    """

    key: tuple[int, ...]
    values: Mapping[str, Array]
    inputs: Array
    checks: Array
    run: Callable[[], None]


class TracedWork:
    """A program for a problem, and the array solver beside it.

    Attributes:
        said: What is to be said about it.
        by_array: Reason -> how many samples the array solver answered.
    """

    def __init__(
        self, lay: Layout, problem: Problem, motion: GivenMotion, backend: str, *, loaded: bool = False
    ) -> None:
        """Traces the program; pivots are chosen at samples of the motion.

        Args:
            loaded: Whether every sample has its own loads, in place of those of the problem.

        Raises:
            NotTraceableError: There is no such program.
            ScrewgaugeError: The motion cannot be followed.
        """
        check_traceable(lay, problem)
        self.lay, self.problem, self.clock, self.length = lay, problem, Clock(), home_equations(lay).length
        self.wanted = [name for name in GIVEN if name in problem.wanted]
        system = home_equations(lay)
        with self.clock.stage("tracing"):
            some, trust, q = self._anchors(motion)
            g = vector(problem.applied.g)
            size = [*map(float, system.size)]
            self.question = Question(lay, system.fixed, size, system.length, g, problem.applied.loads, _open(lay))
            self.traced = traced(self.question, self.wanted, (some.y, some.yd, some.ydd, q), loaded=loaded)
        with self.clock.stage("compiling"):
            self.runner, self.said = runner(self.traced.program, backend)
        self.predictor = Predictor(lay) if self.traced.predicted else None
        self.by_array: Counter[str] = Counter()
        self.bound: Bound | None = None
        self.ratio = Anchor(1.0, 1.0, 1.0, 1.0, 1.0)
        constant = [x for load in problem.applied.loads for x in (*load.force, *load.torque)] if loaded else []
        loads = np.repeat(np.array(constant)[:, None], len(some), axis=1)
        self.ratio = self._compared(self._run(some, q.T, loads, self.arrays(len(some))), trust)

    def _anchors(self, motion: GivenMotion) -> tuple[GivenMotion, Trust, Array]:
        """Well-conditioned samples, what the array solver's numbers there rest on, and all joint coordinates.

        Raises:
            NotTraceableError: There is none.
        """
        some = motion.part(np.unique(np.linspace(0, len(motion) - 1, ANCHORS).astype(int)))
        work = Work(self.problem, some, self.lay)
        self.names, trust = work.names, work.part(slice(None)).trust
        clear = np.setdiff1d(np.arange(len(some)), trust.doubtful())
        if not clear.size:
            raise NotTraceableError("the motion is badly conditioned", self.lay.mechanism.name, "use backend array")
        return some.part(clear), trust.rows(clear), work.assembly[0][clear]

    def again(self) -> TracedWork:
        """The same for another thread: with buffers, predictions and counts of its own."""
        other = copy(self)
        other.clock, other.by_array, other.bound = Clock(), Counter(), None
        other.predictor = None if self.predictor is None else Predictor(self.lay)
        other.runner = self.runner.again()
        return other

    def _compared(self, out: Numbers, trust: Trust) -> Anchor:
        cheap = self._trust(out)

        def ratio(mine: Array | float, theirs: Array | float) -> float:
            with np.errstate(all="ignore"):
                found = np.asarray(theirs, dtype=float) / np.asarray(mine, dtype=float)
            return SAFETY * float(np.max(found[np.isfinite(found)], initial=0.0)) or 1.0

        own = {name: cheap.forces.get(name, np.ones(1)) for name in ("reaction", "actuator_force")}
        return Anchor(
            ratio(cheap.gain, trust.gain),
            ratio(trust.gain, trust.condition) / SAFETY,
            ratio(own["reaction"], trust.forces.get("reaction", 0.0)),
            ratio(own["actuator_force"], trust.forces.get("actuator_force", 0.0)),
            ratio(cheap.load, trust.load),
        )

    def _trust(self, out: Numbers) -> Trust:
        """What the numbers of a program rest on."""
        ratio = self.ratio
        gain = ratio.gain * np.maximum(out["gain"], 1e-300)
        speed = out["speed"]
        rush = np.maximum(speed**2, out["rush"])
        load = self.weight + self.lay.mechanism.mass * rush * self.length
        charts = np.sqrt(np.maximum(out["charts"] ** 2 - self.spare_charts, 1.0))
        forces = dict[str, Array]()
        if "reaction" in self.wanted:
            forces["reaction"] = ratio.reaction * out["whole_gain"] ** 2
        if forces or "actuator_force" in self.wanted:
            forces["actuator_force"] = ratio.drive * out["drive"]
        return Trust(ratio.condition * gain, gain, charts, forces, speed, rush, ratio.load * load)

    @cached_property
    def weight(self) -> float:
        """Weights and loads together [N]."""
        applied, length = self.problem.applied, self.length
        loads = (float(np.linalg.norm(x.force) + np.linalg.norm(x.torque) / length) for x in applied.loads)
        return self.lay.mechanism.mass * float(np.linalg.norm(applied.g)) + sum(loads)

    @cached_property
    def spare_charts(self) -> int:
        """Each of several spherical joints adds one at least."""
        return max(sum(joint.kind == "S" for joint in self.lay.tree.cuts) - 1, 0)

    def _clear(self, checks: Array) -> bool:
        """Whether no sample can be doubtful: one sum of all checks over their limits tells. Shape (n_check, n)."""
        worst = (self._weights @ checks).max(initial=0.0)  # NaN where any is
        return bool(worst <= 1.0 - self.spare_charts / (SAFETY * CLEAR) ** 2)

    @cached_property
    def _weights(self) -> Array:
        ratio, most = self.ratio, SAFETY * CLEAR
        limits = {
            "gain": (most / ratio.gain) ** 2,
            "whole_gain": SAFETY * CLEAR_FORCES / ratio.reaction if "reaction" in self.wanted else np.inf,
            "drive": (SAFETY * CLEAR_FORCES / ratio.drive) ** 2,
            "moved": (NEAR / most) ** 2,
            "closing": self.arrived**2,
            "balance": (BALANCED * ratio.load * self.weight) ** 2,
            "charts": most**2,
        }
        return np.array([1.0 / limits.get(name, np.inf) for name in CHECKS])

    def arrays(self, n: int) -> dict[str, Array]:
        """Arrays for the values of n samples, (n, m) each; numbers of one component lie side by side."""
        places = self.traced.places
        return {name: columns(n, places[name].stop - places[name].start) for name in self.wanted}

    def _run(self, motion: GivenMotion, q: Array, loads: Array, values: Mapping[str, Array]) -> Numbers:
        """Runs the program.

        Args:
            q: Predicted joint coordinates. Shape (n_q, n).
            loads: Of every sample, if each has its own. Shape (m, n).
            values: Filled; see `arrays`.
        """
        predicted, n = list(self.traced.predicted), len(motion)
        inputs = [np.ascontiguousarray(x.T) for x in (motion.y, motion.yd, motion.ydd)]
        inputs += [np.ascontiguousarray(q[predicted]), loads]
        reached, checks = np.empty((len(predicted), n)), np.empty((len(CHECKS), n))
        self.runner.bind(inputs, [reached, *(values[name].T for name in self.wanted), checks])()
        found = Numbers(checks)
        if predicted and not self._clear(checks):  # once more from where Newton's method came to
            with np.errstate(all="ignore"):
                near = found["moved"] * self.ratio.gain * found["gain"] <= NEAR
                rows = np.flatnonzero(near & ~(found["closing"] <= self.arrived))
            if rows.size:
                inputs[3] = reached
                some, arrays = [np.ascontiguousarray(x[:, rows]) for x in inputs], self.arrays(len(rows))
                again = np.empty((len(CHECKS), len(rows)))
                self.runner.bind(some, [some[3].copy(), *(array.T for array in arrays.values()), again])()
                checks[:, rows] = again
                for name, array in arrays.items():
                    values[name][rows] = array
        return found

    @property
    def arrived(self) -> float:
        """Largest closure residual that rounding makes of all rows."""
        return float(ARRIVED * max(self.lay.loop.shape[0] * 6, 1) ** 0.5)

    def fill(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> bool:
        """Fills arrays with the values of some samples, if none of these is doubtful or has to be predicted.

        Args:
            inputs: y, yd, ydd and, if the samples have their own, loads. Shape (n, m) each.

        Returns:
            Whether it did; if not, `part` is to be asked.
        """
        if self.predictor is not None:
            return False
        n, key = len(inputs[0]), tuple(map(id, values.values()))
        if self.bound is None or self.bound.key != key:
            given, checks = columns(n, self.traced.program.inputs).T, columns(n, len(CHECKS)).T
            outputs = [given[:0], *(values[name].T for name in self.wanted), checks]
            self.bound = Bound(key, values, given, checks, self.runner.bind([given], outputs))
        row = 0
        for array in inputs:
            self.bound.inputs[row : row + array.shape[1]] = array.T
            row += array.shape[1]
        self.bound.run()
        return self._clear(self.bound.checks)

    def part(self, motion: GivenMotion, loads: Array | None = None, into: Mapping[str, Array] | None = None) -> Part:
        """Some samples that follow those before.

        Args:
            loads: Of every sample, force and torque of each load, if the samples have their own. Shape (m, n).
            into: Where the values are written, see `arrays`.
        """
        n, values = len(motion), dict(self.arrays(len(motion)) if into is None else into)
        with self.clock.stage("prediction"):
            near = np.empty((0, n)) if self.predictor is None else self.predictor.predict(motion).T
        with self.clock.stage("program"):
            out = self._run(motion, near, np.empty((0, n)) if loads is None else loads, values)
        with self.clock.stage("error estimate"), np.errstate(all="ignore"):
            if self.predictor is not None:
                self._nearest(values, near.T)
            trust = self._trust(out)
            left = _NONE if self._clear(out.checks) else self._left(out, trust)
        return self._completed(motion, loads, values, trust, left)

    def _left(self, out: Numbers, trust: Trust) -> Rows:
        """Samples for the array solver."""
        doubts = {
            "badly conditioned": ~(np.maximum(trust.gain, trust.charts) <= SAFETY * CLEAR),
            "not closed": ~(out["closing"] <= self.arrived) | ~(out["moved"] * trust.gain <= NEAR),
            "not balanced": ~(out["balance"] <= BALANCED * np.maximum(trust.load, 1e-300)),
        }
        for condition in trust.forces.values():
            doubts["badly conditioned"] |= ~(condition <= SAFETY * CLEAR_FORCES)
        left = np.zeros(len(trust.condition), dtype=bool)
        for reason, doubt in doubts.items():
            self.by_array[reason] += int(np.count_nonzero(doubt & ~left))
            left |= doubt
        rows: Rows = np.flatnonzero(left)
        return rows

    def _completed(
        self, motion: GivenMotion, loads: Array | None, values: dict[str, Array], trust: Trust, rows: Rows
    ) -> Part:
        """The same with some samples answered by the array solver."""
        if not rows.size:
            return Part(values, trust, rows, {name: np.zeros((0, x.shape[1])) for name, x in values.items()})
        work = Work(under(self.problem, None if loads is None else loads[:, rows]), motion.part(rows), self.lay)
        part = work.part(slice(None))
        for name, array in part.values.items():
            values[name][rows] = array
        return Part(values, trust.with_rows(rows, part.trust), rows[part.doubtful], part.moved)

    def _nearest(self, values: dict[str, Array], near: Array) -> None:
        """Angles of cut joints as near as can be to those predicted, among all that mean the same."""
        for joint in self.lay.tree.cuts:
            columns = self.lay.columns[joint.name]
            turning = [c for c in columns if self.lay.turns[c]]
            swapped = np.cos(near[:, columns[1]]) < 0.0 if joint.kind == "S" else np.zeros(1, dtype=bool)
            if "joint_position" in values:
                q = values["joint_position"]
                found, other = nearest_angles(q[:, turning], near[:, turning])
                q[:, turning] = found if joint.kind == "S" else nearest_turn(q[:, turning], near[:, turning])
                swapped = other if joint.kind == "S" else swapped
            if swapped.any():
                for name, places in self._middle[columns[1]].items():
                    if name in values:
                        values[name][np.ix_(np.flatnonzero(swapped), np.array(places, dtype=int))] *= -1.0

    @cached_property
    def _middle(self) -> Mapping[int, Mapping[str, list[int]]]:
        """Column of the middle angle of a cut S joint -> where its rates and forces stand."""
        tree = sorted(
            c for link in lay_out(self.lay.mechanism, "minimal").links for c in self.lay.columns[link.joint.name]
        )
        found = {}
        for joint in self.lay.tree.cuts:
            column = self.lay.columns[joint.name][1:2]
            if joint.kind == "S":
                place = [tree.index(column[0])] if column[0] in tree else []
                rates = dict.fromkeys(("joint_velocity", "joint_acceleration"), column)
                found[column[0]] = rates | dict.fromkeys(("tree_force", "tree_force_soft"), place)
        return found

    def notes(self, n: int) -> tuple[str, ...]:
        """What the program answered, and what else is to be said."""
        told = [f"{count} {reason}" for reason, count in self.by_array.items() if count]
        rest = f", {sum(self.by_array.values())} by the array solver ({', '.join(told)})" if told else ""
        program = self.traced.program
        answered = n - sum(self.by_array.values())
        note = f"{answered} of {n} samples by a program of {len(program.code)} operations{rest}"
        return (note, *filter(None, [self.said]))


def solve_traced(lay: Layout, problem: Problem, motion: GivenMotion, progress: Progress, backend: str) -> Solution:
    """Positions, velocities, accelerations and forces of a given motion by a traced program.

    Raises:
        NotTraceableError: There is no such program.
    """
    known = replace(problem, wanted=problem.wanted | {"joint_position"})  # which assembly was solved
    work, assembly = TracedWork(lay, known, motion, backend), list[Array]()

    def part(rows: slice) -> Part:
        found = work.part(motion.part(rows))
        assembly.append(found.values["joint_position"])
        return replace(found, values={name: x for name, x in found.values.items() if name in problem.wanted})

    labels = ("screw", __version__, f"rule {problem.rule}, backend {backend}")
    found = assemble(labels, len(motion), part, work.names, work.clock, progress, length=work.length)
    return replace(found, assembly=np.concatenate(assembly), notes=work.notes(len(motion)))


def _open(lay: Layout) -> tuple[tuple[str, float, Edge], ...]:
    """Links of the open tree: body, its share, and the edge that leads from one link to another."""
    links = lay_out(lay.mechanism, "minimal").links
    parts = Counter(link.original for link in links)
    return tuple(
        (link.original, 1.0 / parts[link.original], Edge(link.joint, link.near, link.name, link.reverse))
        for link in links
    )


__all__ = ["NotTraceableError", "Traced", "TracedWork", "solve_traced"]
