"""Content of model files that a description lacks, classified by ``content.toml`` and ``elements.toml``.

The first lists the kinds that act on motion or forces and how a comparison of two models treats each; the second
lists each element and attribute of the formats.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.formats import WIDE, number_text, vector_text
from screwgauge.models.mjcf import FAR
from screwgauge.reference.errors import first_few
from screwgauge.reference.files import is_file, read_xml
from screwgauge.reference.mechanism import Mechanism

#: The kind of what is in no other.
OTHER = "not held by the reading"
#: Labels and values.
Values = tuple[tuple[str, float | str], ...]
#: Things of a kind that are named; the others are counted.
_NAMED = 3


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of content in ``content.toml``.

    Attributes:
        fate: What becomes of it; `content.toml` explains each.
        note: By what it is compared, or why it is not.
        alone: ``withheld`` or ``aside`` if that is what it is where one model alone can have it or has it.
        xml: Names by which the walk through a file calls it.
        of, arrays, when, joints: How a compiled MuJoCo model keeps it.
        run: What a run of the file makes of it; `content.toml` explains each.
        why, remedy: Of a kind that is refused: what would be wrong without it, and what to do.
    """

    name: str
    fate: str
    note: str
    alone: str = ""
    xml: tuple[str, ...] = ()
    of: str = ""
    arrays: tuple[str, ...] = ()
    when: str = ""
    joints: tuple[int, ...] = ()
    run: str = ""
    why: str = ""
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Content:
    """Content of a file that no other entry of a reading holds.

    Attributes:
        kind: Name of a `Kind`.
        what: In words, or element and attribute.
        whose: What it belongs to, to be read after it: `` of joint a``, or its own name.
        of: Each thing that it acts on: room of a reading (``joints``, ``bodies``, ``actuators``), name there, and how
            much it counts, such as the coefficient of a joint in a tendon.
        values: Label and number or text of each of its values, in a fixed order; None where that is not known.
    """

    kind: str
    what: str
    whose: str = ""
    of: tuple[tuple[str, str, float], ...] = ()
    values: Values | None = None

    @property
    def sentence(self) -> str:
        """Kind and owner as text."""
        return f"{self.what}{self.whose}"

    def renamed(self, names: Mapping[str, Mapping[str, str]]) -> Content:
        """Rename the things that content acts on. `names`: room -> name -> other name."""
        of = sorted((room, names.get(room, {}).get(name, name), share) for room, name, share in self.of)
        return replace(self, of=tuple(of))


@cache
def table() -> Mapping[str, Any]:
    """Return the parsed ``content.toml``."""
    return tomllib.loads(Path(__file__).with_name("content.toml").read_text(encoding="utf-8"))


@cache
def kinds() -> Mapping[str, Kind]:
    """Return all kinds by name."""
    entries_by_name = {}
    for name, entry in table()["kinds"].items():
        entries = {**entry, "xml": tuple(entry.get("xml", ())), "arrays": tuple(entry.get("arrays", "").split())}
        entries["joints"] = tuple(entry.get("joints", ()))
        entries_by_name[name] = Kind(name, **entries)
    return entries_by_name


def kind_of(element: str) -> str:
    """Name of the kind that the walk through a file calls so."""
    return next((kind.name for kind in kinds().values() if element in kind.xml), OTHER)


def force_limits(joint: str, most: float) -> Content:
    """Return the largest force or torque of a joint as content, as MuJoCo keeps it [N or N m]."""
    values = ("actfrcrange[0]", -most), ("actfrcrange[1]", most)
    return Content("force limits", "limit effort", f" of joint {joint}", (("joints", joint, 1.0),), values)


def phrases(contents: Iterable[Content]) -> tuple[str, ...]:
    """Merge content of the same name into a phrase, in the order of the file."""
    owners: dict[str, list[str]] = {}
    for each in contents:
        owners.setdefault(each.what, []).append(each.whose)
    return tuple(f"{what}{_whose(names)}" for what, names in owners.items())


def _whose(owners: list[str]) -> str:
    """Return `` of joint a, b, c and 9 more`` from `` of joint a``, `` of joint b`` ..."""
    owners = list(dict.fromkeys(owners))
    kind = " ".join(owners[0].split(" ")[:3]) if owners[0].startswith(" of ") else ""  # names may have spaces
    return first_few([owners[0], *(owner.removeprefix(f"{kind} ") for owner in owners[1:])], _NAMED)


