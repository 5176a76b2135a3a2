"""The same model written otherwise: nothing physical changes, and no diagnosis may say that it does."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from campaigns.marks import inertials, is_urdf
from campaigns.mutant import CannotError, Random
from support.robots import unit

from screwgauge.diagnosis.files.layout import urdf_links
from screwgauge.diagnosis.files.write_urdf import inertial_text
from screwgauge.diagnosis.files.xml_text import XmlText
from screwgauge.diagnosis.mechanics.matter import NOTHING, Matter, combined, displaced, relative
from screwgauge.reference.rotations import rotation

Rewrite = Callable[[str, Random], str]
_NUMBERS = (
    *("xyz", "rpy", "value", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "pos", "quat", "mass", "diaginertia"),
    *("fullinertia", "axis", "damping", "friction", "frictionloss", "armature", "stiffness", "lower", "upper", "range"),
)


def same_text(text: str, rng: Random) -> str:
    """As it is; read by another library or from another format."""
    return text


def printed_with_17_digits(text: str, rng: Random) -> str:
    xml = XmlText(text, "the model")
    for element in xml.root.iter():
        if element.tag in ("compiler", "option", "geom", "default", "mesh"):
            continue
        said = {name: element.get(name) for name in _NUMBERS if element.get(name)}
        numbers = {name: " ".join(f"{float(word):.16e}" for word in words.split()) for name, words in said.items()}
        xml.set(element, **numbers)
    return xml.text()


def reordered(text: str, rng: Random) -> str:
    """Links and joints of a URDF in another order."""
    xml = _urdf(text)
    pieces = [xml.piece(element) for element in xml.root.children]
    for element, i in zip(xml.root.children, rng.permutation(len(pieces)), strict=True):
        xml.replace(element, pieces[i])
    return xml.text()


def _urdf(text: str) -> XmlText:
    xml = XmlText(text, "the model")
    if not is_urdf(xml):
        raise CannotError("only of a URDF")
    return xml


def renamed(text: str, rng: Random) -> str:
    """All links and joints have a prefix before their names."""
    xml = _urdf(text)
    for element in xml.root.iter():
        if element.tag in ("link", "joint") and element.get("name"):
            xml.set(element, name=f"robot_{element.get('name')}")
        elif element.tag in ("parent", "child") and element.get("link"):
            xml.set(element, link=f"robot_{element.get('link')}")
        elif element.tag == "mimic":
            xml.set(element, joint=f"robot_{element.get('joint')}")
    return xml.text()


def inertials_turned(text: str, rng: Random) -> str:
    """Every tensor in other axes, and the orientation to match."""
    xml = XmlText(text, "the model")
    for mark in inertials(xml):
        if not mark.urdf and mark.at.get("fullinertia"):
            raise CannotError("a full tensor has no orientation")
        if not mark.urdf:
            continue
        R = rotation(unit(rng), np.array(rng.uniform(0.2, 2.0)))
        old, new = mark.turn, mark.turn @ R
        mark.turn, mark.tensor = new, new.T @ old @ mark.tensor @ old.T @ new
    return xml.text()


def fixed_links_merged(text: str, rng: Random) -> str:
    """Mass of links that are fixed goes to what they are fixed to."""
    xml = _urdf(text)
    links = urdf_links(xml)
    into = list(range(len(links)))
    for i, link in enumerate(links):
        if link.near > 0 and not link.joints:
            into[i] = into[link.near]
    moved = {i for i in range(len(links)) if into[i] != i and links[i].matter is not NOTHING}
    if not moved:
        raise CannotError("no link with mass is fixed to another")
    wholes: dict[int, Matter] = {}
    for i, link in enumerate(links):
        if link.matter is not None and link.matter.mass:
            part = displaced(link.matter, relative(links[into[i]].frame, link.frame))
            wholes[into[i]] = combined(wholes[into[i]], part) if into[i] in wholes else part
    for i in sorted(moved | {into[i] for i in moved}):
        for old in [child for child in links[i].element.children if child.tag == "inertial"]:
            xml.replace(old)
        if i not in moved:
            xml.put(links[i].element, inertial_text(wholes[i]))
    return xml.text()


def respaced(text: str, rng: Random) -> str:
    """Other blanks and a comment."""
    return re.sub(r"\n\s*", "\n", text) + "<!-- the same -->\n"


REWRITES: dict[str, Rewrite] = {
    rewrite.__name__: rewrite
    for rewrite in (
        *(same_text, printed_with_17_digits, reordered, renamed, inertials_turned, fixed_links_merged, respaced),
    )
}
