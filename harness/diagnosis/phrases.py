"""English for reasons: what somebody may have done to a file, one sentence for each slip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from screwgauge.diagnosis.nouns import listed, noun
from screwgauge.diagnosis.properties import PROPERTIES
from screwgauge.diagnosis.words import EVENTS

if TYPE_CHECKING:
    from screwgauge.diagnosis.causes.reasons import Reason

#: Slips of tensors, where several properties of a body follow from that of one link.
_OF_TENSORS = ("about the origin", "not turned", "turned", "turned twice", "turned transposed", "meant transposed")
#: One of what a property names in the plural.
_ONE = {"limits": "limit"}
#: Slip -> sentence: ``it`` is what the facts are of, ``noun`` the first of these, ``part`` the body or joint.
SLIPS: Mapping[str, str] = {
    "unit": "{it} is in {0}",
    "unit of A": "{it} is as if A were in {0}",
    "degrees": "angles of {0} are in degrees and are read in rad",
    "radians": "angles of {0} are in rad and are read in degrees",
    "sequence": "angles of {0} are in the sequence {1}, where {2} is meant",
    "w last": "quaternions of {0} have w last",
    "left out": "{it} is left out",
    "decimal point": "{it} has its decimal point {0}",
    "other sign": "{it} has the other sign",
    "mirrored": "{it} is mirrored in {0}",
    "order": "{it} has its entries in the order {0}",
    "turned": "{it} is turned by {0:.4g} degrees",
    "turned by inertial": "{it} is turned by the orientation of its inertial in {0}",
    "turned back by inertial": "{it} is turned back by the orientation of its inertial in {0}",
    "counted back": "{it} is counted the other way",
    "exchanged coefficients": "offset and multiplier are exchanged",
    "inverse multiplier": "the multiplier is the inverse of that of A",
    "inverse function": "the two joints have exchanged their roles",
    "offset in degrees": "the offset is in degrees",
    "upside down": "gravity is upside down",
    "about the origin": "{it} is about the origin of the link, not about its centre of mass",
    "parallel axis twice": "the parallel-axis term is subtracted twice from {it}",
    "not turned": "{it} is not turned by its orientation in {0}",
    "turned twice": "{it} is turned once too often by its orientation in {0}",
    "turned transposed": "{it} is turned by the transpose of its orientation in {0}",
    "meant transposed": "{it} is turned by its orientation in {0} in place of the transpose",
    "products of other sign": "products of inertia have the other sign",
    "product of other sign": "the product of inertia {0} has the other sign",
    "no products": "products of inertia are left out",
    "urdf order": "the entries of {it} are in the order of URDF in the place of MJCF's",
    "mjcf order": "the entries of {it} are in the order of MJCF in the place of URDF's",
    "order of products": "products of inertia are in another order",
    "order of moments": "moments of inertia are in another order",
    "moments on other axes": "principal moments are on other axes",
    "transposed": "the rotation is transposed",
    "no rotation": "the rotation is left out",
    "inertiafromgeom": "{it} comes from the geoms of {0}, as its compiler option inertiafromgeom asks",
    "default density": "{it} comes from the geoms of {0}, by the default density of 1000 kg/m^3",
    "geoms": "{it} comes from the geoms of {0}",
    "density": "masses come from a density of {0:.6g} kg/m^3 in A and {1:.6g} kg/m^3 in B",
    "settotalmass": "masses are scaled to {1:.6g} kg in all, as the compiler option settotalmass of {0} asks",
    "total kept": "masses are scaled to a total of {0:.6g} kg in both, as MuJoCo's settotalmass does",
    "joint order": "from the ground outwards {0} in A, {1} in B{2}",
    "exchanged": "the {noun} of {0} and that of {1} are exchanged",
    "before the gear": "the {noun} of {0} is that of the motor, before the gear of {1:.6g}",
    "gear once": "the {noun} of {0} is reduced by the gear of {1:.6g}, not by its square",
    "missing part": "{part} lacks {0}, which is missing in {1}",
    "merged without rotation": "{0} is merged into {part} in {1} without its rotation",
    "merged transposed": "{0} is merged into {part} in {1} with its rotation transposed",
    "merged without position": "{0} is merged into {part} in {1} without its position",
    "merged by the inverse": "{0} is merged into {part} in {1} at the inverse of its placement",
    "merged without parallel axis": "{0} is merged into {part} in {1} without the parallel-axis term",
}


def phrase(reason: Reason) -> str:
    """Say what somebody may have done."""
    first, parts = reason.facts[0], {fact.part for fact in reason.facts}
    whats = sorted({fact.what for fact in reason.facts}, key=[*PROPERTIES, *EVENTS].index)
    nouns = [_ONE.get(what) or noun(what) for what in whats]
    article = "each" if len(nouns) > 1 or len(parts) > 1 or {*whats} & _ONE.keys() else "the"
    if reason.part and reason.slip in _OF_TENSORS:
        article, nouns = "the", ["inertia"]
    elif reason.part and len(parts) == 1:
        article, nouns = "the", [noun(first.what)]
    it = "B" if first.what == "whole" else f"{article} {listed(nouns)}{f' of {reason.part}' * bool(reason.part)}"
    values = map(_places, reason.values) if reason.slip == "decimal point" else reason.values
    return SLIPS[reason.slip].format(*values, it=it, noun=noun(first.what), part=reason.part or first.part)


def _places(moved: str | float) -> str:
    """Tell where a decimal point is, by the power of ten."""
    n = int(abs(float(moved)))
    places = ("one place", "two places", "three places")[n - 1]
    return f"{places} too far to the {'right' if float(moved) > 0.0 else 'left'}"
