"""Solutions: values with conditions, estimates of their errors, work and cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter, perf_counter_ns, process_time

import numpy as np

from screwgauge.problem import Rows
from screwgauge.reference.rotations import Array

#: Name of the known solution with which the engines of a simulated scene are compared.
REFERENCE = "reference"


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """One quantity over time. `array` has shape (n_sample, n_component)."""

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
class Timing:
    """One measured stage; `covers`: what the clock covers."""

    engine: str
    setting: str
    stage: str
    n_sample: int
    min_s: float
    median_s: float
    covers: str


@dataclass(frozen=True, slots=True)
class Cost:
    """What a simulation, or a pass over states, took.

    Attributes:
        wall_s, cpu_s: Wall and processor time of the engine's own work [s]; NaN where it was not measured.
        steps, evaluations: Steps taken, and accelerations computed.
    """

    wall_s: float
    cpu_s: float = float("nan")
    steps: int = 0
    evaluations: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """What a model answers, for every kind of task.

    Attributes:
        values: Quantity -> values.
        condition: Condition number of the closing system with the selection of y, as it was solved. Shape (n,).
        notes: Sentences for the report, such as samples where a rule is singular.
        tolerances: Errors that the engine itself admits, quantity -> unit -> absolute error [unit]: what rounding of
            its largest summands makes of a number that may be zero, what soft constraints leave.
        stated: Quantity -> what its numbers may be off by [their units], as whoever recorded them says.
        radius: Rigorous bounds of the distance to the true value, quantity -> array of the shape of its values.
            An engine that has them is the reference of the others.
        estimate: Quantity -> estimated error at each sample, over its largest magnitude over all samples, worst unit;
            infinite where not one digit is right, or there is no number. Shape (n,).
        integration: Of a simulation: quantity -> unit -> estimated error of its integration up to each sample [unit],
            NaN where that is not known. Shape (n,). Empty where all agrees without it, see `judging.trust`.
        conditions: Quantity -> condition number of all that it was solved from. Shape (n,).
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
        otherwise: What of the latter is physical, with both values, the largest difference first.
    """

    engine: str
    version: str
    values: Mapping[str, Values]
    condition: Array
    timings: tuple[Timing, ...] = ()
    notes: tuple[str, ...] = ()
    tolerances: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    stated: Mapping[str, float] = field(default_factory=dict)
    radius: Mapping[str, Array] = field(default_factory=dict)
    estimate: Mapping[str, Array] = field(default_factory=dict)
    integration: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    conditions: Mapping[str, Array] = field(default_factory=dict)
    assembly: Array | None = None
    rows: Rows | None = None
    setting: str = ""
    work: Array | None = None
    stopped: str = ""
    cost: Cost | None = None
    warnings: tuple[str, ...] = ()
    otherwise: tuple[str, ...] = ()

    def arranged(self, order: Mapping[str, tuple[str, ...]]) -> Solution:
        """The solution with the components of some quantities in another order."""
        moved = {name: order[name] for name in {*order} & {*self.values} if order[name] != self.values[name].components}
        values = {name: self.values[name].pick(components) for name, components in moved.items()}
        radius = {
            name: self.radius[name][..., [self.values[name].components.index(c) for c in components]]
            for name, components in moved.items()
            if name in self.radius
        }
        return replace(self, values={**self.values, **values}, radius={**self.radius, **radius})

    @property
    def n_solved(self) -> int:
        """How many of the samples it solved."""
        return len(self.condition) if self.rows is None else len(self.rows)


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
        """What is done inside does not count."""
        wall, cpu = perf_counter(), process_time()
        yield
        self.wall += perf_counter() - wall
        self.cpu += process_time() - cpu

    def cost(self, steps: int = 0, evaluations: int = 0) -> Cost:
        """What was spent since the start."""
        return Cost(perf_counter() - self.wall, process_time() - self.cpu, steps, evaluations)
