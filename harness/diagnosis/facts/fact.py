"""Facts (differences between two machines, as data), and the detection of facts that are due to rounding."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from screwgauge.casebook.book import CASES, is_shown_here
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import PASSIVE, PROPERTIES, RIGID, Change
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array, rotation_vector

#: Largest difference that is ignored: relative, or in machine lengths and rad. Readers have rounding errors of 1e-14;
#: Newton's method for closing loops has errors of 1e-11.
TOLERANCE = 1e-9
#: Gravity assumed if a file does not specify it [m/s^2].
STANDARD = np.array(PROPERTIES["gravity"].default)

#: Facts that do not affect motions: the coordinates of a free body determine its initial pose.
IDLE = ("start",)

Kind = Literal["model", "convention", "digits"]


@dataclass(frozen=True, slots=True, eq=False)
class Fact:
    """A physical difference between the two models.

    Attributes:
        part: Name of the body, joint, closure or actuator in A, or in B if A lacks it; empty for the whole model.
        what: Property or event; `words` lists all of them.
        a, b: Values in A's frames and coordinates; None if a model lacks the value. A step from A to B in A's world
            frame is a rotation vector [rad] and a translation [m], shape (2, 3).
        unit: SI unit; empty for a dimensionless number.
        size: Relative difference, or difference in machine lengths and rad; infinite if a model lacks the value.
        kind: ``model``; ``convention``, which does not change the motion; ``digits``, rounding of printed numbers.
        changes: Changes that give A the value of B; empty if no change of a value can do so.
        partner: Name of the part in B; empty if B lacks it.
        of: A second part: the body in whose axes a step is expressed, or the joint of an actuator.
        more: Further names, e.g. of the bodies that a missing link carries.
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
        """The only model that has a value, ``A`` or ``B``; empty if both have a value."""
        return "A" if self.b is None and self.a is not None else "B" if self.a is None and self.b is not None else ""


def known_gravity(gravity: Array | None) -> Array:
    """Return the gravity of a file, or the standard value if the file specifies none [m/s^2]. Shape (3,)."""
    return STANDARD if gravity is None else gravity


def other_gravity(a: Reading, b: Reading) -> str:
    """Return the model that lacks gravity if the other model specifies non-standard gravity, else an empty name."""
    if (a.gravity is None) == (b.gravity is None):
        return ""
    usual = np.allclose(known_gravity(a.gravity), known_gravity(b.gravity), rtol=1e-12, atol=1e-12)
    return "" if usual else "A" if a.gravity is None else "B"


def select(facts: Iterable[Fact], only: str) -> tuple[Fact, ...]:
    """Keep the facts about one group of properties, or all facts if the name is empty."""
    return tuple(fact for fact in facts if not only or fact.what in RIGID)


def difference(a: float, b: float, least: float = 0.0) -> float:
    """Compute the relative difference between two numbers; return 0 if it is within rounding.

    Args:
        least: Smallest magnitude by which to divide.
    """
    size = abs(a - b) / max(abs(a), abs(b), least, 1e-300)
    return size if size > TOLERANCE else 0.0


def step_of(T: Array, point: Array) -> Array:
    """Express a displacement as a rotation vector and the translation of a point. Shape (4, 4) -> (2, 3)."""
    return np.array([rotation_vector(np.asarray(T[:3, :3])), T[:3, :3] @ point + T[:3, 3] - point])


#: Digits of a number with full precision.
ALL = 15
#: Digits of 32-bit numbers.
SINGLE = 8
#: A program rounded a file's numbers if at least this share of the longer numbers, and at least this many of them, have
#: the maximum length: one or two such numbers are a manual edit.
CUT, FEWEST = 0.3, 5
#: Numbers with fewer digits than the first value are meant as written, and numbers with more digits than the second
#: value are exact; rounding affects at least as many facts as the third value.
MEANT, EXACT, SEEN = 5, 12, 4
#: Rounding error of a value computed from several numbers, in units of the last digit.
SUM = 5.0
#: Properties that a file specifies directly.
ITSELF = {"mass", *PASSIVE}
#: Casebook entry on tensors that MuJoCo's compiler rotates inexactly, and a bound on the error.
AXES, INEXACT = "mj-axes-before-3.14", 1e-6
_NUMBER = re.compile(r"(?<![\w.])[-+]?(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][-+]?\d+)?(?![\w.])")


