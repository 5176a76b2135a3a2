"""XML as text: attributes are changed and elements added or taken out, and every other character stays as it was."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from screwgauge.reference.errors import DescriptionError

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
        found = element.find(tag)
        if found is not None:
            self.set(found, **values)
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
