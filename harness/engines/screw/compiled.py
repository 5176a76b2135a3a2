"""``screwgauge.compile``: compiles a scene into a solver for large numbers of samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import RLock
from typing import Any

import numpy as np

from screwgauge.engines.screw.buffers import Buffers, check_array, check_finite, split_columns
from screwgauge.engines.screw.programs import Bound, rows_not_finite
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
#: Number of samples processed at a time, for any input, so that memory stays constant.
PART = CHUNK


@dataclass(frozen=True, slots=True, eq=False)
class CompiledSolution:
    """Result of a solver.

    Attributes:
        values: Quantity -> array of shape (n, n_component).
        by_array: Reason -> number of samples that the array solver had to solve.
        estimate: Quantity -> estimated error at each sample for each unit, shape (n, n_unit), with units in the order
            in which they first occur among the quantity's components; empty if not requested. A call that reuses the
            buffers overwrites the estimates.
    """

    values: Mapping[str, Array]
    by_array: Mapping[str, int]
    estimate: Mapping[str, Array]

    def __getitem__(self, quantity: str) -> Array:
        return self.values[quantity]


class Solver:
    """Inverse dynamics of a mechanism under the gravity and loads of a scene.

    Threads may share a solver if each thread has its own buffers, or uses none. A pickled or copied solver is compiled
    again.

    Attributes:
        quantities: Names of the computed quantities.
        components: Quantity -> names of its components.
        notes: Notes on the solver, such as the reason why it has no program.
    """

    def __init__(
        self, scene: Scene, quantities: Iterable[str], backend: str, threads: int, mode: Mode = (False, False)
    ) -> None:
        """Trace and compile the program, with pivots chosen at samples of the scene's motion.

        Args:
            mode: Mode of the program to build at once; programs of other modes are built on first use.
        """
        self.scene, self.quantities, self.backend, self.threads = scene, tuple(quantities), backend, threads
        self.works: dict[Mode, list[TracedWork]] = {}
        self.pool, self.lock = Pool(), RLock()
        work = self.first = self._works(mode)[0]
        self.components = {name: work.names()[name][0] for name in self.quantities}
        self.counts = {name: len(names) for name, names in self.components.items()}
        self.notes = tuple(filter(None, [work.note]))

    def __reduce__(self) -> tuple[Any, ...]:
        return Solver, (self.scene, self.quantities, self.backend, self.threads), {"notes": self.notes}

    def _works(self, mode: Mode) -> list[TracedWork]:
        """Return the programs of a mode, one for each thread."""
        with self.lock:
            if mode not in self.works:
                lay, scene = layout(self.scene.mechanism), self.scene
                problem, (loaded, estimates) = scene.problem(self.quantities), mode
                first = TracedWork(lay, problem, scene.motion, self.backend, loaded=loaded, estimates=estimates)
                self.works[mode] = [first, *(first.copy() for _ in range(self.threads - 1))]
            return self.works[mode]

    def as_c(self) -> str:
        """Return the program as readable C code; empty if there is no program."""
        return "" if self.first.traced is None else self.first.traced.program.as_c()

    def buffers(self, n: int, arrays: Mapping[str, Array] | None = None) -> Buffers:
        """Allocate the arrays to pass as `out` for n samples, one of shape (n, n_component) per quantity.

        Args:
            arrays: Quantity -> your own array to fill: plain float64, writeable, without shared memory.
                Arrays with contiguous components are filled fastest; all arrays allocated here have this layout.

        Raises:
            ScrewgaugeError: An array is invalid, or the solver does not compute one of the quantities.
        """
        return Buffers(self, self.counts, n, {} if arrays is None else arrays)

    def __call__(
        self,
        y: Array,
        yd: Array,
        ydd: Array,
        *,
        t: Array | None = None,
        load: Array | None = None,
        out: Buffers | None = None,
        estimates: bool = False,
    ) -> CompiledSolution:
        """Solve samples, in any order; the results of a row do not depend on earlier calls.

        Args:
            y, yd, ydd: Independent coordinates [rad or m] and derivatives; second derivatives of undriven coordinates
                are ignored. Shape (n, k).
            t: Times [s]. If given, the rows form a motion, which is followed from the home pose along the curve through
                the rows. Shape (n,).
            load: Force [N] and torque [N m] of each load, which replace the scene's loads. Shape (6 n_load,) or
                (n, 6 n_load).
            out: Arrays to fill, see `buffers`; invalid after an error.
            estimates: Whether to estimate errors sample by sample; samples are always checked.

        Raises:
            ScrewgaugeError: An array has the wrong shape or type, or a row cannot be solved: every path from the home
                pose passes near a singular pose, two different poses are reached, or a value exceeds the float64 range.
        """
        given = (y, yd, ydd) if load is None else (y, yd, ydd, load)
        mode = load is not None, estimates
        if out is None:
            return self._answer_in_pool(given, mode, t)
        if type(out) is not Buffers or out.owner is not self:
            made = "buffers of a different solver" if type(out) is Buffers else type(out).__name__
            raise DescriptionError(
                f"expected buffers of this solver, got {made}",
                "out",
                "use solver.buffers(n) or solver.buffers(n, arrays)",
            )
        if not out.writeable:
            raise DescriptionError("an array has become read-only", "out", "create new buffers")
        if t is None and mode in out.known:
            known: tuple[Bound, CompiledSolution] = out.known[mode]
            if known[0].fill(given):  # nothing to prepare
                return known[1]
        if (n := self._length(y)) != out.n:
            raise DescriptionError(f"expected buffers of {n} samples, got {out.n}", "out", f"use solver.buffers({n})")
        counts = self._error_counts(mode)
        errors = columns(n, sum(counts.values()))
        by_array, last = self._solve(given, mode, {**out} | ({"error": errors} if estimates else {}), t)
        answer = CompiledSolution(out, by_array, split_columns(errors, counts))
        if last is not None:
            out.known[mode] = last, replace(answer, by_array={})
        return answer

    def _answer_in_pool(self, given: Sequence[Array], mode: Mode, t: Array | None) -> CompiledSolution:
        """Solve into a memory block that goes back to the solver's pool when its last array is freed, see `Pool`."""
        counts = self.counts, self._error_counts(mode)
        m, all_m = sum(counts[0].values()), sum(map(sum, (each.values() for each in counts)))
        block, by_array = self.pool.take(self._length(given[0]), all_m), Counter[str]()
        if not (t is None and mode in block.known and block.known[mode].fill(given)):
            arrays = split_columns(block.array, counts[0]) | ({"error": block.array[:, m:]} if mode[1] else {})
            by_array, last = self._solve(given, mode, arrays, t)
            if last is not None:
                block.known[mode] = last
        lent = self.pool.lend(block)
        return CompiledSolution(split_columns(lent, counts[0]), by_array, split_columns(lent[:, m:], counts[1]))

    def _length(self, y: Array) -> int:
        """Return the number of samples; reject y if it is not a two-dimensional array."""
        if type(y) is not np.ndarray or y.ndim != 2:
            check_array(y, (None, len(self.scene.mechanism.independent)), "y")
        return len(y)

    def _error_counts(self, mode: Mode) -> dict[str, int]:
        """Return, for each quantity, the number of errors estimated per sample."""
        return {name: len({*units}) for name, units in self._works(mode)[0].units.items()} if mode[1] else {}

    def _solve(
        self, given: Sequence[Array], mode: Mode, arrays: Mapping[str, Array], t: Array | None
    ) -> tuple[Counter[str], Bound | None]:
        """Solve into preallocated arrays.

        Returns:
            Reason -> number of samples solved by the array solver; and the program bound to these arrays, if any.

        Raises:
            ScrewgaugeError: See `__call__`.
        """
        n = self._length(given[0])
        for name, array in zip(("y", "yd", "ydd"), given, strict=False):
            check_array(array, (n, len(self.scene.mechanism.independent)), name)
            check_finite(array, name)
        if t is not None:
            check_array(t, (n,), "t")
            check_finite(t[:, None], "t")
        elif not all(motor.course.constant for motor in self.scene.applied.motors):
            raise DescriptionError("a motor depends on time, but t is missing", "compile", "pass t")
        elif len(given) == 3 and any(load.courses for load in self.scene.applied.loads):
            raise DescriptionError("a load depends on time, but t is missing", "compile", "pass t or load")
        inputs = [*given[:3], *(self._loads(load, n) for load in given[3:])]
        if any(np.may_share_memory(x, array) for x in inputs for array in arrays.values()):
            inputs = [x.copy() for x in inputs]  # parts would overwrite later inputs
        with self.lock:
            by_array, bound = self._solve_all(inputs, self._works(mode), arrays, t)
        if (rows := rows_not_finite({name: arrays[name] for name in self.quantities})).size:
            names = (name for name in self.quantities if not np.isfinite(arrays[name][rows[0]]).all())
            what = f"{', '.join(names)} exceed the range of float64"
            raise DescriptionError(what, f"row {rows[0]}", "use smaller coordinates, rates, accelerations or loads")
        fits = bound is not None and t is None and bound.fits(inputs, arrays)
        return by_array, bound if fits else None

    def _solve_all(
        self, inputs: Sequence[Array], works: Sequence[TracedWork], arrays: Mapping[str, Array], t: Array | None
    ) -> tuple[Counter[str], Bound | None]:
        """Solve like `_solve`; the returned bound program may cover only some samples."""
        n = len(inputs[0])
        for work in works:
            work.by_array.clear()
        if t is not None or self.threads == 1:  # a motion continues from sample to sample
            self._fill(works[0], slice(0, n), inputs, arrays, t)
        else:
            shares = [slice(n * i // self.threads, n * (i + 1) // self.threads) for i in range(len(works))]
            with ThreadPoolExecutor(self.threads) as pool:
                [*pool.map(lambda work, share: self._fill(work, share, inputs, arrays, t), works, shares)]
        return sum((work.by_array for work in works), start=Counter[str]()), works[0].bound

    def stream(self, chunks: Iterable[Sequence[Array]], *, estimates: bool = False) -> Iterator[CompiledSolution]:
        """Solve chunks of samples in reused buffers, with constant memory use.

        Args:
            chunks: y, yd, ydd and, if loads vary, the loads of each chunk, see `__call__`. About 400 samples of all
                quantities, or 1000 samples of a few quantities, fit into the cache.
        """
        out = self.buffers(0)
        for y, yd, ydd, *load in chunks:
            if out.n != (n := self._length(y)):
                out = self.buffers(n)
            yield self(y, yd, ydd, load=load[0] if load else None, out=out, estimates=estimates)

    def _fill(
        self, work: TracedWork, rows: slice, inputs: Sequence[Array], arrays: Mapping[str, Array], t: Array | None
    ) -> None:
        """Fill in the values of some samples, part by part."""
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
                    with np.errstate(all="ignore"):  # non-finite values are rejected
                        work.part(motion, guess, loads, into)
                except PathEnd as end:
                    where = f"row {end.t:.0f}" if t is None else end.where
                    raise ClosureError(end.what, where, end.remedy) from None

    def _loads(self, load: Array, n: int) -> Array:
        m = 6 * len(self.scene.applied.loads)
        if not m:
            raise DescriptionError("the scene has no load to replace", "load", "remove the argument")
        check_array(load, (m,) if getattr(load, "ndim", 2) == 1 else (n, m), "load")
        check_finite(np.atleast_2d(load), "load")
        return np.broadcast_to(load, (n, m))


def _motion(inputs: Sequence[Array], t: Array) -> tuple[GivenMotion, Array | None]:
    """Convert samples to a motion and loads."""
    y, yd, ydd, *loads = (array.copy() for array in inputs)
    return GivenMotion(t.copy(), y, yd, ydd), np.ascontiguousarray(loads[0].T) if loads else None
