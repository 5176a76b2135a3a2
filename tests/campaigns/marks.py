"""Where a URDF or MJCF says what, by the attributes of its text alone: what the diagnosis uses is not used here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.files.layout import compilers, mjcf_pose, numbers, origin
from screwgauge.diagnosis.files.write_mjcf import orient, put_tensor
from screwgauge.diagnosis.files.xml_text import Element, XmlText
from screwgauge.models.placement import TENSOR, number_text, rpy, tensor, vector_text
from screwgauge.models.urdf import moments
from screwgauge.reference.rotations import Array


def is_urdf(xml: XmlText) -> bool:
    """Whether it is a URDF, and not an MJCF."""
    return xml.root.tag == "robot"


def pose(xml: XmlText, element: Element) -> Array:
    """Placement that an element gives. Shape (4, 4)."""
    return origin(element) if is_urdf(xml) else mjcf_pose(element, compilers(xml))


@dataclass(slots=True, eq=False)
class Inertial:
    """The ``<inertial>`` of a link that moves.

    Attributes:
        link: Its name.
        owner: Its element.
        at: The ``<inertial>``.
    """

    xml: XmlText
    link: str
    owner: Element
    at: Element

    @property
    def urdf(self) -> bool:
        return is_urdf(self.xml)

    @property
    def mass(self) -> float:
        found = self.at.find("mass") if self.urdf else self.at
        return float(found.get("value" if self.urdf else "mass", "0")) if found else 0.0

    @mass.setter
    def mass(self, value: float) -> None:
        if self.urdf:
            self.xml.set_in(self.at, "mass", value=number_text(value))
        else:
            self.xml.set(self.at, mass=number_text(value))

    @property
    def com(self) -> Array:
        return origin(self.at)[:3, 3] if self.urdf else numbers(self.at.get("pos"))

    @com.setter
    def com(self, value: Array) -> None:
        if self.urdf:
            self.xml.set_in(self.at, "origin", xyz=vector_text(value))
        else:
            self.xml.set(self.at, pos=vector_text(value))

    @property
    def turn(self) -> Array:
        """Orientation in which the tensor is written. Shape (3, 3)."""
        return pose(self.xml, self.at)[:3, :3]

    @turn.setter
    def turn(self, R: Array) -> None:
        if self.urdf:
            self.xml.set_in(self.at, "origin", rpy=vector_text(rpy(R)))
        else:
            orient(self.xml, self.at, R)

    @property
    def tensor(self) -> Array:
        """As it is written. Shape (3, 3)."""
        if self.urdf:
            found = self.at.find("inertia")
            values = [float(found.get(f"i{name}", "0")) if found else 0.0 for name in TENSOR]
        elif full := self.at.get("fullinertia"):
            values = [float(word) for word in full.split()]
        else:
            values = [*numbers(self.at.get("diaginertia")), 0.0, 0.0, 0.0]
        return tensor(values)

    @tensor.setter
    def tensor(self, I: Array) -> None:
        if self.urdf:
            self.xml.set_in(self.at, "inertia", **moments(I))
        elif self.at.get("diaginertia") and not np.any(I - np.diag(np.diag(I))):
            self.xml.set(self.at, diaginertia=vector_text(np.diag(I)))
        else:
            R = self.turn
            put_tensor(self.xml, self.at, R @ I @ R.T)


def inertials(xml: XmlText) -> list[Inertial]:
    """Of all links with mass that are behind a joint."""
    if is_urdf(xml):
        moved = _moved(xml)
        owners = [element for element in xml.root.children if element.tag == "link" and element.get("name") in moved]
    else:
        owners = [body for body in xml.root.iter("body") if _jointed(body)]
    found = [(owner, at) for owner in owners if (at := owner.find("inertial")) is not None]
    marks = [Inertial(xml, owner.get("name"), owner, at) for owner, at in found]
    return [mark for mark in marks if mark.link and mark.mass > 0.0]


def _moved(xml: XmlText) -> set[str]:
    """Links of a URDF behind a joint that moves."""
    joints = [element for element in xml.root.children if element.tag == "joint"]
    moved = {end(joint, "child") for joint in joints if joint.get("type") != "fixed"}
    while more := {end(j, "child") for j in joints if end(j, "parent") in moved} - moved:
        moved |= more
    return moved


def end(joint: Element, tag: str) -> str:
    """Name of the parent or child link of a joint of a URDF."""
    found = joint.find(tag)
    return found.get("link") if found else ""


def moving(body: Element) -> list[Element]:
    """The joints of a body of an MJCF."""
    return [child for child in body.children if child.tag in ("joint", "freejoint")]


def _jointed(body: Element | None) -> bool:
    while body is not None and body.tag != "worldbody":
        if moving(body):
            return True
        body = body.parent
    return False


def joints(xml: XmlText) -> list[Element]:
    """Hinges and slides with a name; those that mimic others are none."""
    if is_urdf(xml):
        kinds = ("revolute", "continuous", "prismatic")
        own = [element for element in xml.root.children if element.tag == "joint" and element.get("type") in kinds]
        return [joint for joint in own if joint.find("mimic") is None]
    own = [joint for body in xml.root.iter("body") for joint in body.children if joint.tag == "joint"]
    return [joint for joint in own if joint.get("name") and joint.get("type", "hinge") in ("hinge", "slide")]
