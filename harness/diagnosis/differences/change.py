"""Changes of a reading as an edit of its file would make them, and differences between two readings."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from screwgauge.models.kinematics import moved
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.rotations import Array, cross

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


def outwards(reading: Reading, joint: str) -> tuple[list[str], list[str]]:
    """Bodies that a joint carries, and the joints that it carries, itself first."""
    bodies: list[str] = []
    joints: list[str] = []
    for name, body in reading.bodies.items():
        if body.near in bodies:
            joints += body.joints
        elif joint in body.joints:
            joints += body.joints[body.joints.index(joint) :]
        else:
            continue
        bodies.append(name)
    return bodies, joints


def axis(joint: JointReading) -> Array:
    """Direction of a hinge or slide. Shape (3,)."""
    return joint.screw[3:] if joint.kind == "slide" else joint.screw[:3]


def turned(joint: JointReading, direction: Array, centre: Array) -> JointReading:
    """A hinge or slide on another axis. Shape (3,) both."""
    parts = {"slide": (np.zeros(3), direction), "hinge": (direction, cross(centre, direction))}
    return replace(joint, screw=np.concatenate(parts.get(joint.kind, (joint.screw,))), centre=centre)


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
        return _displaced(reading, change.item, value)
    if what in ("branch", "link"):
        return reading if value else (without if what == "branch" else spliced)(reading, change.item)
    if what == "sign":
        return reading if value > 0 else _reversed(reading, change.item)
    new: Any
    if what in ("axis", "centre"):
        new = turned(item, *((value, item.centre) if what == "axis" else (axis(item), value)))
    elif what == "gear":
        new = (item[0], value)
    else:
        new = replace(item, **{"home" if what == "zero" else what: value})
    entries: dict[str, Any] = {room: {**items, change.item: new}}
    return replace(reading, **entries)


def _displaced(reading: Reading, joint: str, T: Array) -> Reading:
    bodies, joints = outwards(reading, joint)
    return replace(
        reading,
        bodies={**reading.bodies, **{n: replace(reading.bodies[n], pose=T @ reading.bodies[n].pose) for n in bodies}},
        joints={**reading.joints, **{n: moved(reading.joints[n], T) for n in joints}},
    )


def _reversed(reading: Reading, name: str) -> Reading:
    """A joint that counts the other way, and so do the couplings with it."""
    joint = reading.joints[name]
    low, high = joint.limits
    new = replace(joint, screw=-joint.screw, home=-joint.home, limits=(-high, -low), rest=-joint.rest)
    couplings = {}
    for key, coupling in reading.couplings.items():
        polynomial = -coupling.polynomial if coupling.joint == name else coupling.polynomial
        if coupling.of == name:
            polynomial = polynomial * (-1.0) ** np.arange(len(polynomial))
        couplings[key] = replace(coupling, polynomial=polynomial)
    return replace(reading, joints={**reading.joints, name: new}, couplings=couplings)


def without(reading: Reading, joint: str) -> Reading:
    """A reading without a joint and what it carries. Joints before it, of the same body, go with it."""
    bodies, joints = outwards(reading, joint)
    return _lacking(reading, bodies, {*joints, *(name for body in bodies for name in reading.bodies[body].joints)})


def spliced(reading: Reading, joint: str) -> Reading:
    """A reading without the body that a joint moves; what hangs on that hangs, where it is, on what was before it."""
    name = reading.moved_by(joint)
    gone = reading.bodies[name]
    bodies = {n: replace(b, near=gone.near) if b.near == name else b for n, b in reading.bodies.items()}
    return _lacking(replace(reading, bodies=bodies), [name], {*gone.joints})


def _lacking(reading: Reading, bodies: Collection[str], joints: Collection[str]) -> Reading:
    """A reading without some bodies and joints, and without what is of them."""

    def stays(body: str) -> bool:
        return body not in bodies

    return replace(
        reading,
        bodies={name: body for name, body in reading.bodies.items() if stays(name)},
        joints={name: joint for name, joint in reading.joints.items() if name not in joints},
        closures={n: c for n, c in reading.closures.items() if stays(c.first) and stays(c.second)},
        couplings={n: c for n, c in reading.couplings.items() if not {c.joint, c.of} & {*joints}},
        actuators={n: driven for n, driven in reading.actuators.items() if driven[0] not in joints},
    )
