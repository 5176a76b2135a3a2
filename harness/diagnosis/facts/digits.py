"""Facts that are only the rounding of a file that prints few digits."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from screwgauge.casebook.book import CASES, shown_here
from screwgauge.diagnosis.facts.fact import Fact
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import PASSIVE, PROPERTIES

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
