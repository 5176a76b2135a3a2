"""Keeps every finished piece of long work on disk, so that interrupted work goes on where it stopped."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from math import inf
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import DescriptionError, OutputError
from screwgauge.reference.files import parse_json, read_bytes


class Journal:
    """Lines of JSON: a stamp, then results and measured times as they come.

    Attributes:
        results: Key -> result of the first call.
        times: Key -> seconds measured.
        note: What was on disk, for the report; empty if nothing.
    """

    def __init__(
        self, path: Path | None, stamp: str, fits: Callable[[dict[str, Any]], bool] = lambda result: True
    ) -> None:
        """Takes over what is on disk.

        Args:
            stamp: Of what the work depends on; pieces of another are not used.
            fits: Whether a result is one of this work: one that is not is made anew.

        Raises:
            ScrewgaugeError: The file cannot be read, or is no journal.
        """
        self.path, self.results, self.note = path, dict[str, Any](), ""
        self.times: dict[str, list[float]] = {}
        if path is None:
            return
        # a line that was cut off may end within a character
        text = read_bytes(path, "MB of CSV").decode(errors="replace") if os.path.lexists(path) else ""
        records = list(filter(None, map(_parse, text.splitlines())))
        if text.strip() and not (records and "stamp" in records[0]):
            raise OutputError("is no journal of interrupted work", str(path), "move it, or choose another --out")
        if not records or records[0]["stamp"] != stamp:
            if records:
                self.note = "Pieces of earlier work were not used: scene, settings or environment have changed."
            self._write("w", stamp=stamp)
            return
        for record in records[1:]:
            key, result, seconds = (record.get(name) for name in ("key", "result", "time"))
            if isinstance(key, str) and isinstance(result, dict) and fits(result):
                self.results[key] = result
            elif isinstance(key, str) and isinstance(seconds, float) and 0.0 <= seconds < inf:
                self.times.setdefault(key, []).append(seconds)
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
        record = parse_json(line, "line of a journal", "", "")
    except DescriptionError:
        return {}
    return record if isinstance(record, dict) else {}
