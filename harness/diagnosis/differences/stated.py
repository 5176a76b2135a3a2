"""A value that two readings say otherwise, as a difference with its change."""

from __future__ import annotations

from screwgauge.diagnosis.differences.change import PROPERTIES, Change, Difference
from screwgauge.diagnosis.differences.geometry import ROUNDING
from screwgauge.diagnosis.differences.words import compared, unit_of
from screwgauge.diagnosis.pairing.common import Common, owned
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


def differ(a: float, b: float) -> bool:
    return abs(a - b) > ROUNDING * max(abs(a), abs(b))
