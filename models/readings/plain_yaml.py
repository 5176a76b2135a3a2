"""YAML as data: texts, numbers, lists, mappings; no merges, tags or sexagesimal numbers, and so many nodes at most."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.files import check_count, read_file

if TYPE_CHECKING:
    import yaml

#: Scalars without quotes that are no text, as JSON has them; ``~`` and nothing are null, too.
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_NUMBER = re.compile(r"[-+]?(\d{1,18}|\d{1,18}\.\d{0,18}([eE][-+]?\d{1,3})?)")


def read_yaml(path: Path, keys: Iterable[str]) -> dict[str, Any]:
    """The entries of a YAML file.

    Args:
        keys: What to write if there are none.

    Raises:
        ScrewgaugeError: It cannot be read, is no mapping of names, or holds what is not read: see above.
    """
    import yaml

    where, text = str(path), read_file(path)
    check_count(len(text), "characters of YAML", where)  # PyYAML takes seconds for them
    check_count(_nesting(text), "nested brackets", where)  # and minutes for thousands of those
    try:
        data = _Composer(yaml.parse(text, Loader=yaml.SafeLoader), where).document()
    except (yaml.YAMLError, ValueError) as error:
        raise ModelFileError(f"is no YAML ({error})", where, "mend the file") from None
    if not isinstance(data, dict):
        raise ModelFileError("has no entries", where, f"write {', '.join(keys)}")
    return data


def _nesting(text: str) -> int:
    """How deep brackets nest in it."""
    steps = [1 if c in "[{" else -1 for c in text if c in "[]{}"]
    return max(accumulate(steps), default=0)


class _Composer:
    """Makes values of the events of a parser.

    An alias stands for the value that it names, which is not copied: many of them cost no more than one.
    """

    def __init__(self, events: Iterator[yaml.Event], where: str) -> None:
        self.events, self.where = events, where
        self.anchors: dict[str, Any] = {}
        self.nodes = 0

    def document(self) -> Any:
        """The value of the only document; None of an empty file."""
        value, kinds = None, list[str]()
        for event in self.events:
            kinds.append(type(event).__name__)
            if kinds[-1] == "DocumentStartEvent":
                if kinds.count("DocumentStartEvent") > 1:
                    raise self.refusal(event, "a second document", "write one file for each")
                value = self.value(next(self.events), 0)
        return value

    def value(self, event: yaml.Event, depth: int) -> Any:
        """The value that begins with an event."""
        self.nodes += 1
        check_count(self.nodes, "nodes of YAML", self.where)
        check_count(depth, "nested entries", self.where, "write them flat")
        kind, anchor = type(event).__name__, getattr(event, "anchor", None)
        if kind == "AliasEvent":
            if anchor not in self.anchors:
                raise self.refusal(event, f"the alias *{anchor} of nothing before it", "write the value")
            return self.anchors[anchor]
        if event.tag is not None and event.tag != "!":
            raise self.refusal(event, f"the tag {event.tag}", "write the value without it")
        value: Any
        if kind == "ScalarEvent":
            value = self.scalar(event)
        else:
            value = self.sequence(event, depth) if kind == "SequenceStartEvent" else self.mapping(event, depth)
        if anchor is not None:  # known when it is complete: nothing contains itself
            self.anchors[anchor] = value
        return value

    def scalar(self, event: yaml.ScalarEvent) -> Any:
        """A text; unquoted, also a number or a word that JSON has."""
        text: str = event.value
        if event.style is not None or event.tag == "!":
            return text
        if text.lower() in _WORDS:
            return _WORDS[text.lower()]
        if _NUMBER.fullmatch(text):
            return float(text) if re.search("[.eE]", text) else int(text)
        return text

    def sequence(self, event: yaml.SequenceStartEvent, depth: int) -> list[Any]:
        """A list."""
        return [self.value(item, depth + 1) for item in self.inside("SequenceEndEvent")]

    def mapping(self, event: yaml.MappingStartEvent, depth: int) -> dict[str, Any]:
        """Names with their values, each name once."""
        found: dict[str, Any] = {}
        for key in self.inside("MappingEndEvent"):
            name = self.value(key, depth + 1)
            if name == "<<":
                raise self.refusal(key, "the merge <<", "write the entries themselves")
            if not isinstance(name, str):
                raise self.refusal(key, f"{name!r:.60} in place of a name", "write a text before the colon")
            if name in found:
                raise self.refusal(key, f"{name!r:.60} twice", "remove one")
            found[name] = self.value(next(self.events), depth + 1)
        return found

    def inside(self, end: str) -> Iterator[yaml.Event]:
        """Events up to the end of a list or mapping, as far as nobody else takes them."""
        for event in self.events:
            if type(event).__name__ == end:
                return
            yield event

    def refusal(self, event: yaml.Event, what: str, remedy: str) -> ModelFileError:
        """What to say of something that is not read."""
        line = event.start_mark.line + 1
        return ModelFileError(f"holds {what}, which is not read", f"{self.where}, line {line}", remedy)
