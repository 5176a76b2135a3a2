"""Reads untrusted YAML, and ``robot.yaml`` files, which close the loops in the URDF of a parallel robot."""

from __future__ import annotations

import json
import re
import reprlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

from screwgauge.models.content import Content
from screwgauge.models.files.loops import motors, place_in
from screwgauge.models.layout import lay_out
from screwgauge.models.readings.assemble import retype
from screwgauge.models.readings.reading import ClosureReading, Reading
from screwgauge.reference.errors import ModelFileError, UnknownNameError, quote
from screwgauge.reference.files import check_count, read_file
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array

if TYPE_CHECKING:
    import yaml

#: Type of a closure in a ``robot.yaml`` -> kind of `ClosureReading`.
_KINDS = {"3d": "point", "6d": "weld"}
_KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")


def _loops(data: Mapping[str, Any], where: str) -> list[tuple[str, tuple[str, ...]]]:
    """Return the kind of each closed loop, as in `ClosureReading`, and the names of its two links or joints."""
    loops = data.get("closed_loop") or []
    if not isinstance(loops, list):
        raise ModelFileError(
            f"{reprlib.repr(loops)[:60]} is not a list of pairs", f"{where}, closed_loop", "write pairs of names"
        )
    pairs = tuple(_texts(pair, f"{where}, closed_loop") for pair in loops)
    types = _texts(data.get("type"), f"{where}, type")
    if len(types) != len(pairs) or any(len(pair) != 2 for pair in pairs):
        what = f"lists {len(pairs)} closed loops, but {len(types)} types"
        raise ModelFileError(what, where, "write a pair of names and a type, 3d or 6d, for each loop")
    for kind in types:
        if kind.lower() not in _KINDS:
            raise UnknownNameError("type of a closed loop", kind, _KINDS, f"{where}, type")
    return [(_KINDS[kind.lower()], pair) for kind, pair in zip(types, pairs, strict=True)]


def _types(data: Mapping[str, Any], where: str) -> dict[str, str]:
    """Return joint -> type, in capitals, that replaces the joint's type in the URDF."""
    joints = _texts(data.get("joint_name"), f"{where}, joint_name")
    turned = _texts(data.get("joint_type"), f"{where}, joint_type")
    if len(joints) != len(turned):
        what = f"lists {len(joints)} joint names, but {len(turned)} joint types"
        raise ModelFileError(what, where, "write a type for each joint")
    if twice := [name for name, count in Counter(joints).items() if count > 1]:
        raise ModelFileError(f"names joint '{twice[0]}' twice", f"{where}, joint_name", "name it once")
    return {name: kind.upper() for name, kind in zip(joints, turned, strict=True)}


def _texts(value: Any, where: str) -> tuple[str, ...]:
    """Check that an entry is a list of strings and return it; return an empty tuple if the entry is missing."""
    if value is None:
        return ()
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        raise ModelFileError(f"{reprlib.repr(value)[:60]} is not a list of names", where, "write names in brackets")
    return tuple(value)


def with_robot_yaml(reading: Reading, path: Path) -> Reading:
    """Add the closures, motors and spherical joints of a ``robot.yaml`` to a reading.

    Raises:
        ScrewgaugeError: The file cannot be read, or an entry is missing or invalid.
    """
    where, data = str(path), read_yaml(path, _KEYS[:3])
    loops, types, driven = _loops(data, where), _types(data, where), data.get("name_mot")
    names = _texts(driven, f"{where}, name_mot") if not isinstance(driven, str) else ()
    reading, closures = retype(reading, types, where), dict[str, ClosureReading]()
    for i, (kind, pair) in enumerate(loops, 1):
        (first, T1), (second, T2) = (_frame(reading, name, path) for name in pair)
        closures[f"loop{i}"] = ClosureReading(kind, first, T1, second, T2)
    if isinstance(driven, str):  # a substring of the names of all driven joints
        names = tuple(name for name in reading.joints if driven in name)
    actuators = motors(reading, {name: name for name in names}, path)
    left = (Content("entries of loops files", f"entry {key} of {path.name}") for key in data if key not in _KEYS)
    return replace(reading, closures=closures, actuators=actuators, content=(*reading.content, *left))


def _frame(reading: Reading, name: str, path: Path) -> tuple[str, Array]:
    """Return the body and frame of a link, or of the link that a joint carries."""
    link = reading.carried_link(name)
    if link not in ("", name) and reading.has_link(name):
        what = f"'{name}' is a link and also a joint that carries link '{link}'"
        raise ModelFileError(what, f"{path}, closed_loop", "rename one of them in the URDF")
    return place_in(reading, name, path)


#: Unquoted scalars that are not strings, as in JSON; ``~`` and an empty scalar also stand for null.
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_NUMBER = re.compile(r"[-+]?(\d{1,18}|\d{1,18}\.\d{0,18}([eE][-+]?\d{1,3})?)")


