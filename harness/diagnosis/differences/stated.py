"""What two readings say otherwise, as differences: a value with its change, what is of another kind, what one lacks."""

from __future__ import annotations

import math

from screwgauge.diagnosis.differences.change import PROPERTIES, Change, Difference
from screwgauge.diagnosis.differences.words import compared, unit_of
from screwgauge.diagnosis.pairing.common import ROUNDING, Common, owned
from screwgauge.reference.rotations import Array


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
