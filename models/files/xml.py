"""Parses untrusted XML, checks its numbers, locates its elements and edits its text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from screwgauge.models.formats import floats
from screwgauge.models.matter import NOTHING, Matter
from screwgauge.reference.errors import DescriptionError, ModelFileError
from screwgauge.reference.files import check_count, read_xml
from screwgauge.reference.rotations import Array


def parse(path: Path) -> ET.Element:
    """Parse an XML file without resolving namespace prefixes, which robot files often do not declare.

    Raises:
        ScrewgaugeError: The file cannot be read, is not XML, declares entities, or is nested too deeply.
    """
    builder, parser, depth = ET.TreeBuilder(), expat.ParserCreate("utf-8"), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        check_count(depth, "nested elements", str(path), "reduce the nesting")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(name: str, *_: object) -> None:
        raise ModelFileError(f"declares the entity '{name}'", str(path), "write out its text")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(read_xml(path).encode(), True)
        return builder.close()
    except expat.ExpatError as error:
        raise ModelFileError(f"is not a model: not well-formed XML ({error})", str(path), "correct the file") from None


#: Attributes that are strings, even if the value looks like a number.
_TEXT = ("name", "link", "class", "childclass", "filename", "file", "model")
#: Attributes that may be infinite: limits.
_UNLIMITED = re.compile("lower|upper|effort|velocity|.*range")
_NAN, _INFINITE = re.compile(r"[+-]?nan(\(.*\))?"), re.compile("[+-]?inf(inity)?")


def check_numbers(root: ET.Element, where: str) -> None:
    """Reject attributes that are NaN, and infinite attributes that are not limits.

    Raises:
        ModelFileError: The file has such an attribute.
    """
    for element in root.iter():
        for attribute, value in element.items():
            words = value.lower().split() if attribute not in _TEXT else []
            bad = any(map(_NAN.fullmatch, words))
            if bad or (any(map(_INFINITE.fullmatch, words)) and not _UNLIMITED.fullmatch(attribute)):
                what = f"{_label(element, attribute)} is not a finite number ({value})"
                raise ModelFileError(what, where, "write a finite number")


def number(element: ET.Element, attribute: str, default: float, where: str) -> float:
    """Return an attribute as a number, or the default if the attribute is missing.

    Raises:
        ModelFileError: The value is not a finite number.
    """
    value = element.get(attribute)
    return default if value is None else float(floats((value,), 1, _label(element, attribute), where)[0])


def _label(element: ET.Element, attribute: str) -> str:
    return f"{attribute} of {element.tag} {element.get('name', '')}".rstrip()


def numbers(text: str, default: str = "0 0 0") -> Array:
    """Parse the numbers of an attribute.

    Raises:
        DescriptionError: A word is not a number.
    """
    try:
        return np.array([float(word) for word in (text or default).split()])
    except ValueError:
        raise DescriptionError(f"'{text}' is not a list of numbers", "the model file", "write numbers") from None


_ATTRIBUTE = re.compile(r"\s+([^\s=]+)\s*=\s*(\"[^\"]*\"|'[^']*')")


@dataclass(slots=True, eq=False)
class Element:
    """An element and its position in the text.

    Attributes:
        start, stop: Index of the first character of the start tag, and the index after that tag.
        end: Index after the whole element.
    """

    tag: str
    attributes: dict[str, str]
    start: int
    parent: Element | None
    stop: int = 0
    end: int = 0
    children: list[Element] = field(default_factory=list)

    def get(self, name: str, default: str = "") -> str:
        """Return an attribute as it was read, without later changes."""
        return self.attributes.get(name, default)

    def find(self, tag: str) -> Element | None:
        """Return the first child with the given tag, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def iter(self, *tags: str) -> Iterator[Element]:
        """Yield the element and all its descendants that have one of the given tags (any by default), in text order."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            if not tags or element.tag in tags:
                yield element
            waiting += reversed(element.children)


class XmlText:
    """An XML text and its pending edits.

    Attributes:
        root: Outermost element.
        spell: Function that maps the value of an attribute to the string to write.
    """

    root: Element
    spell: Callable[[str], str]

    def __init__(self, text: str, where: str) -> None:
        """Parse a text.

        Raises:
            DescriptionError: The text is not well-formed XML, or declares entities.
        """
        self._text, self.spell = text, str
        self._attributes: dict[Element, dict[str, str | None]] = {}
        self._inserted: dict[Element, list[str]] = {}
        self._replaced: dict[Element, str] = {}
        self._unwrapped: list[Element] = []
        self._parse(text, where)

    def _parse(self, text: str, where: str) -> None:
        data, open_ = text.encode(), list[Element]()
        # expat counts bytes, Python counts characters
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
            element.end = element.stop if self._is_empty(element) else text.index(">", at) + 1

        def refuse(*_: object) -> None:
            raise DescriptionError("declares a document type", where, "remove the declaration")

        parser.StartElementHandler, parser.EndElementHandler = begin, finish
        parser.StartDoctypeDeclHandler = refuse
        try:
            parser.Parse(data, True)
        except expat.ExpatError as error:
            raise DescriptionError(f"is not well-formed XML ({error})", where, "correct the file") from None

    def _stop(self, start: int) -> int:
        """Return the end of a start tag; an attribute may contain any character except its own quote and ``<``."""
        at = start
        while self._text[at] != ">":
            at = self._text.index(self._text[at], at + 1) + 1 if self._text[at] in "\"'" else at + 1
        return at + 1

    def _is_empty(self, element: Element) -> bool:
        return self._text[element.stop - 2] == "/"

    def set(self, element: Element, **values: str | None) -> None:
        """Set attributes of an element; None removes an attribute."""
        new = {name: value if value is None else self.spell(value) for name, value in values.items()}
        self._attributes.setdefault(element, {}).update(new)

    def add(self, element: Element, tag: str, **values: str) -> None:
        """Insert an element without content as the first child."""
        self.insert(element, f"<{tag}{''.join(f' {name}={quoteattr(value)}' for name, value in values.items())}/>")

    def set_in(self, element: Element, tag: str, **values: str) -> None:
        """Set attributes of the first child with a tag; add the child if it is missing."""
        child = element.find(tag)
        if child is not None:
            self.set(child, **values)
        elif values:
            self.add(element, tag, **values)

    def insert(self, element: Element, text: str) -> None:
        """Insert an element, given as XML text, as the first child."""
        spelled = re.sub(r'"([^"]*)"', lambda value: f'"{self.spell(value[1])}"', text)
        self._inserted.setdefault(element, []).append(spelled)

    def replace(self, element: Element, text: str = "") -> None:
        """Replace an element, including its content, with a text."""
        self._replaced[element] = text

    def unwrap(self, element: Element) -> None:
        """Remove the tags of an element and keep its content."""
        self._unwrapped.append(element)

    def text(self) -> str:
        """Return the text with all edits applied."""
        edits = [(element.start, element.end, new) for element, new in self._replaced.items()]
        for element in self._unwrapped:
            last = element.stop if self._is_empty(element) else self._text.rindex("</", element.stop, element.end)
            edits += [(element.start, element.stop, ""), (last, element.end, "")]
        for element in {**self._attributes, **self._inserted}:
            edits.append((element.start, element.stop, self._start_tag(element)))
        out, at = list[str](), 0
        for start, stop, new in sorted(edits, key=lambda edit: (edit[0], -edit[1])):
            if start >= at:  # skip edits inside a replaced element
                out += [self._text[at:start], new]
                at = stop
        return "".join([*out, self._text[at:]])

    def _start_tag(self, element: Element) -> str:
        old = self._text[element.start : element.stop]
        changes = dict(self._attributes.get(element, {}))

        def change(match: re.Match[str]) -> str:
            name = match[1]
            if name not in changes:
                return match[0]
            value = changes.pop(name)
            return "" if value is None else match[0].removesuffix(match[2]) + quoteattr(value)

        head = f"<{element.tag}"
        ending = "/>" if self._is_empty(element) else ">"
        body = _ATTRIBUTE.sub(change, old.removeprefix(head).removesuffix(ending))
        added = "".join(f" {name}={quoteattr(value)}" for name, value in changes.items() if value is not None)
        new = head + body.rstrip() + added
        children = self._inserted.get(element, [])
        if not children:
            return new + body[len(body.rstrip()) :] + ending
        inner = "".join(self._indent(element, 1) + child for child in children)
        return f"{new}>{inner}" + (f"{self._indent(element, 0)}</{element.tag}>" if self._is_empty(element) else "")

    def _indent(self, element: Element, deeper: int) -> str:
        """Return a newline followed by the indentation of an element."""
        line = self._text[self._text.rfind("\n", 0, element.start) + 1 : element.start]
        return "\n" + (line if not line.strip() else "") + "  " * deeper


class UnpatchableError(Exception):
    """Raised for a change that cannot be written into a file; the message gives the reason."""


@dataclass(slots=True, eq=False)
class TextLink:
    """A link of a URDF or a body of an MJCF.

    Attributes:
        element: Element of the link in the text.
        near: Index of the parent link; -1 for the ground itself.
        joints: Name -> element of each joint that moves the link relative to `near`, from the parent outwards.
        mount: Element that defines the placement of the link: the joint of a URDF, the body of an MJCF.
        frame: World pose at the file's initial coordinates. Shape (4, 4).
        matter: Mass properties in the frame of the link; None if the file derives them from geoms.
        turn: Orientation of the axes in which the file gives the inertia tensor. Shape (3, 3).
        base: Pose, in `near`, of the frame relative to which `mount` is placed; the identity except for MJCF bodies in
            a ``<frame>``. Shape (4, 4).
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
