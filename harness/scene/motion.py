"""Motions of the independent coordinates: harmonics, polynomials, or columns of CSV and Parquet files."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from io import BytesIO
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.problem import GivenMotion
from screwgauge.reference.courses import Course, Samples
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.expressions import LARGEST, vector
from screwgauge.reference.files import check_count, is_file, named_file, read_bytes, read_file
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_times, read_coefficients, require
from screwgauge.scene.keys import read_keys

if TYPE_CHECKING:
    from pandas import DataFrame


def read_columns(path: Path, wanted: list[str] | None = None, why: str = "") -> dict[str, Array]:
    """Read columns of a CSV or Parquet file without rounding; reject non-finite values. Shape (n,) each.

    Args:
        wanted: Names of the columns; all columns by default.
        why: Reason stated in the error about a missing column.
    """
    data = (read_parquet if path.suffix == ".parquet" else _csv)(path)
    columns: dict[str, Array] = {}
    for column in [*data.columns] if wanted is None else wanted:
        if column not in data.columns:
            names = f"include all of {', '.join(wanted or ())} ({why})"
            raise DescriptionError(f"column '{column}' is missing", str(path), names)
        if f"{column}.1" in data.columns:  # pandas renames a second column of that name
            raise DescriptionError(f"column '{column}' occurs twice", str(path), "remove one")
        columns[column] = numbers(data[column], f"column '{column}'", str(path))
    return columns


def numbers(values: Any, what: str, where: str) -> Array:
    """Convert values, including strings, to finite numbers. Shape (n,)."""
    result = np.array([_number(value) for value in values], dtype=float)
    bad = np.flatnonzero(~(np.abs(result) <= LARGEST))
    if bad.size:
        raise DescriptionError(f"{what} has no finite number in data row {bad[0] + 1}", where, "complete the samples")
    return result


def _number(value: Any) -> float:
    try:
        return float("nan" if isinstance(value, complex) else value)  # numpy drops imaginary parts
    except (TypeError, ValueError):
        return float("nan")


def _csv(path: Path) -> DataFrame:
    import pandas as pd

    text = read_file(path, "MB of CSV")
    head = re.search(r"^[^#\r\n].*", text, re.MULTILINE)
    _check_fields(text, str(path))
    if head and "," not in head[0] and (other := re.search("[;\t]", head[0])):
        what = f"its columns are separated by {'a tab' if other[0] == chr(9) else repr(other[0])}"
        raise DescriptionError(what, str(path), "separate columns by commas and use decimal points")
    how: dict[str, Any] = {"dtype": str, "keep_default_na": False, "comment": "#", "index_col": False}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            data: DataFrame = pd.read_csv(BytesIO(text.encode()), **how)
    except pd.errors.ParserWarning:
        raise DescriptionError("the rows have more fields than the header", str(path), "name every column") from None
    except ValueError as error:
        raise DescriptionError(f"cannot be read as CSV ({error})", str(path), "check the file") from None
    return data


def _check_fields(text: str, where: str) -> None:
    """Reject rows with too many fields, because pandas takes a minute for a million fields."""
    lines = [line.partition("#")[0] for line in text.splitlines()]
    check_count(max((line.count(",") + 1 for line in lines), default=0), "CSV columns", where)
    if any(line.count('"') % 2 for line in lines):
        raise DescriptionError("a quoted string spans several lines", where, "write each row on one line")


def read_parquet(path: Path) -> DataFrame:
    """Read the table of a Parquet file.

    Raises:
        DescriptionError: The file cannot be read, or exceeds the `LIMITS`.
    """
    content = read_bytes(path, "MB of CSV")
    if find_spec("pyarrow") is None:
        raise DescriptionError("Parquet needs pyarrow, which is not installed", str(path), "run pip install pyarrow")
    from pyarrow.parquet import ParquetFile

    try:
        file = ParquetFile(BytesIO(content))
        columns, rows = file.metadata.num_columns, file.metadata.num_rows
    except Exception as error:  # the library may raise anything if the bytes are not in its format
        raise _no_parquet(path, error) from None
    check_count(columns, "CSV columns", str(path))
    # a few bytes can encode many equal numbers
    check_count(8e-6 * columns * rows, "MB of CSV", str(path))
    try:
        table = file.read(use_threads=False)
        table.validate(full=True)  # pyarrow would otherwise check strings only when they are used
        data: DataFrame = table.to_pandas(ignore_metadata=True)
    except Exception as error:
        raise _no_parquet(path, error) from None
    return data


def _no_parquet(path: Path, error: Exception) -> DescriptionError:
    return DescriptionError(f"cannot be read as Parquet ({error or type(error).__name__})", str(path), "check the file")


_STILL = 1e-9  # smallest travel that counts as motion [rad, m, or per s]


@dataclass(frozen=True, slots=True, eq=False)
class Analytic:
    """Motion given by polynomials and harmonics.

    Attributes:
        terms: Polynomial and harmonics of each coordinate.
        where: Name of the source for error messages.
    """

    terms: tuple[Course, ...]
    where: str

    def __call__(self, t: Array) -> GivenMotion:
        """Return the motion at times [s]. Shape (n,)."""
        y, yd, ydd = (np.empty((len(t), len(self.terms))) for _ in range(3))
        with np.errstate(over="ignore", invalid="ignore"):
            for k, course in enumerate(self.terms):
                coefficients = course.polynomial
                for x in (y, yd, ydd):
                    x[:, k] = _polynomial(coefficients, t)
                    coefficients = coefficients[1:] * np.arange(1.0, len(coefficients))
                for omega, c, s in course.harmonics:
                    cos, sin = np.cos(omega * t), np.sin(omega * t)
                    y[:, k] += c * cos + s * sin
                    yd[:, k] += omega * (s * cos - c * sin)
                    ydd[:, k] -= omega**2 * (c * cos + s * sin)
        finite = np.isfinite(np.concatenate([y, yd, ydd], axis=1)).all(axis=1)
        if not finite.all():
            late = t[np.argmin(finite)]
            raise DescriptionError(f"overflows at t = {late:g} s", self.where, "shorten or slow the motion")
        return GivenMotion(t, y, yd, ydd, self)


def _polynomial(coefficients: Array, t: Array) -> Array | float:
    """Evaluate a polynomial, given by its coefficients from the lowest order up. Shapes (m,), (n,) -> (n,)."""
    value: Array | float = 0.0
    for c in coefficients[::-1].tolist():
        value = value * t + c
    return value


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """Motion from a CSV or Parquet file, defined only at the times in the file."""

    file: Path
    samples: GivenMotion

    def __call__(self, t: Array) -> GivenMotion:
        """Return the motion at times [s], which must be sample times of the file. Shape (n,)."""
        rows = np.searchsorted(self.samples.t, t).clip(max=len(self.samples) - 1)
        wrong = np.flatnonzero(self.samples.t[rows] != t)
        if wrong.size:
            raise DescriptionError(
                f"has no sample at t = {t[wrong[0]]:g} s",
                str(self.file),
                "use times in the file: samples are not interpolated",
            )
        return self.samples.part(rows)

    def interpolate(self, t: Array) -> GivenMotion:
        """Return the motion at times [s], interpolated by cubic splines through values and rates. Shape (n,)."""
        from scipy.interpolate import CubicHermiteSpline, CubicSpline

        one = self.samples
        if len(one) == 1:
            return one.part(np.zeros(len(t), dtype=np.intp))
        y, yd = CubicHermiteSpline(one.t, one.y, one.yd), CubicHermiteSpline(one.t, one.yd, one.ydd)
        return GivenMotion(t, y(t), yd(t), CubicSpline(one.t, one.ydd)(t))

    def doubts(self, labels: Sequence[str]) -> tuple[str, ...]:
        """Warn about columns of derivatives that do not match the differentiated column, e.g. in units or signs.

        A column is reported if its integral (trapezoidal rule) deviates from the differentiated column by more than
        half of the larger travel of the two: either units or signs are wrong, or the sampling is too coarse.
        """
        y, yd, ydd = (x.T for x in (self.samples.y, self.samples.yd, self.samples.ydd))
        sentences, h = [], np.diff(self.samples.t)
        for label, x, xd, order in [*zip(labels, y, yd, repeat("")), *zip(labels, yd, ydd, repeat("d"))]:
            with np.errstate(all="ignore"):
                integral = np.append(0.0, np.cumsum(h * (xd[1:] + xd[:-1]) / 2.0))
                moved, apart = np.abs(x - x[0]).max(), np.abs(x - x[0] - integral).max()
            if not apart <= max(moved / 2.0, np.abs(integral).max() / 2.0, _STILL):
                sentences.append(
                    f"{self.file.name}: {label}d{order} is not the derivative of {label}{order} (its integral is off "
                    f"by up to {apart:.3g}, and {label}{order} moves by {moved:.3g}; check units, signs and step)"
                )
        return tuple(sentences)


Drive = Analytic | Sampled
"""A given motion as a function of time."""


def read_drive(table: Any, labels: list[str], folder: Path, where: str) -> tuple[Drive, Array | None]:
    """Read ``[motion]``.

    Args:
        labels: Labels of the independent coordinates, in order.
        folder: Folder of the CSV file, if any.

    Returns:
        The motion as a function of time, and the times of its file, if it has one.

    Raises:
        DescriptionError: The motion cannot be read.
    """
    if isinstance(table, dict) and "csv" in table:
        return _read_samples(named_file(folder, read_keys("samples", table, where)["csv"]), labels)
    check_keys(table, labels, where)
    terms = (read_course(require(table, label, where), f"{where}.{label}") for label in labels)
    return Analytic(tuple(terms), where), None


def moved_labels(table: Any, labels: list[str], folder: Path, where: str) -> list[str]:
    """Select the independent coordinates that have a motion in ``[motion]`` or its file."""
    if not isinstance(table, dict) or "csv" not in table:
        check_keys(table, labels, where)
        return [label for label in labels if label in table]
    if not isinstance(table["csv"], str) or not is_file(path := named_file(folder, table["csv"])):
        return labels
    names = read_parquet(path).columns if path.suffix == ".parquet" else _head(path)
    return [label for label in labels if {label, f"{label}d", f"{label}dd"} & {*names}]


def _head(path: Path) -> list[str]:
    """Return the column names of a CSV file."""
    head = re.search(r"^[^#\r\n].*", read_file(path, "MB of CSV"), re.MULTILINE)
    return [name.strip(' "') for name in head[0].split(",")] if head else []


def read_course(table: Any, where: str) -> Course:
    """Read ``offset``, ``polynomial`` and ``harmonics`` of a coordinate."""
    given = read_keys("motion", table, where)
    polynomial = read_coefficients(given["polynomial"], f"{where}.polynomial")
    polynomial[0] += given["offset"]
    harmonics = given["harmonics"]
    if not isinstance(harmonics, list):
        raise DescriptionError("is not a list", f"{where}.harmonics", "write [[omega, cos, sin], ...]")
    check_count(len(harmonics), "harmonics", f"{where}.harmonics")
    rows = [vector(row, f"{where}.harmonics") for row in harmonics]
    return Course(polynomial, np.array(rows).reshape(-1, 3))


def read_column(path: Path, column: str) -> Samples:
    """Read a column of a CSV file as samples at the times of its column ``t``."""
    columns = read_columns(path, ["t", column], "of a load")
    check_times(columns["t"], str(path))
    return Samples(columns["t"], columns[column], str(path))


def _read_samples(path: Path, labels: list[str]) -> tuple[Drive, Array]:
    """Read a file with the column t and, for each coordinate x, columns x, xd and xdd: its value and derivatives."""
    wanted = ["t", *(f"{label}{order}" for label in labels for order in ("", "d", "dd"))]
    if len(set(wanted)) < len(wanted):
        what = f"columns {', '.join(wanted)} share a name"
        raise DescriptionError(what, str(path), "rename the independent coordinates")
    columns = read_columns(path, wanted, "derivatives are required")
    check_times(t := columns["t"], str(path))
    arrays = [np.stack([columns[f"{label}{order}"] for label in labels], axis=1) for order in ("", "d", "dd")]
    return Sampled(path, GivenMotion(t, arrays[0], arrays[1], arrays[2])), t
