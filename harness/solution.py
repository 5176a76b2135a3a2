"""Solutions of engines: values with condition numbers, error estimates, work and cost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter, perf_counter_ns, process_time

import numpy as np
from numpy.typing import NDArray

from screwgauge.problem import Rows
from screwgauge.quantities import FLOAT64, NUMBER_TYPES, NumberType
from screwgauge.reference.left_out import LeftOut
from screwgauge.reference.rotations import Array

#: Name of the known solution against which the engines of a simulated scene are compared.
REFERENCE = "reference"
#: The engine that proves bounds of its errors and serves as reference for all others.
TRUTH = "truth"


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """Values of a quantity over time, with `array` of shape (n_sample, n_component)."""

    components: tuple[str, ...]
    units: tuple[str, ...]
    array: Array

    def __post_init__(self) -> None:
        if self.array.ndim != 2 or not self.array.shape[1] == len(self.components) == len(self.units):
            raise ValueError(f"{self.array.shape} values for {len(self.components)} components")
        self.array.setflags(write=False)

    def __reduce__(self) -> tuple[type[Values], tuple[object, ...]]:
        return Values, (self.components, self.units, self.array)  # a copy is also read-only

    def pick(self, components: tuple[str, ...]) -> Values:
        """Return the given components, in the given order."""
        columns = [self.components.index(name) for name in components]
        return Values(components, tuple(self.units[i] for i in columns), self.array[:, columns].copy())

    def at(self, rows: slice | Rows) -> Values:
        """Return the values at the given samples."""
        return Values(self.components, self.units, self.array[rows])


@dataclass(frozen=True, slots=True)
class Mismatch:
    """A mismatch between a model file and the description.

    Attributes:
        key: Element and property that differ: ``coupler.inertia``.
        sentence: Both values in words.
        physical: True if the machine differs physically; rounded digits and shifted coordinate zeros are not physical.
    """

    key: str
    sentence: str
    physical: bool = True


@dataclass(frozen=True, slots=True)
class Timing:
    """Timing of a stage; `covers` describes what the clock includes."""

    engine: str
    setting: str
    stage: str
    n_sample: int
    min_s: float
    median_s: float
    covers: str


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of a simulation, or of a pass over states.

    Attributes:
        wall_s, cpu_s: Wall and processor time of the engine's own work [s]; NaN if not measured.
        steps, evaluations: Number of steps taken, and of accelerations computed.
    """

    wall_s: float
    cpu_s: float = float("nan")
    steps: int = 0
    evaluations: int = 0


#: Sources of an engine's error estimate.
ROUNDING, SOFTNESS, ENCLOSURE = "rounding of its largest summands", "softness of constraints", "enclosure"


