"""``screwgauge.compile``: the traced program of a scene as a function of samples, for volume."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import accumulate
from operator import is_

import numpy as np

from screwgauge.engines.screw.programs import Bound
from screwgauge.engines.screw.traced import TracedWork
from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.continuation import PathEnd
from screwgauge.reference.errors import ClosureError, DescriptionError
from screwgauge.reference.graph import layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import CHUNK, Pool, columns
from screwgauge.scene.scene import Scene

Mode = tuple[bool, bool]
"""Whether samples have their own loads, and whether errors are estimated."""
#: Samples worked on at a time, whatever is given: memory stays constant.
PART = CHUNK


@dataclass(frozen=True, slots=True, eq=False)
class CompiledSolution:
    """What a solver returns.

    Attributes:
        values: Quantity -> array of shape (n, n_component).
        by_array: Reason -> number of samples that the array solver answered.
        estimate: Quantity -> estimated error at each sample in each of its units, in the order in which these occur
            among its components, shape (n, n_unit); empty if it was not wanted. Buffers that are used again have
            theirs filled again.
    """

    values: Mapping[str, Array]
    by_array: Mapping[str, int]
    estimate: Mapping[str, Array]

    def __getitem__(self, quantity: str) -> Array:
        return self.values[quantity]


class Solver:
    """Inverse dynamics of one mechanism under one scene's gravity and loads. Not for two threads at once.

    Attributes:
        quantities: What it computes.
        components: Quantity -> names of its components.
        notes: Notes on it, such as why there is no program.
    """

    def __init__(
        self, scene: Scene, quantities: Iterable[str], backend: str, threads: int, mode: Mode = (False, False)
    ) -> None:
        """Traces and compiles; pivots are chosen at samples of the scene's motion.

        Args:
            mode: Of the program that is made at once; others are made when they are first used.
        """
        self.scene, self.quantities, self.backend, self.threads = scene, tuple(quantities), backend, threads
        self.works: dict[Mode, list[TracedWork]] = {}
        self.last: dict[Mode, tuple[Bound, CompiledSolution]] = {}
        self.pool = Pool()
        work = self.first = self._works(mode)[0]
        self.components = {name: work.names()[name][0] for name in self.quantities}
        self.notes = tuple(filter(None, [work.note]))

    def _works(self, mode: Mode) -> list[TracedWork]:
        """Traced work of a mode, one for each thread."""
        if mode not in self.works:
            lay, motion, problem = layout(self.scene.mechanism), self.scene.motion, self.scene.problem(self.quantities)
            first = TracedWork(lay, problem, motion, self.backend, loaded=mode[0], estimates=mode[1])
            self.works[mode] = [first, *(first.again() for _ in range(self.threads - 1))]
        return self.works[mode]

    def as_c(self) -> str:
        """The program as C, for reading; empty if there is none."""
        return "" if self.first.traced is None else self.first.traced.program.as_c()

    def buffers(self, n: int) -> dict[str, Array]:
        """Arrays for `out`, shape (n, n_component); numbers of one component lie side by side."""
        counts = {name: len(self.components[name]) for name in self.quantities}
        return _divided(columns(n, sum(counts.values())), counts)

    def __call__(
        self,
        y: Array,
        yd: Array,
        ydd: Array,
        *,
        t: Array | None = None,
        load: Array | None = None,
        out: Mapping[str, Array] | None = None,
        estimates: bool = False,
    ) -> CompiledSolution:
        """Answers samples in any order: a function of each row, whatever came before.

        Args:
            y, yd, ydd: Independent coordinates [rad or m] and derivatives. Shape (n, k).
            t: Times [s]: the rows are a motion, which is followed from home along the curve through them. Shape (n,).
            load: In place of the scene's loads, force [N] and torque [N m] of each. Shape (6 n_load,) or
                (n, 6 n_load).
            out: Where the values are written, see `buffers`.
            estimates: Whether errors are estimated sample by sample; samples are checked in any case.

        Raises:
            ScrewgaugeError: An array of wrong shape or type, or a row that cannot be solved: not reached from home
                without passing near a singular pose, or in two poses that are both reached.
        """
        given = (y, yd, ydd) if load is None else (y, yd, ydd, load)
        mode = load is not None, estimates
        if out is None:
            return self._lent(given, mode, t)
        if t is None and mode in self.last and len(out) == len(self.quantities):
            bound, answer = self.last[mode]  # the buffers of the last call: nothing to prepare
            if all(map(is_, out.values(), bound.values)) and bound.fill(given):
                return answer
        n, counts, arrays = len(y), self._error_counts(mode), self._checked(out, len(y))
        errors = columns(n, sum(counts.values()))
        by_array, last = self._solve(given, mode, arrays | ({"error": errors} if estimates else {}), t)
        answer = CompiledSolution(arrays, by_array, _divided(errors, counts))
        if last is not None:
            self.last[mode] = last, replace(answer, by_array={})
        return answer

    def _lent(self, given: Sequence[Array], mode: Mode, t: Array | None) -> CompiledSolution:
        """An answer in memory that is the solver's again once nothing refers to it, see `Pool`."""
        counts = {name: len(self.components[name]) for name in self.quantities}, self._error_counts(mode)
        m, all_m = sum(counts[0].values()), sum(map(sum, (each.values() for each in counts)))
        block, by_array = self.pool.take(len(given[0]), all_m), Counter[str]()
        if not (t is None and mode in block.known and block.known[mode].fill(given)):
            arrays = _divided(block.array, counts[0]) | ({"error": block.array[:, m:]} if mode[1] else {})
            by_array, last = self._solve(given, mode, arrays, t)
            if last is not None:
                block.known[mode] = last
        lent = self.pool.lend(block)
        return CompiledSolution(_divided(lent, counts[0]), by_array, _divided(lent[:, m:], counts[1]))

    def _error_counts(self, mode: Mode) -> dict[str, int]:
        """Quantity -> how many errors are estimated of it at each sample."""
        return {name: len({*units}) for name, units in self._works(mode)[0].units.items()} if mode[1] else {}

    def _solve(
        self, given: Sequence[Array], mode: Mode, arrays: Mapping[str, Array], t: Array | None
    ) -> tuple[Counter[str], Bound | None]:
        """Fills arrays.

        Returns:
            What the array solver answered, and the program bound to these arrays.
        """
        n = len(given[0])
        for name, array in zip(("y", "yd", "ydd"), given, strict=False):
            _check_array(array, (n, len(self.scene.mechanism.independent)), name)
            _check_finite(array, name)
        if t is not None:
            _check_array(t, (n,), "t")
            _check_finite(t[:, None], "t")
        elif not all(motor.constant for motor in self.scene.applied.motors):
            raise DescriptionError("a motor changes over time, which samples do not say", "compile", "give t")
        inputs = [*given[:3], *(self._loads(load, n) for load in given[3:])]
        works = self._works(mode)
        for work in works:
            work.by_array.clear()
        if t is not None or self.threads == 1:  # a motion goes on from sample to sample
            self._fill(works[0], slice(0, n), inputs, arrays, t)
        else:
            shares = [slice(n * i // self.threads, n * (i + 1) // self.threads) for i in range(len(works))]
            with ThreadPoolExecutor(self.threads) as pool:
                [*pool.map(lambda work, share: self._fill(work, share, inputs, arrays, t), works, shares)]
        bound = works[0].bound
        fits = bound is not None and t is None and bound.fits(inputs, arrays)
        return sum((work.by_array for work in works), start=Counter[str]()), bound if fits else None

    def stream(self, chunks: Iterable[Sequence[Array]], *, estimates: bool = False) -> Iterator[CompiledSolution]:
        """Answers chunks of samples, one after the other, in buffers that are filled again: memory stays constant.

        Args:
            chunks: y, yd, ydd and, if they have their own, loads: see `__call__`. Some 400 samples of all quantities,
                or a thousand of a few, stay in the cache.
        """
        out = self.buffers(0)
        for y, yd, ydd, *load in chunks:
            if any(len(array) != len(y) for array in out.values()):
                out = self.buffers(len(y))
            yield self(y, yd, ydd, load=load[0] if load else None, out=out, estimates=estimates)

    def _fill(
        self, work: TracedWork, rows: slice, inputs: Sequence[Array], arrays: Mapping[str, Array], t: Array | None
    ) -> None:
        """Fills in the values of some samples part after part."""
        work.work.mode.restart()
        for start in range(rows.start, rows.stop, PART):
            some = slice(start, min(start + PART, rows.stop))
            given, into = inputs, arrays
            if some != slice(0, len(inputs[0])):
                given, into = [x[some] for x in inputs], {name: x[some] for name, x in arrays.items()}
            bound = work.bind(given, into) if t is None else None
            if bound is None or not bound.fill(given):
                motion, loads = _motion(given, np.arange(some.start, some.stop, dtype=float) if t is None else t[some])
                guess = work.reach(motion) if t is None else work.predict(motion)
                try:
                    work.part(motion, guess, loads, into)
                except PathEnd as end:
                    where = f"row {end.t:.0f}" if t is None else end.where
                    raise ClosureError(end.what, where, end.remedy) from None

    def _loads(self, load: Array, n: int) -> Array:
        m = 6 * len(self.scene.applied.loads)
        if not m:
            raise DescriptionError("the scene has no load that could be replaced", "load", "leave it out")
        load = np.asarray(load)
        wide = np.broadcast_to(load, (n, m)) if load.shape == (m,) else load
        _check_array(wide, (n, m), "load")
        _check_finite(wide, "load")
        return wide

    def _checked(self, out: Mapping[str, Array], n: int) -> dict[str, Array]:
        if out.keys() != {*self.quantities}:
            raise DescriptionError(f"buffers for {sorted(out)}", "out", f"give them for {', '.join(self.quantities)}")
        for name, array in out.items():
            _check_array(array, (n, len(self.components[name])), f"out, {name}")
            if not array.flags.writeable:
                raise DescriptionError("the buffer is read-only", f"out, {name}", "give one that can be written to")
        return {name: out[name] for name in self.quantities}


def _divided(array: Array, counts: Mapping[str, int]) -> dict[str, Array]:
    """Columns of an array under their names, so many of each."""
    ends = accumulate(counts.values())
    return {name: array[:, end - count : end] for (name, count), end in zip(counts.items(), ends, strict=True)}


def _motion(inputs: Sequence[Array], t: Array) -> tuple[GivenMotion, Array | None]:
    """Samples as a motion, and their loads."""
    y, yd, ydd, *loads = (array.copy() for array in inputs)
    return GivenMotion(t.copy(), y, yd, ydd), np.ascontiguousarray(loads[0].T) if loads else None


def _check_array(array: Array, shape: tuple[int, ...], where: str) -> None:
    if not isinstance(array, np.ndarray) or array.dtype != np.float64:
        kind = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
        raise DescriptionError(f"it is of {kind}", where, "give an array of float64")
    if array.shape != shape:
        raise DescriptionError(f"its shape is {array.shape}, not {shape}", where, "give a row for each sample")


def _check_finite(array: Array, where: str) -> None:
    if not np.isfinite(array).all():
        row = int(np.isfinite(array).all(axis=1).argmin())
        raise DescriptionError(f"row {row} is not finite", where, "complete the samples")
