"""Changes of a reading as an edit of its file would make them, and differences between two readings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

from screwgauge.diagnosis.transformations import axis, carried, counted_back, spliced, turned, without
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.rotations import Array

Owner = Literal["body", "joint", "closure", "coupling", "actuator", "model"]
Kind = Literal["model", "digits", "convention"]


@dataclass(frozen=True, slots=True)
class Property:
    """What a model says of a part of itself.

    Attributes:
        owner: What has it.
        shape: Of its value.
        unit: SI; of a joint that turns, then, behind a bar, of one that slides.
    """

    owner: Owner
    shape: tuple[int, ...]
    unit: str


#: Name -> property. Poses, axes and points are those in the world at home, as everywhere in a reading.
#: ``pose`` of a body is that of its own frame alone, its matter with it; ``placement`` of a joint is the displacement
#: of the joint and of all outwards of it; ``axis`` and ``centre`` move the screw alone; ``zero`` is the coordinate at
#: home; ``sign`` -1 counts the coordinate the other way, limits and rest with it; ``branch`` 0 takes a joint away and
#: all outwards of it, ``link`` 0 a joint and the body that it moves: what hangs on that hangs on what is before it.
#: ``inertia`` is about the centre of mass in the axes of the body. ``softness`` is also that of a coupling.
PROPERTIES: dict[str, Property] = {
    "mass": Property("body", (), "kg"),
    "com": Property("body", (3,), "m"),
    "inertia": Property("body", (3, 3), "kg m^2"),
    "gravcomp": Property("body", (), "1"),
    "pose": Property("body", (4, 4), "m"),
    "placement": Property("joint", (4, 4), "m"),
    "axis": Property("joint", (3,), "1"),
    "centre": Property("joint", (3,), "m"),
    "zero": Property("joint", (), "rad|m"),
    "sign": Property("joint", (), "1"),
    "limits": Property("joint", (2,), "rad|m"),
    "armature": Property("joint", (), "kg m^2|kg"),
    "damping": Property("joint", (), "N m s/rad|N s/m"),
    "friction": Property("joint", (), "N m|N"),
    "stiffness": Property("joint", (), "N m/rad|N/m"),
    "rest": Property("joint", (), "rad|m"),
    "branch": Property("joint", (), "1"),
    "link": Property("joint", (), "1"),
    "first_frame": Property("closure", (4, 4), "m"),
    "second_frame": Property("closure", (4, 4), "m"),
    "softness": Property("closure", (-1,), "1"),
    "polynomial": Property("coupling", (-1,), "1"),
    "gear": Property("actuator", (), "1"),
    "gravity": Property("model", (3,), "m/s^2"),
    "medium": Property("model", (2,), "kg/m^3, Pa s"),
}
#: Owner -> where a reading has all of its kind.
ROOMS: dict[str, str] = {
    "body": "bodies",
    "joint": "joints",
    "closure": "closures",
    "coupling": "couplings",
    "actuator": "actuators",
}
#: Properties that a reading has as a tuple of numbers.
_TUPLES = ("limits", "softness", "medium")


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A property and the value that it should have.

    Attributes:
        item: Body, joint, closure, coupling or actuator of the reading; empty for the model.
        what: One of `PROPERTIES`.
        value: Its value, of the shape that the property has.
    """

    item: str
    what: str
    value: Array


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


def applied(reading: Reading, changes: Iterable[Change]) -> Reading:
    """A reading with changes made, one after the other.

    Raises:
        UnknownNameError: The reading has no such item, or an item no such property.
    """
    for change in changes:
        if change.what not in PROPERTIES:
            raise UnknownNameError("property", change.what, PROPERTIES)
        reading = _changed(reading, change)
    return reading


def _changed(reading: Reading, change: Change) -> Reading:
    what, owner = change.what, PROPERTIES[change.what].owner
    value: Any = float(change.value) if PROPERTIES[what].shape == () else change.value
    if what in _TUPLES:
        value = tuple(map(float, value))
    if owner == "model":
        return replace(reading, **{what: value})
    room = "couplings" if what == "softness" and change.item in reading.couplings else ROOMS[owner]
    items = getattr(reading, room)
    if change.item not in items:
        raise UnknownNameError(owner, change.item, items)
    item = items[change.item]
    if what == "placement":
        return carried(reading, change.item, value)
    if what in ("branch", "link"):
        return reading if value else (without if what == "branch" else spliced)(reading, change.item)
    if what == "sign":
        return reading if value > 0 else counted_back(reading, change.item)
    new: Any
    if what in ("axis", "centre"):
        new = turned(item, *((value, item.centre) if what == "axis" else (axis(item), value)))
    elif what == "gear":
        new = (item[0], value)
    else:
        new = replace(item, **{"home" if what == "zero" else what: value})
    entries: dict[str, Any] = {room: {**items, change.item: new}}
    return replace(reading, **entries)
