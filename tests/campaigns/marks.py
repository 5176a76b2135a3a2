"""Where a URDF or MJCF has which numbers, by the attributes of its text."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.models.files.mjcf import compilers, orient, pose, put_tensor
from screwgauge.models.files.urdf import moments, origin
from screwgauge.models.files.xml import Element, XmlText, numbers
from screwgauge.models.formats import TENSOR, rpy, tensor, vector_text
from screwgauge.reference.rotations import Array

#: Numbers -> child and attribute that hold them in a URDF, the same of an MJCF, what holds without them in each.
PLACES = {
    "mass": ("mass value", " mass", "0", "0"),
    "position": ("origin xyz", " pos", "0 0 0", "0 0 0"),
    "axis": ("axis xyz", " axis", "1 0 0", "0 0 1"),
    "damping": ("dynamics damping", " damping", "0", ""),
    "friction": ("dynamics friction", " frictionloss", "0", ""),
    "armature": ("", " armature", "", ""),
    "stiffness": ("", " stiffness", "", ""),
    "rest": ("", " springref", "", ""),
    "limits": ("limit upper", " range", "", ""),
    "multiplier": ("mimic multiplier", "", "1", ""),
    "gear": ("", " gear", "", "1"),
    "gravcomp": ("", " gravcomp", "", "0"),
    "gravity": ("", "option gravity", "", "0 0 -9.81"),
}


def is_urdf(xml: XmlText) -> bool:
    return xml.root.tag == "robot"


@dataclass(slots=True, eq=False)
class Mark:
    """An element with numbers.

    Attributes:
        name: Link, joint, motor or closure, as the file calls it; empty for the model.
        joint: Of a placement, the joint that it is before.
    """

    xml: XmlText
    element: Element
    name: str
    joint: Mark | None = None

    def has(self, what: str) -> bool:
        """Whether the format has such numbers, and the file has them here or leaves them at a known value."""
        place, default = self._place(what) if what in PLACES else (what, what)
        return bool(place) and bool(default or self._text(place))

    def get(self, what: str) -> Array:
        """Numbers of `PLACES`; `turn` and `tensor`, as it is written, have the shape (3, 3)."""
        if what == "turn":
            return self._pose()[:3, :3]
        if what == "tensor":
            return self._tensor()
        place, default = self._place(what)
        return numbers(self._text(place), default)

    def put(self, what: str, value: Array) -> None:
        """Writes other numbers."""
        if what == "turn" and not is_urdf(self.xml):
            orient(self.xml, self.element, value)
        elif what == "turn":
            self.xml.set_in(self.element, "origin", rpy=vector_text(rpy(value)))
        elif what == "tensor":
            self._put_tensor(value)
        else:
            tag, attribute = self._place(what)[0].split(" ")
            put = self.xml.set_in if tag else self.xml.set
            put(*filter(None, (self.element, tag)), **{attribute: vector_text(value)})

    def _place(self, what: str) -> tuple[str, str]:
        return PLACES[what][0 if is_urdf(self.xml) else 1 :: 2]

    def _text(self, place: str) -> str:
        tag, attribute = place.split(" ")
        holder = self.element.find(tag) if tag else self.element
        return holder.get(attribute) if holder else ""

    def _pose(self) -> Array:
        return origin(self.element) if is_urdf(self.xml) else pose(self.element, compilers(self.xml))

    def _tensor(self) -> Array:
        if is_urdf(self.xml):
            entries = self.element.find("inertia")
            return tensor(float(entries.get(f"i{name}", "0")) if entries else 0.0 for name in TENSOR)
        full = self.element.get("fullinertia") or f"{self.element.get('diaginertia') or '0 0 0'} 0 0 0"
        return tensor(numbers(full))

    def _put_tensor(self, I: Array) -> None:
        if is_urdf(self.xml):
            self.xml.set_in(self.element, "inertia", **moments(I))
        elif self.element.get("diaginertia") and not np.any(I - np.diag(np.diag(I))):
            self.xml.set(self.element, diaginertia=vector_text(np.diag(I)))
        else:
            R = self.get("turn")
            put_tensor(self.xml, self.element, R @ I @ R.T)


def inertials(xml: XmlText) -> list[Mark]:
    if is_urdf(xml):
        moved = _moved(xml)
        owners = [link for link in children(xml, "link") if link.get("name") in moved]
    else:
        owners = [body for body in xml.root.iter("body") if _jointed(body)]
    marks = [Mark(xml, at, owner.get("name")) for owner in owners if (at := owner.find("inertial"))]
    return [mark for mark in marks if mark.name and mark.get("mass") > 0.0]


def children(xml: XmlText, *tags: str) -> list[Element]:
    return [element for element in xml.root.children if element.tag in tags]


def _moved(xml: XmlText) -> set[str]:
    joints = children(xml, "joint")
    moved = {end(joint, "child") for joint in joints if joint.get("type") != "fixed"}
    while more := {end(j, "child") for j in joints if end(j, "parent") in moved} - moved:
        moved |= more
    return moved


def end(joint: Element, tag: str) -> str:
    link = joint.find(tag)
    return link.get("link") if link else ""


def moving(body: Element) -> list[Element]:
    return [child for child in body.children if child.tag in ("joint", "freejoint")]


def _jointed(body: Element | None) -> bool:
    while body is not None and body.tag != "worldbody":
        if moving(body):
            return True
        body = body.parent
    return False


def joints(xml: XmlText) -> list[Mark]:
    if is_urdf(xml):
        kinds = ("revolute", "continuous", "prismatic")
        own = [joint for joint in children(xml, "joint") if joint.get("type") in kinds and not joint.find("mimic")]
    else:
        own = [joint for body in xml.root.iter("body") for joint in body.children if joint.tag == "joint"]
        own = [joint for joint in own if joint.get("name") and joint.get("type", "hinge") in ("hinge", "slide")]
    return [Mark(xml, joint, joint.get("name")) for joint in own]


def placements(xml: XmlText) -> list[Mark]:
    if is_urdf(xml):
        return [Mark(xml, joint.element, joint.name, joint) for joint in joints(xml)]
    bodies = [(joint.element.parent, joint) for joint in joints(xml)]
    return [Mark(xml, body, joint.name, joint) for body, joint in bodies if body and len(moving(body)) == 1]


def whole(xml: XmlText) -> list[Mark]:
    """The model itself."""
    return [Mark(xml, xml.root, "")]


def last_bodies(xml: XmlText) -> list[Mark]:
    own = [] if is_urdf(xml) else [joint.element.parent for joint in joints(xml)]
    own = [body for body in own if body and body.find("inertial")]
    return [Mark(xml, b, b.get("name")) for b in own if all(moving(c) for c in b.children if c.tag == "body")]


def motors(xml: XmlText) -> list[Mark]:
    some = (motor for room in children(xml, "actuator") for motor in room.children if motor.tag == "motor")
    return [Mark(xml, motor, motor.get("name")) for motor in some if motor.get("joint")]


def anchors(xml: XmlText) -> list[Mark]:
    sites = {site.get("name"): site for site in xml.root.iter("site")}
    closures = (part for room in children(xml, "equality") for part in room.children if part.tag == "connect")
    return [
        Mark(xml, sites[c.get("site1")], c.get("name")) for c in closures if c.get("name") and c.get("site1") in sites
    ]


def mimics(xml: XmlText) -> list[Mark]:
    return [Mark(xml, joint, joint.get("name")) for joint in children(xml, "joint") if joint.find("mimic")]
