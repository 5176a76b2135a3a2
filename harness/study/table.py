"""CSV files of tidy rows that later studies add to."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from math import inf
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import OutputError
from screwgauge.reference.files import read_file


@dataclass(frozen=True, slots=True)
class TableFile:
    """A CSV file that rows are added to.

    Attributes:
        what: It is the table of, for complaints.
        key: Makes the name of the task of a row.
        whole, sizes: See `rows_in`.
    """

    file: Path
    columns: Sequence[str]
    what: str
    key: Callable[[Mapping[str, Any]], str]
    whole: Sequence[str] = ()
    sizes: Sequence[str] = ()

    def rows(self) -> list[dict[str, str]]:
        """Those that it has already."""
        return rows_in(self.file, self.columns, self.what, self.whole, self.sizes)


def rows_in(
    file: Path, columns: Sequence[str], what: str, whole: Sequence[str] = (), sizes: Sequence[str] = ()
) -> list[dict[str, str]]:
    """The rows that a CSV file has already; none where there is no file.

    Args:
        what: It is the table of, for the complaint.
        whole: Columns of whole numbers.
        sizes: Columns of numbers from 0 on, which may be empty.

    Raises:
        ScrewgaugeError: It cannot be read, its columns are others, or a number is none.
    """
    if not os.path.lexists(file):
        return []
    text = read_file(file, "MB of CSV")
    if not text and not os.path.getsize(file):
        return []
    try:
        head, *rows = list(csv.reader(text.splitlines(keepends=True), strict=True)) or [[]]
    except csv.Error:  # a field of a megabyte, quotes within quotes
        head, rows = [], []
    if not text.endswith("\n"):  # a row that is added would be part of the last
        head = []
    if tuple(head) != tuple(columns) or any(len(row) != len(columns) for row in rows):
        said = f"is no table of {what}, is of another version, or was cut short"
        raise OutputError(said, str(file), "move it, or choose another --out")
    found = [dict(zip(columns, row, strict=True)) for row in rows]
    for name, holds in [*zip(whole, repeat(_is_whole)), *zip(sizes, repeat(_is_size))]:
        if odd := [row[name] for row in found if not holds(row[name])]:
            raise OutputError(
                f"is no table of {what}: {name} is {odd[0]!r:.60}", str(file), "move it, or choose another --out"
            )
    return found


def _is_whole(text: str) -> bool:
    return bool(re.fullmatch(r"[0-9]{1,9}", text))


def _is_size(text: str) -> bool:
    try:
        return not text or 0.0 <= float(text) < inf
    except ValueError:
        return False
