"""Numbers of one's own, of a file or arrays, which stand beside the engines of a scene."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.reference.description import check_keys, read_text
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.files import beside
from screwgauge.reference.rotations import Array
from screwgauge.scene.columns import numbers, read_columns, same_times
from screwgauge.scene.entries import positive

_NAME = re.compile(r"[\w.-]+")


@dataclass(frozen=True, slots=True)
class Header:
    """What a column is named: ``component``, ``quantity/component``, either with its unit: ``leg1 [N]``."""

    text: str
    quantity: str
    component: str
    unit: str

    def check_unit(self, unit: str, where: str) -> None:
        """Refuses a stated unit that is not that of the component: nothing is converted."""
        if self.unit and self.unit.replace("·", " ").replace("²", "^2") != unit:
            raise DescriptionError(f"column '{self.text}' is in {unit} here", where, "convert it")


def read_header(text: str) -> Header:
    """Takes the name of a column apart."""
    name, _, unit = text.partition("[")
    quantity, _, component = name.strip().rpartition("/")
    return Header(text, quantity, component, unit.rstrip("] "))


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Numbers of one's own: a solution by hand or by another program, a recording.

    Attributes:
        t: Times [s], increasing. Shape (n,).
        columns: Name, as in a file (see ``harness/scenes/README.md``) -> values. Shape (n,) each.
        error: Quantity -> what its values may be off by [its units], beyond the tolerances of the scene.
        file: Where it was read from.

    Raises:
        DescriptionError: A number is missing, or the times do not increase.
    """

    t: Array
    columns: Mapping[str, Array]
    error: Mapping[str, float] = field(default_factory=dict)
    file: Path | None = None

    def __post_init__(self) -> None:
        if np.ndim(self.t) != 1:
            raise DescriptionError("are no list of times", f"t of {self.where}", "give a list of times in s")
        t = numbers(self.t, "column 't'", self.where)
        if not len(t):
            raise DescriptionError("has no samples", self.where, "write at least one row below the header")
        if (np.diff(t) <= 0).any():
            raise DescriptionError("the times do not increase", self.where, "sort the rows by t")
        if not self.columns:
            raise DescriptionError("has no column besides t", self.where, "name columns as components are named")
        if not isinstance(self.error, Mapping):
            raise DescriptionError(f"error {self.error!r} is not a table", self.where, "write quantity = number")
        error = {name: positive(value, f"{self.where}, error.{name}") for name, value in self.error.items()}
        object.__setattr__(self, "error", error)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "columns", {name: self._column(name) for name in self.columns})

    @property
    def where(self) -> str:
        """What to blame."""
        return str(self.file or "arrays")

    def _column(self, name: str) -> Array:
        values = self.columns[name]
        if np.shape(values) != (len(self.t),):
            what = f"column '{name}' has shape {np.shape(values)}, for {len(self.t)} times"
            raise DescriptionError(what, self.where, "give a number for each time")
        return numbers(values, f"column '{name}'", self.where)


def read_tables(tables: Any, folder: Path, where: str) -> dict[str, Recorded]:
    """Reads ``[tables]``: name -> file, or ``{ file, error }``.

    Raises:
        DescriptionError: A name is none, or a file is no table.
    """
    if not isinstance(tables, dict):
        raise DescriptionError(f"{tables!r} is not a table", where, "write name = 'file'")
    return {name: _read(name, table, folder, where) for name, table in tables.items()}


def _read(name: str, entry: Any, folder: Path, where: str) -> Recorded:
    if not _NAME.fullmatch(name):
        raise DescriptionError(f"'{name}' is no name", where, "write letters, digits, dots and dashes")
    entry = {"file": entry} if isinstance(entry, str) else entry
    check_keys(entry, {"file", "error"}, where := f"{where}.{name}")
    path = beside(folder, read_text(entry, "file", where))
    columns = read_columns(path)
    times = [header for header in map(read_header, columns) if header.component == "t" and not header.quantity]
    if len(times) != 1:
        raise DescriptionError("column 't' is missing", str(path), "give one column t with the times in s")
    times[0].check_unit("s", str(path))
    return Recorded(columns.pop(times[0].text), columns, entry.get("error", {}), path)


def merged(t: Array, tables: Iterable[Recorded]) -> Array:
    """Times of a scene with those of its tables, in order if these bring further ones. Shape (n,).

    Raises:
        DescriptionError: A table has times before or after those of the scene.
    """
    first, last = t.min(), t.max()
    for table in tables:
        beyond = table.t[~np.isclose(table.t, np.clip(table.t, first, last), rtol=1e-12, atol=1e-15)]
        if beyond.size:
            what = f"t = {beyond[0]:g} s is not within the scene, {first:g} to {last:g} s"
            raise DescriptionError(what, table.where, "give times in s, or lengthen the scene")
        further = np.delete(table.t, same_times(t, table.t)[1])
        t = np.sort(np.concatenate([t, further])) if further.size else t
    return t
