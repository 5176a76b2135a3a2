"""Classifies content of model files that descriptions cannot express, using ``content.toml`` and ``elements.toml``.

``content.toml`` lists the kinds that affect motion or forces, and how a comparison of two models treats each kind;
``elements.toml`` lists every element and attribute of the formats.
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

#: Kind of content that does not belong to any other kind.
OTHER = "not represented in the reading"
#: Pairs of label and value.
Values = tuple[tuple[str, float | str], ...]
#: Number of items of a kind that are named; further items are only counted.
_NAMED = 3


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of content in ``content.toml``.

    Attributes:
        fate: How a comparison treats this kind; `content.toml` explains each value.
        note: Quantity by which content of this kind is compared, or the reason why it is not compared.
        alone: Treatment if only one of the two models has, or can have, content of this kind: ``withheld``, ``aside``,
            or empty if `fate` still applies.
        xml: Names that `_ElementWalk` reports for content of this kind.
        of, arrays, when, joints: How a compiled MuJoCo model stores content of this kind.
        run: How a run treats this kind; `content.toml` explains each value.
        why, remedy: For a kind that is refused: the error that it would cause, and how to avoid it.
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
    """Content of a file that the remaining entries of a reading do not represent.

    Attributes:
        kind: Name of a `Kind`.
        what: Description, or names of the element and attribute.
        whose: Owner of the content, formatted to follow `what`: `` of joint a``, or the content's own name.
        of: Items on which the content acts: namespace in the reading (``joints``, ``bodies``, ``actuators``), name, and
            weight, such as the coefficient of a joint in a tendon.
        values: Label and number or string of each value, in a fixed order; None if the values are unknown.
    """

    kind: str
    what: str
    whose: str = ""
    of: tuple[tuple[str, str, float], ...] = ()
    values: Values | None = None

    @property
    def sentence(self) -> str:
        """The content and its owner as text."""
        return f"{self.what}{self.whose}"

    def rename(self, names: Mapping[str, Mapping[str, str]]) -> Content:
        """Rename the items on which the content acts. `names`: namespace -> name -> new name."""
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
    """Return the name of the kind that contains an XML element, or `OTHER`."""
    return next((kind.name for kind in kinds().values() if element in kind.xml), OTHER)


def force_limits(joint: str, most: float) -> Content:
    """Convert the force or torque limit of a joint [N or N m] to content, in the form that MuJoCo stores."""
    values = ("actfrcrange[0]", -most), ("actfrcrange[1]", most)
    return Content("force limits", "limit effort", f" of joint {joint}", (("joints", joint, 1.0),), values)


def phrases(contents: Iterable[Content]) -> tuple[str, ...]:
    """Merge content with the same name into one phrase; keep the file order."""
    owners: dict[str, list[str]] = {}
    for each in contents:
        owners.setdefault(each.what, []).append(each.whose)
    return tuple(f"{what}{_owner_phrase(names)}" for what, names in owners.items())


def _owner_phrase(owners: list[str]) -> str:
    """Merge owners such as `` of joint a``, `` of joint b`` into one phrase: `` of joint a, b, c and 9 more``."""
    owners = list(dict.fromkeys(owners))
    kind = " ".join(owners[0].split(" ")[:3]) if owners[0].startswith(" of ") else ""  # names may have spaces
    return first_few([owners[0], *(owner.removeprefix(f"{kind} ") for owner in owners[1:])], _NAMED)


#: Suffix of a model file -> name of its format in the table.
FORMATS = {".urdf": "urdf", ".xml": "mjcf", ".sdf": "sdf"}
_ALL, _WITH_ALL_IN_IT = "*", "..."
#: Kinds in the table in lookup order, and the kinds that are reported.
_KINDS = ("compared", "nothing", "measured", "applied", "ignored")
SAID = ("measured", "ignored", "applied", "unknown", "lost")
#: Kinds that depend on the library; they are looked up before all other kinds.
_OF_READINGS = ("lost", "held")


@dataclass(frozen=True, slots=True)
class Extra:
    """An element or attribute that descriptions cannot express.

    Attributes:
        kind: One of `SAID`.
        what: Element or attribute.
        whose: Owner, formatted to follow `what`: `` of joint a``, or the element's own name.
        element, attribute: Location; the attribute is empty for a whole element.
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
    """List the extras of a readable file; omit extras without effect (zero damping, limits as in the description).

    Args:
        form: ``urdf`` or ``mjcf``.

    Raises:
        ParseError: The file is not well-formed XML; some parsers used in robotics accept it nevertheless.
    """
    root = ET.fromstring(read_xml(path))
    if form == "mjcf":
        _include(root, path.parent)
    flags = {key: value for flag in root.iter("flag") for key, value in flag.items()}
    return list(_ElementWalk(element_tables()[form], flags, _of_coordinates(mechanism)).walk(root))


