"""Problems for engines: what acts on a mechanism, the task, the rule, and the wanted quantities."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.applied import Applied
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import Array

Rows = NDArray[np.intp]
"""Indices of samples."""

Progress = Callable[[float], None]
"""Takes the share of the work that is done, 0 to 1."""

Report = Callable[[str, float], None]
"""Takes the name of a step and the share of it that is done, 0 to 1."""


def spread(n: int, most: int) -> Rows:
    """Rows of `n` samples: at most `most`, evenly spread, both ends among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.intp))


def given_columns(k: int, idle: Collection[int]) -> list[int]:
    """Numbers of the independent coordinates whose motion is given: those below k that are not idle."""
    return [i for i in range(k) if i not in idle]


def quiet(share: float) -> None:
    """A progress that is not shown."""


def silent(step: str, share: float) -> None:
    """A report that is not shown."""


@dataclass(frozen=True, slots=True, eq=False)
class _ReadOnly:
    """Data whose arrays cannot be written to."""

    def __post_init__(self) -> None:
        for field in fields(self):
            if isinstance(array := getattr(self, field.name), np.ndarray):
                array.setflags(write=False)


@dataclass(frozen=True, slots=True, eq=False)
class GivenMotion(_ReadOnly):
    """Inverse dynamics: the independent coordinates over time.

    Attributes:
        t: Time [s]. Shape (n,).
        y, yd, ydd: Coordinates [rad or m] and derivatives. Shape (n, n_independent).
        drive: The motion as a function of time, where it is one.
        idle: Numbers of the independent coordinates that no actuator drives: their motion follows from the forces. y
            and yd are as they were integrated, ydd follows from these to rounding; an engine may solve it itself.
    """

    t: Array
    y: Array
    yd: Array
    ydd: Array
    drive: Callable[[Array], GivenMotion] | None = None
    idle: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.t)

    def part(self, rows: slice | Rows) -> GivenMotion:
        return GivenMotion(self.t[rows], self.y[rows], self.yd[rows], self.ydd[rows], self.drive, self.idle)

    def ordered(self, columns: list[int]) -> GivenMotion:
        """The motion with its independent coordinates in another order."""
        drive = None if self.drive is None else partial(_reorder, self.drive, columns)
        idle = tuple(columns.index(i) for i in self.idle)
        return GivenMotion(self.t, self.y[:, columns], self.yd[:, columns], self.ydd[:, columns], drive, idle)


def _reorder(drive: Callable[[Array], GivenMotion], columns: list[int], t: Array) -> GivenMotion:
    """A motion whose independent coordinates come in another order, at times [s]."""
    return drive(t).ordered(columns)


@dataclass(frozen=True, slots=True)
class Integration:
    """Method and tolerances of an integration.

    Attributes:
        name: ``DOP853`` for smooth motion, ``Radau`` or ``BDF`` for stiff ones.
        rtol, atol: Tolerances of a step, for rad, m and their rates alike.
        near: Condition number of the closed loops above which a pose is stepped over.
    """

    name: str = "DOP853"
    rtol: float = 1e-10
    atol: float = 1e-12
    near: float = 1e5


@dataclass(frozen=True, slots=True, eq=False)
class InitialValue(_ReadOnly):
    """Simulation: a start, from which the motion is integrated.

    Attributes:
        start, rates: Independent coordinates [rad or m] and their rates at the start. Shape (k,).
        since: Time of the start [s].
        t: Where the motion is wanted [s], increasing, from the start on. Shape (n,).
        integration: Method and tolerances, for engines that integrate by the methods of scipy.
    """

    start: Array
    rates: Array
    since: float
    t: Array
    integration: Integration = Integration()

    def __len__(self) -> int:
        return len(self.t)

    @property
    def grid(self) -> Array:
        """The wanted times, that of the start before them [s]. Shape (n,) or (n + 1,)."""
        return self.t if self.t[0] == self.since else np.concatenate([[self.since], self.t])

    def ordered(self, columns: list[int]) -> InitialValue:
        """The initial value with its independent coordinates in another order."""
        return replace(self, start=self.start[columns], rates=self.rates[columns])


@dataclass(frozen=True, slots=True, eq=False)
class States(_ReadOnly):
    """Sampled states of an open tree, taken as they are: nothing is closed first.

    Attributes:
        coordinates: Joint coordinates of the tree, as the arrays have them.
        q, v: Coordinates [rad or m] and rates. Shape (n, n_v).
        a: Accelerations, for inverse dynamics of the tree; None if these are wanted. Shape (n, n_v).
        tau: All that acts along the coordinates besides gravity [N or N m], for accelerations; None if forces are
            wanted. Shape (n, n_v).
    """

    coordinates: tuple[str, ...]
    q: Array
    v: Array
    a: Array | None = None
    tau: Array | None = None

    def __len__(self) -> int:
        return len(self.q)


Task = GivenMotion | InitialValue | States


@dataclass(frozen=True, slots=True)
class Wording:
    """The text of what was rounded to doubles, for whoever reads it exactly; None where the doubles are meant.

    Attributes:
        motion: Label -> table of the motion.
        gravity: Three numbers.
        loads: Tables of the loads.
    """

    motion: Mapping[str, Any] | None = None
    gravity: list[Any] | None = None
    loads: tuple[Mapping[str, Any], ...] | None = None


@dataclass(frozen=True, slots=True)
class ModelFiles:
    """Files that an engine loads.

    Attributes:
        model: Mechanism TOML, URDF or MJCF.
        loops: The loops file of a URDF or MJCF: what these formats cannot express.
    """

    model: Path
    loops: Path | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A question to a loaded model, which closes its own loops. Frozen, and it pickles.

    Attributes:
        applied: What acts besides actuators.
        task: What is given.
        wanted: Names of quantities; nothing else is computed.
        rule: What fixes redundant actuation: ``min_norm`` or ``spherical_axial``.
        wording: The text that motion, gravity and loads were rounded from; only ``truth`` reads it.
        points: Named ones, whose velocities are components of ``jacobian``.
    """

    applied: Applied
    task: Task
    wanted: frozenset[str]
    rule: str = "min_norm"
    wording: Wording = Wording()
    points: tuple[Point, ...] = ()


def check_fits(problem: Problem, mechanism: Mechanism, where: str) -> None:
    """Refuses a problem that is not that of a description.

    Raises:
        ModelFileError: It has another number of independent coordinates, or loads on other bodies.
    """
    task, k = problem.task, len(mechanism.independent)
    given = {"motion": task.y.shape[1]} if isinstance(task, GivenMotion) else {}
    if isinstance(task, InitialValue):
        given = {"start": len(task.start)}
    for what, n in given.items():
        if n != k:
            differs = f"has {k} independent coordinates, the {what} {n}"
            raise ModelFileError(differs, where, "name a description of the same mechanism")
    for load in problem.applied.loads:
        if load.body not in mechanism.body_index:
            raise ModelFileError(f"has no body '{load.body}'", where, "keep the names of the scene")
