"""Solutions: values with conditions, estimates of their errors, work and cost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter, perf_counter_ns, process_time

import numpy as np

from screwgauge.problem import Rows
from screwgauge.quantities import FLOAT64, NUMBER_TYPES, NumberType
from screwgauge.reference.left_out import LeftOut
from screwgauge.reference.rotations import Array

#: Name of the known solution with which the engines of a simulated scene are compared.
REFERENCE = "reference"
#: The engine that proves how far its numbers may be off: the measure of all others.
TRUTH = "truth"


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """Values of a quantity over time. `array` has shape (n_sample, n_component)."""

    components: tuple[str, ...]
    units: tuple[str, ...]
    array: Array

    def __post_init__(self) -> None:
        if self.array.ndim != 2 or not self.array.shape[1] == len(self.components) == len(self.units):
            raise ValueError(f"{self.array.shape} values for {len(self.components)} components")
        self.array.setflags(write=False)

    def __reduce__(self) -> tuple[type[Values], tuple[object, ...]]:
        return Values, (self.components, self.units, self.array)  # a copy is read-only, too

    def pick(self, components: tuple[str, ...]) -> Values:
        """Some components, in the order given."""
        columns = [self.components.index(name) for name in components]
        return Values(components, tuple(self.units[i] for i in columns), self.array[:, columns].copy())

    def at(self, rows: slice | Rows) -> Values:
        """Some samples."""
        return Values(self.components, self.units, self.array[rows])


@dataclass(frozen=True, slots=True)
class Mismatch:
    """A difference of a model file from the description.

    Attributes:
        key: What has it, and which property: ``coupler.inertia``.
        sentence: Both values in words.
        physical: Whether the machine is another one; rounding of printed digits, and where coordinates count from, are
            not.
    """

    key: str
    sentence: str
    physical: bool = True


@dataclass(frozen=True, slots=True)
class Timing:
    """A measured stage; `covers`: what the clock covers."""

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
        wall_s, cpu_s: Wall and processor time of the engine's own work [s]; NaN where it was not measured.
        steps, evaluations: Steps taken, and accelerations computed.
    """

    wall_s: float
    cpu_s: float = float("nan")
    steps: int = 0
    evaluations: int = 0


#: Whence an engine knows how far its numbers may be off.
ROUNDING, SOFTNESS, ENCLOSURE = "rounding of its largest summands", "softness of constraints", "enclosure"


@dataclass(frozen=True, slots=True, eq=False)
class Error:
    """Error of one quantity, as its engine states it.

    Attributes:
        scaled: At each sample, over the largest magnitude of the unit over all samples, worst unit; what is zero within
            rounding is measured by its largest summand. Infinite where not one digit is right, or there is no number.
            Shape (n,).
        absolute: Unit -> what its `source` makes of a number that may be zero [unit].
        condition: Condition number of all that it was solved from; NaN where it is not known. Shape (n,).
        source: What makes the absolute error.
        radius: Rigorous bounds of the distance to the true value; None of an engine that has none. The shape of the
            values.
        precision: Name of the number type that makes them. Where it is another than float64, who loads the engine has
            estimated the errors; those that an engine states are none of these.
    """

    scaled: Array
    absolute: Mapping[str, float] = field(default_factory=dict)
    condition: Array | None = None
    source: str = ROUNDING
    radius: Array | None = None
    precision: str = FLOAT64.name

    @property
    def kind(self) -> NumberType:
        """The number type that makes them."""
        return NUMBER_TYPES[self.precision]

    @property
    def largest(self) -> float:
        """The largest scaled error; infinite where one is not known."""
        return float(np.nan_to_num(self.scaled, nan=np.inf, posinf=np.inf).max(initial=0.0))

    @property
    def worst_condition(self) -> float:
        """The largest condition number; NaN where none is known."""
        return float("nan") if self.condition is None else float(np.max(self.condition))


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Answer of a model to a task of any kind.

    Attributes:
        values: Quantity -> values.
        condition: Condition number of the closing system with the selection of y, as it was solved. Shape (n,).
        notes: Sentences for the report, such as samples where a rule is singular.
        errors: Quantity -> how far its numbers may be off. What it says above 1e-8 never makes two numbers agree, see
            `judging.allowance`.
        assembly: All joint coordinates [rad or m] in the order of the description, which tell the assembly that was
            solved, whatever was asked for; None where it is not known. Shape (n, n_q).
        rows: The samples that it solved, if not all of them; its arrays are NaN at the others. Shape (n_solved,).
        setting: Method and settings, in words.
        work: Of a simulation: what motors, loads and dampers have put in since the start [J]; NaN where it is not
            known. Shape (n,).
        stopped: Why a simulation ended early, empty if it did not.
        cost: What it took, where the engine has measured it.
        warnings: What the engine itself warned of, and what its model file says otherwise than the description or
            beyond it; these are notes, too. With them, agreement is not plain.
        otherwise: Mismatches of its model file, the largest first; nothing that an engine says of itself.
        lacks: Quantity that its engine does not give -> why not. Who loads the engine writes it, never the engine.
        left_out: What acts in a model file of the user's own, and in no other engine.
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

    def arranged(self, order: Mapping[str, tuple[str, ...]]) -> Solution:
        """The solution with the components of some quantities in another order."""
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
        """Number of samples that it solved."""
        return len(self.condition) if self.rows is None else len(self.rows)


def reference_first(solutions: Iterable[Solution]) -> list[Solution]:
    """The solutions in their order, but for the truth, which comes first."""
    return sorted(solutions, key=lambda one: one.engine != TRUTH)


def common_rows(n: int, *solutions: Solution) -> Rows:
    """The samples, of n, that all of them solved."""
    rows: Rows = np.arange(n)
    for solution in solutions:
        if solution.rows is not None:
            rows = np.intersect1d(rows, solution.rows)
    return rows


@dataclass(frozen=True, slots=True)
class Failure:
    """An engine that is missing or raised. `traceback`: where, for those who ask."""

    engine: str
    reason: str
    traceback: str = ""


def empty(n: int) -> Array:
    """An array that shows what was never written. Shape (n,)."""
    return np.full(n, np.nan)


@dataclass(slots=True)
class Clock:
    """Adds up the time of each stage over the parts of a trajectory."""

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
    """Wall and processor time, without what is done aside."""

    def __init__(self) -> None:
        self.wall, self.cpu = perf_counter(), process_time()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Context whose time does not count."""
        wall, cpu = perf_counter(), process_time()
        yield
        self.wall += perf_counter() - wall
        self.cpu += process_time() - cpu

    def cost(self, steps: int = 0, evaluations: int = 0) -> Cost:
        """Time spent since the start."""
        return Cost(perf_counter() - self.wall, process_time() - self.cpu, steps, evaluations)
