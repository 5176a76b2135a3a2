"""A difference of two machines as data, and the pair of machines that differ."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from screwgauge.diagnosis.machine.alignment import Alignment
from screwgauge.diagnosis.properties import PROPERTIES, RIGID, Change
from screwgauge.models.machine import Machine
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array, rotation_vector

#: What two files may differ by and be one machine: relative, or in lengths of the machine and rad. Rounding of readers
#: leaves 1e-14, Newton's method that closes loops 1e-11.
TOLERANCE = 1e-9
#: Gravity of a file that cannot say it [m/s^2].
STANDARD = np.array(PROPERTIES["gravity"].default)

#: Facts that leave all motions and coordinates as they are: a free body starts where its coordinates say.
IDLE = ("start",)

Kind = Literal["model", "convention", "digits"]


@dataclass(frozen=True, slots=True, eq=False)
class Fact:
    """One physical difference.

    Attributes:
        part: Body, joint, closure or actuator by its name in A, in B where A has none; empty of the model.
        what: Property or event; see `words` for all of them.
        a, b: Values in A's frames and counting; None of a side that has none. A step from A to B in A's world is a
            rotation vector [rad] and a way [m], shape (2, 3).
        unit: SI; empty of a number without one.
        size: Relative, or in lengths of the machine and rad; infinite where a side has none.
        kind: ``model``; ``convention``, which changes no motion; ``digits``, rounding of printed numbers.
        changes: Give A the value of B; none where no value does.
        partner: Name of the part in B; empty where it has none.
        of: What else the fact is of: the body in whose axes a step is told, the joint of an actuator.
        more: Names that belong to it, such as what a lost link carries.
    """

    part: str
    what: str
    a: Any = None
    b: Any = None
    unit: str = ""
    size: float = math.inf
    kind: Kind = "model"
    changes: tuple[Change, ...] = ()
    partner: str = ""
    of: str = ""
    more: tuple[str, ...] = ()

    @property
    def side(self) -> str:
        """The one side that has it; empty where both do."""
        return "A" if self.b is None and self.a is not None else "B" if self.a is None and self.b is not None else ""


@dataclass(frozen=True, slots=True)
class Partner:
    """A joint of B, whose coordinate is ``sign`` times that of its partner in A, plus ``zero`` [rad or m]."""

    name: str
    sign: float = 1.0
    zero: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two machines, their alignment, and joints of A with their partners; filled while links are compared.

    Attributes:
        lost: Facts of links and welds that either side has alone, and that the machines are without.
    """

    a: Machine
    b: Machine
    alignment: Alignment
    joints: dict[str, Partner] = field(default_factory=dict)
    lost: tuple[Fact, ...] = ()

    @property
    def inverse(self) -> Pair:
        """B and A."""
        lost = tuple(replace(fact, a=fact.b, b=fact.a) for fact in self.lost)
        return Pair(self.b, self.a, self.alignment.inverse, lost=lost)

    @property
    def back(self) -> Mapping[str, str]:
        """Joints of B with those of A."""
        return {partner.name: name for name, partner in self.joints.items()}

    def displacement(self, near: str, far: str) -> Array:
        """How the far body of B stands against that of A, seen from the near ones. Shape (4, 4)."""
        placed = self.alignment.placed
        return np.asarray(placed[far] @ np.linalg.inv(placed[near]))

    def crosses_names(self, joint: str) -> bool:
        """Whether a joint of A or its partner has the name of another joint on the other side."""
        other = self.joints[joint].name
        return other != joint and (joint in self.b.reading.joints or other in self.a.reading.joints)

    def partner(self, joint: str) -> Partner:
        """The partner of a joint of A; one of its name where it has none."""
        return self.joints.get(joint, Partner(joint))


def known_gravity(gravity: Array | None) -> Array:
    """Gravity that is stated, or the usual one where a file cannot say it [m/s^2]. Shape (3,)."""
    return STANDARD if gravity is None else gravity


def other_gravity(a: Reading, b: Reading) -> str:
    """The side that is silent on gravity where the other one states another than the usual one; empty elsewhere."""
    if (a.gravity is None) == (b.gravity is None):
        return ""
    usual = np.allclose(known_gravity(a.gravity), known_gravity(b.gravity), rtol=1e-12, atol=1e-12)
    return "" if usual else "A" if a.gravity is None else "B"


def among(facts: Iterable[Fact], only: str) -> tuple[Fact, ...]:
    """Facts of what alone is compared; all of them where nothing is named."""
    return tuple(fact for fact in facts if not only or fact.what in RIGID)


def apart(a: float, b: float, least: float = 0.0) -> float:
    """Relative difference of two numbers, 0 where it is rounding.

    Args:
        least: Magnitude that smaller ones are compared with.
    """
    size = abs(a - b) / max(abs(a), abs(b), least, 1e-300)
    return size if size > TOLERANCE else 0.0


def step_of(T: Array, point: Array) -> Array:
    """A displacement as a rotation vector and the way of a point. Shape (4, 4) -> (2, 3)."""
    return np.array([rotation_vector(np.asarray(T[:3, :3])), T[:3, :3] @ point + T[:3, 3] - point])
