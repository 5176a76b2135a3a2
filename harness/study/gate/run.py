"""All items of a gate, one after the other or in processes of their own; those that an interrupted one has are kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from time import perf_counter

from screwgauge.environment import environment, json_text
from screwgauge.models.catalog import mechanism_tables
from screwgauge.models.importing import is_model
from screwgauge.problem import GivenMotion
from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError
from screwgauge.reference.files import digest
from screwgauge.scene.read import load_scene
from screwgauge.solution import Failure
from screwgauge.study import isolation
from screwgauge.study.gate.items import Item
from screwgauge.study.gate.measure import Settings, files_of, measured
from screwgauge.study.gate.row import Row, row_from
from screwgauge.study.journal import Journal

NAME = "check.partial.jsonl"


def check_items(
    items: Sequence[Item],
    settings: Settings,
    *,
    jobs: int = 1,
    limits: isolation.Limits | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
    journal: Path | None = None,
) -> list[Row]:
    """A row for each item, in their order.

    Args:
        jobs: Processes at a time.
        limits: What each item may take in a process; by default all are checked in this one.
        journal: File of rows that an interrupted gate goes on from; it goes away when all are there.
    """
    record = [environment(), settings.smoke, settings.tolerances]
    kept = Journal(journal, hashlib.sha256(json_text(record).encode()).hexdigest(), _is_row)
    keys = {item.name: fingerprint(item) for item in items} if journal else {}
    rows = {name: row_from(kept.results[key]) for name, key in keys.items() if key in kept.results}
    works = {item.name: partial(_timed, item, settings) for item in items if item.name not in rows}

    def keep(name: str, result: Row | Failure) -> None:
        if isinstance(result, Failure):
            engine = f"{result.engine}: " * (result.engine != name)
            result = Row(name, "failed", f"{name}: {engine}{result.reason}")
        rows[name] = result
        if keys:
            with suppress(OutputError):  # the row is told all the same; the report meets the full disk again
                kept.keep(keys[name], asdict(result))

    if limits is None:
        for i, (name, work) in enumerate(works.items()):
            progress(name, i / len(works))
            keep(name, work(lambda share, step: None))
    else:
        found = isolation.isolated(works, limits, progress, lanes=jobs, keep=keep)
        for name in found.keys() - rows.keys():
            keep(name, found[name])
    kept.remove()
    return [rows[item.name] for item in items]


def _is_row(record: object) -> bool:
    try:
        return bool(row_from(record))
    except ValueError:
        return False


def _timed(item: Item, settings: Settings, progress: Callable[..., None]) -> Row:
    begin = perf_counter()
    row = measured(item, settings, progress)
    return replace(row, seconds=perf_counter() - begin)


def fingerprint(item: Item) -> str:
    """Of an item's name and all files that it is made of, as far as they can be read."""
    said = hashlib.sha256(json_text([item.name, item.files]).encode())
    files = [Path(name) for name in item.files if is_model(name)]
    if not files:
        try:
            scene = load_scene(item.files[0])
        except ScrewgaugeError as error:
            said.update(str(error).encode())
        else:
            said.update(json_text([mechanism_tables(scene.mechanism_file), scene.text]).encode())
            files = files_of(scene)
            if isinstance(scene.task, GivenMotion):
                for array in (scene.task.t, scene.task.y, scene.task.yd, scene.task.ydd):
                    said.update(array.tobytes())
    for file in files:
        with suppress(DescriptionError):
            said.update(digest(file).encode())
    return said.hexdigest()
