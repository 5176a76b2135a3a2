"""Execution of the solver's programs, with cheap error bounds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite
from operator import is_
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy import ndarray
from numpy.typing import NDArray

from screwgauge.engines.error_estimate import (
    ACCELERATED,
    CLEAR,
    CLEAR_FORCES,
    SolvedPart,
    Trust,
    absolute_error,
    by_powers,
    summand,
)
from screwgauge.problem import GivenMotion, Problem, Rows, given_columns
from screwgauge.quantities import ACTUATED, arm
from screwgauge.reference import linear
from screwgauge.reference.closed_motion import driven_at_home
from screwgauge.reference.equations.rounding import stretch
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.program import Lanes, Narrow, Program, is_clear
from screwgauge.reference.traced.trace import NotTraceableError, Scalar, apply
from screwgauge.reference.traced.tracing import CHECKS, Traced
from screwgauge.truth import cache

if TYPE_CHECKING:
    from screwgauge.reference.traced.native import Native

#: Safety factor of estimated gains, and approximate dimensionless norm of the closing equations.
SAFETY, CONDITION = 2.0, 4.0
#: Closure residual of one row above which Newton's method has not converged, in eps; and relative residual allowed in
#: the balance of all bodies.
ARRIVED, BALANCED = 32, 1e-9
#: Limit of the largest Newton correction times the gain; below it, Newton's method stays in its assembly mode.
NEAR = 0.2


Numbers = Mapping[str, Scalar]
"""Check -> nodes of a program's trace, or values at all samples, shape (n,), see `roots`."""


def roots(checks: Iterable[Scalar]) -> dict[str, Scalar]:
    """Return the square root of each check that a program emits, by name, see `CHECKS`."""
    return {name: apply("sqrt", x) for name, x in zip(CHECKS, checks, strict=True)}


