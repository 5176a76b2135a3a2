"""TOML of descriptions and loops files, numbers in full."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwgauge.models.placement import number_text
from screwgauge.reference.mechanism import Frame, Mechanism

Table = tuple[str, Mapping[str, Any]]


def document(top: Sequence[str], mechanism: Mechanism, parts: Sequence[Table], closures: Sequence[Table] = ()) -> str:
    """The first lines, then tables, each under its title: what is independent, the parts, couplings and closures."""
    tables: list[Table] = [("[independent]", mechanism.independent)]
    if mechanism.axial:
        tables.append(("[spherical_axial]", {"joint": mechanism.axial[0], "direction": mechanism.axial[1]}))
    tables += parts
    for one in mechanism.couplings:
        of = {"of": one.of} if one.of else {}
        coupling = {"coordinate": one.coordinate, **of, "polynomial": one.polynomial}
        tables.append((f"[couplings.{key(one.name)}]", coupling))
    out = [*top]
    for title, entries in (*tables, *closures):
        out += ["", title, *lines(entries)]
    return "\n".join(out) + "\n"


def lines(entries: Mapping[str, Any]) -> list[str]:
    """``key = value``, one line each."""
    return [f"{key(name)} = {value_text(value)}" for name, value in entries.items()]


def value_text(value: Any) -> str:
    """Text, numbers in full, frames, arrays and tables."""
    match value:
        case bool():
            return str(value).lower()
        case str():  # JSON strings are TOML strings but for DEL
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case Frame():
            return f"{{ position = {value_text(value.p)}, rotation = {{ matrix = {value_text(value.R)} }} }}"
        case dict():
            return "{ " + ", ".join(lines(value)) + " }"
        case tuple() | np.ndarray():
            return "[" + ", ".join(map(value_text, value)) + "]"
    return number_text(value)


def key(name: str) -> str:
    """A name as a key."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else value_text(name)
