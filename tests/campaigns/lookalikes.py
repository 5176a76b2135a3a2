"""The same model in other words: nothing physical changes, and no diagnosis may name a difference."""

import re
from collections.abc import Callable

import numpy as np
from campaigns.changes import CannotError, Random
from campaigns.marks import inertials, is_urdf

from screwgauge.models.files import urdf
from screwgauge.models.files.xml import XmlText
from screwgauge.models.matter import NOTHING, combine, displace
from screwgauge.models.poses import relative
from screwgauge.reference.rotations import rotation
from support.robots import unit

Rewrite = Callable[[str, Random], str]
_NUMBERS = (
    *("xyz", "rpy", "value", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "pos", "quat", "mass", "diaginertia"),
    *("fullinertia", "axis", "damping", "friction", "frictionloss", "armature", "stiffness", "lower", "upper", "range"),
)


def same_text(text: str, rng: Random) -> str:
    return text


def printed_with_17_digits(text: str, rng: Random) -> str:
    xml = XmlText(text, "the model")
    for element in xml.root.iter():
        if element.tag not in ("compiler", "option", "geom", "default", "mesh"):
            words = {name: element.get(name).split() for name in _NUMBERS if element.get(name)}
            xml.set(element, **{name: " ".join(f"{float(word):.16e}" for word in some) for name, some in words.items()})
    return xml.text()


def _urdf(text: str) -> XmlText:
    xml = XmlText(text, "the model")
    if not is_urdf(xml):
        raise CannotError("only of a URDF")
    return xml


def reordered(text: str, rng: Random) -> str:
    xml = _urdf(text)
    pieces = [text[element.start : element.end] for element in xml.root.children]
    for element, i in zip(xml.root.children, rng.permutation(len(pieces)), strict=True):
        xml.replace(element, pieces[i])
    return xml.text()


def renamed(text: str, rng: Random) -> str:
    xml = _urdf(text)
    holders = {"link": "name", "joint": "name", "parent": "link", "child": "link", "mimic": "joint"}
    for element in xml.root.iter(*holders):
        if name := element.get(key := holders[element.tag]):
            xml.set(element, **{key: f"robot_{name}"})
    return xml.text()


def inertials_turned(text: str, rng: Random) -> str:
    xml = _urdf(text)
    for mark in inertials(xml):
        old, I = mark.get("turn"), mark.get("tensor")
        R = rotation(unit(rng), np.array(rng.uniform(0.2, 2.0)))
        mark.put("turn", old @ R)
        mark.put("tensor", R.T @ I @ R)
    return xml.text()


def fixed_links_merged(text: str, rng: Random) -> str:
    xml = _urdf(text)
    links = urdf.links(xml)
    into = list(range(len(links)))
    for i, link in enumerate(links):
        if link.near > 0 and not link.joints:
            into[i] = into[link.near]
    moved = {i for i, link in enumerate(links) if into[i] != i and link.matter is not NOTHING}
    if not moved:
        raise CannotError("no link with mass is fixed to another")
    wholes = {}
    for i, link in enumerate(links):
        if link.matter.mass:
            part = displace(link.matter, relative(links[into[i]].frame, link.frame))
            wholes[into[i]] = combine(wholes[into[i]], part) if into[i] in wholes else part
    for i in moved | {into[i] for i in moved}:
        for old in [child for child in links[i].element.children if child.tag == "inertial"]:
            xml.replace(old)
        if i not in moved:
            xml.insert(links[i].element, urdf.inertial_text(wholes[i]))
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
