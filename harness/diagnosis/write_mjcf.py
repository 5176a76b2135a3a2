"""Changes in the text of an MJCF."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from screwgauge.diagnosis.layout import Link, UnpatchableError, compilers, mjcf_links, mjcf_pose
from screwgauge.diagnosis.matter import Matter, relative
from screwgauge.diagnosis.write_urdf import SAME
from screwgauge.diagnosis.xml_text import Element, XmlText
from screwgauge.models.placement import number_text, quaternion, vector_text
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.rotations import Array

#: What a joint's reading has -> attribute.
JOINT = {
    "armature": "armature",
    "damping": "damping",
    "friction": "frictionloss",
    "stiffness": "stiffness",
    "rest": "springref",
    "home": "ref",
    "limits": "range",
}
_FRAMES = frozenset({"pose", "placement", "axis", "centre", "zero", "sign", "branch"})
_PARTS = frozenset({"gravcomp", "gear", "gravity", "medium", "polynomial"})
SAYS = frozenset({"mass", "com", "inertia", *_FRAMES, *_PARTS, *JOINT})
#: Settings of the compiler that change mass properties after they were read.
_MENDING = ("balanceinertia", "boundmass", "boundinertia", "settotalmass")
_ANGLES = ("rest", "home", "limits")
#: Ways to write an orientation; one at a time may be there.
_ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
#: What refers to bodies, joints or what is in them, and would name nothing when they are gone.
_REFERRING = ("actuator", "sensor", "equality", "tendon", "contact", "keyframe")

links = mjcf_links


def place(xml: XmlText, link: Link, T: Array) -> None:
    """Gives a body another placement on the one before it."""
    new = relative(link.base, T)
    old = mjcf_pose(link.element, compilers(xml))
    if np.abs(new[:3, 3] - old[:3, 3]).max() > SAME:
        xml.set(link.element, pos=vector_text(new[:3, 3]))
    if np.abs(new[:3, :3] - old[:3, :3]).max() > SAME:
        _orient(xml, link.element, new[:3, :3])


def _orient(xml: XmlText, element: Element, R: Array) -> None:
    xml.set(element, **dict.fromkeys(name for name in _ORIENTATIONS if name in element.attributes))
    xml.set(element, quat=vector_text(quaternion(R)))


def direct(xml: XmlText, joint: Element, axis: Array, point: Array) -> None:
    """Gives a joint another axis, through another point, in the frame of its body."""
    xml.set(joint, axis=vector_text(axis), pos=vector_text(point))


def fill(xml: XmlText, link: Link, matter: Matter, *, plain: bool) -> None:
    """Gives a body other mass properties; only what differs is written.

    Args:
        plain: All of them, the tensor in the axes of the body.
    """
    J, inertial, old = matter.inertia, link.element.find("inertial"), link.matter
    full = vector_text([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
    mass, pos = number_text(matter.mass), vector_text(matter.com)
    if inertial is None:
        xml.add(link.element, "inertial", pos=pos, mass=mass, fullinertia=full)
        return
    if plain or old is None or matter.mass != old.mass:
        xml.set(inertial, mass=mass)
    if plain or old is None or np.abs(matter.com - old.com).max() > SAME:
        xml.set(inertial, pos=pos)
    if not plain and old is not None and np.allclose(J, old.inertia, rtol=0.0, atol=1e-15 * np.abs(J).max()):
        return
    R = mjcf_pose(inertial, compilers(xml))[:3, :3]
    principal = R.T @ J @ R
    moments = np.diag(principal)
    aside = float(np.abs(principal - np.diag(moments)).max())
    if not plain and inertial.get("diaginertia") and aside <= SAME * float(moments.max()):
        xml.set(inertial, diaginertia=vector_text(moments))
        return
    lost = [name for name in ("diaginertia", *_ORIENTATIONS) if name in inertial.attributes]
    xml.set(inertial, **dict.fromkeys(lost))
    xml.set(inertial, fullinertia=full)


def check_matter(xml: XmlText) -> None:
    """Whether mass properties that are written are those that MuJoCo then has.

    Raises:
        UnpatchableError: They are not.
    """
    settings = compilers(xml)
    if settings.get("inertiafromgeom") == "true":
        raise UnpatchableError('inertiafromgeom="true" takes mass properties from geoms and not from <inertial>')
    for name in _MENDING:
        if settings.get(name, "false") not in ("false", "0", "-1"):
            raise UnpatchableError(f'{name}="{settings[name]}" changes mass properties after they were read')


def tell(xml: XmlText, joint: Element, what: str, value: Array) -> None:
    """Gives a joint another property; angles as the file counts them."""
    turns = joint.get("type") != "slide"
    unit = 180.0 / np.pi if turns and compilers(xml).get("angle") != "radian" and what in _ANGLES else 1.0
    if what != "limits":
        xml.set(joint, **{JOINT[what]: number_text(float(value) * unit)})
    elif np.all(np.isfinite(value)):
        xml.set(joint, limited="true", range=vector_text(value * unit))
    else:
        xml.set(joint, limited="false")


def tell_body(xml: XmlText, body: Element, gravcomp: float) -> None:
    """Compensates another share of a body's weight."""
    xml.set(body, gravcomp=number_text(gravcomp))


def tell_model(xml: XmlText, **said: ArrayLike) -> None:
    """Gives the model another gravity, density or viscosity."""
    texts = {name: vector_text(value) for name, value in said.items()}
    option = [element for element in xml.root.children if element.tag == "option"][-1:]
    if option:
        xml.set(option[0], **texts)
    else:
        xml.add(xml.root, "option", **texts)


def couple(xml: XmlText, joint: Element, coupling: CouplingReading) -> None:
    """Gives two coupled joints another polynomial."""
    for part in xml.root.iter("equality"):
        for equality in part.children:
            if equality.tag == "joint" and equality.get("joint1") == coupling.joint:
                xml.set(equality, polycoef=vector_text(coupling.polynomial))
                return
    raise UnpatchableError(f"no equality of joint '{coupling.joint}' stands in the file itself")


def drive(xml: XmlText, name: str, gear: float) -> None:
    """Gives an actuator another gear ratio."""
    for room in (element for element in xml.root.children if element.tag == "actuator"):
        for actuator in room.children:
            if actuator.get("name") == name:
                xml.set(actuator, gear=number_text(gear))
                return
    raise UnpatchableError(f"no actuator of the name '{name}' stands in the file itself")


def drop(xml: XmlText, gone: Collection[Link]) -> None:
    """Takes bodies out, with all that refers to them, and all that refers to that."""
    names = set()
    for link in gone:
        xml.replace(link.element)
        named = link.element.iter("body", "joint", "freejoint", "geom", "site", "camera")
        names |= {element.get("name") for element in named} - {""}
    parts = [(room, part) for room in xml.root.children if room.tag in _REFERRING for part in room.children]
    while lost := [part for room, part in parts if room.tag == "keyframe" or names & _referred(part)]:
        parts = [(room, part) for room, part in parts if part not in lost]
        for part in lost:
            xml.replace(part)
            names |= {part.get("name")} - {""}


def _referred(part: Element) -> set[str]:
    """Names in an element but its own."""
    said = (item for inner in (part, *part.children) for item in inner.attributes.items())
    return {value for key, value in said if key != "name"}
