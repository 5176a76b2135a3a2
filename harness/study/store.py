"""Rows on disk: journals that interrupted work goes on from, and CSV files that later studies add to.

A journal is a log of JSON lines. Where pyarrow is installed, each thousand results are moved into a Parquet file of
their own, in a folder next to the log; it is there in whole or not at all.
"""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass
from importlib.util import find_spec
from io import BytesIO
from itertools import repeat
from math import inf
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from screwgauge.reference.errors import DescriptionError, OutputError, shown
from screwgauge.reference.files import parse_json, read_bytes, read_file, replace_file, why

Row = TypeVar("Row")
#: Results of a part.
SEAL = 1000
_ELSEWHERE = "move it, or choose another --out"
_CHANGED = "Pieces of earlier work were not used: scene, settings or environment have changed."
#: Goes with a table that Parquet keeps: stamp, and columns whose values are JSON.
_STAMP, _ENCODED = b"screwgauge.stamp", b"screwgauge.json"


class Journal:
    """A log: a stamp, then results and measured times as they come.

    Attributes:
        results: Key -> result of the first call.
        times: Key -> seconds measured.
        note: A sentence for the report on what was on disk; empty if nothing.
    """

    def __init__(
        self, path: Path | None, stamp: str, fits: Callable[[dict[str, Any]], bool] = lambda result: True
    ) -> None:
        """Reads what is on disk.

        Args:
            stamp: Stands for all that the work depends on; results under another stamp are not used.
            fits: Whether a result has the form of this work's; another is made anew.

        Raises:
            ScrewgaugeError: The file cannot be read, or is no journal.
        """
        self.path, self.stamp, self.results, self.note = path, stamp, dict[str, Any](), ""
        self.times: dict[str, list[float]] = {}
        self._loose = dict[str, Any]()  # in the log alone
        if path is None:
            return
        self._parts = path.with_suffix(".parts")
        # a line that was cut off may end within a character
        text = read_bytes(path, "MB of CSV").decode(errors="replace") if os.path.lexists(path) else ""
        records = list(filter(None, map(_parse, text.splitlines())))
        if text.strip() and not (records and "stamp" in records[0]):
            raise OutputError("is no journal of interrupted work", str(path), _ELSEWHERE)
        if not records or records[0]["stamp"] != stamp:
            self.note = _CHANGED if records else ""
            shutil.rmtree(self._parts, ignore_errors=True)
            self._write("w", {"stamp": stamp})
            return
        self.results = {key: result for key, result in self._sealed() if fits(result)}
        for record in records[1:]:
            key, result, seconds = (record.get(name) for name in ("key", "result", "time"))
            if isinstance(key, str) and isinstance(result, dict) and fits(result):
                self.results[key] = self._loose[key] = result
            elif isinstance(key, str) and isinstance(seconds, float) and 0.0 <= seconds < inf:
                self.times.setdefault(key, []).append(seconds)
        taken = f"Resumed: {len(self.results)} results of interrupted work were taken over."
        self.note = taken if self.results else ""

    def rows(self, form: type[Row]) -> dict[str, Row]:
        """Results as rows of a dataclass; those that are no such rows are left out, and made anew."""
        return {key: from_record(each, form) for key, each in self.results.items() if is_record(each, form)}

    def keep(self, key: str, result: Any) -> None:
        """Adds a result, a mapping or an instance of a dataclass.

        Raises:
            OutputError: There is no room, say; all results before are there.
        """
        self.results[key] = self._loose[key] = _record(result)
        self._write("a", {"key": key, "result": self.results[key]})
        if len(self._loose) >= SEAL and self.path is not None and find_spec("pyarrow"):
            self._seal(self.path)

    def time(self, key: str, seconds: float) -> None:
        """Adds one measurement."""
        self.times.setdefault(key, []).append(seconds)
        self._write("a", {"key": key, "time": seconds})

    def remove(self) -> None:
        """The work is complete: the next starts afresh."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
            shutil.rmtree(self._parts, ignore_errors=True)

    def _write(self, mode: str, *records: Mapping[str, Any]) -> None:
        """Writes each record on a line of its own, even after one that was cut off."""
        if self.path is None:
            return
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open(mode, encoding="utf-8") as file:
                file.write("".join(f"\n{json.dumps(record)}\n" for record in records))
        except OSError as error:
            remedy = "make room and run the same command again: it goes on from the rows that are there"
            raise OutputError(f"cannot be written ({why(error)})", str(self.path), remedy) from None

    def _seal(self, log: Path) -> None:
        """Moves the results of the log into a part. If that is interrupted, keys tell what is in both."""
        self._parts.mkdir(exist_ok=True)
        part = self._parts / f"{len([*self._parts.glob('*.parquet')]):06d}.parquet"
        replace_file(part, _parquet(self._loose, self.stamp))
        self._loose.clear()
        rest = [{"key": key, "time": seconds} for key, times in self.times.items() for seconds in times]
        replace_file(log, "".join(f"\n{json.dumps(record)}\n" for record in ({"stamp": self.stamp}, *rest)))

    def _sealed(self) -> Iterator[tuple[str, dict[str, Any]]]:
        for part in sorted(self._parts.glob("*.parquet")):
            yield from _of_parquet(part, self.stamp)


def _parse(line: str) -> dict[str, Any]:
    """The record of a line; empty if it is none."""
    try:
        record = parse_json(line, "line of a journal", "", "")
    except DescriptionError:
        return {}
    return record if isinstance(record, dict) else {}


def _parquet(results: Mapping[str, Mapping[str, Any]], stamp: str) -> bytes:
    """Results as a table: a column for each entry, as JSON where values are of several types or have parts."""
    import pyarrow as pa
    from pyarrow.parquet import write_table

    columns: dict[str, list[Any]] = {"key": [*results]}
    encoded = list[str]()
    for name in dict.fromkeys(name for result in results.values() for name in result):
        values = [result.get(name) for result in results.values()]
        if len({type(value) for value in values}) == 1 and isinstance(values[0], str | bool | int | float):
            columns[f"result.{name}"] = values
        else:
            encoded.append(name)
            texts = [json.dumps(result[name]) if name in result else None for result in results.values()]
            columns[f"result.{name}"] = texts
    table = pa.table(columns).replace_schema_metadata({_STAMP: stamp, _ENCODED: json.dumps(encoded)})
    write_table(table, text := BytesIO())
    return text.getvalue()


def _of_parquet(part: Path, stamp: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Results from a file that `_parquet` has made.

    Raises:
        OutputError: It is something else, or was not written in whole.
    """
    import pyarrow as pa
    from pyarrow.parquet import read_table

    try:
        table = read_table(part)
        metadata = table.schema.metadata or {}
        if metadata.get(_STAMP) != stamp.encode():
            raise ValueError("its stamp is another")
        encoded = {*json.loads(metadata[_ENCODED])}
        rows = table.to_pylist()
        for row in rows:
            entries = {name.removeprefix("result."): value for name, value in row.items() if value is not None}
            key = entries.pop("key")
            yield key, {name: json.loads(value) if name in encoded else value for name, value in entries.items()}
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as error:
        raise OutputError(f"is no part of a journal ({error})", str(part), _ELSEWHERE) from None


