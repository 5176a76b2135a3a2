"""Content of model files that acts on motion or forces, by the table ``content.toml``: what kinds there are, what a
comparison of two models makes of each.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import first_few

#: What becomes of a kind; `content.toml` says what each means.
FATES = ("held", "compared", "withheld", "aside", "irrelevant")
#: The kind of what is in no other.
OTHER = "not held by the reading"
#: Labels and values.
Values = tuple[tuple[str, float | str], ...]
#: Things of a kind that are named; the others are counted.
_NAMED = 3


@dataclass(frozen=True, slots=True)
class Kind:
    """An entry of the table.

    Attributes:
        fate: One of `FATES`.
        note: By what it is compared, or why it is not.
        alone: ``withheld`` or ``aside`` if that is what it is where one model alone can have it or has it.
        xml: Names by which the walk through a file calls it.
        of, arrays, when, joints: How a compiled MuJoCo model keeps it.
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


@dataclass(frozen=True, slots=True)
class Content:
    """Something that a file says and no other entry of a reading holds.

    Attributes:
        kind: Name of a `Kind`.
        what: In words, or element and attribute.
        whose: What it belongs to, to be read after it: `` of joint a``, or its own name.
        of: Each thing that it acts on: room of a reading (``joints``, ``bodies``, ``actuators``), name there, and how
            much it counts, such as the coefficient of a joint in a tendon.
        values: Label and number or text of all that it says, in a fixed order; None where that is not known.
    """

    kind: str
    what: str
    whose: str = ""
    of: tuple[tuple[str, str, float], ...] = ()
    values: Values | None = None

    @property
    def sentence(self) -> str:
        """What and whose."""
        return f"{self.what}{self.whose}"

    def renamed(self, names: Mapping[str, Mapping[str, str]]) -> Content:
        """By other names of what it acts on. `names`: room -> name -> other name."""
        of = sorted((room, names.get(room, {}).get(name, name), share) for room, name, share in self.of)
        return replace(self, of=tuple(of))


@cache
def table() -> Mapping[str, Any]:
    """The table, as read."""
    return tomllib.loads(Path(__file__).with_name("content.toml").read_text(encoding="utf-8"))


@cache
def kinds() -> Mapping[str, Kind]:
    """All kinds by name."""
    found = {}
    for name, entry in table()["kinds"].items():
        entries = {**entry, "xml": tuple(entry.get("xml", ())), "arrays": tuple(entry.get("arrays", "").split())}
        entries["joints"] = tuple(entry.get("joints", ()))
        found[name] = Kind(name, **entries)
    return found


def kind_of(element: str) -> str:
    """Name of the kind that the walk through a file calls so."""
    return next((kind.name for kind in kinds().values() if element in kind.xml), OTHER)


def phrases(found: Iterable[Content]) -> tuple[str, ...]:
    """One phrase for all that is called alike, in the order in which they were found."""
    owners: dict[str, list[str]] = {}
    for each in found:
        owners.setdefault(each.what, []).append(each.whose)
    return tuple(f"{what}{_whose(names)}" for what, names in owners.items())


def _whose(owners: list[str]) -> str:
    """`` of joint a, b, c and 9 more``, from `` of joint a``, `` of joint b`` ..."""
    owners = list(dict.fromkeys(owners))
    kind = " ".join(owners[0].split(" ")[:3]) if owners[0].startswith(" of ") else ""  # names may have spaces
    return first_few([owners[0], *(owner.removeprefix(f"{kind} ") for owner in owners[1:])], _NAMED)
