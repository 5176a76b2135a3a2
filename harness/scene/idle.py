"""Coordinates that a scene's motion omits because no actuator drives them, so that forces determine their motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.home import check_home
from screwgauge.problem import GivenMotion
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.assembly_mode import AssemblyMode, BranchPose
from screwgauge.reference.closed.loops import home_equations
from screwgauge.reference.closed_motion import driven_at_home, motion_at
from screwgauge.reference.equations.screws import transpose
from screwgauge.reference.errors import ClosureError, DescriptionError, first_few
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.idle_motion import IdleMotion, State
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, require
from screwgauge.scene.keys import read_keys
from screwgauge.scene.motion import Analytic, Sampled, moved_labels, read_drive

#: Inertia below this share of the whole machine's inertia counts as rounding.
NO_INERTIA = 1e-13
#: Distance from home at which inertia is evaluated at additional poses [rad or lengths of the mechanism].
ASIDE = 0.05


Start = Mapping[str, float | None]
"""``start`` of a coordinate that no actuator drives (default: home), and ``rate`` (default: no momentum along it)."""


@dataclass(frozen=True, slots=True)
class Freedom:
    """Coordinate that no actuator drives, with its initial state.

    Attributes:
        label, number: Name and index of the independent coordinate.
        start, rate: Value and rate at the first time [rad or m, per s].
        chosen: True if the scene specifies the rate.
        rests: True if the coordinate has no inertia and therefore rests.
    """

    label: str
    number: int
    start: float
    rate: float
    chosen: bool
    rests: bool


def read_given(
    table: Any, mechanism: Mechanism, folder: Path, where: str
) -> tuple[Analytic | Sampled, Array | None, tuple[str, ...]]:
    """Read ``[motion]``: the motion as a function of time, the times of its CSV file, and the coordinates it moves.

    Raises:
        DescriptionError: The motion cannot be read, or omits coordinates that actuators drive.
    """
    every = [*mechanism.independent]
    labels = moved_labels(table, every, folder, where)
    if not labels:
        labels = every  # treat an empty motion as a motion of all coordinates
    if labels != every:
        check_driven(mechanism, labels, where)
    return *read_drive(table, labels, folder, where), tuple(labels)


def read_undriven(table: Any, motion: Collection[str], mechanism: Mechanism, where: str) -> dict[str, Start]:
    """Read ``[idle]``: label -> start and rate."""
    check_keys(table, mechanism.independent, where)
    for label in table:
        if label in motion:
            raise DescriptionError(f"'{label}' also has a motion", where, f"remove motion.{label} or idle.{label}")
    return {label: read_keys("idle", entry, f"{where}.{label}") for label, entry in table.items()}


def check_driven(mechanism: Mechanism, labels: Sequence[str], where: str) -> None:
    """Reject a motion unless its coordinates are exactly the independent coordinates that actuators drive.

    Raises:
        DescriptionError: A driven coordinate has no motion, or a coordinate with a motion is not driven.
    """
    lay, every = check_home(mechanism), [*mechanism.independent]
    given = [every.index(label) for label in labels]
    driven = driven_at_home(lay, given)
    for k, label in enumerate(every):
        if label not in labels and len(driven_at_home(lay, [*given, k])) > len(driven):
            require({}, label, where)
    if len(driven) < len(given):
        names = first_few((f"'{every[k]}'" for k in given if k not in driven), 4)
        raise DescriptionError(
            f"no actuator drives {names}", where, "remove them from [motion], because forces determine their motion"
        )


def undriven_labels(mechanism: Mechanism) -> list[str]:
    """Return the independent coordinates that actuators do not drive at home."""
    driven = driven_at_home(check_home(mechanism))
    return [label for k, label in enumerate(mechanism.independent) if k not in driven]


@dataclass(frozen=True, eq=False)
class Followed:
    """Prescribed motion of coordinates as a function of time; all remaining coordinates move under the forces.

    Attributes:
        given: Prescribed motion.
        labels: Coordinates with a prescribed motion.
        stated: Label of a coordinate that no actuator drives -> its entry in the scene.
        since: Time at which the coordinates without an actuator start to move [s].
    """

    given: Analytic | Sampled
    labels: tuple[str, ...]
    stated: Mapping[str, Start]
    since: float
    mechanism: Mechanism
    applied: Applied

    def __call__(self, t: Array) -> GivenMotion:
        """Return the motion at times [s]. Shape (n,).

        Raises:
            ScrewgaugeError: The motion ends before one of the times, or its file lacks a sample at one of them.
        """
        motion = self.interpolate(t)
        if not isinstance(self.given, Sampled):
            return motion
        exact, places = self.given(t), self._places
        y, yd, ydd = (x.copy() for x in (motion.y, motion.yd, motion.ydd))
        for whole, part in ((y, exact.y), (yd, exact.yd), (ydd, exact.ydd)):
            whole[:, places] = part
        return replace(motion, y=y, yd=yd, ydd=self._motion.accelerations(t, y, yd, ydd))

    def interpolate(self, t: Array) -> GivenMotion:
        """Return the motion at times [s], interpolated between the samples of its file."""
        if (early := np.flatnonzero(t < self.since)).size:
            what = f"the motion of coordinates without an actuator starts at t = {self.since:g} s"
            raise DescriptionError(what, "motion", f"remove earlier times, such as {t[early[0]]:g} s")
        return GivenMotion(t, *self._motion(t), self.interpolate, self._motion.idle)

    @property
    def _places(self) -> list[int]:
        labels = [*self.mechanism.independent]
        return [labels.index(label) for label in self.labels]

    def _given_motion(self, t: Array) -> State:
        """Return the prescribed motion, in which all other coordinates keep their start values. Shape (n, k) each."""
        some = self.given.interpolate(t) if isinstance(self.given, Sampled) else self.given(t)
        home = self.mechanism.home[self.mechanism.independent_columns]
        y, yd, ydd = np.tile(home, (len(t), 1)), *np.zeros((2, len(t), len(home)))
        for label, one in self.stated.items():
            if one["start"] is not None:
                y[:, [*self.mechanism.independent].index(label)] = one["start"]
        for whole, part in ((y, some.y), (yd, some.yd), (ydd, some.ydd)):
            whole[:, self._places] = part
        return y, yd, ydd

    @cached_property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Coordinates that no actuator drives."""
        labels = [*self.mechanism.independent]
        every = [k for k in range(len(labels)) if k not in self._places]
        idle = self._select_inertial(every)
        y, yd, _ = self._given_motion(np.array([self.since]))
        rates = {labels.index(label): rate for label, one in self.stated.items() if (rate := one["rate"]) is not None}
        chosen = [k for k in idle if k in rates]
        for k in chosen:
            yd[0, k] = rates[k]
        yd[0] = self._rates_without_momentum(y, yd, idle, [k for k in idle if k not in chosen])
        for k in every:
            if k not in idle and rates.get(k):
                what = f"'{labels[k]}' has no inertia, so its rate cannot be chosen"
                raise DescriptionError(what, f"idle.{labels[k]}", "remove the rate, because the coordinate rests")
        return tuple(Freedom(labels[k], k, float(y[0, k]), float(yd[0, k]), k in chosen, k not in idle) for k in every)

    @cached_property
    def _motion(self) -> IdleMotion:
        if sampled := [load.body for load in self.applied.loads if load.sampled]:
            what = f"coordinates without an actuator need values of the load on '{sampled[0]}' between its samples"
            raise DescriptionError(
                what, "loads", "define the load as a function of time, or give all coordinates a motion"
            )
        idle = [one for one in self.freedoms if not one.rests]
        return IdleMotion(
            mechanism=self.mechanism,
            applied=self.applied,
            given=self._given_motion,
            idle=tuple(one.number for one in idle),
            resting=tuple(one.number for one in self.freedoms if one.rests),
            since=self.since,
            start=np.array([one.start for one in idle]),
            rates=np.array([one.rate for one in idle]),
            breaks=self.given.samples.t if isinstance(self.given, Sampled) else None,
        )

    def _select_inertial(self, undriven: list[int]) -> list[int]:
        """Select as many coordinates as possible with a nonsingular inertia matrix; all others rest."""
        lay = layout(self.mechanism)
        unit = home_equations(lay).sizes[self.mechanism.independent_columns]
        total: Array | float = 0.0
        for q in _about_home(lay):
            at = motion_at(lay, q[None], np.zeros((1, len(unit))))
            at.idle = tuple(undriven)
            N = transpose(at.neutral)[0]
            total = total + sum(N @ v[0] @ p[0].T @ N.T for v, p in at.momenta) * np.outer(*[unit[undriven]] * 2)
        left, kept = np.array(total), list[int]()
        least = NO_INERTIA * self.mechanism.mass * at.loops.length**2
        while len(kept) < len(undriven) and (j := int(np.argmax(np.diagonal(left)))) >= 0 and left[j, j] > least:
            kept.append(j)
            left = left - np.outer(left[:, j], left[j]) / left[j, j]
        return sorted(undriven[j] for j in kept)

    def _rates_without_momentum(self, y: Array, yd: Array, idle: list[int], free: list[int]) -> Array:
        """Return initial rates such that the momentum along the `free` coordinates is zero. Shape (k,)."""
        if not free:
            return np.asarray(yd[0])
        q = AssemblyMode(layout(self.mechanism)).motion(y, np.array([self.since]))
        at = motion_at(layout(self.mechanism), q, yd)
        at.idle, at.resting = tuple(idle), tuple(k for k in range(yd.shape[1]) if k not in {*idle, *self._places})
        N = transpose(at.neutral)[0][[idle.index(k) for k in free]]
        M: Array = np.sum([N @ velocity[0] @ momentum[0].T for velocity, momentum in at.momenta], axis=0)
        rates: Array = yd[0].copy()
        rates[free] = 0.0
        rates[free] = np.linalg.solve(M[:, free], -M @ rates)
        return rates


def _about_home(lay: Layout) -> list[Array]:
    """Return the home pose and nearby poses at which the loops close. Shape (n_q,) each."""
    branch, columns = BranchPose(lay, lay.mechanism.home), lay.mechanism.independent_columns
    unit, poses = branch.system.sizes[columns], [lay.mechanism.home]
    for i in range(2):
        try:
            branch.move(lay.mechanism.home[columns] + ASIDE * unit * np.cos(1.0 + 2.3 * i + 1.7 * np.arange(len(unit))))
        except ClosureError:
            continue
        poses.append(branch.q.copy())
    return poses
