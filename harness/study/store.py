"""Rows on disk: journals from which interrupted work resumes, and conversion of rows to and from JSON."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, asdict, fields, is_dataclass
from hmac import compare_digest
from math import inf
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from screwgauge.reference.errors import DescriptionError, OutputError
from screwgauge.reference.files import read_bytes, why
from screwgauge.truth import cache

Row = TypeVar("Row")
_CHANGED = "Results of interrupted work were not reused: the scene, settings, code or environment has changed."


class Journal:
    """Log in the cache folder, to which results and measured times are written as they arrive.

    Each line begins with a signature of its text and of the address of the work, made with the secret of that folder.
    Lines that were written by others, or for different files, code or versions, are ignored.

    Attributes:
        results: Key -> result.
        times: Key -> measured times [s].
        note: Sentence for the report on reused results; empty if none were reused.
    """

    def __init__(
        self, place: Path | None, address: str, fits: Callable[[dict[str, Any]], bool] = lambda result: True
    ) -> None:
        """Read the log on disk.

        Args:
            place: Folder or file to which the table or report is written; if None, nothing is stored.
            address: Address of the work, see `address`.
            fits: Function that returns True if a result has the expected form; other results are computed again.
        """
        self.address, self.results, self.times = address, dict[str, Any](), dict[str, list[float]]()
        self.path, self.note = None, ""
        if place is None:
            return
        try:
            self._sign = cache.signer()
            name = hashlib.sha256(os.path.abspath(place).encode(errors="surrogateescape")).hexdigest()
            self.path = cache.folder() / f"journal-{name[:32]}.jsonl"
            data = read_bytes(self.path, "MB of CSV") if os.path.lexists(self.path) else b""
        except (OSError, DescriptionError) as error:
            self.path, self.note = None, f"If interrupted, this work loses its results ({error})."
            return
        lines = [*filter(None, data.splitlines())]
        records = [record for line in lines if (record := self._read(line)) is not None]
        for record in records:
            key, result, seconds = (record.get(name) for name in ("key", "result", "time"))
            if isinstance(key, str) and isinstance(result, dict) and fits(result):
                self.results[key] = result
            elif isinstance(key, str) and isinstance(seconds, float) and 0.0 <= seconds < inf:
                self.times.setdefault(key, []).append(seconds)
        if lines and not records:
            self.note = _CHANGED
            self.remove()
        elif self.results:
            self.note = f"Resumed: {len(self.results)} results of interrupted work are reused."

    def rows(self, form: type[Row]) -> dict[str, Row]:
        """Return results as rows of a dataclass, omitting malformed rows, which are then computed again."""
        return {key: from_record(each, form) for key, each in self.results.items() if is_record(each, form)}

    def keep(self, key: str, result: Any) -> None:
        """Add a result, a mapping or an instance of a dataclass.

        Raises:
            OutputError: The log cannot be written, e.g. because the disk is full; earlier results are kept.
        """
        self.results[key] = _record(result)
        self._write({"key": key, "result": self.results[key]})

    def time(self, key: str, seconds: float) -> None:
        """Add one measured time."""
        self.times.setdefault(key, []).append(seconds)
        self._write({"key": key, "time": seconds})

    def remove(self) -> None:
        """Remove the log of completed work, so that the next run starts from scratch."""
        if self.path is not None:
            with suppress(OSError):
                self.path.unlink()

    def _read(self, line: bytes) -> dict[str, Any] | None:
        """Return the record in a line that was written on this machine for this work; None for other lines."""
        code, _, text = line.decode(errors="replace").partition(" ")
        if not compare_digest(code.encode(), self._sign(self.address, text).encode()):
            return None
        record: dict[str, Any] = json.loads(text)
        return record

    def _write(self, record: Mapping[str, Any]) -> None:
        """Write a record on a separate line, even after a truncated line."""
        if self.path is None:
            return
        text = json.dumps(record)
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(f"\n{self._sign(self.address, text)} {text}\n")
        except OSError as error:
            remedy = "free some space and run the same command again; it resumes from the existing rows"
            raise OutputError(f"cannot be written ({why(error)})", str(self.path), remedy) from None


def _record(row: Any) -> dict[str, Any]:
    if is_dataclass(row) and not isinstance(row, type):
        return asdict(row)
    return dict(row)


def is_record(value: object, hint: Any) -> bool:
    """Return True if a value that was read from JSON has a given type.

    Args:
        hint: A plain type, a dataclass (for its record by `dataclasses.asdict`), or a sequence, mapping, union or
            literal.
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
    """Rebuild a dataclass from its record, which `is_record` has accepted; sequences become tuples."""
    origin, inner = get_origin(hint), get_args(hint)
    if is_dataclass(hint):
        form: Any = hint
        hints = get_type_hints(form)
        return form(**{name: from_record(each, hints[name]) for name, each in value.items()})
    if origin in (Sequence, tuple):
        return tuple(from_record(each, inner[0]) for each in value)
    return value