#: Ending of a model file -> its format in the table.
FORMATS = {".urdf": "urdf", ".xml": "mjcf", ".sdf": "sdf"}
_ALL, _WITH_ALL_IN_IT = "*", "..."
#: Kinds in the table, in the order in which they are looked up, and those of them that are worth a word.
_KINDS = ("compared", "nothing", "measured", "applied", "ignored")
SAID = ("measured", "ignored", "applied", "unknown", "lost")
#: Those of a library's readings, looked up before.
_OF_READINGS = ("lost", "held")


@dataclass(frozen=True, slots=True)
class Extra:
    """An element or attribute that descriptions do not have.

    Attributes:
        kind: One of `SAID`.
        what: Element or attribute.
        whose: What it belongs to, to be read after it: `` of joint a``, or the element's own name.
        element, attribute: Where it stands; no attribute where it is the whole element.
    """

    kind: str
    what: str
    whose: str
    element: ET.Element | None = None
    attribute: str = ""


@cache
def element_tables() -> Mapping[str, Any]:
    """Return the parsed ``elements.toml``."""
    return tomllib.loads(Path(__file__).with_name("elements.toml").read_text(encoding="utf-8"))


def extras(path: Path, form: str, mechanism: Mechanism) -> list[Extra]:
    """List the extras of a readable file, without those of no effect (damping 0, limits of the description).

    Args:
        form: ``urdf`` or ``mjcf``.

    Raises:
        ParseError: It is no XML: the parsers of robotics let pass more than is one.
    """
    root = ET.fromstring(read_xml(path))
    if form == "mjcf":
        _include(root, path.parent)
    flags = {key: value for flag in root.iter("flag") for key, value in flag.items()}
    return list(_ElementWalk(element_tables()[form], flags, _of_coordinates(mechanism)).through(root))


def beyond_reading(root: ET.Element, form: str, library: str) -> list[Extra]:
    """List the content of a file that a library's reading does not hold.

    Args:
        root: Of the file.
        form: ``urdf``, ``mjcf`` or ``sdf``.
        library: One that reads the format.
    """
    known = element_tables()[form]
    reading = {kind: known.get(kind, {}).get(library, {}) for kind in _OF_READINGS}
    return list(_ElementWalk({**known, **reading}, {}, {}, (*_OF_READINGS, *_KINDS)).through(root))


def unread_rows(library: str) -> list[str]:
    """List the properties of a loops file, as the model check calls them, that engines on a library ignore."""
    rows: list[str] = element_tables()["loops"]["ignored"].get(library, [])
    return rows


