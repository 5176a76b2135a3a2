"""Changes in the text of a URDF."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from screwgauge.diagnosis.files.layout import Element, Link, UnpatchableError, XmlText, origin, urdf_links
from screwgauge.diagnosis.properties import attributes
from screwgauge.models.formats import number_text, rpy, vector_text
from screwgauge.models.matter import Matter
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.models.urdf import moments
from screwgauge.reference.rotations import Array

#: Below it a placement or direction is the same [m or 1]: products of frames leave as much.
SAME = 1e-14
#: What a joint's reading has -> element and attribute.
JOINT = attributes("urdf")

links = urdf_links


def place(xml: XmlText, link: Link, T: Array) -> None:
    """Gives a link another placement on the one before it."""
    if link.mount is not None:
        _set_origin(xml, link.mount, T)


def _set_origin(xml: XmlText, element: Element, T: Array) -> None:
    old = origin(element)
    new = {}
    if np.abs(T[:3, 3] - old[:3, 3]).max() > SAME:
        new["xyz"] = vector_text(T[:3, 3])
    if np.abs(T[:3, :3] - old[:3, :3]).max() > SAME:
        new["rpy"] = vector_text(rpy(T[:3, :3]))
    xml.set_in(element, "origin", **new)


def direct(xml: XmlText, joint: Element, axis: Array, point: Array) -> None:
    """Gives a joint another axis, in the frame of its link, through whose origin it goes."""
    xml.set_in(joint, "axis", xyz=vector_text(axis))


def fill(xml: XmlText, link: Link, matter: Matter, *, plain: bool) -> None:
    """Gives a link other mass properties; only what differs is written.

    Args:
        plain: All of them, the tensor in the axes of the link.
    """
    inertial, old = link.element.find("inertial"), link.matter
    T = np.eye(4) if inertial is None or plain else origin(inertial)
    R = T[:3, :3]
    J = R.T @ matter.inertia @ R
    if inertial is None:
        xml.put(link.element, inertial_text(matter))
        return
    if plain or old is None or matter.mass != old.mass:
        xml.set_in(inertial, "mass", value=number_text(matter.mass))
    if plain:
        xml.set_in(inertial, "origin", xyz=vector_text(matter.com), rpy="0 0 0")
    else:
        _set_origin(xml, inertial, matrix(matter.com, R))
    if plain or old is None or not np.allclose(matter.inertia, old.inertia, rtol=0.0, atol=1e-15 * np.abs(J).max()):
        xml.set_in(inertial, "inertia", **moments(J))


def inertial_text(matter: Matter) -> str:
    """The element that says mass properties, the tensor in the axes of the link."""
    tensor = " ".join(f'{name}="{value}"' for name, value in moments(matter.inertia).items())
    where = f'<origin xyz="{vector_text(matter.com)}" rpy="0 0 0"/>'
    return f'<inertial>{where}<mass value="{number_text(matter.mass)}"/><inertia {tensor}/></inertial>'


def tell(xml: XmlText, joint: Element, what: str, value: Array) -> None:
    """Gives a joint another property."""
    if what == "limits":
        bounds = {side: number_text(bound) for side, bound in zip(("lower", "upper"), value, strict=True)}
        xml.set_in(joint, "limit", **{side: bound for side, bound in bounds.items() if np.isfinite(float(bound))})
    else:
        tag, name = JOINT[what]
        xml.set_in(joint, tag, **{name: number_text(float(value))})


def couple(xml: XmlText, joint: Element, coupling: CouplingReading) -> None:
    """Gives a joint that mimics another one a new rule."""
    if joint.find("mimic") is None or len(coupling.polynomial) > 2:
        raise UnpatchableError(f"joint '{coupling.joint}' mimics no other, or not linearly")
    offset, multiplier = (number_text(number) for number in (*coupling.polynomial, 0.0, 0.0)[:2])
    xml.set_in(joint, "mimic", offset=offset, multiplier=multiplier)


def check_matter(xml: XmlText) -> None:
    """A URDF always says mass properties itself."""


def hang(xml: XmlText, link: Link, near: Link) -> None:
    """Hangs a link on another one."""
    if link.mount is not None:
        xml.set_in(link.mount, "parent", link=near.name)


def drop(xml: XmlText, gone: Collection[Link]) -> None:
    """Takes links out, with their joints."""
    for link in gone:
        xml.replace(link.element)
        if link.mount is not None:
            xml.replace(link.mount)


#: What hung on links that go hangs on others by now.
splice = drop