class Bounds:
    """Derives error data, error estimates and doubtful samples from a program's outputs.

    Attributes:
        weights: A sample may be doubtful if the sum of its checks, multiplied by these weights, exceeds 1.
    """

    def __init__(self, lay: Layout, problem: Problem, length: float, eps: float = linear.EPS) -> None:
        self.wanted, self.length, self.mass = problem.wanted, length, lay.mechanism.mass
        self.idle = bool(undriven_columns(lay, problem)[0])
        self.stretch = stretch(lay)
        # all weights and loads [N]
        self.weight = self.mass * float(np.linalg.norm(problem.applied.g)) + _largest(problem, length)
        # each further spherical joint adds at least one
        self.spare_charts = max(sum(joint.angles == 3 for joint in lay.cuts) - 1, 0)
        # largest closure residual of all rows that rounding causes
        self.arrived = float(ARRIVED * eps * max(6 * len(lay.cuts), 1) ** 0.5)
        self.weights = self._weights()

    def trust(self, out: Numbers) -> Trust:
        """Build error data from a program's outputs."""
        gain = SAFETY * apply("max", out["gain"], 1e-300)
        speed = out["speed"]
        rush = apply("max", speed * speed, out["rush"])
        load = self.weight + self.mass * self.length * rush
        charts = apply("sqrt", apply("max", out["charts"] * out["charts"] - float(self.spare_charts), 1.0))
        forces = dict[str, Scalar]()
        if "reaction" in self.wanted:
            forces["reaction"] = SAFETY * out["whole_gain"] * out["whole_gain"]
        if self.wanted & ACTUATED:
            driven = "actuator_force", "axis_moment", "jacobian"
            forces |= dict.fromkeys(driven, SAFETY * apply("max", out["drive"], 1.0))
        if self.idle:
            drive = SAFETY * apply("max", out["drive"], 1.0)
            forces |= {name: apply("max", drive, forces.get(name, 1.0)) for name in ACCELERATED}
        numbers = charts, forces, speed, rush, load, out["closing"], self.stretch
        return Trust(CONDITION * gain, gain, *numbers)

    def estimate(
        self, out: Numbers, values: Mapping[str, Sequence[Scalar]], units: Mapping[str, Sequence[str]]
    ) -> tuple[list[Scalar], list[Scalar]]:
        """Estimate errors of quantities, for each unit, at samples that are not in doubt.

        Returns:
            Each value followed by the partial sum of squares up to this value; and the errors.
        """
        trust, sums, errors = self.trust(out), list[Scalar](), list[Scalar]()
        for name, each in units.items():
            whole: Scalar = 0.0
            for x, unit in zip(values[name], each, strict=True):
                whole = whole + arm(unit, self.length) ** -2.0 * (x * x)
                sums += [x, whole]
            errors += [by_powers(name, trust) * local for _, local in _sizes(name, whole, each, trust, self.length)]
        return sums, errors

    def _weights(self) -> Array:
        limits = {
            "gain": CLEAR**2,
            "whole_gain": CLEAR_FORCES if "reaction" in self.wanted else np.inf,
            "drive": CLEAR_FORCES**2,
            "moved": (NEAR / (SAFETY * CLEAR)) ** 2,
            "closing": self.arrived**2,
            "balance": max(BALANCED * self.weight, 1e-150) ** 2,  # without gravity every balance is in doubt
            "charts": (SAFETY * CLEAR) ** 2,
        }
        free = 1.0 - self.spare_charts / (SAFETY * CLEAR) ** 2
        return np.array([1.0 / (free * limits.get(name, np.inf)) for name in CHECKS])

    def near(self, out: Numbers) -> NDArray[np.bool_]:
        """Flag samples at which Newton's method stayed in its assembly mode. Shape (n,)."""
        return np.asarray(out["moved"] * SAFETY * out["gain"] <= NEAR)

    def select_doubtful(self, out: Numbers, trust: Trust, values: Mapping[str, Array], counts: Counter[str]) -> Rows:
        """Return the samples left to the array solver; `counts` collects their number by reason."""
        doubts = {
            "badly conditioned": trust.doubtful(SAFETY),
            "not closed": np.flatnonzero(~((out["closing"] <= self.arrived) & self.near(out))),
            "not balanced": np.flatnonzero(~(out["balance"] <= BALANCED * np.maximum(trust.load, 1e-300))),
            "not finite": rows_not_finite(values),
        }
        left: Rows = np.zeros(0, dtype=np.intp)
        for reason, rows in doubts.items():
            counts[reason] += len(np.setdiff1d(rows, left))
            left = np.union1d(left, rows)
        return left


def _largest(problem: Problem, length: float) -> float:
    """Return the sum of the peak forces of all loads, with torques divided by a length [N]."""
    applied = problem.applied
    loads = applied.at(problem.task.t).loads if isinstance(problem.task, GivenMotion) else applied.loads
    sizes = (np.linalg.norm(x.force, axis=-1) + np.linalg.norm(x.torque, axis=-1) / length for x in loads)
    return sum(float(np.max(size)) for size in sizes)


def rows_not_finite(values: Mapping[str, Array]) -> Rows:
    """Return the indices of samples with a non-finite value. Shape (n, m) each -> (count,)."""
    return np.flatnonzero(~np.all([np.isfinite(x).all(axis=1) for x in values.values()], axis=0))


def estimate_errors(part: SolvedPart, units: Mapping[str, Sequence[str]], length: float) -> Array:
    """Estimate errors like `Bounds.estimate`, but at all samples, even doubtful samples. Shape (n, n_unit)."""
    errors = []
    for name, each in units.items():
        whole = (part.values[name] ** 2 / np.array([arm(unit, length) for unit in each]) ** 2).sum(axis=1)
        for unit, local in _sizes(name, whole, each, part.trust, length):
            errors.append(absolute_error(name, part, local, [i for i, has in enumerate(each) if has == unit]))
    return np.stack(errors, axis=1)


