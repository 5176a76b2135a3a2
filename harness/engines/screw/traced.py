"""Inverse dynamics with a traced program; samples at which its results are doubtful go to the array solver."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from screwgauge import __version__
from screwgauge.engines.chunks import assemble
from screwgauge.engines.error_estimate import SolvedPart, Trust, vanishing_samples
from screwgauge.engines.screw.inverse import Work
from screwgauge.engines.screw.programs import (
    Bound,
    Bounds,
    Numbers,
    check_traceable,
    estimate_errors,
    has_contiguous_columns,
    roots,
    runner_of,
)
from screwgauge.models.layout import open_tree
from screwgauge.problem import GivenMotion, Problem, Progress, Rows
from screwgauge.quantities import FLOAT64, OF_MOTION, NumberType
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.continuation import Poses
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array, nearest_angles
from screwgauge.reference.traced.program import columns
from screwgauge.reference.traced.trace import NotTraceableError, Scalar
from screwgauge.reference.traced.tracing import CHARTED, CHECKS, Traced, TracedQuantities, trace_dynamics
from screwgauge.solution import Solution

#: Samples of the motion at which pivots are chosen.
ANCHORS = 16
LOST = "the pose cannot be reached from the home pose without passing near a singular pose"
TWICE = "two poses with these coordinates can be reached from the home pose, so the coordinates are ambiguous"


class TracedWork:
    """A program for a problem, with the array solver as fallback.

    Attributes:
        outputs: Quantities, followed by ``error`` if errors are estimated, see `Bounds.estimate`.
        units: Quantity -> units of its components.
        note: Remark on the program, or an empty string.
        by_array: Reason -> number of samples that the array solver had to solve.
        traced: The program, if there is one.
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
        kind: NumberType = FLOAT64,
    ) -> None:
        """Trace the program, with pivots chosen at samples of the motion.

        Args:
            loaded: Whether every sample has its own loads, which replace the problem's loads. This is always the case
                if the problem's loads change over time.
            estimates: Whether errors are estimated, see `Bounds.estimate`.
            kind: Number type of the program. Only with float64 does the array solver solve doubtful samples again.

        Raises:
            ScrewgaugeError: The motion cannot be followed, or no program in float32 covers the problem.
        """
        self.lay, self.problem, self.work = lay, problem, Work(lay, problem)
        self.clock, self.length, self.names = self.work.clock, self.work.loops.length, self.work.names
        self.wanted = [name for name in OF_MOTION if name in problem.wanted]
        self.outputs = [*self.wanted, *(["error"] if estimates else [])]
        self.by_array = Counter[str]()
        self.bound: Bound | None = None
        self.traced: Traced | None = None
        self.kind = kind
        self.varying = problem.applied if any(load.courses for load in problem.applied.loads) else None
        try:
            check_traceable(lay, problem)
            self._trace(motion, backend, loaded=loaded or self.varying is not None)
        except NotTraceableError as error:
            if kind is not FLOAT64:
                raise
            self.reason = error.what
            self.note = f"all samples were solved by the array solver: {error.what}"

    def _trace(self, motion: GivenMotion, backend: str, *, loaded: bool) -> None:
        self.bounds = Bounds(self.lay, self.problem, self.length, self.kind.eps)
        with self.clock.stage("tracing"):
            some, q = anchors(self.work, motion)
            shares, tree = open_tree(self.lay)
            axial, points = self.problem.rule == "spherical_axial", self.problem.points
            left = self.work.idle, self.work.resting
            wanted = TracedQuantities(self.wanted, axial, shares, tree, loaded, points, *left)
            samples = (some.y, some.yd, some.ydd, q)
            applied = self.problem.applied if self.varying is None else self.varying.at(some.t[:1])
            self.traced = trace_dynamics(self.work.loops, applied, wanted, samples, self._error_outputs)
        with self.clock.stage("compiling"):
            self.runner, self.note = runner_of(self.traced, backend, np.dtype(self.kind.name))
        #: Signs of the cosines of middle angles of cut joints, in the program.
        self.folds = [float(fold.flat[0]) for fold in self.work.loops.folds(q)]
        #: Whether angles of cut joints must be distinguished from equivalent angles.
        self.charted = bool((self.traced.predicted and CHARTED & {*self.wanted}) or self.traced.near)

    def _error_outputs(self, outputs: Mapping[str, Sequence[Scalar]]) -> Mapping[str, list[Scalar]]:
        """Return the outputs of error estimates, if requested."""
        if "error" not in self.outputs:
            return {}
        sums, errors = self.bounds.estimate(roots(outputs[name][0] for name in CHECKS), outputs, self.units)
        return {"first": sums, "error": errors}

    @cached_property
    def units(self) -> dict[str, Sequence[str]]:
        names = self.names()
        return {name: names[name][1] for name in self.wanted}

    def copy(self) -> TracedWork:
        """Return a copy for a different thread, with separate buffers, poses and counts."""
        other = copy(self)
        other.work = Work(self.lay, self.problem)
        other.clock, other.by_array, other.bound = other.work.clock, Counter(), None
        if self.traced is not None:
            other.runner = self.runner.copy()
        return other

    def arrays(self, n: int) -> dict[str, Array]:
        """Allocate an array (n, m) for each of `outputs` at n samples, with contiguous components."""
        names, errors = self.names(), sum(len({*each}) for each in self.units.values())
        return {name: columns(n, errors if name == "error" else len(names[name][0])) for name in self.outputs}

    def _run(
        self, traced: Traced, motion: GivenMotion, guess: Poses | None, loads: Array, values: Mapping[str, Array]
    ) -> tuple[Numbers, bool]:
        """Run the program.

        Args:
            guess: Predictions, unless poses have a closed form.
            loads: Loads at every sample, if these differ between samples. Shape (m, n).
            values: Arrays to fill, see `arrays`.

        Returns:
            The program's checks, and whether no sample is in doubt.
        """
        n, d, mode = len(motion), len(traced.predicted), self.work.mode
        inputs = [np.ascontiguousarray(x.T) for x in (motion.y, motion.yd, motion.ydd)]
        if guess is not None:
            sprung = mode.joints(guess).T[[*traced.near]] if traced.near else np.empty((0, n))
            inputs += [mode.rows(guess, traced.predicted), np.ascontiguousarray(sprung)]
        inputs += [motion.t[None] if traced.timed else np.empty((0, n)), loads]
        reached, checks, clear = self._pass(inputs, np.empty((2 * d, n)), values)
        for first in (True, False) if d and not clear else ():
            assert guess is not None
            with np.errstate(all="ignore"):
                out = roots(checks)
                near = self.bounds.near(out)
                rows = np.flatnonzero(~(near & (out["closing"] <= self.bounds.arrived / 8.0)))
            stray = np.flatnonzero(~near)
            inputs[3][:, rows] = reached[:d, rows]  # continue from the last Newton iterate
            if stray.size and first:  # or start from a closer prediction
                inputs[3][:, stray] = mode.rows(mode.refine(guess.rows(stray)), traced.predicted)
            elif stray.size:
                rows = np.setdiff1d(rows, stray)
            if not rows.size:
                break
            some, arrays = [np.ascontiguousarray(x[:, rows]) for x in inputs], self.arrays(len(rows))
            reached[:, rows], checks[:, rows], _ = self._pass(some, np.empty((2 * d, len(rows))), arrays)
            for name, array in arrays.items():
                values[name][rows] = array
        with np.errstate(all="ignore"):
            return roots(checks), clear

    def _pass(self, inputs: Sequence[Array], reached: Array, values: Mapping[str, Array]) -> tuple[Array, Array, bool]:
        """Run the program once; return the last Newton iterate, checks, and True if no sample is in doubt."""
        checks = np.empty((len(CHECKS), inputs[0].shape[1]))
        outputs = [reached, *(values[name].T for name in self.outputs), checks]
        return reached, checks, self.runner.bind(inputs, outputs, self.bounds.weights)()

    def bind(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> Bound | None:
        """Bind the program to output arrays, see `arrays`, and to reusable inputs of the given shapes.

        Returns:
            The bound program. None if the program needs predictions, or if the numbers of a component are not
            contiguous; use `part` in these cases.
        """
        if self.guessed or self.traced is None or self.traced.timed or not has_contiguous_columns(values):
            return None
        if self.bound is None or not self.bound.fits(inputs, values):
            n = len(inputs[0])
            given, checks = columns(n, self.traced.program.inputs), columns(n, len(CHECKS))
            ends = np.cumsum([array.shape[1] for array in inputs])[:-1]
            run = self.runner.bind(
                [given.T], [*(values[name].T for name in self.outputs), checks.T], self.bounds.weights
            )
            unseen = given if len(inputs) > 3 or not self.lay.cuts else None
            self.bound = Bound(values.values(), np.split(given, ends, axis=1), unseen, run)
        return self.bound

    @property
    def guessed(self) -> bool:
        """True if poses are predicted, False if they have a closed form."""
        return self.traced is None or bool(self.traced.predicted or self.traced.near)

    def predict(self, motion: GivenMotion) -> Poses | None:
        """Predict the poses of the next samples; return None if poses have a closed form."""
        return self.work.predict(motion) if self.guessed else None

    def reach(self, motion: GivenMotion) -> Poses | None:
        """Predict the poses of samples in any order; `motion.t` holds the row numbers.

        Raises:
            ClosureError: A sample cannot be reached, or y does not determine its pose.
        """
        if not self.guessed:
            return None
        guess, lost, twice = self.work.mode.reach(motion.y)
        for rows, what, remedy in ((lost, LOST, "use samples nearer to the home pose"), (twice, TWICE, "pass t")):
            if rows.any():
                first, count = int(np.argmax(rows)), int(np.count_nonzero(rows))
                others = f" and {count - 1} more rows" if count > 1 else ""
                where = f"row {motion.t[first]:.0f} ({self.lay.mechanism.pose_text(motion.y[first])}){others}"
                raise ClosureError(what, where, remedy)
        return guess

    def part(
        self,
        motion: GivenMotion,
        guess: Poses | None,
        loads: Array | None = None,
        into: Mapping[str, Array] | None = None,
        *,
        thorough: bool = False,
    ) -> SolvedPart:
        """Solve samples with the program, and doubtful samples with the array solver.

        Args:
            guess: See `predict`.
            loads: Force and torque of each load at every sample, if they differ between samples. Shape (m, n).
            into: Arrays for the values, see `arrays`.
            thorough: Whether the array solver also solves samples where a quantity vanishes, see `vanishing_samples`.
        """
        if loads is None and self.varying is not None:
            loads = _loads(self.varying, motion.t)
        arrays = self.arrays(len(motion)) if into is None or not has_contiguous_columns(into) else into
        values = {name: arrays[name] for name in self.wanted}
        if self.traced is None:
            self.by_array[self.reason] += len(motion)
            part = SolvedPart(values, Trust.unknown(len(motion)), np.arange(len(motion)), {})
        else:
            part = self._by_program(self.traced, motion, guess, loads, arrays, thorough=thorough)
        part = self._complete(motion, guess, loads, arrays, part)
        for name, array in arrays.items() if into is not None and arrays is not into else ():
            into[name][:] = array  # type: ignore[index]
        return part

    def _by_program(
        self,
        traced: Traced,
        motion: GivenMotion,
        guess: Poses | None,
        loads: Array | None,
        arrays: Mapping[str, Array],
        *,
        thorough: bool,
    ) -> SolvedPart:
        """Solve samples with the program; the returned part lists the samples that remain doubtful."""
        values, n = {name: arrays[name] for name in self.wanted}, len(motion)
        with self.clock.stage("program"):
            out, clear = self._run(traced, motion, guess, np.empty((0, n)) if loads is None else loads, arrays)
        with self.clock.stage("error estimate"), np.errstate(all="ignore"):
            if self.charted and guess is not None:
                self._choose_nearest(values, self.work.mode.joints(guess))
            trust = self.bounds.trust(out)
            guarded = self.kind is FLOAT64
            left: Rows = np.zeros(0, dtype=np.intp)
            if guarded and not clear:
                left = self.bounds.select_doubtful(out, trust, values, self.by_array)
            if guarded and thorough:
                zeros = np.setdiff1d(vanishing_samples(values, trust, self.units, self.length), left)
                self.by_array["zero relative to their terms"] += len(zeros)
                left = np.union1d(left, zeros)
        return SolvedPart(values, trust, left, {})

    def _complete(
        self,
        motion: GivenMotion,
        guess: Poses | None,
        loads: Array | None,
        arrays: Mapping[str, Array],
        part: SolvedPart,
    ) -> SolvedPart:
        """Solve doubtful samples again with the array solver."""
        rows = part.doubtful
        if not rows.size:
            return replace(part, moved={name: np.zeros((0, x.shape[1])) for name, x in part.values.items()})
        work, some = self.work.with_loads(None if loads is None else loads[:, rows]), motion.part(rows)
        begun = work.predict(some) if guess is None else guess.rows(rows)
        other = work.part(some, work.close(some, begun))
        for name, array in arrays.items():
            array[rows] = estimate_errors(other, self.units, self.length) if name == "error" else other.values[name]
        return SolvedPart(part.values, part.trust.with_rows(rows, other.trust), rows[other.doubtful], other.moved)

    def _choose_nearest(self, values: dict[str, Array], near: Array) -> None:
        """Replace angles of cut joints with the equivalent angles nearest to the prediction."""
        for joint, fold in zip(self.lay.cuts, self.folds, strict=True):
            columns = self.lay.columns[joint.name]
            turning = [c for c in columns if self.lay.turns[c]]
            swapped = fold * np.cos(near[:, columns[1]]) < 0.0 if joint.angles == 3 else np.zeros(1, dtype=bool)
            if "joint_position" in values:
                q = values["joint_position"]
                q[:, turning], swapped = nearest_angles(q[:, turning], near[:, turning])
            if swapped.any():
                for name, places in self._middle[columns[1]].items():
                    if name in values:
                        values[name][np.ix_(np.flatnonzero(swapped), np.array(places, dtype=int))] *= -1.0

    @cached_property
    def _middle(self) -> Mapping[int, Mapping[str, list[int]]]:
        """Column of a cut S joint's middle angle -> quantity -> columns of this angle's rates and forces."""
        middle, tree = {}, open_tree(self.lay)[1]
        for joint in self.lay.cuts:
            column = self.lay.columns[joint.name][1:2]
            if joint.angles == 3:
                place = [tree.index(column[0])] if column[0] in tree else []
                rates = dict.fromkeys(("joint_velocity", "joint_acceleration"), column)
                middle[column[0]] = rates | dict.fromkeys(("tree_force", "tree_force_soft"), place)
        return middle

    def notes(self, n: int) -> tuple[str, ...]:
        """Describe how many samples the program and the array solver solved."""
        if self.traced is None:
            return (self.note,)
        left, reasons = self.by_array.total(), [f"{count} {why}" for why, count in self.by_array.items() if count]
        rest = f", {left} by the array solver ({', '.join(reasons)})" if reasons else ""
        note = f"{n - left} of {n} samples were solved by a program of {len(self.traced.program.code)} operations{rest}"
        return (note, *filter(None, [self.note]))


def _loads(applied: Applied, t: Array) -> Array:
    """Return force and torque of each load at times [s]. Shape (6 n_load, n)."""
    each = [vector for load in applied.at(t).loads for vector in (load.force, load.torque)]
    return np.concatenate([np.broadcast_to(vector, (len(t), 3)).T for vector in each])


def anchors(work: Work, motion: GivenMotion) -> tuple[GivenMotion, Array]:
    """Choose well-conditioned samples of a motion; return them with their joint coordinates.

    Raises:
        NotTraceableError: None of the samples tried is well conditioned.
    """
    some = motion.part(np.unique(np.linspace(0, len(motion) - 1, ANCHORS).astype(int)))
    guess, lost, twice = work.mode.reach(some.y)  # there may be a thousand turns between samples
    if (reached := np.flatnonzero(~(lost | twice))).size:
        some, guess = some.part(reached), guess.rows(reached)
    else:
        guess = work.predict(some)
    q = work.close(some, guess)
    work.mode.restart()
    clear = np.setdiff1d(np.arange(len(some)), work.part(some, q).trust.doubtful())
    if not clear.size:
        raise NotTraceableError("the motion is ill-conditioned", work.lay.mechanism.name, "use backend array")
    return some.part(clear), q[clear]


def solve_traced(
    lay: Layout, problem: Problem, motion: GivenMotion, progress: Progress, by: tuple[str, NumberType]
) -> Solution:
    """Solve a given motion, with a traced program if there is one.

    Args:
        by: Backend and number type; float32 provides no error estimate.
    """
    known, (backend, kind) = replace(problem, wanted=problem.wanted | {"joint_position"}), by  # gives the mode
    work = TracedWork(lay, known, motion, backend, kind=kind)

    def part(rows: slice) -> SolvedPart:
        some = motion.part(rows)
        chunk = work.part(some, work.predict(some), thorough=True)
        wanted = {name: x for name, x in chunk.values.items() if name in problem.wanted}
        return replace(chunk, values=wanted, q=chunk.values["joint_position"])

    narrow = "" if kind is FLOAT64 else f" in {kind.name}, from predictions in float64"
    labels = ("screw", __version__, f"rule {problem.rule}" + (f", backend {backend}{narrow}" if work.traced else ""))
    size = work.length, lay.mechanism.mass
    solution = assemble(labels, len(motion), part, work.names, work.clock, progress, size)
    return replace(solution, notes=work.notes(len(motion)), errors={} if narrow else solution.errors)
