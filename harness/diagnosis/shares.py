"""Torques of A with some of B's values, at motions that A's loops admit: what each cause makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.diagnosis.facts.fact import STANDARD, Fact, known_gravity
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import PASSIVE, applied, sequence
from screwgauge.models.kinematics import draw, near_home, plant
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.linear import null_space
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import DEPENDENT, closed, equations
from screwgauge.witness.dynamics import inverse_dynamics
from screwgauge.witness.tree import TreeStates

#: How many states are drawn: more than the ten inertial parameters of a body need to be distinguished.
STATES = 24
#: Scaled torques that differ by no more are the same: own dynamics leave 1e-14, MuJoCo's tensors 5e-14.
UNSEEN = 1e-11
#: Scaled torques of readings that agree: loops are closed to about 1e-11.
SAME = 1e-9


def weighed(reading: Reading) -> Reading:
    """A reading with gravity, also of a file that cannot say it."""
    return replace(reading, gravity=known_gravity(reading.gravity))


def freedom_left(reading: Reading, seed: int = 0) -> int:
    """Freedoms that closures and couplings leave at poses near home; -1 where none closes."""
    tree = plant(reading)
    if not (reading.closures or reading.couplings):
        return reading.freedom
    states, _ = closed(tree, near_home(tree, 3, _units(reading), seed))
    ranks = [int(np.linalg.matrix_rank(rows, tol=1e-7)) for rows in equations(tree, states).rows]
    return reading.freedom - min(ranks) if ranks else -1


def _slides(reading: Reading) -> NDArray[np.bool_]:
    """Which velocities are of slides. Shape (n_freedom,)."""
    kinds = [joint.kind for joint in reading.joints.values() for _ in range(FREEDOMS[joint.kind])]
    return np.array([kind == "slide" for kind in kinds], dtype=bool)


def _units(reading: Reading) -> Array:
    """What counts as 1 of each velocity. Shape (n_freedom,)."""
    return np.where(_slides(reading), _reach(reading), 1.0)


def _reach(reading: Reading) -> float:
    """Largest distance of a body's centre of mass from that of all, whatever the frames of the file are [m]."""
    bodies = [body for body in reading.bodies.values() if body.mass > 0.0]
    if not bodies:
        return 1.0
    centres = np.array([body.centre for body in bodies])
    middle = np.average(centres, axis=0, weights=[body.mass for body in bodies])
    return float(np.linalg.norm(centres - middle, axis=1).max()) or 1.0


def components(reading: Reading) -> list[tuple[str, str]]:
    """Name and unit of the force along each velocity."""
    ends = {"hinge": ("",), "slide": ("",), "ball": (".x", ".y", ".z"), "free": (".wx", ".wy", ".wz", ".x", ".y", ".z")}
    return [
        (name + end, "N" if joint.kind == "slide" or (joint.kind == "free" and k > 2) else "N m")
        for name, joint in reading.joints.items()
        for k, end in enumerate(ends[joint.kind])
    ]


@dataclass(frozen=True, slots=True)
class Largest:
    """The largest difference of torques: scaled, and as it is, with component and unit."""

    scaled: float
    value: float
    component: str
    unit: str


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques of a machine and of what it becomes, at the same motions, which its loops admit.

    Attributes:
        reading: The machine, with gravity.
        seed: Of the states.
    """

    reading: Reading
    seed: int = 0

    @cached_property
    def states(self) -> TreeStates:
        """Random states; of loops, closed ones near home, with velocities and accelerations that these admit."""
        tree = plant(self.reading)
        if not (self.reading.closures or self.reading.couplings):
            return draw(self.reading, STATES, self.seed)
        return closed(tree, near_home(tree, STATES, _units(self.reading), self.seed))[0]

    @cached_property
    def bases(self) -> list[Array] | None:
        """Motions that loops leave at each state, in `_units`, shape (n_freedom, m); None of an open tree."""
        if not (self.reading.closures or self.reading.couplings):
            return None
        units = _units(self.reading)
        return [null_space(rows * units, DEPENDENT) for rows in equations(plant(self.reading), self.states).rows]

    @cached_property
    def own(self) -> Array:
        """Of the machine as it is. Shape (n, n_freedom)."""
        return inverse_dynamics(plant(self.reading), self.states)

    @cached_property
    def scale(self) -> Array:
        """The largest torque of the same unit. Shape (n_freedom,)."""
        slides, most = _slides(self.reading), np.abs(self.own).max(axis=0, initial=0.0)
        scale = np.ones(len(most))
        for which in (slides, ~slides):
            scale[which] = most[which].max(initial=0.0) or 1.0
        return scale

    def effect(self, facts: Iterable[Fact]) -> Array | None:
        """What facts make of the torques; None where no value does, or there is no number. Shape (n, n_freedom)."""
        try:
            tau = inverse_dynamics(plant(self.changed(facts)), self.states)
        except (ScrewgaugeError, LookupError, ValueError):  # of a part that another change takes away
            return None
        return tau - self.own if tau.shape == self.own.shape and np.all(np.isfinite(tau)) else None

    def changed(self, facts: Iterable[Fact]) -> Reading:
        """The machine with B's values, the whole last.

        Raises:
            ScrewgaugeError: A part is gone that a change is of.
        """
        facts = list(facts)
        reading = applied(self.reading, sequence(facts))
        for whole in (fact.b for fact in facts if isinstance(fact.b, Whole)):
            reading = whole.done(reading)
        return reading

    @property
    def names(self) -> list[str]:
        """Of the components."""
        return [name for name, _ in components(self.reading)]

    def scaled(self, effect: Array) -> Array:
        """An effect over the largest torques of its units, along motions that the loops leave; all in one row."""
        if self.bases is None:
            return np.asarray(effect / self.scale).ravel()
        units = _units(self.reading)
        most = float((units * self.scale).max(initial=0.0)) or 1.0
        parts = [N.T @ (units * row) / most for N, row in zip(self.bases, effect, strict=True)]
        return np.concatenate([np.zeros(0), *parts])

    def largest(self, effect: Array) -> Largest:
        """Where an effect is largest."""
        if not effect.size:
            return Largest(0.0, 0.0, "", "")
        off = np.abs(effect).max(axis=0)
        k = int((off / self.scale).argmax())
        name, unit = components(self.reading)[k]
        return Largest(float(off[k] / self.scale[k]), float(off[k]), name, unit)


def bare(reading: Reading) -> Reading:
    """A reading of rigid bodies alone: without what joints exert by themselves, in one gravity."""
    joints, bodies = reading.joints.items(), reading.bodies.items()
    nothing: dict[str, Any] = dict.fromkeys(PASSIVE, 0.0)
    return replace(
        reading,
        joints={name: replace(joint, **nothing) for name, joint in joints},
        bodies={name: replace(body, gravcomp=0.0) for name, body in bodies},
        gravity=STANDARD,
    )


def able(facts: Sequence[Fact]) -> bool:
    """Whether values make all of some facts, whatever joints are called."""
    real = [fact for fact in facts if fact.what != "name"]
    return bool(real) and all(fact.changes or isinstance(fact.b, Whole) for fact in real)