def read_yaml(path: Path, keys: Iterable[str]) -> dict[str, Any]:
    """Read the entries of a YAML file.

    Args:
        keys: Entries that the error message suggests if the file is empty.

    Raises:
        ScrewgaugeError: The file cannot be read, is not a mapping of names, or contains unsupported YAML.
    """
    import yaml

    where, text = str(path), read_file(path)
    check_count(len(text), "characters of YAML", where)  # PyYAML takes seconds to parse that many
    check_count(_nesting_depth(text), "nested brackets", where)  # and minutes for thousands of nested brackets
    try:
        data = _Composer(yaml.parse(text, Loader=yaml.SafeLoader), where).document()
    except (yaml.YAMLError, ValueError) as error:
        raise ModelFileError(f"is not valid YAML ({error})", where, "correct the file") from None
    if not isinstance(data, dict):
        raise ModelFileError("has no entries", where, f"write {', '.join(keys)}")
    return data


def _nesting_depth(text: str) -> int:
    """Return the maximum nesting depth of brackets in a text."""
    steps = [1 if c in "[{" else -1 for c in text if c in "[]{}"]
    return max(accumulate(steps), default=0)


class _Composer:
    """Composes values from the events of a YAML parser.

    An alias refers to its value without copying it; therefore, many aliases do not take more memory than one.
    """

    def __init__(self, events: Iterator[yaml.Event], where: str) -> None:
        self.events, self.where = events, where
        self.anchors: dict[str, Any] = {}
        self.nodes = 0

    def document(self) -> Any:
        """Compose the value of the file's only document; None for an empty file."""
        value, kinds = None, list[str]()
        for event in self.events:
            kinds.append(type(event).__name__)
            if kinds[-1] == "DocumentStartEvent":
                if kinds.count("DocumentStartEvent") > 1:
                    raise self.refusal(event, "a second document", "split the file")
                value = self.value(next(self.events), 0)
        return value

    def value(self, event: yaml.Event, depth: int) -> Any:
        """Compose the value that begins with an event."""
        self.nodes += 1
        check_count(self.nodes, "nodes of YAML", self.where)
        check_count(depth, "nested entries", self.where, "flatten them")
        kind, anchor = type(event).__name__, getattr(event, "anchor", None)
        if kind == "AliasEvent":
            if anchor not in self.anchors:
                raise self.refusal(event, f"the alias *{anchor} of an undefined anchor", "write the value")
            return self.anchors[anchor]
        if event.tag is not None and event.tag != "!":
            raise self.refusal(event, f"the tag {event.tag}", "remove the tag")
        value: Any
        if kind == "ScalarEvent":
            value = self.scalar(event)
        else:
            value = self.sequence(event, depth) if kind == "SequenceStartEvent" else self.mapping(event, depth)
        if anchor is not None:  # registered once complete: a value cannot contain itself
            self.anchors[anchor] = value
        return value

    def scalar(self, event: yaml.ScalarEvent) -> Any:
        """Convert a scalar: to a string if it is quoted, or else to a number, a JSON literal or a string."""
        text: str = event.value
        if event.style is not None or event.tag == "!":
            return text
        if text.lower() in _WORDS:
            return _WORDS[text.lower()]
        if _NUMBER.fullmatch(text):
            return float(text) if re.search("[.eE]", text) else int(text)
        return text

    def sequence(self, event: yaml.SequenceStartEvent, depth: int) -> list[Any]:
        """Compose a list."""
        return [self.value(item, depth + 1) for item in self.events_until("SequenceEndEvent")]

    def mapping(self, event: yaml.MappingStartEvent, depth: int) -> dict[str, Any]:
        """Compose a mapping; reject duplicate names."""
        entries: dict[str, Any] = {}
        for key in self.events_until("MappingEndEvent"):
            name = self.value(key, depth + 1)
            if name == "<<":
                raise self.refusal(key, "the merge <<", "write out the entries")
            if not isinstance(name, str):
                raise self.refusal(key, f"{quote(name)} as a key", "use a string as the key")
            if name in entries:
                raise self.refusal(key, f"the key {quote(name)} twice", "remove one")
            entries[name] = self.value(next(self.events), depth + 1)
        return entries

    def events_until(self, end: str) -> Iterator[yaml.Event]:
        """Yield the events up to the end of a list or mapping."""
        for event in self.events:
            if type(event).__name__ == end:
                return
            yield event

    def refusal(self, event: yaml.Event, what: str, remedy: str) -> ModelFileError:
        """Build the error for an unsupported event."""
        line = event.start_mark.line + 1
        return ModelFileError(f"contains {what}, which is not supported", f"{self.where}, line {line}", remedy)


def write_loops_yaml(mechanism: Mechanism, cut: str) -> str:
    """Format the loops and motors of a cut mechanism as YAML; frames are links of its URDF, see `Closure.frames`."""
    pairs, types = list[list[str]](), list[str]()
    for closure in lay_out(mechanism, cut).closures:
        for first, second in closure.frames():
            pairs.append([first[0], second[0]])
            types.append("6d" if closure.type == "weld" else "3d")
    motors = [joint.coordinates[0] for joint in mechanism.actuators]
    lines = ["# Written by screwgauge models.", f"closed_loop: {_flow(pairs)}", f"type: {_flow(types)}"]
    return "\n".join([*lines, f"name_mot: {_flow(motors)}"]) + "\n"


def _flow(value: Sequence[object]) -> str:
    """Format a list as JSON, which is also valid YAML."""
    return json.dumps(value, ensure_ascii=False)
