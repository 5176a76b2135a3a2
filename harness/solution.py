"""What an engine is given and what it returns: `Problem` -> `Solution`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.reference.springs import Spring

if TYPE_CHECKING:
    from screwgauge.forward.problem import Motor

#: Name of a known solution that stands beside the engines of a forward scene.
REFERENCE = "reference"

Rows = NDArray[np.intp]
"""Indices of samples."""

Progress = Callable[[float], None]
"""Takes the share of the work that is done, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The independent coordinates over time.

    Attributes:
        t: Time [s]. Shape (n,).
        y, yd, ydd: Coordinates [rad or m] and derivatives. Shape (n, n_independent).
    """

    t: Array
    y: Array
    yd: Array
    ydd: Array

    def __post_init__(self) -> None:
        for array in (self.t, self.y, self.yd, self.ydd):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.t)

    def part(self, rows: slice | Rows) -> Motion:
        return Motion(self.t[rows], self.y[rows], self.yd[rows], self.ydd[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """A constant force and moment on a body, in world axes.

    Attributes:
        body: Body that the load acts on (signs of an opposite reading are already applied).
        point: Point of action in the body frame [m], or None for its centre of mass. Shape (3,).
        force: [N]. Shape (3,).
        torque: [N m]. Shape (3,).
    """

    body: str
    point: Array | None
    force: Array
    torque: Array

    def numbers(self) -> tuple[str, list[float] | None, list[float], list[float]]:
        """The load as plain values, which can be compared and written down."""
        point = None if self.point is None else self.point.tolist()
        return self.body, point, self.force.tolist(), self.torque.tolist()


@dataclass(frozen=True, slots=True)
class Wording:
    """The text of what was rounded to doubles, for who reads it exactly; None where the doubles are meant.

    Attributes:
        motion: Label -> table of the motion.
        gravity: Three numbers.
        loads: Tables of the loads.
    """

    motion: Mapping[str, Any] | None = None
    gravity: list[Any] | None = None
    loads: tuple[Mapping[str, Any], ...] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """All that an engine is given; it closes its own loops.

    Attributes:
        model: Its model file: mechanism TOML, URDF or MJCF.
        loops: The loops file beside it: what URDF and MJCF cannot say.
        gravity: World axes [m/s^2], shape (3,); None leaves the model file's own.
        rule: ``min_norm`` or ``spherical_axial``.
        quantities: Names of what is wanted; nothing else is computed.
        wording: The text that motion, gravity and loads were rounded from; only ``truth`` reads it.
        springs, motors: What acts besides loads and actuators.
    """

    model: Path
    loops: Path | None
    gravity: Array | None
    loads: tuple[Load, ...]
    rule: str
    motion: Motion
    quantities: frozenset[str]
    progress: Progress = lambda share: None
    wording: Wording = Wording()
    springs: tuple[Spring, ...] = ()
    motors: tuple[Motor, ...] = ()


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
    """An engine that is missing or raised."""

    engine: str
    reason: str


class Engine(Protocol):
    """An engine is a function from a problem to a solution."""

    def __call__(self, problem: Problem) -> Solution: ...


def empty(n: int) -> Array:
    """An array that shows what was never written. Shape (n,)."""
    return np.full(n, np.nan)
