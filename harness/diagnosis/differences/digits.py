"""With how many digits the numbers of a file are printed, and which differences are no more than that."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.differences.change import Difference

#: Digits of numbers that are not printed shorter than they are.
ALL = 15
#: Share of a file's longer numbers that have as many digits as the longest, if a program has cut them; and how many it
#: leaves at least: one or two are somebody's edit.
CUT, FEWEST = 0.3, 5
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
    return Counter(
        _significant(match.group(0))
        for value in re.findall(r"=\s*[\"']([^\"']*)[\"']", text)
        for match in _NUMBER.finditer(value)
    )


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
