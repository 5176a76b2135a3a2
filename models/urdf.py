"""Writes URDF. A link's frame is the description's body frame; crosses of composite joints have no inertial."""

from __future__ import annotations

from collections.abc import Set
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.formats import inverse, number_text, rpy, vector_text
from screwgauge.models.layout import Freedom, Link, lay_out
from screwgauge.models.loops import PART, closure_frames
from screwgauge.reference.mechanism import GROUND, Body, Frame, Mechanism
from screwgauge.reference.rotations import Array

#: Limits of a joint that has none. URDF wants some; "continuous" would do without, but Pinocchio then uses
#: two coordinates (cosine and sine) for the angle.
WIDE = 1e3
STRONG = 1e9


def write_urdf(mechanism: Mechanism, cut: str, *, include: Set[str] = frozenset()) -> str:
    """The tree of a cut mechanism as URDF; its closures go to the loops file.

    Args:
        cut: ``minimal`` or ``full``.
        include: ``limits`` writes the description's finite limits instead of wide ones; ``yaml`` adds the frames that
            a ``robot.yaml`` names.
    """
    tree = lay_out(mechanism, cut)
    robot = ET.Element("robot", name=mechanism.name)
    robot.append(ET.Comment(f" {cut} cut; loops are closed by the loops file; written by screwgauge models "))
    ET.SubElement(robot, "link", name=GROUND)
    for link in tree.links:
        _add(robot, link, "limits" in include)
    if PART in include:
        for name, link_name, frame in (side for one in tree.closures for pair in closure_frames(one) for side in pair):
            ET.SubElement(robot, "link", name=name)
            joint = ET.SubElement(robot, "joint", name=f"{name}.fixed", type="fixed")
            _placement(joint, frame)
            _ends(joint, link_name, name)
    ET.indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _add(robot: ET.Element, link: Link, limited: bool) -> None:
    """The elementary joints that lead to a link, the massless links between them, and the link."""
    name = link.joint.name
    names = [f"{name}.cross{i + 1}" for i in range(len(link.freedoms) - 1)]
    mounted = not link.far_frame.is_identity
    names.append(frame_link(link) if mounted else link.name)
    near, frame = link.near, link.near_frame
    for freedom, far in zip(link.freedoms, names, strict=True):
        _elementary(robot, freedom, near, far, frame, limited)
        if far != link.name:
            ET.SubElement(robot, "link", name=far)
        near, frame = far, Frame()
    if mounted:
        mount = ET.SubElement(robot, "joint", name=f"{name}.mount", type="fixed")
        _placement(mount, inverse(link.far_frame))
        _ends(mount, near, link.name)
    element = ET.SubElement(robot, "link", name=link.name)
    if link.body.mass:
        _inertial(element, link.body)


def frame_link(link: Link) -> str:
    """Name of the massless link that stands in the joint's frame on the far body."""
    return f"{link.original}@{link.joint.name}.frame"


def _elementary(robot: ET.Element, freedom: Freedom, near: str, far: str, frame: Frame, limited: bool) -> None:
    kind = "revolute" if freedom.turns else "prismatic"
    joint = ET.SubElement(robot, "joint", name=freedom.coordinate, type=kind)
    _placement(joint, frame)
    _ends(joint, near, far)
    ET.SubElement(joint, "axis", xyz=vector_text(freedom.axis))
    low, high = np.clip(freedom.limits, -WIDE, WIDE) if limited else (-WIDE, WIDE)
    bounds = {"lower": low, "upper": high, "effort": STRONG, "velocity": STRONG}
    ET.SubElement(joint, "limit", {key: number_text(value) for key, value in bounds.items()})


def _ends(joint: ET.Element, near: str, far: str) -> None:
    ET.SubElement(joint, "parent", link=near)
    ET.SubElement(joint, "child", link=far)


def _placement(joint: ET.Element, frame: Frame) -> None:
    if not frame.is_identity:
        ET.SubElement(joint, "origin", xyz=vector_text(frame.p), rpy=vector_text(rpy(frame.R)))


def _inertial(link: ET.Element, body: Body) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=vector_text(body.com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=number_text(body.mass))
    ET.SubElement(inertial, "inertia", moments(body.inertia))


def moments(I: Array) -> dict[str, str]:
    """The attributes of an ``<inertia>``, ixx, ixy, ixz, iyy, iyz, izz, for a tensor [kg m^2]. Shape (3, 3)."""
    return {f"i{'xyz'[i]}{'xyz'[j]}": number_text(I[i, j]) for i in range(3) for j in range(i, 3)}
