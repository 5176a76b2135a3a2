"""Quantities that the user adds: observables computed from the motion, and recorded values from files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.problem import Rows
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.courses import same_times
from screwgauge.reference.equations.kinematics import pose
from screwgauge.reference.errors import DescriptionError, quote
from screwgauge.reference.files import named_file
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_name, check_times, positive, require
from screwgauge.scene.keys import read_keys
from screwgauge.scene.motion import numbers, read_columns
from screwgauge.solution import Values


@dataclass(frozen=True, slots=True, eq=False)
class Observable:
    """Number to record: a joint coordinate, or a world coordinate of a point of a body.

    Attributes:
        unit: ``rad`` or ``m``.
        coordinate: Joint coordinate; empty for a point.
        body, point, axis: Body of the point, its position in the body frame [m], shape (3,), and world axis 0, 1 or 2.
    """

    name: str
    unit: str
    coordinate: str = ""
    body: str = ""
    point: Array | None = None
    axis: int = 0


@dataclass(frozen=True, slots=True)
class Published:
    """A published result.

    Attributes:
        who: Method or program, with its settings.
        remark: Note on the numbers.
        accuracy: Error of the `measure`, an observable [m or rad] or the energy [J]; NaN if not published.
        cpu_s: CPU time on the authors' computer [s]; NaN if not published.
    """

    who: str
    source: str
    measure: str
    remark: str
    accuracy: float = float("nan")
    cpu_s: float = float("nan")


def read_observable(mechanism: Mechanism, table: Any, where: str) -> Observable:
    """Read an entry of ``[[observables]]``."""
    given = read_keys("observables", table, where)
    name, coordinate = given["name"], given["coordinate"]
    if not name or "," in name:
        raise DescriptionError(f"'{name}' is not a name", f"{where}.name", "use letters, digits and dots")
    if ("coordinate" in table) == ("body" in table):
        raise DescriptionError(
            f"observable '{name}' must be either a coordinate or a point of a body",
            where,
            "write coordinate = ..., or body, point, axis",
        )
    if coordinate is not None:
        check_keys(table, {"name", "coordinate"}, where)
        check_name("coordinate", coordinate, mechanism.moving, where)
        unit = mechanism.units[mechanism.coordinates.index(coordinate)]
        return Observable(name, unit, coordinate=coordinate)
    require(table, "axis", where)
    check_name("body", given["body"], mechanism.body_index, where)
    return Observable(name, "m", body=given["body"], point=given["point"], axis="xyz".index(given["axis"]))


def read_known(table: Any, names: Sequence[str], folder: Path, where: str) -> Recorded:
    """Read ``[reference]``: a CSV file with t and the observables; additional columns are ignored."""
    given = read_keys("reference", table, where)
    if not names:
        raise DescriptionError("the scene has no observables to compare", where, "add [[observables]]")
    path = named_file(folder, given["file"])
    columns = read_columns(path, ["t", *names], "the observables of the scene are required")
    return Recorded(columns.pop("t"), columns, file=path, source=given["source"])


def read_published(table: Any, where: str) -> Published:
    """Read an entry of ``[[published]]``."""
    given = read_keys("published", table, where)
    stated = {key: value for key in ("accuracy", "cpu_s") if (value := given[key]) is not None}
    return Published(given["who"], given["source"], given["of"], given["remark"], **stated)


def observe(lay: Layout, observables: Sequence[Observable], q: Array) -> Values:
    """Evaluate the observables at joint coordinates `q`, shape (n, n_q)."""
    at, columns = pose(lay, q), []
    for item in observables:
        if item.point is None:
            columns.append(q[:, lay.mechanism.coordinates.index(item.coordinate)])
        else:
            i = lay.mechanism.body_index[item.body]
            columns.append(at.p[:, i, item.axis] + at.R[:, i, item.axis] @ item.point)
    return _values(observables, np.stack(columns, axis=1))


def known_values(known: Recorded, observables: Sequence[Observable], t: Array, where: str) -> tuple[Values, Rows]:
    """Return the reference values at the times of a scene, NaN where missing, and the indices of the rows with values.

    Raises:
        DescriptionError: The reference contains none of the scene's times.
    """
    array = np.full((len(t), len(observables)), np.nan)
    rows, same = same_times(t, known.t)
    if not rows.size:
        raise DescriptionError(
            "the reference has no sample at the scene's times", where, "remove [time], or change its step"
        )
    array[rows] = known.array[same]
    return _values(observables, array), rows


def _values(observables: Sequence[Observable], array: Array) -> Values:
    names, units = zip(*((item.name, item.unit) for item in observables), strict=True)
    return Values(names, units, array)


_NAME = re.compile(r"[\w.-]+")
#: Suffix of a component's header if redundant constraints leave the component undetermined.
NOT_UNIQUE = " not unique"
#: Unit to convert -> SI unit and factor.
CONVERTED = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), ("rad", np.pi / 180.0)),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "kN": ("N", 1e3),
    "ms": ("s", 1e-3),
    **dict.fromkeys(("us", "µs", "μs"), ("s", 1e-6)),
}
TIMES = ("t", "time")  # accepted names of the time column
_UNIT = re.compile(r"([^\W\d_]+|°)(?:\^(\d))?")


def _si_unit(unit: str) -> tuple[str, float]:
    """Return the SI unit that corresponds to a unit, and the conversion factor: ``N mm`` gives ``N m``, 1e-3."""
    text, factor = unit.replace("·", " ").replace("²", "^2"), 1.0
    for one in _UNIT.finditer(text):
        power = int(one[2] or 1) * (-1 if text[: one.start()].endswith("/") else 1)
        factor *= CONVERTED.get(one[1], ("", 1.0))[1] ** power
    return _UNIT.sub(lambda one: one[0].replace(one[1], CONVERTED.get(one[1], (one[1],))[0]), text), factor


@dataclass(frozen=True, slots=True)
class Header:
    """Column header: ``component`` or ``quantity/component``, optionally with a unit: ``leg1 [N]``."""

    text: str
    quantity: str
    component: str
    unit: str

    def of(self, quantity: str, unit: str) -> bool:
        """Return True if the header contradicts neither the quantity nor the unit."""
        return self.quantity in ("", quantity) and _si_unit(self.unit)[0] in ("", unit)

    @property
    def factor(self) -> float:
        """Factor that converts values to SI units."""
        return _si_unit(self.unit)[1]

    def check_unit(self, unit: str, where: str) -> None:
        """Reject a unit that is neither the component's unit nor convertible to it."""
        if not self.of(self.quantity, unit):
            remedy = f"convert it to {unit}, or omit the unit from the header and let `review` find it"
            raise DescriptionError(f"column '{self.text}' must be in {unit}", where, remedy)


