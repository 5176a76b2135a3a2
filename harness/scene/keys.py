"""Reads the tables of scene files as defined in ``keys.toml``, from which a page of the guide is also generated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import DescriptionError, quote
from screwgauge.reference.expressions import number, unit_vector, vector
from screwgauge.reference.tables import (
    check_keys,
    check_name,
    positive,
    read_flag,
    read_name,
    read_names,
    read_text,
    read_toml,
    require,
)

#: Table of a scene file -> its title, its purpose and its keys.
TABLES: dict[str, dict[str, Any]] = read_toml(Path(__file__).with_name("keys.toml"))


def _count(value: Any, key: str, where: str) -> int:
    if type(value) is not int or value < 2:
        raise DescriptionError(f"{key} is {quote(value)}", where, "use a whole number of at least 2")
    return value


#: Shape -> function that reads a value, given its key and the place of its table. Other shapes have separate readers.
SHAPES: dict[str, Callable[[Any, str, str], Any]] = {
    "text": lambda value, key, where: read_text({key: value}, key, where),
    "flag": lambda value, key, where: read_flag({key: value}, key, where),
    "number": lambda value, key, where: number(value, f"{where}.{key}"),
    "positive": lambda value, key, where: positive(value, f"{where}.{key}"),
    "vector": lambda value, key, where: vector(value, f"{where}.{key}"),
    "unit vector": lambda value, key, where: unit_vector(value, f"{where}.{key}"),
    "name": lambda value, key, where: read_name(value, f"{where}.{key}"),
    "names": lambda value, key, where: read_names(value, f"{where}, {key}"),
    "count": _count,
}


def read_keys(name: str, table: Any, where: str) -> dict[str, Any]:
    """Read a table of a scene file; return key -> value, where a missing key has its default, or None if optional.

    Args:
        name: Name of the table in ``keys.toml``.

    Raises:
        ScrewgaugeError: The entry is not a table, a key is unknown or missing, or a value has the wrong shape or is out
            of bounds.
    """
    keys = TABLES[name]["keys"]
    check_keys(table, keys, where)
    return {key: _read(key, one, table, where) for key, one in keys.items()}


def _read(key: str, one: dict[str, Any], table: dict[str, Any], where: str) -> Any:
    if key not in table and "default" not in one:
        return None if one.get("optional") else require(table, key, where)
    value: Any = table.get(key, one.get("default"))
    if "among" in one:
        return check_name(one.get("noun", key), value, one["among"], where)
    if read := SHAPES.get(one["shape"]):
        value = read(value, key, where)
    if "between" in one:
        least, most = map(float, one["between"])
        if not least < value < most:
            what = f"{value:g} is not between {least:g} and {most:g}"
            raise DescriptionError(what, f"{where}.{key}", "use a number in this range")
    return value


def choices_of(table: str, key: str) -> tuple[str, ...]:
    """Return the names that a key accepts, starting with the default."""
    return tuple(TABLES[table]["keys"][key]["among"])
