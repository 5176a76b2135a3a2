"""TOML of descriptions and loops files, numbers in full."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from screwgauge.models.placement import number_text
from screwgauge.reference.mechanism import Frame


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
