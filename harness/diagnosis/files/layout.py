"""What a model file says, link by link, in the numbers of the file itself and not of any library."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from screwgauge.diagnosis.files.xml_text import Element, XmlText
from screwgauge.models.formats import TENSOR, tensor
from screwgauge.models.matter import NOTHING, Matter
from screwgauge.models.readings.assemble import matrix
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.rotations import Array, quaternion_rotation, rotation

_AXES = np.eye(3)


class UnpatchableError(Exception):
    """A change that cannot be written into a file; the message says why."""


@dataclass(slots=True, eq=False)
class Link:
    """A link of a URDF or a body of an MJCF.

    Attributes:
        element: Where it stands.
        near: Index of the link on its ground side; -1 of the ground itself.
        joints: Name -> element of each joint that moves it against `near`, from there outwards.
        mount: What holds its placement: the joint of a URDF, the body of an MJCF.
        frame: In the world, with all coordinates as the file has them at first. Shape (4, 4).
        matter: In its frame; None where the file leaves it to the geoms.
        turn: Orientation in which its inertia is written. Shape (3, 3).
        base: Frame of `near` -> the frame that `mount` counts from, another one where MJCF bodies stand in ``<frame>``.
    """

    name: str
    element: Element
    near: int = -1
    joints: dict[str, Element] = field(default_factory=dict)
    mount: Element | None = None
    frame: Array = field(default_factory=lambda: np.eye(4))
    matter: Matter | None = NOTHING
    turn: Array = field(default_factory=lambda: np.eye(3))
    base: Array = field(default_factory=lambda: np.eye(4))


def numbers(text: str, default: str = "0 0 0") -> Array:
    """Numbers of an attribute.

    Raises:
        DescriptionError: There are others than numbers.
    """
    try:
        return np.array([float(word) for word in (text or default).split()])
    except ValueError:
        raise DescriptionError(f"'{text}' are no numbers", "the model file", "write numbers") from None


def urdf_links(xml: XmlText) -> list[Link]:
    """The links of a URDF, each after the one before it; the first is its root.

    Raises:
        DescriptionError: A joint names a link that is not there.
    """
    elements = {element.get("name"): element for element in xml.root.children if element.tag == "link"}
    towards: dict[str, list[Element]] = {}
    children = set()
    for joint in (element for element in xml.root.children if element.tag == "joint"):
        ends = [end.get("link") if (end := joint.find(tag)) else "" for tag in ("parent", "child")]
        if not {*ends} <= {*elements}:
            raise DescriptionError(f"joint '{joint.get('name')}' joins no links", "the URDF", "name two of its links")
        towards.setdefault(ends[0], []).append(joint)
        children.add(ends[1])
    links = [Link(name, elements[name]) for name in elements if name not in children][:1]
    for i, near in enumerate(links):  # grows
        near.matter, near.turn = _urdf_matter(near.element)
        for joint in towards.get(near.name, []):
            name = child.get("link") if (child := joint.find("child")) else ""
            moves = {} if joint.get("type") == "fixed" else {joint.get("name"): joint}
            links.append(Link(name, elements[name], i, moves, joint, near.frame @ origin(joint)))
    return links


def origin(element: Element) -> Array:
    """Placement by the ``<origin>`` in an element of a URDF. Shape (4, 4)."""
    found = element.find("origin")
    if found is None:
        return np.eye(4)
    roll, pitch, yaw = numbers(found.get("rpy"))
    R = rotation(_AXES[2], yaw) @ rotation(_AXES[1], pitch) @ rotation(_AXES[0], roll)
    return matrix(numbers(found.get("xyz")), R)


def _urdf_matter(link: Element) -> tuple[Matter, Array]:
    """Mass properties of a link, and the orientation in which they are written."""
    inertial = link.find("inertial")
    if inertial is None:
        return NOTHING, np.eye(3)
    T, mass, entries = origin(inertial), inertial.find("mass"), inertial.find("inertia")
    R = T[:3, :3]
    J = tensor(float(entries.get(f"i{name}", "0")) if entries else 0.0 for name in TENSOR)
    return Matter(float(mass.get("value", "0")) if mass else 0.0, T[:3, 3], R @ J @ R.T), R


def mjcf_links(xml: XmlText) -> list[Link]:
    """The bodies of an MJCF, each after the one before it; the first is the world."""
    compiler = compilers(xml)
    worlds = [element for element in xml.root.children if element.tag == "worldbody"]
    numbers_ = {element: i for i, element in enumerate(_bodies(worlds), 1)}
    links = [Link("world", worlds[0])] if worlds else []
    waiting = [(child, 0, np.eye(4)) for world in worlds for child in world.children]
    while waiting:
        element, near, T = waiting.pop(0)
        if element.tag == "frame":
            waiting += [(child, near, T @ mjcf_pose(element, compiler)) for child in element.children]
        elif element.tag == "body":
            name = element.get("name") or f"body_{numbers_[element]}"
            frame = links[near].frame @ T @ mjcf_pose(element, compiler)
            joints, said = _mjcf_joints(name, element), _mjcf_matter(element, compiler)
            links.append(Link(name, element, near, joints, element, frame, *said, T))
            waiting += [(child, len(links) - 1, np.eye(4)) for child in element.children]
    return links


def _bodies(worlds: Iterable[Element]) -> Iterator[Element]:
    for world in worlds:
        yield from world.iter("body")


def _mjcf_joints(body: str, element: Element) -> dict[str, Element]:
    """Joints of a body by name; those without one are called as `readings.source` calls them."""
    moving = [child for child in element.children if child.tag in ("joint", "freejoint")]
    return {joint.get("name") or f"{body}_joint" + (f"_{k + 1}" if k else ""): joint for k, joint in enumerate(moving)}


def compilers(xml: XmlText) -> dict[str, str]:
    """What all ``<compiler>`` elements of an MJCF say."""
    return {
        key: value
        for element in xml.root.children
        if element.tag == "compiler"
        for key, value in element.attributes.items()
    }


def mjcf_pose(element: Element, compiler: Mapping[str, str]) -> Array:
    """Placement by the attributes of an element of an MJCF. Shape (4, 4)."""
    return matrix(numbers(element.get("pos")), _mjcf_rotation(element.attributes, compiler))


def _mjcf_rotation(given: Mapping[str, str], compiler: Mapping[str, str]) -> Array:
    unit = 1.0 if compiler.get("angle") == "radian" else np.pi / 180.0
    if "quat" in given:
        q = numbers(given["quat"])
        return quaternion_rotation(q / np.linalg.norm(q))
    if "axisangle" in given:
        values = numbers(given["axisangle"])
        return rotation(values[:3] / np.linalg.norm(values[:3]), values[3] * unit)
    if "euler" in given:
        R = np.eye(3)
        for letter, angle in zip(compiler.get("eulerseq", "xyz"), numbers(given["euler"]) * unit, strict=True):
            turn = rotation(_AXES["xyz".index(letter.lower())], angle)
            R = R @ turn if letter.islower() else turn @ R  # capitals: about axes that stay
        return R
    if "xyaxes" in given:
        x, y = numbers(given["xyaxes"]).reshape(2, 3)
        x = x / np.linalg.norm(x)
        y = y - (x @ y) * x
        y = y / np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])
    if "zaxis" in given:
        z = numbers(given["zaxis"])
        z = z / np.linalg.norm(z)
        axis = np.cross(_AXES[2], z)
        s = float(np.linalg.norm(axis))
        return rotation(axis / s if s > 0.0 else _AXES[0], np.arctan2(s, z[2]))
    return np.eye(3)


def _mjcf_matter(body: Element, compiler: Mapping[str, str]) -> tuple[Matter | None, Array]:
    """Mass properties of a body, none where geoms have to tell them, and the orientation in which they are written."""
    inertial, geoms, setting = body.find("inertial"), body.find("geom"), compiler.get("inertiafromgeom", "auto")
    if inertial is None or (setting == "true" and geoms is not None):
        return (NOTHING if geoms is None or setting == "false" else None), np.eye(3)
    T = mjcf_pose(inertial, compiler)
    R = T[:3, :3]
    if full := inertial.get("fullinertia"):
        J = tensor(numbers(full))
    else:
        J = np.diag(numbers(inertial.get("diaginertia")))
    return Matter(float(inertial.get("mass", "0")), T[:3, 3], R @ J @ R.T), R
