"""A difference of two readings: a value with the change that puts it right, what is of another kind, what one lacks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from screwgauge.diagnosis.differences.words import compared
from screwgauge.diagnosis.pairing.common import ROUNDING, Common, owned
from screwgauge.diagnosis.properties import PROPERTIES, Change, unit_of
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
        change: What makes B as A, in B's own names and counting; None where no change of B does.
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
    """With its change.

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
