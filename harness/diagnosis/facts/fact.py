"""A difference of two machines as data, the pair of machines that differ, and differences that printed digits make."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from screwgauge.casebook.book import CASES, shown_here
from screwgauge.diagnosis.machine.alignment import Alignment
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import PASSIVE, PROPERTIES, RIGID, Change
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


#: Digits of numbers that are not printed shorter than they are.
ALL = 15
#: Digits of numbers of 32 bits.
SINGLE = 8
#: Share of a file's longer numbers that have as many digits as the longest, if a program has cut them; and how many it
#: leaves at least: one or two are somebody's edit.
CUT, FEWEST = 0.3, 5
#: Numbers of fewer digits are meant so, those of more are exact; and rounding is seen in several places.
MEANT, EXACT, SEEN = 5, 12, 4
#: What is made of several numbers is off by so many units of the last digit.
SUM = 5.0
#: What stands in a file as it is.
ITSELF = {"mass", *PASSIVE}
#: Case of tensors that MuJoCo's compiler turns inexactly, and more than it changes of them.
AXES, INEXACT = "mj-axes-before-3.14", 1e-6
_NUMBER = re.compile(r"(?<![\w.])[-+]?(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][-+]?\d+)?(?![\w.])")


def digits_of(text: str) -> int:
    """Digits that the numbers in the attributes of a file are cut to, at most `ALL`.

    A program that cuts leaves many numbers of the same length and none that is longer; people do not.
    """
    counts = _counts(text)
    long = {n: count for n, count in counts.items() if n > 3}
    if not long or max(long) >= ALL:
        return ALL
    most = max(long)
    return most if long[most] >= max(FEWEST, CUT * sum(long.values())) else ALL


def longest(text: str) -> int:
    """Digits of the longest number in the attributes of a file."""
    return max(_counts(text), default=0)


def numbers_in(text: str) -> list[float]:
    """All numbers in the attributes of a file."""
    return [float(match[0]) for value in _values(text) for match in _NUMBER.finditer(value)]


def _counts(text: str) -> Counter[int]:
    """How many numbers have how many digits; those of comments do not count."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    return Counter(_significant(match.group(0)) for value in _values(text) for match in _NUMBER.finditer(value))


def _values(text: str) -> list[str]:
    """Values of all attributes, and texts of elements, where an SDF has its numbers."""
    return ["".join(pair) for pair in re.findall(r"=\s*[\"']([^\"']*)[\"']|>([^<>]+)<", text)]


def _significant(number: str) -> int:
    return len(re.sub(r"[eE].*|[-+.]", "", number).lstrip("0"))


def rounded(facts: Sequence[Fact], digits: tuple[int, int], longest: tuple[int, int] = (0, 0)) -> list[Fact]:
    """Mark facts that are the rounding of a file.

    Args:
        digits: That numbers of A's and of B's file are cut to.
        longest: Of their longest numbers; 0 where there is no file.
    """
    n = min(digits)
    if n < ALL and any(isinstance(fact.b, Whole) and not fact.b.stands for fact in facts):
        return [_marked(fact) if fact.size <= SUM * 10.0 ** (1 - n) else fact for fact in facts]
    if n < ALL and digits[0] != digits[1]:
        side = "a" if digits[0] == n else "b"
        return [_marked(fact) if _cut_off(fact, n, side) else fact for fact in facts]
    if n < ALL:
        facts = [_marked(fact) if _printed(fact, n) else fact for fact in facts]
    n, real = min(longest), [fact for fact in facts if fact.changes]
    cut = 0 < MEANT <= n <= EXACT and longest[0] != longest[1] and len(real) >= SEEN
    if cut and all(fact.size <= SUM * 10.0 ** (1 - n) for fact in real):
        return [_marked(fact) if fact.changes else fact for fact in facts]
    return list(facts)


def _cut_off(fact: Fact, n: int, side: str) -> bool:
    """Half a unit of the last digit of a number itself; of what is made of several numbers, some of them.

    Args:
        n: Digits of the file that has fewer; `side`: which one that is.
    """
    unit = 10.0 ** (1 - n)
    if fact.what not in ITSELF or fact.side or fact.a is None:
        return fact.size <= SUM * unit
    value = float(getattr(fact, side))
    if float(f"{value:.{n}g}") != value:  # no number of that file, but made of some, such as of a geom
        return fact.size <= SUM * unit
    decade = 10.0 ** math.floor(math.log10(abs(float(fact.a)))) if fact.a else 0.0
    return abs(float(fact.a) - float(fact.b)) <= 0.501 * unit * decade


def _printed(fact: Fact, n: int) -> bool:
    """Whether all numbers of one side are those of the other one in n digits, such as degrees that became radians."""
    if fact.side or fact.a is None or fact.what not in PROPERTIES:
        return False
    try:
        a, b = (np.asarray(value, float).ravel() for value in (fact.a, fact.b))
    except ValueError:  # letters, such as those of a kind of joint
        return False
    return any(all(float(f"{x:.{n}g}") == y for x, y in zip(*pair, strict=True)) for pair in ((a, b), (b, a)))


def as_compiled(facts: Sequence[Fact], libraries: Sequence[str]) -> list[Fact]:
    """Mark tensors that differ by no more than what the installed MuJoCo makes of those of a file."""
    small = [fact.what == "inertia" and fact.kind == "model" and fact.size <= INEXACT for fact in facts]
    if not any(small) or "mujoco" not in libraries or not shown_here(CASES[AXES]):
        return list(facts)
    return [replace(_marked(fact), of=AXES) if of_it else fact for fact, of_it in zip(facts, small, strict=True)]


def _marked(fact: Fact) -> Fact:
    return fact if fact.what == "whole" else replace(fact, kind="digits")
