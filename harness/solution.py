"""What an engine returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from screwgauge.problem import Rows
from screwgauge.reference.rotations import Array

#: Name of a known solution that stands beside the engines of a forward scene.
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


@dataclass(frozen=True, slots=True)
class Timing:
    """One measured stage. `covers` says what the clock covers."""

    engine: str
    setting: str
    stage: str
    n_sample: int
    min_s: float
    median_s: float
    covers: str


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """What an engine returns.

    Attributes:
        values: Quantity -> values.
        condition: Condition number of the closing system with the selection of y, as it was solved. Shape (n,).
        notes: Sentences for the report, such as samples where a rule is singular.
        tolerances: Absolute tolerances that the engine derives itself, quantity -> value.
        radius: Rigorous bounds of the distance to the true value, quantity -> array of the shape of its values.
            An engine that has them is the reference of the others.
        estimate: Quantity -> estimated error at each sample, over its largest magnitude over all samples, worst unit;
            infinite where not one digit is right, or there is no number. Shape (n,).
        conditions: Quantity -> condition number of all that it was solved from. Shape (n,).
        rows: The samples that it solved, if not all of them; its arrays are NaN at the others. Shape (n_solved,).
    """

    engine: str
    version: str
    values: Mapping[str, Values]
    condition: Array
    timings: tuple[Timing, ...] = ()
    notes: tuple[str, ...] = ()
    tolerances: Mapping[str, float] = field(default_factory=dict)
    radius: Mapping[str, Array] = field(default_factory=dict)
    estimate: Mapping[str, Array] = field(default_factory=dict)
    conditions: Mapping[str, Array] = field(default_factory=dict)
    rows: Rows | None = None


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


@dataclass(frozen=True, slots=True, eq=False)
class ForwardSolution:
    """A motion as an engine integrated it, as far as it came; m of the n times were reached.

    Attributes:
        engine, version, setting: Who made it, and how.
        q, v, a: Joint coordinates of the description, in its order, unwrapped, with rates and accelerations
            [rad or m, per s, per s^2]. Shape (m, n_q).
        work: What motors, loads and dampers have put in since the start [J]; NaN where it is not known. Shape (m,).
        condition: Condition number of the closed loops. Shape (m,).
        steps, evaluations: How many steps were taken, and accelerations computed.
        seconds: Wall time of the integration alone [s].
        cpu: Processor time of the same [s]; NaN where it was not measured.
        stopped: Why it ended early, empty if it did not.
        notes: Sentences for the report.
    """

    engine: str
    version: str
    setting: str
    q: Array
    v: Array
    a: Array
    work: Array
    condition: Array
    steps: int
    evaluations: int
    seconds: float
    stopped: str = ""
    notes: tuple[str, ...] = ()
    cpu: float = float("nan")


def empty(n: int) -> Array:
    """An array that shows what was never written. Shape (n,)."""
    return np.full(n, np.nan)