def beyond_reading(root: ET.Element, form: str, library: str) -> list[Extra]:
    """List the content of a file that is lost, or not represented in the reading, when a library reads the file.

    Args:
        root: Root element of the file.
        form: ``urdf``, ``mjcf`` or ``sdf``.
        library: Library that reads the format.
    """
    known = element_tables()[form]
    reading = {kind: known.get(kind, {}).get(library, {}) for kind in _OF_READINGS}
    return list(_ElementWalk({**known, **reading}, {}, {}, (*_OF_READINGS, *_KINDS)).walk(root))


def unread_rows(library: str) -> list[str]:
    """List the properties of a loops file that a library's engines ignore, named as in the model check."""
    rows: list[str] = element_tables()["loops"]["ignored"].get(library, [])
    return rows


def _include(root: ET.Element, folder: Path) -> None:
    """Replace each ``<include>`` with the elements of the included file, as MuJoCo does."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        for i in reversed(range(len(element))):
            if element[i].tag == "include" and is_file(file := folder / element[i].get("file", "")):
                element[i : i + 1] = [*ET.fromstring(read_xml(file))]
        waiting += element


def _of_coordinates(mechanism: Mechanism) -> dict[str, dict[str, str]]:
    """Map each coordinate to its attributes in model files, with values formatted from the description."""
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
    """Searches the elements of a file for extras.

    Attributes:
        table: Element table of the file's format.
        flags: Flags that the file enables or disables.
        own: See `_of_coordinates`.
        kinds: Kinds in lookup order.
    """

    table: Mapping[str, Any]
    flags: Mapping[str, str]
    own: Mapping[str, Mapping[str, str]]
    kinds: tuple[str, ...] = _KINDS

    def walk(self, root: ET.Element) -> Iterator[Extra]:
        """Yield all extras of a file; do not recurse, since elements may be nested deeper than Python's call stack."""
        bare = {tag: {*names.split()} for tag, names in self.table.get("bare", {}).items()}
        if any(True for default in root.iter("default") for _ in default.iter("tendon")):
            bare = {}  # default classes may give the element further attributes
        joined = self.table.get("joined", "").split()
        waiting = [(root, ET.Element(""), "")]  # element, its parent, tag and name of the nearest named ancestor
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
            owner = f"{tag} {name}" if name and parent else owner  # the model itself is not reported as an owner
            for attribute, value in {**self._absent(element, around), **element.attrib}.items():
                kind = self._kind(attribute, kinds)
                if attribute.partition(":")[0] == "xmlns":  # the elements of that namespace are reported
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
        """Return the values implied by absent attributes."""
        values: dict[str, str] = self.table.get("absent", {}).get(f"{around.get('type')}/{element.tag}", {})
        return values

    def _kind(self, attribute: str, kinds: Mapping[str, list[str] | None]) -> str:
        if self.flags.get(self.table.get("switch", {}).get(attribute)) == "disable":
            return "ignored"
        every = {attribute, _ALL, _WITH_ALL_IN_IT}
        return next((kind for kind, names in kinds.items() if names and every & {*names}), "unknown")

    def _attributes(self, kind: str, parent: str, tag: str) -> list[str] | None:
        """Return the attributes that the table lists for an element under a kind; None if the element is not listed."""
        entries = self.table.get(kind, {})
        names = entries.get(f"{parent}/{tag}", entries.get(tag))
        return None if names is None else names.split()

    def _is_nothing(self, element: ET.Element) -> bool:
        """Return True if the file's flags or the element's own attributes make the element mechanically irrelevant."""
        has = {**self.flags, **element.attrib}
        cases, text = self.table.get("unless", {}).get(element.tag, ()), (element.text or "").strip()
        if text and self._has_no_effect(element.tag, text, ""):
            return True
        return any(all(has.get(key) == value for key, value in case.items()) for case in cases)

    def _has_no_effect(self, attribute: str, value: str, name: str) -> bool:
        """Return True if the value is neutral or equals the value in the description."""
        idle = self.table["neutral"].get(attribute), self.own.get(name, {}).get(attribute)
        return _numbers(value) in map(_numbers, filter(None, idle))


def _plain(name: str) -> str:
    """Remove the XML namespace from a name."""
    return name.rpartition("}")[2]


def _numbers(text: str) -> list[float] | str:
    """Return the numbers of a value, omitting zeros at the end, or the text itself if it is not numeric."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return text
    while numbers and numbers[-1] == 0.0:
        numbers.pop()
    return numbers
