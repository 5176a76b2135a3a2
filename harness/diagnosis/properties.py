"""The table of properties of a model's parts, and changes to their values."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from screwgauge.models.kinematics import displace_joint
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.rotations import Array, cross

_INCH, _POUND = 0.0254, 0.45359237
ANGLE = {180.0 / math.pi: "degrees"}
UNITS: dict[str, dict[float, str]] = {
    "kg": {1e3: "g", 1.0 / _POUND: "lb"},
    "m": {1e3: "mm", 1e2: "cm", 1.0 / _INCH: "inches"},
    "kg m^2": {
        1e9: "g mm^2",
        1e6: "kg mm^2",
        1e7: "g cm^2",
        1e4: "kg cm^2",
        1e3: "g m^2",
        1.0 / (_POUND * _INCH**2): "lb in^2",
    },
    "rad": ANGLE,
    "N m s/rad": {math.pi / 180.0: "N m s/deg"},
    "N m/rad": {math.pi / 180.0: "N m/deg", 1e3: "N mm/rad"},
    "N m": {1e3: "N mm"},
    "m/s^2": {1e3: "mm/s^2", 1.0 / 9.81: "g"},
}


_Recount = Callable[[PolynomialSum], PolynomialSum]


def descendants(reading: Reading, joint: str) -> tuple[list[str], list[str]]:
    """Return the bodies that a joint carries, and the joints that it moves, starting with the joint itself."""
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


def put_on_axis(joint: JointReading, direction: Array, centre: Array) -> JointReading:
    """Put a hinge or slide on a different axis, given by direction and point. Shape (3,) each."""
    parts = {"slide": (np.zeros(3), direction), "hinge": (direction, cross(centre, direction))}
    return replace(joint, screw=np.concatenate(parts.get(joint.kind, (joint.screw,))), centre=centre)


def displace(reading: Reading, joint: str, T: Array) -> Reading:
    bodies, joints = descendants(reading, joint)
    return replace(
        reading,
        bodies={**reading.bodies, **{n: replace(reading.bodies[n], pose=T @ reading.bodies[n].pose) for n in bodies}},
        joints={**reading.joints, **{n: displace_joint(reading.joints[n], T) for n in joints}},
    )


def displace_seat(reading: Reading, joint: str, T: Array) -> Reading:
    """Displace the bodies that a joint carries by T, shape (4, 4), leaving the joint in place."""
    moved_ = displace(reading, joint, T)
    return replace(moved_, joints={**moved_.joints, joint: reading.joints[joint]})


def reverse(reading: Reading, name: str) -> Reading:
    """Reverse the coordinate of a joint, including its couplings."""
    joint = reading.joints[name]
    low, high = joint.limits
    new = replace(joint, screw=-joint.screw, home=-joint.home, limits=(-high, -low), rest=-joint.rest)
    return _recount(reading, name, new, lambda f: f.change_variables({}, {name: -1.0}), lambda f: f.times(-1.0))


def shift_home(reading: Reading, name: str, home: float) -> Reading:
    """Shift the coordinate of a joint to a different home value, along with limits, spring rest and couplings."""
    joint = reading.joints[name]
    step = home - joint.home
    low, high = joint.limits
    new = replace(joint, home=home, limits=(low + step, high + step), rest=joint.rest + step)
    return _recount(reading, name, new, lambda f: f.change_variables({name: -step}, {}), lambda f: f.plus(step))


def _recount(reading: Reading, name: str, joint: JointReading, lead: _Recount, follow: _Recount) -> Reading:
    """Replace a joint's coordinate; `lead` converts couplings that depend on it, `follow` those that determine it."""
    couplings = {key: replace(each, function=lead(each.function)) for key, each in reading.couplings.items()}
    own = {key: replace(each, function=follow(each.function)) for key, each in couplings.items() if each.joint == name}
    return replace(reading, joints={**reading.joints, name: joint}, couplings={**couplings, **own})


