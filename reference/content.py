"""Compares mechanisms and their parts by content."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

#: Fields that do not affect the motion of a mechanism.
_LABELS = {"title", "source", "group", "where", "remarks"}


def same_content(a: Any, b: Any) -> bool:
    """Return True if two mechanisms, or parts of them, are equal to the last bit, ignoring titles and files."""
    if is_dataclass(a) or is_dataclass(b):
        names = [each.name for each in fields(a) if each.name not in _LABELS] if type(a) is type(b) else []
        return bool(names) and all(same_content(getattr(a, name), getattr(b, name)) for name in names)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return same_content([*a.items()], [*b.items()])
    if isinstance(a, (tuple, list)) and isinstance(b, (tuple, list)):
        return len(a) == len(b) and all(map(same_content, a, b))
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    return bool(a == b)
