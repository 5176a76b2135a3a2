"""Differences of two readings, and which of them are only the digits that a file prints."""

from __future__ import annotations

import math
import re
from bisect import bisect
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from screwgauge.diagnosis.differences.words import compared
from screwgauge.diagnosis.pairing.common import ROUNDING, Common, owned
from screwgauge.diagnosis.properties import PROPERTIES, Change, unit_of
from screwgauge.models.formats import number_text
from screwgauge.models.mjcf import LEAST
from screwgauge.reference.rotations import Array

Kind = Literal["model", "digits", "convention"]


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """What two readings say otherwise.

    Attributes:
        item_a, item_b: Names in A and in B; one is empty where the item is missing, both for the model.
        what: One of `PROPERTIES`, or what else differs.
        a, b: Values, in common terms (B's in the frame and counting of A); None where there is none.
        unit: Of both.
        size: Relative difference; infinite where one is missing.
        sentence: Both values and their difference in words.
        change: What to do to B to get A, in B's own names and counting; None where no change of B does it.
        kind: ``model``, ``digits`` (rounding of a printed number) or ``convention``, which changes nothing physical.
        whole: Values of the body of which this is a share that was cut off; None of all others.
    """

    item_a: str
    item_b: str
    what: str
    a: Array | None
    b: Array | None
    unit: str
    size: float
    sentence: str
    change: Change | None = None
    kind: Kind = "model"
    whole: tuple[Array | None, Array | None] | None = None


def difference(
    common: Common, item: str, what: str, a: Array, b: Array, more: tuple[float, str] | None = None
) -> Difference:
    """A difference of values with the change that mends it.

    Args:
        item: Common name.
        a, b: Values in B's frame.
        more: Relative size and sentence, where they are not those of the values.
    """
    owner = PROPERTIES[what].owner
    joint = common.a.joints.get(item) if owner == "joint" else None
    unit = unit_of(what, joint)
    size_, sentence = more or compared(item, what, a, b, unit)
    change = owned(common, Change(item, what, a))
    return Difference(item, change.item, what, a, b, unit, size_, sentence, change)


def another(common: Common, kind: str, name: str, what: str, sentence: str) -> Difference:
    """Something that both have and that no change of a value makes the same. `kind`: in `Common.own`."""
    return Difference(name, common.own[kind].get(name, name), what, None, None, "", math.inf, sentence)


def only(side: str, item: str, what: str, sentence: str, value: Array | None = None, unit: str = "") -> Difference:
    """Something that A or B alone has, by its own name there."""
    (item_a, a), (item_b, b) = ((item, value) if each == side else ("", None) for each in "AB")
    return Difference(item_a, item_b, what, a, b, unit, math.inf, sentence)


def differ(a: float, b: float) -> bool:
    return abs(a - b) > ROUNDING * max(abs(a), abs(b))


#: Digits of numbers that are not printed shorter than they are.
ALL = 15
#: Share of a file's longer numbers that have as many digits as the longest, if a program has cut them; and how many it
#: leaves at least: one or two are somebody's edit.
CUT, FEWEST = 0.3, 5
#: Numbers of fewer digits are meant so, those of more are exact; and rounding is seen in several places.
MEANT, EXACT, SEEN = 5, 12, 4
#: Rounding of a computed number, relative to the largest entry.
DUST = 1e-15
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


def _counts(text: str) -> Counter[int]:
    """How many numbers have how many digits; those of comments do not count."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    return Counter(_significant(match.group(0)) for value in _values(text) for match in _NUMBER.finditer(value))


def _values(text: str) -> list[str]:
    """Values of all attributes."""
    return re.findall(r"=\s*[\"']([^\"']*)[\"']", text)


def speller(text: str) -> Callable[[str], str]:
    """Prints computed numbers as the numbers of a file, else as the decimals of `EXACT` digits, that they nearly are.

    Products of frames leave rounding in the last digits, and next to larger entries of a vector in place of a zero.

    Args:
        text: Of the file.

    Returns:
        The value of an attribute, of numbers or not -> the same as it is to be written.
    """
    numbers = sorted({float(match[0]) for value in _values(text) for match in _NUMBER.finditer(value)})
    nothing = min([DUST, *(1e-3 * abs(number) for number in numbers if number)]) if numbers else 0.0

    def spell(value: str) -> str:
        try:
            entries = [float(word) for word in value.split()]
        except ValueError:
            return value
        return " ".join(_spelled(entries))

    def _spelled(entries: list[float]) -> Iterator[str]:
        most = max(map(abs, entries), default=0.0)
        for x in entries:
            if LEAST <= x <= np.nextafter(LEAST, 1.0):  # written in place of a moment of zero
                yield number_text(x)
                continue
            k, off = bisect(numbers, x), DUST * (4.0 * abs(x) + most)
            near = [number for _, number in sorted((abs(one - x), one) for one in numbers[max(k - 1, 0) : k + 1])]
            near = [0.0] if abs(x) <= max(off, nothing) else [*near, float(f"{x:.{EXACT}g}")]
            yield number_text(next((number for number in near if abs(number - x) <= max(off, nothing)), x))

    return spell


def _significant(number: str) -> int:
    return len(re.sub(r"[eE].*|[-+.]", "", number).lstrip("0"))


def marked(differences: Sequence[Difference], digits: tuple[int, int]) -> list[Difference]:
    """The differences, those marked that are the rounding of a file with so many digits.

    Args:
        digits: Of A's file and of B's.
    """
    n, side = min((digits[1], "B"), (digits[0], "A"))
    if n >= ALL or digits[0] == digits[1]:
        return list(differences)
    unit = 10.0 ** (1 - n)
    return [
        replace(each, kind="digits", sentence=f"{each.sentence}: rounding, {side} has {n} digits")
        if (each.kind == "model" or each.what == "zero") and _rounding(each, unit)
        else each
        for each in differences
    ]


def _rounding(difference: Difference, unit: float) -> bool:
    """Half a unit of the last digit of the number itself; of what is made of several numbers, some of them."""
    if difference.a is None or difference.b is None or not math.isfinite(difference.size):
        return False
    if np.ndim(difference.a) == 0 and difference.what != "zero":  # which follows from orientations
        return abs(float(difference.a - difference.b)) <= 0.501 * unit * _decade(float(difference.a))
    return difference.size <= 5.0 * unit


def _decade(value: float) -> float:
    return float(10.0 ** math.floor(math.log10(abs(value)))) if value else 0.0


def rounded(differences: Sequence[Difference], texts: Sequence[str]) -> tuple[int, ...]:
    """Numbers of all differences that are rounding of printed digits.

    Args:
        texts: Of the files, where they are known.
    """
    numbers = tuple(i for i, each in enumerate(differences) if each.kind == "digits")
    if len(numbers) >= SEEN:  # zeros, too, are then where rounding puts them
        most = max(differences[i].size for i in numbers)
        zeros = (i for i, each in enumerate(differences) if each.what == "zero" and each.size <= most)
        return tuple(sorted({*numbers, *zeros}))
    return numbers or (_cut(differences, *map(longest, texts)) if len(texts) == 2 else ())


def _cut(differences: Sequence[Difference], a: int, b: int) -> tuple[int, ...]:
    """All differences, if one file has no number with more than a few digits and none of them is larger than these."""
    digits, real = min(a, b), [i for i, each in enumerate(differences) if each.change is not None]
    small = all(differences[i].size <= 5.0 * 10.0 ** (1 - digits) for i in real)
    return tuple(real) if a != b and MEANT <= digits <= EXACT and len(real) >= SEEN and small else ()
