"""Problems for engines: a task, applied forces on a mechanism, a redundancy rule, and requested quantities."""

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
"""Function that takes the completed share of the work, 0 to 1."""

Report = Callable[[str, float], None]
"""Function that takes the name of a step and its completed share, 0 to 1."""


def spread(n: int, most: int) -> Rows:
    """Return indices of at most `most` of `n` samples, evenly spread and including both ends."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(np.intp))


def given_columns(k: int, idle: Collection[int]) -> list[int]:
    """Return the indices, out of k, of the independent coordinates that are not idle and thus have a given motion."""
    return [i for i in range(k) if i not in idle]


def quiet(share: float) -> None:
    """Ignore a progress report."""


def silent(step: str, share: float) -> None:
    """Ignore a progress report that names a step."""


class _ReadOnly:
    """Base class of records with read-only arrays."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]  # of the record
            if isinstance(array := getattr(self, field.name), np.ndarray):
                array.setflags(write=False)


@dataclass(frozen=True, slots=True, eq=False)
class GivenMotion(_ReadOnly):
    """Inverse dynamics task: the independent coordinates as functions of time.

    Attributes:
        t: Time [s]. Shape (n,).
        y, yd, ydd: Independent coordinates [rad or m] and their derivatives. Shape (n, n_independent).
        drive: Function that returns the motion at given times, if available.
        idle: Indices of the independent coordinates that no actuator drives. Their y and yd come from integrating the
            motion due to the forces, and their ydd is accurate to rounding; an engine may solve for this ydd itself.
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

    def reorder(self, columns: list[int]) -> GivenMotion:
        """Return the motion with its independent coordinates in a given order."""
        drive = None if self.drive is None else partial(_reorder, self.drive, columns)
        idle = tuple(columns.index(i) for i in self.idle)
        return GivenMotion(self.t, self.y[:, columns], self.yd[:, columns], self.ydd[:, columns], drive, idle)


def _reorder(drive: Callable[[Array], GivenMotion], columns: list[int], t: Array) -> GivenMotion:
    """Return the motion at times [s] with its independent coordinates in a given order."""
    return drive(t).reorder(columns)


@dataclass(frozen=True, slots=True)
class Integration:
    """Method and tolerances of an integration.

    Attributes:
        name: ``DOP853`` for smooth motion, ``Radau`` or ``BDF`` for stiff motion.
        rtol, atol: Tolerances of a step; the same value applies to rad, m and their rates.
        near: Condition number of the closed loops above which the integrator steps over a pose.
    """

    name: str = "DOP853"
    rtol: float = 1e-10
    atol: float = 1e-12
    near: float = 1e5


@dataclass(frozen=True, slots=True, eq=False)
class InitialValue(_ReadOnly):
    """Simulation task: an initial state from which the motion is integrated.

    Attributes:
        start, rates: Independent coordinates [rad or m] and their rates at the start. Shape (k,).
        since: Time of the start [s].
        t: Increasing output times [s], not before the start. Shape (n,).
        integration: Method and tolerances, for engines that integrate with scipy's methods.
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
        """The output times, preceded by the start time [s]. Shape (n,) or (n + 1,)."""
        return self.t if self.t[0] == self.since else np.concatenate([[self.since], self.t])

    def reorder(self, columns: list[int]) -> InitialValue:
        """Return the initial value with its independent coordinates in a given order."""
        return replace(self, start=self.start[columns], rates=self.rates[columns])


@dataclass(frozen=True, slots=True, eq=False)
class States(_ReadOnly):
    """Sampled states of an open tree, used unmodified: the engine does not close loops first.

    Attributes:
        coordinates: Joint coordinates of the tree, in the order of the arrays.
        q, v: Coordinates [rad or m] and rates. Shape (n, n_v).
        a: Accelerations, for inverse dynamics of the tree; None if the accelerations are to be computed. Shape (n,
            n_v).
        tau: Total force along the coordinates, excluding gravity [N or N m], for forward dynamics; None if the forces
            are to be computed. Shape (n, n_v).
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
    """Strings of a scene before rounding to doubles, for exact readers; None where the doubles are exact.

    Attributes:
        motion: Label -> table of the motion.
        gravity: The three components of gravity.
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
        loops: The loops file of a URDF or MJCF, with the data that these formats cannot express.
    """

    model: Path
    loops: Path | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A problem for a loaded model, which closes its own loops. Frozen; can be pickled.

    Attributes:
        applied: Applied forces other than actuator forces.
        task: Given motion, initial value or states.
        wanted: Names of the quantities to compute.
        rule: Rule that resolves redundant actuation: ``min_norm`` or ``spherical_axial``.
        wording: Strings of motion, gravity and loads before rounding; only the engine ``truth`` reads them.
        points: Named points, whose velocities are components of ``jacobian``.
    """

    applied: Applied
    task: Task
    wanted: frozenset[str]
    rule: str = "min_norm"
    wording: Wording = Wording()
    points: tuple[Point, ...] = ()


def check_fits(problem: Problem, mechanism: Mechanism, where: str) -> None:
    """Reject a problem that does not fit a description.

    Raises:
        ModelFileError: The problem has a different number of independent coordinates, or a load on a body that
            the description lacks.
    """
    task, k = problem.task, len(mechanism.independent)
    given = {"motion": task.y.shape[1]} if isinstance(task, GivenMotion) else {}
    if isinstance(task, InitialValue):
        given = {"start": len(task.start)}
    for what, n in given.items():
        if n != k:
            differs = f"has {k} independent coordinates, but the {what} has {n}"
            raise ModelFileError(differs, where, "choose a description of the same mechanism")
    for load in problem.applied.loads:
        if load.body not in mechanism.body_index:
            raise ModelFileError(f"has no body '{load.body}'", where, "use the body names of the scene")
