"""Keeps every finished piece of a bench on disk, so that an interrupted one goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from screwgauge.environment import json_text
from screwgauge.models.generate import model_texts
from screwgauge.reference.errors import OutputError
from screwgauge.scene.scene import Scene

NAME = "bench.partial.jsonl"
VERSION = 1  # of the protocol: raise it when old pieces no longer fit new ones


class Journal:
    """Lines of JSON: a stamp, then results and measured times as they come.

    Attributes:
        results: Key -> result of the error pass.
        times: Key -> seconds measured.
        note: What was found on disk, for the report; empty if nothing.
    """

    def __init__(self, path: Path | None, stamp: str) -> None:
        self.path, self.results, self.note = path, dict[str, Any](), ""
        self.times: dict[str, list[float]] = {}
        if path is None:
            return
        if not self._read(path, stamp):
            self._write(path, {"stamp": stamp}, "w")

    def _read(self, path: Path, stamp: str) -> bool:
        """Takes over what an earlier bench of the same stamp left; False if there is none."""
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError):
            return False
        records = [record for record in map(_parse, lines) if record is not None]
        if not records or records[0].get("stamp") != stamp:
            self.note = "Pieces of an earlier bench were not used: scene, settings or environment have changed."
            return False
        for record in records[1:]:
            if "result" in record:
                self.results[record["key"]] = record["result"]
            elif "time" in record:
                self.times.setdefault(record["key"], []).append(float(record["time"]))
        if self.results:
            self.note = f"Resumed: {len(self.results)} results of an interrupted bench were taken over."
        if lines and _parse(lines[-1]) is None:  # cut off while it was written
            self._write(path, None, "a")
        return True

    def keep(self, key: str, result: Mapping[str, Any]) -> None:
        """Adds a result of the error pass."""
        self.results[key] = dict(result)
        self._add({"key": key, "result": self.results[key]})

    def time(self, key: str, seconds: float) -> None:
        """Adds one measurement."""
        self.times.setdefault(key, []).append(seconds)
        self._add({"key": key, "time": seconds})

    def remove(self) -> None:
        """The bench is complete: the next one starts afresh."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def _add(self, record: Mapping[str, Any]) -> None:
        if self.path is not None:
            self._write(self.path, record, "a")

    def _write(self, path: Path, record: Mapping[str, Any] | None, mode: str) -> None:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open(mode, encoding="utf-8") as file:
                file.write("\n" if record is None else json.dumps(record) + "\n")
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror})", str(path), "choose another --out") from None


def _parse(line: str) -> dict[str, Any] | None:
    try:
        record = json.loads(line)
    except ValueError:
        return None
    return record if isinstance(record, dict) else None


def stamp(scene: Scene, environment: Mapping[str, Any], quick: bool) -> str:
    """Hash of all that results depend on: mechanism, motion, gravity and loads, environment, protocol."""
    motion, applied = scene.motion, scene.applied
    record = {
        "models": model_texts(scene.mechanism),
        "motion": [motion.t, motion.y, motion.yd, motion.ydd],
        "applied": [applied.g, *(load.numbers() for load in applied.loads)],
        "environment": environment,
        "quick": quick,
        "v": VERSION,
    }
    return hashlib.sha256(json_text(record).encode()).hexdigest()