def _include(root: ET.Element, folder: Path) -> None:
    """Puts the elements of included files in the place of ``<include>``, as MuJoCo does."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        for i in reversed(range(len(element))):
            if element[i].tag == "include" and is_file(file := folder / element[i].get("file", "")):
                element[i : i + 1] = [*ET.fromstring(read_xml(file))]
        waiting += element


def _of_coordinates(mechanism: Mechanism) -> dict[str, dict[str, str]]:
    """Return coordinate -> attribute -> value of the description, as the writers write it."""
    values = {}
    for joint in mechanism.joints:
        numbers = joint.coordinates, joint.limits, joint.rotor, joint.damping, joint.friction
        for name, limits, *amounts in zip(*numbers, strict=True):
            low, high = vector_text(np.clip(limits, -WIDE, WIDE)).split()
            rotor, damping, friction = map(number_text, amounts)
            values[name] = {"lower": low, "upper": high, "range": vector_text(np.clip(limits, -FAR, FAR))}
            values[name] |= {"armature": rotor, "damping": damping, "friction": friction, "frictionloss": friction}
    return values


@dataclass(frozen=True, slots=True)
class _ElementWalk:
    """A walk through the elements of a file.

    Attributes:
        table: Of its format.
        flags: All that the file switches on and off.
        own: See `_of_coordinates`.
        kinds: In the order in which they are looked up.
    """

    table: Mapping[str, Any]
    flags: Mapping[str, str]
    own: Mapping[str, Mapping[str, str]]
    kinds: tuple[str, ...] = _KINDS

    def through(self, root: ET.Element) -> Iterator[Extra]:
        """Yield all extras of a file, whose elements may be nested deeper than Python's call stack."""
        bare = {tag: {*names.split()} for tag, names in self.table.get("bare", {}).items()}
        if any(True for default in root.iter("default") for _ in default.iter("tendon")):
            bare = {}  # as classes may give it more
        joined = self.table.get("joined", "").split()
        waiting = [(root, ET.Element(""), "")]  # element, what it is in, tag and name of the nearest around with a name
        while waiting:
            element, around, owner = waiting.pop()
            tag, name, parent = element.tag, element.get("name", ""), around.tag
            kinds = {kind: self._attributes(kind, parent, tag) for kind in self.kinds}
            first = next((kind for kind, names in kinds.items() if names is not None), "")
            whole = first if kinds.get(first) == [_WITH_ALL_IN_IT] else ""
            if whole or not first:
                nothing = self._is_nothing(element) or (tag in bare and {*element.attrib} <= bare[tag])
                if whole not in ("compared", "nothing", "held") and not nothing:
                    what = f"{tag} tendon" if parent == "tendon" else _plain(tag)
                    what = f"{parent} {what}" if not name and parent in joined else what
                    yield Extra(whole or "unknown", what, f" {name}" if name else owner and f" of {owner}", element)
                continue
            owner = f"{tag} {name}" if name and parent else owner  # the model is no owner worth naming
            for attribute, value in {**self._absent(element, around), **element.attrib}.items():
                kind = self._kind(attribute, kinds)
                if attribute.partition(":")[0] == "xmlns":  # names a dialect, of which elements follow or not
                    continue
                if kind in SAID and not self._has_no_effect(attribute, value, owner.partition(" ")[2]):
                    what = _plain(attribute) if name else f"{tag} {_plain(attribute)}"
                    yield Extra(kind, what, owner and f" of {owner}", element, attribute)
            once, read = self.table.get("once", {}).get(tag, "").split(), dict[str, ET.Element]()
            for child in element:
                if child.tag in once and read.setdefault(child.tag, child) is not child:
                    yield Extra("ignored", f"second {child.tag}", owner and f" of {owner}")
            waiting += [(child, element, owner) for child in reversed(element) if read.get(child.tag, child) is child]

    def _absent(self, element: ET.Element, around: ET.Element) -> dict[str, str]:
        """Return the values that absent attributes stand for."""
        values: dict[str, str] = self.table.get("absent", {}).get(f"{around.get('type')}/{element.tag}", {})
        return values

    def _kind(self, attribute: str, kinds: Mapping[str, list[str] | None]) -> str:
        if self.flags.get(self.table.get("switch", {}).get(attribute)) == "disable":
            return "ignored"
        every = {attribute, _ALL, _WITH_ALL_IN_IT}
        return next((kind for kind, names in kinds.items() if names and every & {*names}), "unknown")

    def _attributes(self, kind: str, parent: str, tag: str) -> list[str] | None:
        """Return the attributes that the table has of a kind; None if it does not have the element."""
        entries = self.table.get(kind, {})
        names = entries.get(f"{parent}/{tag}", entries.get(tag))
        return None if names is None else names.split()

    def _is_nothing(self, element: ET.Element) -> bool:
        """True if the file's flags or the element's own attributes leave it without mechanics."""
        has = {**self.flags, **element.attrib}
        cases, text = self.table.get("unless", {}).get(element.tag, ()), (element.text or "").strip()
        if text and self._has_no_effect(element.tag, text, ""):
            return True
        return any(all(has.get(key) == value for key, value in case.items()) for case in cases)

    def _has_no_effect(self, attribute: str, value: str, name: str) -> bool:
        """True for a neutral value, and for that of the description."""
        idle = self.table["neutral"].get(attribute), self.own.get(name, {}).get(attribute)
        return _numbers(value) in map(_numbers, filter(None, idle))


def _plain(name: str) -> str:
    """Remove the namespace from a name."""
    return name.rpartition("}")[2]


def _numbers(text: str) -> list[float] | str:
    """Return the numbers of a value without zeros at its end, or the value itself."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return text
    while numbers and numbers[-1] == 0.0:
        numbers.pop()
    return numbers