def remove(reading: Reading, joint: str) -> Reading:
    """Remove a joint, the remaining joints of its body and everything that it carries."""
    bodies, joints = descendants(reading, joint)
    return _drop(reading, bodies, {*joints, *(name for body in bodies for name in reading.bodies[body].joints)})


def splice(reading: Reading, joint: str) -> Reading:
    """Remove the body that a joint moves, and attach that body's children to its parent without moving them."""
    name = reading.moved_by(joint)
    gone = reading.bodies[name]
    bodies = {n: replace(b, near=gone.near) if b.near == name else b for n, b in reading.bodies.items()}
    return _drop(replace(reading, bodies=bodies), [name], {*gone.joints})


def _drop(reading: Reading, bodies: Collection[str], joints: Collection[str]) -> Reading:
    """Remove bodies and joints, and their closures, couplings and actuators."""

    def stays(body: str) -> bool:
        return body not in bodies

    return replace(
        reading,
        bodies={name: body for name, body in reading.bodies.items() if stays(name)},
        joints={name: joint for name, joint in reading.joints.items() if name not in joints},
        closures={n: c for n, c in reading.closures.items() if stays(c.first) and stays(c.second)},
        couplings={n: c for n, c in reading.couplings.items() if not {*c.named} & {*joints}},
        actuators={n: driven for n, driven in reading.actuators.items() if driven.joint not in joints},
    )