def read_header(text: str) -> Header:
    """Parse the name of a column."""
    name, _, unit = text.removesuffix(NOT_UNIQUE).partition("[")
    quantity, _, component = name.strip().partition("/")
    if quantity not in QUANTITIES:  # the component may contain a slash
        quantity, _, component = name.strip().rpartition("/")
    return Header(text, quantity, component, unit.rstrip("] "))


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Numbers from the user: computed by hand, computed by another program, or recorded.

    Attributes:
        t: Times [s], increasing. Shape (n,).
        columns: Column header, as in a file (see ``harness/scenes/README.md``) -> values. Shape (n,) each.
        error: Quantity -> error allowed in its values in addition to the tolerances of the scene [unit of the
            quantity].
        file: File from which the numbers were read.
        header: Header of the time column in that file.
        source: Origin of the numbers, if stated.

    Raises:
        DescriptionError: A number is missing, or the times do not increase.
    """

    t: Array
    columns: Mapping[str, Array]
    error: Mapping[str, float] = field(default_factory=dict)
    file: Path | None = None
    header: str = TIMES[0]
    source: str = ""

    def __post_init__(self) -> None:
        if np.ndim(self.t) != 1:
            raise DescriptionError("is not a list of times", f"t of {self.where}", "pass a list of times in s")
        t = numbers(self.t, "column 't'", self.where)
        check_times(t, self.where)
        if not self.columns:
            raise DescriptionError("has no column besides t", self.where, "name the columns after components")
        if not isinstance(self.error, Mapping):
            raise DescriptionError(f"error {quote(self.error)} is not a table", self.where, "write quantity = number")
        error = {name: positive(value, f"{self.where}, error.{name}") for name, value in self.error.items()}
        object.__setattr__(self, "error", error)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "columns", {name: self._column(name) for name in self.columns})

    @property
    def where(self) -> str:
        """Name of the source for error messages."""
        return str(self.file or "arrays")

    @property
    def array(self) -> Array:
        """Columns side by side. Shape (n, n_column)."""
        return np.stack([*self.columns.values()], axis=1)

    @property
    def converted(self) -> list[str]:
        """Headers of the columns whose values were converted to SI units."""
        return [name for name in (self.header, *self.columns) if read_header(name).factor != 1.0]

    def _column(self, name: str) -> Array:
        values = self.columns[name]
        if np.shape(values) != (len(self.t),):
            what = f"column '{name}' has shape {np.shape(values)}, but there are {len(self.t)} times"
            raise DescriptionError(what, self.where, "pass one number per time")
        return numbers(values, f"column '{name}'", self.where)


def read_tables(tables: Any, folder: Path, where: str) -> dict[str, Recorded]:
    """Read ``[tables]``: name -> file, or ``{ file, error }``.

    Raises:
        DescriptionError: A name is invalid, or a file is not a table.
    """
    if not isinstance(tables, dict):
        raise DescriptionError(f"{quote(tables)} is not a table", where, "write name = 'file'")
    return {name: _read(name, table, folder, where) for name, table in tables.items()}


def _read(name: str, entry: Any, folder: Path, where: str) -> Recorded:
    if not _NAME.fullmatch(name):
        raise DescriptionError(f"'{name}' is not a name", where, "use letters, digits, dots and dashes")
    given = read_keys("tables", {"file": entry} if isinstance(entry, str) else entry, f"{where}.{name}")
    return read_recorded(named_file(folder, given["file"]), given["error"])


def read_recorded(path: Path, error: Any = None) -> Recorded:
    """Read a table of recorded numbers from CSV or Parquet.

    Args:
        error: Quantity -> error allowed in its values [unit of the quantity].

    Raises:
        DescriptionError: The file is not a table with times.
    """
    columns = read_columns(path)
    headers = [read_header(text) for text in columns]
    found = ([header for header in headers if (header.quantity, header.component) == ("", name)] for name in TIMES)
    times = next(filter(None, found), [])
    if len(times) != 1:
        what = "there are two columns of times" if times else "column 't' is missing"
        raise DescriptionError(what, str(path), "keep one column t with the times in s")
    (time,) = times
    if not time.of("", "s"):
        raise DescriptionError(f"column '{time.text}' must be in s, ms or us", str(path), "convert it to seconds")
    t = columns.pop(time.text) * time.factor
    return Recorded(t, columns, {} if error is None else error, path, time.text)


def merge_times(t: Array, tables: Iterable[Recorded]) -> Array:
    """Merge the times of a scene with additional times of its tables, in increasing order. Shape (n,).

    Raises:
        DescriptionError: A table has times before the first or after the last time of the scene.
    """
    first, last = t.min(), t.max()
    for table in tables:
        beyond = table.t[~np.isclose(table.t, np.clip(table.t, first, last), rtol=1e-12, atol=1e-15)]
        if beyond.size:
            what = f"t = {beyond[0]:g} s is outside the scene, which lasts from {first:g} to {last:g} s"
            raise DescriptionError(what, table.where, "convert times to s, or extend the scene")
        further = np.delete(table.t, same_times(t, table.t)[1])
        t = np.sort(np.concatenate([t, further])) if further.size else t
    return t
