"""Keeps every finished piece of long work on disk, so that interrupted work goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import OutputError


class Journal:
    """Lines of JSON: a stamp, then results and measured times as they come.

    Attributes:
        results: Key -> result of the first call.
        times: Key -> seconds measured.
        note: What was on disk, for the report; empty if nothing.
    """

    def __init__(self, path: Path | None, stamp: str) -> None:
        self.path, self.results, self.note = path, dict[str, Any](), ""
        self.times: dict[str, list[float]] = {}
        if path is None:
            return
        text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
        records = list(filter(None, map(_parse, text.splitlines())))
        if text.strip() and not (records and "stamp" in records[0]):
            raise OutputError("is no journal of interrupted work", str(path), "move it, or choose another --out")
        if not records or records[0]["stamp"] != stamp:
            if records:
                self.note = "Pieces of earlier work were not used: scene, settings or environment have changed."
            self._write("w", stamp=stamp)
            return
        for record in records[1:]:
            if "result" in record:
                self.results[record["key"]] = record["result"]
            elif "time" in record:
                self.times.setdefault(record["key"], []).append(float(record["time"]))
        taken = f"Resumed: {len(self.results)} results of interrupted work were taken over."
        self.note = taken if self.results else ""

    def keep(self, key: str, result: Mapping[str, Any]) -> None:
        """Adds the result of a first call."""
        self.results[key] = dict(result)
        self._write("a", key=key, result=self.results[key])

    def time(self, key: str, seconds: float) -> None:
        """Adds one measurement."""
        self.times.setdefault(key, []).append(seconds)
        self._write("a", key=key, time=seconds)

    def remove(self) -> None:
        """The work is complete: the next starts afresh."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def _write(self, mode: str, **record: Any) -> None:
        """A line of its own, even after one that was cut off while it was written."""
        if self.path is None:
            return
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open(mode, encoding="utf-8") as file:
                file.write(f"\n{json.dumps(record)}\n")
        except OSError as error:
            text = f"cannot be written ({error.strerror})"
            raise OutputError(text, str(self.path), "choose another --out") from None


def _parse(line: str) -> dict[str, Any]:
    """The record of a line; empty if there is none."""
    try:
        record = json.loads(line)
    except ValueError:
        return {}
    return record if isinstance(record, dict) else {}
