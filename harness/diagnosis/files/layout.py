"""What a model file says link by link, in its own numbers and not those of any library; its text with changes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from screwgauge.models.formats import TENSOR, tensor
from screwgauge.models.matter import NOTHING, Matter
from screwgauge.models.poses import matrix
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.rotations import Array, quaternion_rotation, rotation

_ATTRIBUTE = re.compile(r"\s+([^\s=]+)\s*=\s*(\"[^\"]*\"|'[^']*')")


@dataclass(slots=True, eq=False)
class Element:
    """An element and where it stands.

    Attributes:
        start, stop: First character of its start tag, and the one after that tag.
        end: The character after all of it.
    """

    tag: str
    attributes: dict[str, str]
    start: int
    parent: Element | None
    stop: int = 0
    end: int = 0
    children: list[Element] = field(default_factory=list)

    def get(self, name: str, default: str = "") -> str:
        """An attribute as it was read, later changes not included."""
        return self.attributes.get(name, default)

    def find(self, tag: str) -> Element | None:
        """The first child of that tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def iter(self, *tags: str) -> Iterator[Element]:
        """All elements in it with one of these tags, or any, itself included, in the order of the text."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            if not tags or element.tag in tags:
                yield element
            waiting += reversed(element.children)


class XmlText:
    """A text and the changes to be made in it.

    Attributes:
        root: Its outermost element.
        spell: The value of an attribute -> as it is to be written.
    """

    root: Element
    spell: Callable[[str], str]

    def __init__(self, text: str, where: str) -> None:
        """Reads a text.

        Raises:
            DescriptionError: It is no well-formed XML, or it declares entities.
        """
        self._text, self.spell = text, str
        self._attributes: dict[Element, dict[str, str | None]] = {}
        self._inserted: dict[Element, list[str]] = {}
        self._replaced: dict[Element, str] = {}
        self._unwrapped: list[Element] = []
        self._parse(text, where)

    def _parse(self, text: str, where: str) -> None:
        data, open_ = text.encode(), list[Element]()
        # expat counts bytes, Python characters
        place = (lambda byte: byte) if text.isascii() else (lambda byte: len(data[:byte].decode()))
        parser = expat.ParserCreate("utf-8")

        def begin(tag: str, attributes: dict[str, str]) -> None:
            element = Element(tag, attributes, place(parser.CurrentByteIndex), open_[-1] if open_ else None)
            element.stop = self._stop(element.start)
            if element.parent is None:
                self.root = element
            else:
                element.parent.children.append(element)
            open_.append(element)

        def finish(_: str) -> None:
            element, at = open_.pop(), place(parser.CurrentByteIndex)
            element.end = element.stop if self._alone(element) else text.index(">", at) + 1

        def refuse(*_: object) -> None:
            raise DescriptionError("declares a document type", where, "take the declaration out")

        parser.StartElementHandler, parser.EndElementHandler = begin, finish
        parser.StartDoctypeDeclHandler = refuse
        try:
            parser.Parse(data, True)
        except expat.ExpatError as error:
            raise DescriptionError(f"is no well-formed XML ({error})", where, "mend the file") from None

    def _stop(self, start: int) -> int:
        """The character after a start tag; its attributes may contain any sign but their own quote and ``<``."""
        at = start
        while self._text[at] != ">":
            at = self._text.index(self._text[at], at + 1) + 1 if self._text[at] in "\"'" else at + 1
        return at + 1

    def _alone(self, element: Element) -> bool:
        return self._text[element.stop - 2] == "/"

    def set(self, element: Element, **values: str | None) -> None:
        """Gives attributes other values; None takes one out."""
        new = {name: value if value is None else self.spell(value) for name, value in values.items()}
        self._attributes.setdefault(element, {}).update(new)

    def add(self, element: Element, tag: str, **values: str) -> None:
        """Adds an element without content as the first child."""
        self.put(element, f"<{tag}{''.join(f' {name}={quoteattr(value)}' for name, value in values.items())}/>")

    def set_in(self, element: Element, tag: str, **values: str) -> None:
        """Gives attributes of the first child of that tag other values; the child is added if need be."""
        child = element.find(tag)
        if child is not None:
            self.set(child, **values)
        elif values:
            self.add(element, tag, **values)

    def put(self, element: Element, text: str) -> None:
        """Adds an element, written out, as the first child."""
        spelled = re.sub(r'"([^"]*)"', lambda value: f'"{self.spell(value[1])}"', text)
        self._inserted.setdefault(element, []).append(spelled)

    def replace(self, element: Element, text: str = "") -> None:
        """Puts a text in the place of an element with all that is in it."""
        self._replaced[element] = text

    def unwrap(self, element: Element) -> None:
        """Takes out the tags of an element and leaves what is between them."""
        self._unwrapped.append(element)

    def text(self) -> str:
        """The text with all changes made."""
        edits = [(element.start, element.end, new) for element, new in self._replaced.items()]
        for element in self._unwrapped:
            last = element.stop if self._alone(element) else self._text.rindex("</", element.stop, element.end)
            edits += [(element.start, element.stop, ""), (last, element.end, "")]
        for element in {**self._attributes, **self._inserted}:
            edits.append((element.start, element.stop, self._start_tag(element)))
        out, at = list[str](), 0
        for start, stop, new in sorted(edits, key=lambda edit: (edit[0], -edit[1])):
            if start >= at:  # else it is in an element that was replaced
                out += [self._text[at:start], new]
                at = stop
        return "".join([*out, self._text[at:]])

    def _start_tag(self, element: Element) -> str:
        old = self._text[element.start : element.stop]
        changes = dict(self._attributes.get(element, {}))

        def changed(match: re.Match[str]) -> str:
            name = match[1]
            if name not in changes:
                return match[0]
            value = changes.pop(name)
            return "" if value is None else match[0].removesuffix(match[2]) + quoteattr(value)

        head = f"<{element.tag}"
        ending = "/>" if self._alone(element) else ">"
        body = _ATTRIBUTE.sub(changed, old.removeprefix(head).removesuffix(ending))
        added = "".join(f" {name}={quoteattr(value)}" for name, value in changes.items() if value is not None)
        new = head + body.rstrip() + added
        children = self._inserted.get(element, [])
        if not children:
            return new + body[len(body.rstrip()) :] + ending
        inner = "".join(self._indent(element, 1) + child for child in children)
        return f"{new}>{inner}" + (f"{self._indent(element, 0)}</{element.tag}>" if self._alone(element) else "")

    def _indent(self, element: Element, deeper: int) -> str:
        """A new line with the indentation of an element."""
        line = self._text[self._text.rfind("\n", 0, element.start) + 1 : element.start]
        return "\n" + (line if not line.strip() else "") + "  " * deeper


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
    place = element.find("origin")
    if place is None:
        return np.eye(4)
    roll, pitch, yaw = numbers(place.get("rpy"))
    R = rotation(_AXES[2], yaw) @ rotation(_AXES[1], pitch) @ rotation(_AXES[0], roll)
    return matrix(numbers(place.get("xyz")), R)


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
            joints, matter = _mjcf_joints(name, element), _mjcf_matter(element, compiler)
            links.append(Link(name, element, near, joints, element, frame, *matter, T))
            waiting += [(child, len(links) - 1, np.eye(4)) for child in element.children]
    return links


def _bodies(worlds: Iterable[Element]) -> Iterator[Element]:
    for world in worlds:
        yield from world.iter("body")


def _mjcf_joints(body: str, element: Element) -> dict[str, Element]:
    """Joints of a body by name; those without one are named as `readings.source` names them."""
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
    """Mass properties of a body, none where geoms determine them, and the orientation in which they are written."""
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
