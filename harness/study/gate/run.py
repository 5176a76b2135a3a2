"""All items of a gate, one after the other or in processes of their own; those that an interrupted one has are kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from screwgauge.environment import environment, json_text
from screwgauge.models.catalog import mechanism_tables
from screwgauge.models.importing import is_model
from screwgauge.models.readings.loops import loops_for
from screwgauge.models.readings.source import prepare
from screwgauge.problem import GivenMotion
from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError
from screwgauge.reference.files import digest, files_read, is_file
from screwgauge.scene.read import load_scene
from screwgauge.study.comparison import built_in
from screwgauge.study.gate.items import GateRow, Item
from screwgauge.study.gate.measure import GateSettings, files_of, measured
from screwgauge.study.runner import Executor, InTurn, Task, run_tasks
from screwgauge.study.store import Journal

NAME = "check.partial.jsonl"


def check_items(
    items: Sequence[Item],
    settings: GateSettings,
    *,
    execute: Executor | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
    journal: Path | None = None,
) -> list[GateRow]:
    """A row for each item, in their order.

    Args:
        execute: Where items are checked; in this process by default.
        journal: File of rows that an interrupted gate goes on from; it goes away when all are there.
    """
    stamp = json_text([environment(), settings.smoke, settings.tolerances])
    kept = Journal(journal, hashlib.sha256(stamp.encode()).hexdigest())
    tasks = [
        Task(item.name, partial(_timed, item, settings), fingerprint(item) if journal else "", partial(files_in, item))
        for item in items
    ]

    def keep(key: str, row: GateRow) -> None:
        with suppress(OutputError):  # the report meets the full disk again
            kept.keep(key, row)

    rows = run_tasks(
        tasks,
        execute or InTurn(),
        lost=lambda name, reason: GateRow(name, "failed", f"{name}: {reason}"),
        before=kept.rows(GateRow),
        keep=keep,
        progress=progress,
    )
    kept.remove()
    return rows


def _timed(item: Item, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    begin = perf_counter()
    row = measured(item, settings, progress)
    return replace(row, seconds=perf_counter() - begin)


def fingerprint(item: Item) -> str:
    """SHA-256 of an item's name and all files that it is made of, as far as they can be read."""
    contents = hashlib.sha256(json_text([item.name, item.files]).encode())
    files = [Path(name) for name in item.files if is_model(name)]
    if not files:
        try:
            scene = load_scene(item.files[0])
        except ScrewgaugeError as error:
            contents.update(str(error).encode())
        else:
            contents.update(json_text([mechanism_tables(scene.mechanism_file), scene.text]).encode())
            files = files_of(scene)
            if isinstance(scene.task, GivenMotion):
                for array in (scene.task.t, scene.task.y, scene.task.yd, scene.task.ydd):
                    contents.update(array.tobytes())
    for file in files:
        with suppress(DescriptionError):
            contents.update(digest(file).encode())
    return contents.hexdigest()


def files_in(item: Item) -> list[Path]:
    """All files that an item is made of and that do not come with this package: loops files, what models name, too."""
    with files_read() as read, suppress(ScrewgaugeError):
        models = []
        for name in item.files:
            if is_model(name):
                models.append(Path(name))
            else:
                read += files_of(load_scene(name))
        models += filter(is_model, read)
        for model in models:
            prepare(model)
            read += filter(None, [loops_for(model)])
    every = dict.fromkeys([*map(Path, item.files), *read])
    loops = (path.with_suffix(".loops.toml") for path in [*every])
    return [path for path in dict.fromkeys([*every, *loops]) if is_file(path) and not built_in(path.absolute())]