Owner = Literal["body", "joint", "closure", "coupling", "actuator", "model"]
#: Casebook entry on springs that Pinocchio ignores.
SPRINGS = "pin-mjcf-springs"
#: Library -> its call for inverse dynamics.
CALLS = {"mujoco": "mj_inverse", "pinocchio": "rnea"}
#: Kind of part -> attribute of a reading that contains parts of that kind.
ROOMS = {
    "body": "bodies",
    "joint": "joints",
    "closure": "closures",
    "coupling": "couplings",
    "actuator": "actuators",
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Property:
    """A property of the parts of a model.

    Attributes:
        owner: Kind of part to which the property belongs.
        shape: Shape of the value; None if the property cannot be set to a value.
        unit: SI unit; for a joint, the unit for a rotation and, after a bar, the unit for a translation.
        noun: Noun, if it differs from the name of the property.
        part: True if the property is the presence of a part.
        scales: True if the property may differ by a common factor in many parts.
        default: Value if a file omits the property; None if every file specifies it.
        urdf, mjcf: Element and, after an ``@``, attribute that contain the property; empty if the format lacks it.
        entry: Name of the field in a reading, if it differs from the name of the property.
        write: Function that returns the reading with a new value for a part, if that changes more than one field.
        cases: Library that ignores the property -> casebook entry.
        call: Casebook entry on inverse dynamics that contain the property in one library but not in another library.
    """

    owner: Owner
    shape: tuple[int, ...] | None = None
    unit: str = "1"
    noun: str = ""
    part: bool = False
    scales: bool = False
    default: tuple[float, ...] | float | None = None
    urdf: str = ""
    mjcf: str = ""
    entry: str = ""
    write: Callable[[Reading, str, Any], Reading] | None = None
    cases: Mapping[str, str] = field(default_factory=dict)
    call: str = ""


def _set_axis(reading: Reading, name: str, direction: Array | None, centre: Array | None) -> Reading:
    joint = reading.joints[name]
    new = put_on_axis(
        joint, joint.direction if direction is None else direction, joint.centre if centre is None else centre
    )
    return replace(reading, joints={**reading.joints, name: new})


def _set_gear(reading: Reading, name: str, gear: float) -> Reading:
    return replace(reading, actuators={**reading.actuators, name: reading.actuators[name]._replace(gear=gear)})


def _set_coefficients(reading: Reading, name: str, coefficients: Array) -> Reading:
    coupling = reading.couplings[name]
    new = replace(coupling, function=coupling.function.fill(coefficients))
    return replace(reading, couplings={**reading.couplings, name: new})


def _matter(shape: tuple[int, ...], unit: str, **more: Any) -> Property:
    return Property(owner="body", shape=shape, unit=unit, urdf="inertial", mjcf="inertial", **more)


def _place(shape: tuple[int, ...], unit: str = "1", mjcf: str = "joint", **more: Any) -> Property:
    return Property(owner="joint", shape=shape, unit=unit, urdf="origin", mjcf=mjcf, **more)


def _passive(unit: str, **more: Any) -> Property:
    return Property(owner="joint", shape=(), unit=unit, scales=True, default=0.0, **more)


def _presence(less: Callable[[Reading, str], Reading]) -> Property:
    def write(reading: Reading, name: str, there: float) -> Reading:
        return reading if there else less(reading, name)

    return Property(owner="joint", shape=(), part=True, urdf="joint", mjcf="body", write=write)


#: Name -> property. As everywhere in a reading, poses, axes and points are expressed in the world frame at the home
#: pose. ``pose`` moves the frame of a body with its mass; ``placement`` displaces a joint and everything that it
#: carries, ``seat`` displaces only the bodies that it carries; ``axis`` and ``centre`` move only the screw; ``zero`` is
#: the home coordinate; ``sign`` -1 reverses the coordinate, its limits and its rest; ``branch`` 0 removes a joint and
#: everything that it carries; ``link`` 0 removes a joint and the body that it moves, and attaches that body's children
#: to its parent. ``inertia`` is about the centre of mass in the axes of the body. ``softness`` also applies to
#: couplings.
PROPERTIES: dict[str, Property] = {
    "mass": _matter((), "kg", scales=True),
    "com": _matter((3,), "m", noun="centre of mass"),
    "inertia": _matter((3, 3), "kg m^2", scales=True),
    "gravcomp": Property(
        owner="body",
        shape=(),
        noun="gravity compensation factor",
        scales=True,
        default=0.0,
        mjcf="body@gravcomp",
        cases={"pinocchio": "pin-mjcf-gravcomp"},
    ),
    "pose": Property(owner="body", shape=(4, 4), unit="m", urdf="origin", mjcf="body"),
    "placement": _place((4, 4), "m", "body", write=displace),
    "seat": _place((4, 4), "m", "body", write=displace_seat),
    "axis": _place((3,), write=lambda reading, name, axis_: _set_axis(reading, name, axis_, None)),
    "centre": _place((3,), "m", write=lambda reading, name, centre: _set_axis(reading, name, None, centre)),
    "zero": _place((), "rad|m", "joint@ref", write=shift_home, entry="home"),
    "sign": _place((), write=lambda reading, name, sign: reading if sign > 0 else reverse(reading, name)),
    "limits": Property(owner="joint", shape=(2,), unit="rad|m", urdf="limit@", mjcf="joint@range"),
    "armature": _passive("kg m^2|kg", mjcf="joint@armature"),
    "damping": _passive("N m s/rad|N s/m", urdf="dynamics@damping", mjcf="joint@damping", call="urdf-damping-one-side"),
    "friction": _passive("N m|N", noun="dry friction", urdf="dynamics@friction", mjcf="joint@frictionloss"),
    "stiffness": _passive("N m/rad|N/m", mjcf="joint@stiffness", cases={"pinocchio": SPRINGS}, call=SPRINGS),
    "rest": Property(
        owner="joint",
        shape=(),
        unit="rad|m",
        noun="rest position of the spring",
        default=0.0,
        mjcf="joint@springref",
        cases={"pinocchio": SPRINGS},
    ),
    "branch": _presence(remove),
    "link": _presence(splice),
    "kind": Property(owner="joint", part=True),
    "body": Property(owner="body", part=True),
    "closure": Property(owner="closure"),
    "first_frame": Property(owner="closure", shape=(4, 4), unit="m", mjcf="equality"),
    "second_frame": Property(owner="closure", shape=(4, 4), unit="m", mjcf="equality"),
    "softness": Property(owner="closure", shape=(-1,), mjcf="equality"),
    "coupling": Property(owner="coupling"),
    "leading joint": Property(owner="coupling"),
    "polynomial": Property(
        owner="coupling", shape=(-1,), noun="coupling", urdf="mimic", mjcf="equality", write=_set_coefficients
    ),
    "gear": Property(owner="actuator", shape=(), scales=True, mjcf="actuator@gear", write=_set_gear),
    "gravity": Property(
        owner="model",
        shape=(3,),
        unit="m/s^2",
        default=(0.0, 0.0, -9.81),
        mjcf="option@gravity",
        cases={"pinocchio": "pin-mjcf-gravity"},
    ),
    "medium": Property(owner="model", shape=(2,), unit="kg/m^3, Pa s", default=0.0, mjcf="option"),
}
#: Mass properties; passive forces of joints; properties that files may omit.
INERTIAL = tuple(name for name, each in PROPERTIES.items() if each.urdf == "inertial")
PASSIVE = tuple(name for name, each in PROPERTIES.items() if each.owner == "joint" and each.scales)
OPTIONAL = tuple(name for name, each in PROPERTIES.items() if each.default is not None)
#: Properties of closures and couplings, on which torques of the open tree do not depend; presence of parts.
CLOSING = frozenset(name for name, each in PROPERTIES.items() if each.owner in ("closure", "coupling"))
PARTS = frozenset(name for name, each in PROPERTIES.items() if each.part)


#: Properties and events of rigid bodies and their joints, without forces.
RIGID = frozenset(
    {*INERTIAL, "placement", "axis", "end", "zero", "sign", "whole", "kind", "base", "start", "fixed", "branch", "link"}
    | {"held", "coupling", "polynomial", "leading joint"}
)


def noun_of(what: str) -> str:
    """Return the noun for a property."""
    return (PROPERTIES[what].noun if what in PROPERTIES else "") or what


def unit_of(what: str, joint: JointReading | None = None) -> str:
    """Return the unit of a property, given the joint if the unit differs between hinges and slides."""
    turns, _, slides = PROPERTIES[what].unit.partition("|")
    unit = slides if slides and joint is not None and joint.kind == "slide" else turns
    return "" if unit == "1" else unit


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A property and its new value.

    Attributes:
        item: Name of a body, joint, closure, coupling or actuator in the reading; empty for the whole model.
        what: Key of `PROPERTIES`.
        value: New value, with the shape of the property.
    """

    item: str
    what: str
    value: Array


#: Changes to placements, which are applied from the outermost part inwards; and removals, which are applied last.
_FIRST, _LAST = ("placement", "seat", "axis", "centre", "zero", "sign"), ("branch", "link")


def sequence(several: Iterable[Any]) -> list[Change]:
    """Collect the changes of facts in the order in which to apply them; facts are ordered from the ground outwards."""
    changes = [change for each in several for change in each.changes]
    places = [change for change in changes if change.what in _FIRST]
    lost = [change for change in changes if change.what in _LAST]
    return [*places[::-1], *(change for change in changes if change.what not in (*_FIRST, *_LAST)), *lost]


def apply_changes(reading: Reading, changes: Iterable[Change]) -> Reading:
    """Apply changes to a reading in sequence.

    Raises:
        UnknownNameError: The reading lacks the item, or `PROPERTIES` lacks the property.
    """
    for change in changes:
        if change.what not in PROPERTIES or PROPERTIES[change.what].shape is None:
            raise UnknownNameError("property", change.what, [n for n, p in PROPERTIES.items() if p.shape is not None])
        reading = _apply_change(reading, change)
    return reading


def _apply_change(reading: Reading, change: Change) -> Reading:
    what, each = change.what, PROPERTIES[change.what]
    value: Any = float(change.value) if each.shape == () else change.value
    if what in ("limits", "softness", "medium"):  # tuples in a reading
        value = tuple(map(float, value))
    if each.owner == "model":
        return replace(reading, **{what: value})
    room = "couplings" if what == "softness" and change.item in reading.couplings else ROOMS[each.owner]
    items = getattr(reading, room)
    if change.item not in items:
        raise UnknownNameError(each.owner, change.item, items)
    if each.write is not None:
        return each.write(reading, change.item, value)
    entries: dict[str, Any] = {room: {**items, change.item: replace(items[change.item], **{each.entry or what: value})}}
    return replace(reading, **entries)
