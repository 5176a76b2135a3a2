"""Given motions by a traced program, with the guard of the array solver, which takes what the program cannot answer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from screwgauge import __version__
from screwgauge.engines.estimate import Part, vanishing
from screwgauge.engines.parts import assemble
from screwgauge.engines.screw.array_work import filled, under
from screwgauge.engines.screw.bounds import Bounds, Numbers, roots
from screwgauge.engines.screw.inverse import Work
from screwgauge.engines.screw.prediction import Predictor, closer, single
from screwgauge.engines.screw.programs import Bound, check_traceable, flat, runner_of
from screwgauge.models.layout import open_tree
from screwgauge.problem import GivenMotion, Problem, Progress
from screwgauge.quantities import GIVEN
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.equations.closure import Loops
from screwgauge.reference.layout import Layout
from screwgauge.reference.rotations import Array, nearest_angles, nearest_turn
from screwgauge.reference.traced.blocks import columns
from screwgauge.reference.traced.trace import NotTraceableError, Scalar
from screwgauge.reference.traced.tracing import CHARTED, CHECKS, Wanted, traced
from screwgauge.solution import Clock, Solution

#: Samples of the motion at which pivots are chosen, and the cheap bounds compared with what the array solver says.
ANCHORS = 16


class TracedWork:
    """A program for a problem, and the array solver beside it.

    Attributes:
        outputs: Quantities, and if errors are estimated ``error``, see `Bounds.estimated`.
        units: Quantity -> units of its components.
        said: What is to be said about it.
        by_array: Reason -> how many samples the array solver answered.
    """

    def __init__(
        self,
        lay: Layout,
        problem: Problem,
        motion: GivenMotion,
        backend: str,
        *,
        loaded: bool = False,
        estimates: bool = False,
    ) -> None:
        """Traces the program; pivots are chosen at samples of the motion.

        Args:
            loaded: Whether every sample has its own loads, in place of those of the problem.
            estimates: Whether the program says what its errors are, see `Bounds.estimated`.

        Raises:
            NotTraceableError: There is no such program.
            ScrewgaugeError: The motion cannot be followed.
        """
        check_traceable(lay, problem)
        self.lay, self.problem, self.clock, self.length = lay, problem, Clock(), home_equations(lay).length
        self.wanted = [name for name in GIVEN if name in problem.wanted]
        self.outputs = [*self.wanted, *(["error"] if estimates else [])]
        system, self.bounds = home_equations(lay), Bounds(lay, problem, self.length)
        with self.clock.stage("tracing"):
            some, q = self._anchors(motion)
            shares, tree = open_tree(lay)
            wanted = Wanted(self.wanted, problem.rule == "spherical_axial", shares, tree, loaded)
            samples = (some.y, some.yd, some.ydd, q)
            self.traced = traced(Loops(lay, system.fixed), problem.applied, wanted, samples, self._further)
        with self.clock.stage("compiling"):
            self.runner, self.said = runner_of(self.traced, backend)
        self.single = single(self.runner, self.traced)
        self.predictor = self._predictor()
        self.by_array: Counter[str] = Counter()
        self.bound: Bound | None = None

    def _further(self, outputs: Mapping[str, Sequence[Scalar]]) -> Mapping[str, list[Scalar]]:
        """Estimates errors if they are wanted."""
        if "error" not in self.outputs:
            return {}
        sums, errors = self.bounds.estimated(roots(outputs[name][0] for name in CHECKS), outputs, self.units)
        return {"first": sums, "error": errors}

    def _anchors(self, motion: GivenMotion) -> tuple[GivenMotion, Array]:
        """Well-conditioned samples, and all joint coordinates there.

        Raises:
            NotTraceableError: There is none.
        """
        some = motion.part(np.unique(np.linspace(0, len(motion) - 1, ANCHORS).astype(int)))
        work = Work(self.problem, some, self.lay)
        self.names, trust = work.names, work.part(slice(None)).trust
        self.units = {name: self.names()[name][1] for name in self.wanted}
        clear = np.setdiff1d(np.arange(len(some)), trust.doubtful())
        if not clear.size:
            raise NotTraceableError("the motion is badly conditioned", self.lay.mechanism.name, "use backend array")
        return some.part(clear), work.assembly[0][clear]

    def again(self) -> TracedWork:
        """The same for another thread: with buffers, predictions and counts of its own."""
        other = copy(self)
        other.clock, other.by_array, other.bound = Clock(), Counter(), None
        other.runner, other.single = self.runner.again(), self.single.again()
        other.predictor = other._predictor()
        return other

    def _predictor(self) -> Predictor | None:
        """What predicts poses with this program, if it needs that."""
        if not (self.traced.predicted or self.traced.near):
            return None
        if not self.traced.predicted:  # only the turns of cut joints are to be known
            return Predictor(self.lay, (), lambda y, rates, guess: None, cuts=True)
        close = closer(self.single, self.traced, self.bounds, len(self.lay.mechanism.independent_columns))
        cuts = bool(CHARTED & {*self.wanted} or self.traced.near)
        return Predictor(self.lay, self.traced.predicted, close, cuts=cuts)

    def arrays(self, n: int) -> dict[str, Array]:
        """Arrays for `outputs` of n samples, (n, m) each; numbers of one component lie side by side."""
        places = [self.traced.places[name] for name in self.outputs]
        return {name: columns(n, place.stop - place.start) for name, place in zip(self.outputs, places, strict=True)}

    def _run(self, motion: GivenMotion, q: Array, loads: Array, values: Mapping[str, Array]) -> tuple[Numbers, bool]:
        """Runs the program.

        Args:
            q: Predicted joint coordinates. Shape (n_q, n).
            loads: Of every sample, if each has its own. Shape (m, n).
            values: Filled; see `arrays`.

        Returns:
            What the program says, and whether no sample is in doubt.
        """
        predicted, n = list(self.traced.predicted), len(motion)
        inputs = [np.ascontiguousarray(x.T) for x in (motion.y, motion.yd, motion.ydd)]
        inputs += [np.ascontiguousarray(q[predicted]), np.ascontiguousarray(q[[*self.traced.near]])]
        inputs += [motion.t[None] if self.traced.timed else np.empty((0, n)), loads]
        reached, checks = np.empty((2 * len(predicted), n)), np.empty((len(CHECKS), n))
        outputs = [reached, *(values[name].T for name in self.outputs), checks]
        clear = self.runner.bind(inputs, outputs, self.bounds.weights)()
        with np.errstate(all="ignore"):
            found = roots(checks)
            near = self.bounds.near(found)
            rows = np.flatnonzero(near & ~(found["closing"] <= self.bounds.arrived))
        if predicted and rows.size:  # once more from where Newton's method came to
            inputs[3] = reached[: len(predicted)]
            some, arrays = [np.ascontiguousarray(x[:, rows]) for x in inputs], self.arrays(len(rows))
            again = np.empty((len(CHECKS), len(rows)))
            self.runner.bind(some, [reached[:, rows], *(array.T for array in arrays.values()), again])()
            checks[:, rows] = again
            for name, array in arrays.items():
                values[name][rows] = array
            with np.errstate(all="ignore"):
                found, clear = roots(checks), False
        return found, clear

    def bind(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> Bound | None:
        """Binds the program to arrays, see `arrays`, and to inputs like these.

        Returns:
            Nothing, if the program needs predictions, or numbers of a component lie apart: then `part` is to be asked.
        """
        if self.predictor is not None or not flat(values):
            return None
        if self.bound is None or not self.bound.fits(inputs, values):
            n = len(inputs[0])
            given, checks = columns(n, self.traced.program.inputs), columns(n, len(CHECKS))
            ends = np.cumsum([array.shape[1] for array in inputs])[:-1]
            run = self.runner.bind(
                [given.T], [*(values[name].T for name in self.outputs), checks.T], self.bounds.weights
            )
            self.bound = Bound(tuple(values.values()), tuple(np.split(given, ends, axis=1)), run)
        return self.bound

    def part(
        self,
        motion: GivenMotion,
        loads: Array | None = None,
        into: Mapping[str, Array] | None = None,
        *,
        thorough: bool = False,
    ) -> Part:
        """Some samples that follow those before.

        Args:
            thorough: Whether samples with what is zero are left to the array solver, see `vanishing`.
            loads: Of every sample, force and torque of each load, if the samples have their own. Shape (m, n).
            into: Where the values are written, see `arrays`.
        """
        n = len(motion)
        arrays = self.arrays(n) if into is None or not flat(into) else into
        values = {name: arrays[name] for name in self.wanted}
        with self.clock.stage("prediction"):
            near = np.empty((0, n)) if self.predictor is None else self.predictor.predict(motion).T
        with self.clock.stage("program"):
            given = np.empty((0, n)) if loads is None else loads
            out, clear = self._run(motion, near, given, arrays)
            if not clear and self.predictor and self.predictor.by_program and not self.bounds.near(out).all():
                near = self.predictor.by_array(motion).T
                out, clear = self._run(motion, near, given, arrays)
        with self.clock.stage("error estimate"), np.errstate(all="ignore"):
            if self.predictor is not None:
                self._nearest(values, near.T)
            trust = self.bounds.trust(out)
            left = np.zeros(0, dtype=np.intp) if clear else self.bounds.left(out, trust, self.by_array)
            if thorough:
                zeros = np.setdiff1d(vanishing(values, trust, self.units, self.length), left)
                self.by_array["zero beside their summands"] += len(zeros)
                left = np.union1d(left, zeros)
        found = self._completed(motion, loads, arrays, Part(values, trust, left, {}))
        for name, array in arrays.items() if into is not None and arrays is not into else ():
            into[name][:] = array  # type: ignore[index]
        return found

    def _completed(self, motion: GivenMotion, loads: Array | None, arrays: Mapping[str, Array], part: Part) -> Part:
        """The same with some samples, those named doubtful, answered by the array solver."""
        rows = part.doubtful
        if not rows.size:
            return replace(part, moved={name: np.zeros((0, x.shape[1])) for name, x in part.values.items()})
        work = Work(under(self.problem, None if loads is None else loads[:, rows]), motion.part(rows), self.lay)
        other = work.part(slice(None))
        some = {name: array[rows] for name, array in arrays.items()}
        filled(some, other, self.units, self.length)
        for name, array in some.items():
            arrays[name][rows] = array
        return Part(part.values, part.trust.with_rows(rows, other.trust), rows[other.doubtful], other.moved)

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
        found, tree = {}, open_tree(self.lay)[1]
        for joint in self.lay.tree.cuts:
            column = self.lay.columns[joint.name][1:2]
            if joint.kind == "S":
                place = [tree.index(column[0])] if column[0] in tree else []
                rates = dict.fromkeys(("joint_velocity", "joint_acceleration"), column)
                found[column[0]] = rates | dict.fromkeys(("tree_force", "tree_force_soft"), place)
        return found

    def notes(self, n: int) -> tuple[str, ...]:
        """What the program answered, and what else is to be said."""
        left, told = self.by_array.total(), [f"{count} {why}" for why, count in self.by_array.items() if count]
        rest = f", {left} by the array solver ({', '.join(told)})" if told else ""
        note = f"{n - left} of {n} samples by a program of {len(self.traced.program.code)} operations{rest}"
        return (note, *filter(None, [self.said]))


def solve_traced(lay: Layout, problem: Problem, motion: GivenMotion, progress: Progress, backend: str) -> Solution:
    """Positions, velocities, accelerations and forces of a given motion by a traced program.

    Raises:
        NotTraceableError: There is no such program.
    """
    known = replace(problem, wanted=problem.wanted | {"joint_position"})  # which assembly was solved
    work, assembly = TracedWork(lay, known, motion, backend), list[Array]()

    def part(rows: slice) -> Part:
        found = work.part(motion.part(rows), thorough=True)
        assembly.append(found.values["joint_position"])
        return replace(found, values={name: x for name, x in found.values.items() if name in problem.wanted})

    labels = ("screw", __version__, f"rule {problem.rule}, backend {backend}")
    size = {"length": work.length, "mass": lay.mechanism.mass}
    found = assemble(labels, len(motion), part, work.names, work.clock, progress, **size)
    return replace(found, assembly=np.concatenate(assembly), notes=work.notes(len(motion)))
