"""Reads TOML tables and checks their entries: keys, strings, names, lists, ranges.

`description` defines the meaning of entries for mechanisms; the package `scene` defines it for scenes.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from screwgauge.reference.errors import DescriptionError, UnknownNameError, quote
from screwgauge.reference.expressions import number, vector
from screwgauge.reference.files import LIMITS, check_count, check_plain, read_file
from screwgauge.reference.rotations import Array

T = TypeVar("T")

#: Tables that an extending description replaces as a whole.
WHOLE = ("inertia", "independent")
#: Tokens of a line: strings, words, dots and other characters.
_WORDS = re.compile(r"""(?P<part>"(?:[^"\\]|\\.)*+"?|'[^']*+'?|[\w-]++)|\.|\S""")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; decimals remain strings so that they can be read exactly.

    Raises:
        DescriptionError: The file cannot be read or is not TOML.
    """
    text = read_file(path)
    _check_dots(text, str(path))
    try:
        data = tomllib.loads(text, parse_float=str)
    except tomllib.TOMLDecodeError as error:
        raise DescriptionError(f"TOML syntax error: {error}", str(path), "correct that line") from None
    except (ValueError, RecursionError):  # integers with thousands of digits, deeply nested lists
        raise DescriptionError(
            "contains an integer too long, or lists nested too deeply, for TOML readers", str(path), "simplify it"
        ) from None
    check_plain(data, str(path))
    return data


def _check_dots(text: str, where: str) -> None:
    """Reject keys with too many parts, for which `tomllib` takes quadratic time."""
    for line in text.splitlines():
        parts, joined = 0, False
        for word in _WORDS.finditer(line) if line.count(".") >= LIMITS["parts of a dotted key"] else ():
            if word["part"]:
                parts = parts + 1 if joined else 1
                check_count(parts, "parts of a dotted key", where)
            elif word[0] != ".":
                parts = 0
            joined = word[0] == "."


def check_keys(table: Any, known: Iterable[str], where: str) -> None:
    """Reject unknown keys, and values that are not tables."""
    known = list(known)
    if not isinstance(table, dict):
        raise DescriptionError(f"{quote(table)} is not a table", where, "write key = value entries")
    for key in table:
        if key not in known:
            raise UnknownNameError("key", key, sorted(known), where)


def require(table: dict[str, Any], key: str, where: str) -> Any:
    """Return an entry; reject a table that lacks it."""
    if key not in table:
        raise DescriptionError(f"'{key}' is missing", where, f"add {key} = ...")
    return table[key]


def read_text(table: dict[str, Any], key: str, where: str, default: str | None = None) -> str:
    """Read a string entry, which is required if no default is given."""
    value = require(table, key, where) if default is None else table.get(key, default)
    if not isinstance(value, str):
        raise DescriptionError(f"{quote(value)} is not text", f"{where}, {key}", "write it in quotes")
    return value


def merge(base: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Merge `change` into `base` table by table; replace `WHOLE` entries."""
    result = dict(base)
    for key, value in change.items():
        deep = isinstance(value, dict) and isinstance(result.get(key), dict) and key not in WHOLE
        result[key] = merge(result[key], value) if deep else value
    return result


def read_name(value: Any, where: str) -> str:
    """Read a name that is valid in file names, URDF and MJCF ('@' is reserved for elements that model files add)."""
    if not re.fullmatch(r"\w[\w.:+-]*", check_text(value, where)):
        raise DescriptionError(f"{quote(value)} is not a name", where, "use letters, digits and . _ - + : only")
    return str(value)


def read_table(data: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    """Read a required, non-empty table of named entries."""
    table = require(data, key, where)
    if not isinstance(table, dict) or not table:
        raise DescriptionError(f"'{key}' has no entries", where, f"write at least one [{key}.NAME]")
    if key in LIMITS:
        check_count(len(table), key, where)
    return table


def check_length(value: Any, n: int, what: str, where: str, remedy: str) -> None:
    """Reject a value that is not a list of n entries."""
    if not isinstance(value, list) or len(value) != n:
        raise DescriptionError(what, where, remedy)


def read_list(data: dict[str, Any], key: str, where: str) -> list[Any]:
    """Read an optional list of tables, ``[[key]]``."""
    items = data.get(key, [])
    if not isinstance(items, list):
        raise DescriptionError(f"'{key}' is not a list", where, f"write [[{key}]]")
    check_count(len(items), "entries", f"{where}, {key}")
    return items


def read_items(data: dict[str, Any], key: str, where: str, read: Callable[[Any, str], T]) -> tuple[T, ...]:
    """Read the entries of a list with `read`, which also receives the location of the entry in the file."""
    return tuple(read(item, f"{where}, {key}") for item in read_list(data, key, where))


def read_flag(table: dict[str, Any], key: str, where: str) -> bool:
    """Read a Boolean value; the default is false."""
    value = table.get(key, False)
    if not isinstance(value, bool):
        raise DescriptionError(f"'{value}' is not true or false", f"{where}.{key}", "write true or false")
    return value


def check_name(kind: str, name: str, known: Iterable[str], where: str) -> str:
    """Return a name; reject unknown names.

    Raises:
        UnknownNameError: The name is unknown.
    """
    if name not in known:
        raise UnknownNameError(kind, name, known, where)
    return name


def read_vector(table: dict[str, Any], key: str, where: str) -> Array:
    """Read three numbers; the default is zeros. Shape (3,)."""
    return vector(table.get(key, [0, 0, 0]), f"{where}.{key}")


def positive(value: Any, where: str, remedy: str = "use a positive number") -> float:
    """Read a positive number."""
    result = number(value, where)
    if result <= 0.0:
        raise DescriptionError(f"{result:g} is not positive", where, remedy)
    return result


def read_names(value: Any, where: str) -> tuple[str, ...]:
    """Read a list of names without duplicates; the list may be empty, and names may be unknown."""
    if not isinstance(value, list):
        raise DescriptionError(f"{quote(value)} is not a list of names", where, "write a list")
    return tuple(dict.fromkeys(str(name) for name in value))


def check_text(value: Any, where: str) -> str:
    """Read a non-empty string; only ``source`` may be empty."""
    if not isinstance(value, str) or (value == "" and not where.endswith("source")):
        raise DescriptionError(f"{quote(value)} is not text", where, "write a name in quotes")
    return value


def read_coefficients(value: Any, where: str) -> Array:
    """Read the coefficients of a polynomial, at least one, lowest first. Shape (m,)."""
    if not isinstance(value, list) or not value:
        what = f"{quote(value)} is not a list of coefficients"
        raise DescriptionError(what, where, "write the coefficients, lowest first: [c0, c1]")
    check_count(len(value), "coefficients", where)
    return vector(value, where, len(value))


def check_times(t: Array, where: str) -> None:
    """Reject sample times that do not increase, and an empty list of times. Shape (n,)."""
    if not len(t):
        raise DescriptionError("has no samples", where, "write at least one row below the header")
    if (np.diff(t) <= 0.0).any():
        raise DescriptionError("the times do not increase", where, "sort the rows by t")
