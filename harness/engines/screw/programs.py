"""Programs ready to run: which questions have one, what runs it, and machine code kept on disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from operator import is_
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy import ndarray

from screwgauge import __version__
from screwgauge.problem import Problem, Rows
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Lanes, Program
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.tracing import Traced
from screwgauge.truth import cache

FLOAT = np.dtype(float)
#: Squares of gains between samples at which pivots were chosen, over the largest of those.
WITHIN = 2.0


class Runner(Protocol):
    """What runs a program."""

    program: Program

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """See `screwgauge.reference.traced.native.Native.bind`."""

    def again(self) -> Runner:
        """One that may run at the same time."""


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A program bound to arrays that are used again.

    Attributes:
        values: What it fills; they are kept, so that no others can take their places.
        inputs: What it is given. Shape (n, m) each.
        unseen: The same, if numbers that are none may leave no residual: loads, and y of an open tree. Shape (n, m).
        run: Says whether no sample is in doubt.
    """

    values: tuple[Array, ...]
    inputs: tuple[Array, ...]
    unseen: Array | None
    run: Callable[[], bool]

    def fits(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> bool:
        """Whether these are the first of its arrays, and such inputs."""
        alike = [x.shape for x in inputs] == [place.shape for place in self.inputs]
        return alike and all(map(is_, values.values(), self.values))

    def fill(self, inputs: Sequence[Array]) -> bool:
        """Fills its arrays with what follows from some inputs; says whether they are such, and no sample in doubt."""
        for x, place in zip(inputs, self.inputs, strict=True):
            if type(x) is not ndarray or x.dtype is not FLOAT or x.shape != place.shape:
                return False
            place[...] = x
        return self.run() and (self.unseen is None or isfinite(self.unseen.sum()))


def runner(program: Program, backend: str, plain: Callable[[Program], Runner] = Lanes) -> tuple[Runner, str]:
    """A program ready to run, and what is to be said about that.

    Args:
        plain: What runs it without a compiler.
    """
    if backend != "llvm":
        return plain(program), ""
    try:
        from screwgauge.reference.traced import native

        version = cache.code_version(Path(native.__file__).parent, extra=f"{__version__} {native.cpu()}")
    except ImportError:
        how = "NumPy" if plain is Lanes else "Python"
        return plain(program), f"llvmlite is not installed (extra 'fast'): the program runs with {how}"
    key = cache.digest("program", program.inputs, program.code, program.outputs, program.checks, version)
    stored, said = cache.read(key, version)
    if stored is not None and "code" in stored:
        return native.Native(program, stored["code"].tobytes()), said
    code = native.machine_code(program)
    failed = cache.write(key, version, {"code": np.frombuffer(code, dtype=np.uint8)})
    return native.Native(program, code), "; ".join(filter(None, (said, failed)))


class Arcs:
    """Programs that differ in their pivots, each sample by the one whose pivots are largest there.

    What a program says of a sample's gain stands on its pivots. Where that is more than it was at all samples for which
    they were chosen, the next program is tried.
    """

    def __init__(self, runners: Sequence[Runner], limits: Sequence[float]) -> None:
        """`limits`: of the check of the gain, of each program."""
        self.runners, self.limits, self.program = runners, limits, runners[0].program

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """As `Runner.bind`."""
        first, checks = self.runners[0].bind(inputs, outputs, weights), self.program.checks
        given, found = ([row for block in blocks for row in block] for blocks in (inputs, outputs))

        def run() -> bool:
            clear, rows = first(), np.flatnonzero(~(found[-checks] <= self.limits[0]))
            for runner, limit in zip(self.runners[1:], self.limits[1:], strict=True):
                if rows.size:
                    rows = rows[~(_retried(runner, rows, given, found) <= limit)]
                    clear = weights is None or not any(~(weights @ np.array(found[-checks:]) <= 1.0))
            return clear

        return run

    def again(self) -> Arcs:
        """One that may run at the same time."""
        return Arcs([runner.again() for runner in self.runners], self.limits)


def _retried(runner: Runner, rows: Rows, given: Sequence[Array], found: Sequence[Array]) -> Array:
    """Puts another program's numbers in the place of those of some samples where its gain, returned, is smaller."""
    out, checks = np.empty((len(found), len(rows))), runner.program.checks
    runner.bind([np.array([row[rows] for row in given])], [out])()
    better = ~(found[-checks][rows] <= out[-checks])
    for row, new in zip(found, out, strict=True):
        row[rows[better]] = new[better]
    gain: Array = out[-checks]
    return gain


def runner_of(traced: Traced, backend: str) -> tuple[Runner, str]:
    """The programs of a trace ready to run, see `runner`."""
    made, said = zip(*(runner(arc.program, backend) for arc in traced.arcs), strict=True)
    limits = [WITHIN * arc.gain for arc in traced.arcs]
    return made[0] if len(made) == 1 else Arcs(made, limits), "; ".join(filter(None, dict.fromkeys(said)))


def check_traceable(lay: Layout, problem: Problem) -> None:
    """Refuses what no program answers.

    Raises:
        NotTraceableError: With the reason.
    """
    mechanism = lay.mechanism
    if {"actuator_force", "reaction"} & problem.wanted and len(mechanism.actuators) < len(mechanism.independent):
        reason = "there are fewer actuators than freedoms"
        raise NotTraceableError(reason, mechanism.name, "the array solver answers it")


def flat(arrays: Mapping[str, Array]) -> bool:
    """Whether the numbers of each column lie side by side."""
    return all(array.strides[0] == array.itemsize for array in arrays.values())