def _sizes(name: str, whole: Scalar, units: Sequence[str], trust: Trust, length: float) -> list[tuple[str, Scalar]]:
    """Return the magnitude of a quantity's terms in each unit; `whole` is the sum of squares of all components."""
    local = apply("sqrt", whole) + summand(name, units[0], trust) if units else 0.0
    return [(unit, arm(unit, length) * local) for unit in dict.fromkeys(units)]


FLOAT = np.dtype(float)
#: Limit of squared gains, relative to the largest squared gain at the samples where pivots were chosen.
WITHIN = 2.0


class Runner(Protocol):
    """A program that is ready to run."""

    program: Program

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """See `screwgauge.reference.traced.native.Native.bind`."""

    def copy(self) -> Runner:
        """Return a runner that may run concurrently."""


class Bound:
    """A program bound to reusable arrays.

    Attributes:
        values: Arrays that the program fills, kept alive so that no other arrays take their addresses.
        inputs: Arrays that the program reads. Shape (n, m) each.
        unseen: All inputs as one array, or None if every NaN in an input shows in a residual; a NaN in loads, or in y
            of an open tree, does not. Shape (n, m).
        run: Fills the values; returns whether all are finite and no sample is in doubt.
    """

    __slots__ = "inputs", "run", "unseen", "values"

    def __init__(
        self, values: Iterable[Array], inputs: Sequence[Array], unseen: Array | None, run: Callable[[], bool]
    ) -> None:
        self.values, self.inputs, self.unseen, self.run = tuple(values), inputs, unseen, run

    def fits(self, inputs: Sequence[Array], values: Mapping[str, Array]) -> bool:
        """Return True if `values` are the bound output arrays and `inputs` have the shapes of the bound inputs."""
        alike = [x.shape for x in inputs] == [place.shape for place in self.inputs]
        return alike and all(map(is_, values.values(), self.values))

    def fill(self, inputs: Sequence[Array]) -> bool:
        """Fill the arrays from inputs; return False if the inputs do not fit or a sample is in doubt."""
        for x, place in zip(inputs, self.inputs, strict=True):
            if type(x) is not ndarray or x.dtype is not FLOAT or x.shape != place.shape:
                return False
            place[...] = x
        return self.run() and (self.unseen is None or isfinite(self.unseen.sum()))


def runner(
    program: Program, backend: str, plain: Callable[[Program], Runner] = Lanes, dtype: np.dtype[Any] = FLOAT
) -> tuple[Runner, str]:
    """Prepare a program for execution; return the runner and a note.

    Args:
        plain: Class that runs the program without a compiler.
        dtype: Number type of the computation, float64 or float32; arrays are always float64.
    """
    if dtype != FLOAT:
        made, note = _native(program, dtype) if backend == "llvm" else (None, "")
        return Narrow(made or Lanes(program, dtype=dtype)), note
    if backend != "llvm":
        return plain(program), ""
    made, note = _native(program, dtype)
    return (made, note) if made else (plain(program), note.replace("NumPy", "NumPy" if plain is Lanes else "Python"))


def _native(program: Program, dtype: np.dtype[Any]) -> tuple[Native | None, str]:
    """Return a program's machine code, read from disk if cached, and a note; the code is None without a compiler."""
    try:
        from screwgauge.reference.traced import native

        folder, packages = Path(native.__file__).parent, ("screwgauge", "llvmlite")
        version = cache.code_version(folder, packages=packages, extra=native.cpu())
    except ImportError:
        return None, "llvmlite is not installed (extra 'fast'): the program runs with NumPy"
    of_type = () if dtype == FLOAT else (dtype.name,)
    key = cache.digest("program", program.inputs, program.code, program.outputs, program.checks, version, *of_type)
    stored, note = cache.read(key, version)
    if stored is not None and "code" in stored:
        return native.Native(program, stored["code"].tobytes(), dtype), note
    code = native.machine_code(program, dtype)
    failed = cache.write(key, version, {"code": np.frombuffer(code, dtype=np.uint8)})
    return native.Native(program, code, dtype), "; ".join(filter(None, (note, failed)))