def digits_of(text: str) -> int:
    """Return the number of digits to which a program rounded the numbers in a file; `ALL` if they are not rounded.

    A program writes many numbers of the same maximum length; people do not.
    """
    counts = _counts(text)
    long = {n: count for n, count in counts.items() if n > 3}
    if not long or max(long) >= ALL:
        return ALL
    most = max(long)
    return most if long[most] >= max(FEWEST, CUT * sum(long.values())) else ALL


def longest_number(text: str) -> int:
    """Count the digits of the longest number in the attributes of a file."""
    return max(_counts(text), default=0)


def numbers_in(text: str) -> list[float]:
    """List all numbers in the attributes of a file."""
    return [float(match[0]) for value in _values(text) for match in _NUMBER.finditer(value)]


def _counts(text: str) -> Counter[int]:
    """Count the numbers outside comments by their number of digits."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    found = (match[0] for value in _values(text) for match in _NUMBER.finditer(value))
    return Counter(len(re.sub(r"[eE].*|[-+.]", "", number).lstrip("0")) for number in found)


def _values(text: str) -> list[str]:
    """Return the values of all attributes and the text of all elements, which contains the numbers in an SDF."""
    return ["".join(pair) for pair in re.findall(r"=\s*[\"']([^\"']*)[\"']|>([^<>]+)<", text)]


def mark_rounding(facts: Sequence[Fact], digits: tuple[int, int], longest: tuple[int, int] = (0, 0)) -> list[Fact]:
    """Mark facts that are due to rounded numbers in a file.

    Args:
        digits: Digits to which the numbers in A's and B's files are rounded.
        longest: Digits of the longest number in each file; 0 without a file.
    """
    n = min(digits)
    if n < ALL and any(isinstance(fact.b, Whole) and not fact.b.stands for fact in facts):
        return [_mark(fact) if fact.size <= SUM * 10.0 ** (1 - n) else fact for fact in facts]
    if n < ALL and digits[0] != digits[1]:
        side = "a" if digits[0] == n else "b"
        return [_mark(fact) if _is_cut(fact, n, side) else fact for fact in facts]
    if n < ALL:
        facts = [_mark(fact) if _is_printed(fact, n) else fact for fact in facts]
    n, real = min(longest), [fact for fact in facts if fact.changes]
    cut = 0 < MEANT <= n <= EXACT and longest[0] != longest[1] and len(real) >= SEEN
    if cut and all(fact.size <= SUM * 10.0 ** (1 - n) for fact in real):
        return [_mark(fact) if fact.changes else fact for fact in facts]
    return list(facts)


def _is_cut(fact: Fact, n: int, side: str) -> bool:
    """Return True if a difference is within half a unit of the last digit, or within a few units for computed values.

    Args:
        n: Digits of the file with fewer digits.
        side: Model that contains this file, ``a`` or ``b``.
    """
    unit = 10.0 ** (1 - n)
    if fact.what not in ITSELF or fact.side or fact.a is None:
        return fact.size <= SUM * unit
    value = float(getattr(fact, side))
    if float(f"{value:.{n}g}") != value:  # not a number in that file, but computed, e.g. from a geom
        return fact.size <= SUM * unit
    decade = 10.0 ** math.floor(math.log10(abs(float(fact.a)))) if fact.a else 0.0
    return abs(float(fact.a) - float(fact.b)) <= 0.501 * unit * decade


def _is_printed(fact: Fact, n: int) -> bool:
    """Return True if the numbers in one model, rounded to n digits, equal the numbers in the other model."""
    if fact.side or fact.a is None or fact.what not in PROPERTIES:
        return False
    try:
        a, b = (np.asarray(value, float).ravel() for value in (fact.a, fact.b))
    except ValueError:  # letters, such as a kind of joint
        return False
    return any(all(float(f"{x:.{n}g}") == y for x, y in zip(*pair, strict=True)) for pair in ((a, b), (b, a)))


def mark_compiled(facts: Sequence[Fact], libraries: Sequence[str]) -> list[Fact]:
    """Mark tensors whose difference is within the error of the installed MuJoCo's compiler."""
    small = [fact.what == "inertia" and fact.kind == "model" and fact.size <= INEXACT for fact in facts]
    if not any(small) or "mujoco" not in libraries or not is_shown_here(CASES[AXES]):
        return list(facts)
    return [replace(_mark(fact), of=AXES) if of_it else fact for fact, of_it in zip(facts, small, strict=True)]


def _mark(fact: Fact) -> Fact:
    return fact if fact.what == "whole" else replace(fact, kind="digits")