def _record(row: Any) -> dict[str, Any]:
    if is_dataclass(row) and not isinstance(row, type):
        return asdict(row)
    return dict(row)


def is_record(value: object, hint: Any) -> bool:
    """Whether a value that was read from JSON is of a type.

    Args:
        hint: A plain type, a dataclass (its record by `dataclasses.asdict`), or a sequence, mapping, union or literal.
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        return value in inner
    if origin is UnionType:
        return any(is_record(value, each) for each in inner)
    if origin is tuple:
        return isinstance(value, list) and len(value) == len(inner) and all(map(is_record, value, inner))
    if origin is Sequence:
        return isinstance(value, list) and all(is_record(each, inner[0]) for each in value)
    if origin is Mapping:
        return isinstance(value, dict) and all(is_record(each, inner[1]) for each in value.values())
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        needed = {each.name for each in fields(hint) if each.default is each.default_factory is MISSING}
        if not isinstance(value, dict) or not needed <= value.keys() <= hints.keys():
            return False
        return all(is_record(each, hints[name]) for name, each in value.items())
    return isinstance(value, int | float if hint is float else hint)


def from_record(value: Any, hint: Any) -> Any:
    """What `dataclasses.asdict` made a record of, which `is_record` has found to be one; sequences become tuples."""
    origin, inner = get_origin(hint), get_args(hint)
    if is_dataclass(hint):
        form: Any = hint
        hints = get_type_hints(form)
        return form(**{name: from_record(each, hints[name]) for name, each in value.items()})
    if origin in (Sequence, tuple):
        return tuple(from_record(each, inner[0]) for each in value)
    return value


@dataclass(frozen=True, slots=True)
class TableFile:
    """A CSV file that rows are added to.

    Attributes:
        what: It is the table of, for complaints.
        key: Makes the name of the task of a row.
        whole: Columns of whole numbers.
        sizes: Columns of numbers from 0 on, which may be empty.
    """

    file: Path
    columns: Sequence[str]
    what: str
    key: Callable[[Mapping[str, Any]], str]
    whole: Sequence[str] = ()
    sizes: Sequence[str] = ()

    def rows(self) -> list[dict[str, str]]:
        """The rows that it has already; none where there is no file.

        Raises:
            ScrewgaugeError: It cannot be read, its columns are others, or a number is none.
        """
        if not os.path.lexists(self.file):
            return []
        text = read_file(self.file, "MB of CSV")
        if not text and not os.path.getsize(self.file):
            return []
        try:
            head, *lines = list(csv.reader(text.splitlines(keepends=True), strict=True)) or [[]]
        except csv.Error:  # a field of a megabyte, quotes within quotes
            head, lines = [], []
        if not text.endswith("\n"):  # a row that is added would be part of the last
            head = []
        if tuple(head) != tuple(self.columns) or any(len(line) != len(head) for line in lines):
            what = f"is no table of {self.what}, is of another version, or was cut short"
            raise OutputError(what, str(self.file), _ELSEWHERE)
        rows = [dict(zip(head, line, strict=True)) for line in lines]
        for name, holds in [*zip(self.whole, repeat(_is_whole)), *zip(self.sizes, repeat(_is_size))]:
            if odd := [row[name] for row in rows if not holds(row[name])]:
                raise OutputError(f"is no table of {self.what}: {name} is {shown(odd[0])}", str(self.file), _ELSEWHERE)
        return rows


def _is_whole(text: str) -> bool:
    return bool(re.fullmatch(r"[0-9]{1,9}", text))


def _is_size(text: str) -> bool:
    try:
        return not text or 0.0 <= float(text) < inf
    except ValueError:
        return False