class Arcs:
    """Programs with different pivots; each sample uses a program whose pivots are large enough at that sample.

    A program's estimate of the gain depends on its pivots. Where the estimate exceeds its values at the samples for
    which the pivots were chosen, the next program is tried.
    """

    def __init__(self, runners: Sequence[Runner], limits: Sequence[float]) -> None:
        """Combine runners; `limits` holds the largest accepted gain check of each runner."""
        self.runners, self.limits, self.program = runners, limits, runners[0].program

    def bind(
        self, inputs: Sequence[Array], outputs: Sequence[Array], weights: Array | None = None
    ) -> Callable[[], bool]:
        """Bind arrays like `Runner.bind`."""
        first, checks = self.runners[0].bind(inputs, outputs, weights), self.program.checks
        given, results = ([row for block in blocks for row in block] for blocks in (inputs, outputs))

        def run() -> bool:
            sure, rows = first(), np.flatnonzero(~(results[-checks] <= self.limits[0]))
            for runner, limit in zip(self.runners[1:], self.limits[1:], strict=True):
                if rows.size:
                    rows = rows[~(_retry(runner, rows, given, results) <= limit)]
                    sure = weights is None or is_clear(outputs, weights)
            return sure

        return run

    def copy(self) -> Arcs:
        """Return a copy that may run concurrently."""
        return Arcs([runner.copy() for runner in self.runners], self.limits)


def _retry(runner: Runner, rows: Rows, given: Sequence[Array], outputs: Sequence[Array]) -> Array:
    """Solve samples with another program and adopt its values where its gain is smaller; return its gains."""
    out, checks = np.empty((len(outputs), len(rows))), runner.program.checks
    runner.bind([np.array([row[rows] for row in given])], [out])()
    better = ~(outputs[-checks][rows] <= out[-checks])
    for row, new in zip(outputs, out, strict=True):
        row[rows[better]] = new[better]
    gain: Array = out[-checks]
    return gain


def runner_of(traced: Traced, backend: str, dtype: np.dtype[Any] = FLOAT) -> tuple[Runner, str]:
    """Prepare the programs of a trace, see `runner`."""
    made, notes = zip(*(runner(program, backend, dtype=dtype) for program, _ in traced.arcs), strict=True)
    limits = [WITHIN * gain for _, gain in traced.arcs]
    return made[0] if len(made) == 1 else Arcs(made, limits), "; ".join(filter(None, dict.fromkeys(notes)))


def undriven_columns(lay: Layout, problem: Problem) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return undriven independent coordinates: idle coordinates, and given coordinates that must be at rest."""
    if not isinstance(problem.task, GivenMotion) or not lay.mechanism.actuator_names:
        return (), ()
    idle, k = problem.task.idle, len(lay.mechanism.independent)
    given = given_columns(k, idle)
    driven = driven_at_home(lay, given)
    # too few actuators for a motion without idle coordinates: their forces are a least-squares fit
    rest = [i for i in given if i not in driven] if idle or len(lay.mechanism.actuator_names) > len(driven) else []
    return idle, tuple(rest)


def check_traceable(lay: Layout, problem: Problem) -> None:
    """Reject problems that no program covers.

    Raises:
        NotTraceableError: The mechanism has fewer actuators than driven coordinates, or the mass matrix is requested.
    """
    mechanism, undriven = lay.mechanism, sum(map(len, undriven_columns(lay, problem)))
    if ACTUATED & problem.wanted and len(mechanism.actuator_names) < len(mechanism.independent) - undriven:
        reason = "there are fewer actuators than degrees of freedom"
        raise NotTraceableError(reason, mechanism.name, "use the array solver")
    if "mass_matrix" in problem.wanted:
        raise NotTraceableError("programs do not compute mass matrices", mechanism.name, "use the array solver")


def has_contiguous_columns(arrays: Mapping[str, Array]) -> bool:
    """Return True if each column of every array is contiguous in memory."""
    return all(array.strides[0] == array.itemsize for array in arrays.values())
