"""What a model file can carry beyond its mechanics: shapes to look at, contacts between them, sensors."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.layout import Link, Tree, length_scale
from screwgauge.models.placement import number_text, vector_text
from screwgauge.reference.rotations import Array


def add_geoms(bodies: Mapping[str, ET.Element], tree: Tree, *, solid: bool) -> None:
    """A ball at each centre of mass and bars from there to the body's joints; copies get none.

    Args:
        solid: They collide; else they are only seen.
    """
    radius = 0.02 * length_scale(tree.mechanism)
    for link in tree.links:
        if link.name != link.original:
            continue
        body = bodies[link.name]
        _geom(body, "sphere", 1.5 * radius, solid).set("pos", vector_text(link.body.com))
        for end in _bar_ends(link, tree):
            if np.linalg.norm(end - link.body.com) > radius:
                bar = _geom(body, "capsule", radius, solid)
                bar.set("fromto", vector_text([*link.body.com, *end]))


def _bar_ends(link: Link, tree: Tree) -> list[Array]:
    """The body's joint points; a body with one is a rod that reaches as far beyond its centre of mass."""
    ends: dict[tuple[float, ...], Array] = {}
    for joint in tree.mechanism.joints:
        for side, frame in joint.sides:
            if side == link.original:
                ends[tuple(np.round(frame.p, 9))] = frame.p
    if len(ends) == 1:
        (end,) = ends.values()
        return [end, 2.0 * link.body.com - end]
    return list(ends.values())


def _geom(body: ET.Element, kind: str, radius: float, solid: bool) -> ET.Element:
    geom = ET.SubElement(body, "geom", type=kind, size=number_text(radius), mass="0")
    if not solid:
        geom.set("contype", "0")
        geom.set("conaffinity", "0")
    return geom


def add_contact_pairs(root: ET.Element, tree: Tree) -> None:
    """Bodies that a joint holds together overlap there: they do not collide."""
    contact = ET.SubElement(root, "contact")
    for first, second in sorted({(joint.parent, joint.child) for joint in tree.mechanism.joints}):
        ET.SubElement(contact, "exclude", body1=first, body2=second)


def add_sensors(root: ET.Element, tree: Tree) -> None:
    """Poses of all bodies, positions and rates of all joints of the tree."""
    sensor = ET.SubElement(root, "sensor")
    for link in tree.links:
        for kind in ("framepos", "framequat"):
            ET.SubElement(sensor, kind, name=f"{link.name}.{kind}", objtype="xbody", objname=link.name)
    for name in tree.coordinates:
        for kind in ("jointpos", "jointvel"):
            ET.SubElement(sensor, kind, name=f"{name}.{kind}", joint=name)