@dataclass(frozen=True, slots=True, eq=False)
class Error:
    """Error of one quantity, as its engine estimates it.

    Attributes:
        scaled: Error at each sample divided by the unit's largest magnitude over all samples, maximum over units; a
            value that is zero within rounding is compared with its largest term. Infinite where no digit is correct or
            the value is missing. Shape (n,).
        absolute: Unit -> absolute error from `source`, for values that may be zero [unit].
        condition: Condition number of the systems that determine the quantity; NaN if unknown. Shape (n,).
        source: Source of the absolute error.
        radius: Rigorous bounds on the distance to the true value, with the shape of the values; None if the engine does
            not compute bounds.
        precision: Name of the number type of the computation. If it is not float64, the caller of the engine estimates
            the errors and ignores the engine's own estimate.
    """

    scaled: Array
    absolute: Mapping[str, float] = field(default_factory=dict)
    condition: Array | None = None
    source: str = ROUNDING
    radius: Array | None = None
    precision: str = FLOAT64.name

    @property
    def kind(self) -> NumberType:
        """The number type of the computation."""
        return NUMBER_TYPES[self.precision]

    @property
    def largest(self) -> float:
        """The largest scaled error; infinite if any is unknown."""
        return float(np.nan_to_num(self.scaled, nan=np.inf, posinf=np.inf).max(initial=0.0))

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """True at samples whose scaled error exceeds the limit of the number type or is unknown. Shape (n,)."""
        return ~(self.scaled <= self.kind.limit)

    @property
    def ok(self) -> bool:
        """True if no sample is flagged."""
        return not self.flagged.any()

    @property
    def worst(self) -> int:
        """Index of the sample with the largest scaled error."""
        return int(np.argmax(self.scaled))

    @property
    def worst_condition(self) -> float:
        """The largest condition number; NaN if none is known."""
        return float("nan") if self.condition is None else float(np.max(self.condition))


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Answer of a model to a task of any kind.

    Attributes:
        values: Quantity -> values.
        condition: Condition number of the solved closing system, including the rows that select y. Shape (n,).
        notes: Messages for the report, such as samples where a rule is singular.
        errors: Quantity -> estimated error. An estimate above 1e-8 never makes two numbers agree, see
            `judging.allowance`.
        assembly: All joint coordinates [rad or m] in the order of the description, which identify the solved assembly
            mode even if they were not requested; None if unknown. Shape (n, n_q).
        rows: Indices of the solved samples, None if all are solved; arrays are NaN at unsolved samples. Shape
            (n_solved,).
        setting: Description of the method and its settings.
        work: For a simulation, work of motors, loads and dampers since the start [J]; NaN if unknown. Shape (n,).
        stopped: Reason why a simulation ended early; empty if it did not.
        cost: Cost of the solution, if the engine measured the cost.
        warnings: Warnings from the engine, and content of its model file that contradicts or exceeds the description;
            `notes` repeats them. With warnings, agreement is qualified.
        otherwise: Mismatches between the engine's model file and the description, largest first; engines do not set
            this.
        lacks: Quantity that the engine does not compute -> reason. Set by the caller of the engine, never by the
            engine.
        left_out: Forces in a user's own model file that no other engine applies.
    """

    engine: str
    version: str
    values: Mapping[str, Values]
    condition: Array
    timings: tuple[Timing, ...] = ()
    notes: tuple[str, ...] = ()
    errors: Mapping[str, Error] = field(default_factory=dict)
    assembly: Array | None = None
    rows: Rows | None = None
    setting: str = ""
    work: Array | None = None
    stopped: str = ""
    cost: Cost | None = None
    warnings: tuple[str, ...] = ()
    otherwise: tuple[Mismatch, ...] = ()
    lacks: Mapping[str, str] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()

    def reorder(self, order: Mapping[str, tuple[str, ...]]) -> Solution:
        """Return the solution with the components of given quantities in a given order."""
        moved = {name: order[name] for name in {*order} & {*self.values} if order[name] != self.values[name].components}
        values = {name: self.values[name].pick(components) for name, components in moved.items()}
        errors = dict(self.errors)
        for name, components in moved.items():
            if name in errors and (radius := errors[name].radius) is not None:
                columns = [self.values[name].components.index(c) for c in components]
                errors[name] = replace(errors[name], radius=radius[:, columns])
        return replace(self, values={**self.values, **values}, errors=errors)

    @property
    def n_solved(self) -> int:
        """Number of solved samples."""
        return len(self.condition) if self.rows is None else len(self.rows)


def reference_first(solutions: Iterable[Solution]) -> list[Solution]:
    """Return the solutions in order, except that the solution of `TRUTH` comes first."""
    return sorted(solutions, key=lambda one: one.engine != TRUTH)


def common_rows(n: int, *solutions: Solution) -> Rows:
    """Return the indices, out of n samples, of the samples that all solutions contain."""
    rows: Rows = np.arange(n)
    for solution in solutions:
        if solution.rows is not None:
            rows = np.intersect1d(rows, solution.rows)
    return rows


@dataclass(frozen=True, slots=True)
class Failure:
    """Failure of an engine that is missing or raised an error; `traceback` holds the details on request."""

    engine: str
    reason: str
    traceback: str = ""


def empty(n: int) -> Array:
    """Return an array of NaN, which reveals unwritten entries. Shape (n,)."""
    return np.full(n, np.nan)


@dataclass(slots=True)
class Clock:
    """Clock that accumulates the time of each stage over the parts of a trajectory."""

    spent: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = perf_counter_ns()
        yield
        self.spent[name] = self.spent.get(name, 0.0) + (perf_counter_ns() - start) * 1e-9

    def timings(self, engine: str, setting: str, n: int) -> tuple[Timing, ...]:
        return tuple(
            Timing(engine, setting, stage, n, seconds, seconds, "whole trajectory, once")
            for stage, seconds in self.spent.items()
        )


class Stopwatch:
    """Wall and processor time, excluding work within `pause`."""

    def __init__(self) -> None:
        self.wall, self.cpu = perf_counter(), process_time()

    @contextmanager
    def pause(self) -> Iterator[None]:
        """Exclude the time spent in the context."""
        wall, cpu = perf_counter(), process_time()
        yield
        self.wall += perf_counter() - wall
        self.cpu += process_time() - cpu

    def cost(self, steps: int = 0, evaluations: int = 0) -> Cost:
        """Return the cost since the start."""
        return Cost(perf_counter() - self.wall, process_time() - self.cpu, steps, evaluations)
