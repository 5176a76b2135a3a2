"""Columns of numbers in CSV and Parquet files, and times that they have in common."""

from __future__ import annotations

import re
import warnings
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.problem import Rows
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.expressions import LARGEST
from screwgauge.reference.files import check_count, read_bytes, read_file
from screwgauge.reference.rotations import Array

if TYPE_CHECKING:
    from pandas import DataFrame


def read_columns(path: Path, wanted: list[str] | None = None, why: str = "") -> dict[str, Array]:
    """Columns of a CSV or Parquet file, read to the last bit and finite. Shape (n,) each.

    Args:
        wanted: Their names; all of them by default.
        why: What to say of a column that is missing.
    """
    data = (read_parquet if path.suffix == ".parquet" else _csv)(path)
    columns: dict[str, Array] = {}
    for column in [*data.columns] if wanted is None else wanted:
        if column not in data.columns:
            names = f"give all of {', '.join(wanted or ())} ({why})"
            raise DescriptionError(f"column '{column}' is missing", str(path), names)
        if f"{column}.1" in data.columns:  # what pandas makes of a second one
            raise DescriptionError(f"column '{column}' is there twice", str(path), "remove one")
        columns[column] = numbers(data[column], f"column '{column}'", str(path))
    return columns


def numbers(values: Any, what: str, where: str) -> Array:
    """Finite numbers, text among them. Shape (n,)."""
    result = np.array([_number(value) for value in values], dtype=float)
    bad = np.flatnonzero(~(np.abs(result) <= LARGEST))
    if bad.size:
        raise DescriptionError(f"{what} is not a finite number in data row {bad[0] + 1}", where, "complete the samples")
    return result


def _number(value: Any) -> float:
    try:
        return float("nan" if isinstance(value, complex) else value)  # of complex ones numpy drops a part
    except (TypeError, ValueError):
        return float("nan")


def _csv(path: Path) -> DataFrame:
    import pandas as pd

    text = read_file(path, "MB of CSV")
    head = re.search(r"^[^#\r\n].*", text, re.MULTILINE)
    _check_fields(text, str(path))
    if head and "," not in head[0] and (other := re.search("[;\t]", head[0])):
        what = f"its columns are separated by {'a tab' if other[0] == chr(9) else repr(other[0])}"
        raise DescriptionError(what, str(path), "separate them by commas, with decimal points in the numbers")
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
    """Refuses rows of more fields than columns are admitted: pandas takes a minute for a million of them."""
    lines = [line.partition("#")[0] for line in text.splitlines()]
    check_count(max((line.count(",") + 1 for line in lines), default=0), "CSV columns", where)
    if any(line.count('"') % 2 for line in lines):
        raise DescriptionError("a text in quotes goes over several lines", where, "write each row on one line")


def read_parquet(path: Path) -> DataFrame:
    """The table of a Parquet file.

    Raises:
        DescriptionError: It cannot be read, or is larger than `LIMITS` say.
    """
    content = read_bytes(path, "MB of CSV")
    if find_spec("pyarrow") is None:
        raise DescriptionError("needs pyarrow, which is not installed", str(path), "run pip install pyarrow")
    from pyarrow.parquet import ParquetFile

    try:
        file = ParquetFile(BytesIO(content))
        columns, rows = file.metadata.num_columns, file.metadata.num_rows
    except Exception as error:  # whatever a library makes of bytes that are none of its format
        raise _no_parquet(path, error) from None
    check_count(columns, "CSV columns", str(path))
    # a few bytes can stand for many equal numbers
    check_count(8e-6 * columns * rows, "MB of CSV", str(path))
    try:
        table = file.read(use_threads=False)
        table.validate(full=True)  # texts are looked at when they are used, or here
        data: DataFrame = table.to_pandas(ignore_metadata=True)
    except Exception as error:
        raise _no_parquet(path, error) from None
    return data


def _no_parquet(path: Path, error: Exception) -> DescriptionError:
    return DescriptionError(f"cannot be read as Parquet ({error or type(error).__name__})", str(path), "check the file")


def same_times(t: Array, others: Array) -> tuple[Rows, Rows]:
    """Where two lists have the same times; those that differ only in how their decimals were rounded are the same.

    Args:
        t: In any order. Shape (n,).
        others: Increasing. Shape (m,).

    Returns:
        Indices into both, for each of `t` that is there.
    """
    right = np.searchsorted(others, t).clip(max=len(others) - 1)
    left = (right - 1).clip(min=0)
    nearest = np.where(np.abs(others[left] - t) < np.abs(others[right] - t), left, right)
    rows = np.flatnonzero(np.isclose(others[nearest], t, rtol=1e-12, atol=1e-15))
    return rows, nearest[rows]
