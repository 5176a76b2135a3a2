"""Checks of all items of a gate: sequential, in parallel processes, or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from screwgauge.models.importing import MESHES, is_model
from screwgauge.models.importing.model import imported_file, is_scratch
from screwgauge.models.readings.loops import loops_for
from screwgauge.models.readings.source import prepare
from screwgauge.reference.errors import OutputError, ScrewgaugeError
from screwgauge.reference.files import files_read, is_file
from screwgauge.scene.read import load_scene
from screwgauge.study.address import address
from screwgauge.study.comparison import built_in
from screwgauge.study.gate.items import GateRow, Item
from screwgauge.study.gate.known_files import known_item, known_row
from screwgauge.study.gate.measure import GateSettings, compare_pair, compare_scene, files_of
from screwgauge.study.gate.smoke import smoke_row
from screwgauge.study.runner import Executor, InTurn, Task, run_tasks
from screwgauge.study.store import Journal


def check_items(
    items: Sequence[Item],
    settings: GateSettings,
    *,
    execute: Executor | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
    place: Path | None = None,
) -> list[GateRow]:
    """Check items; return their rows in order.

    Args:
        execute: Executor of the checks; this process by default.
        place: Folder of the report. If given, finished rows are kept on disk until all are finished.
    """
    kept = Journal(place, address("check", settings.smoke, settings.tolerances, settings.meshes))
    tasks = []
    for item in items:
        files = files_in(item, meshes=settings.meshes) if place else []
        key = address(item.name, item.files, files=files) if place else ""
        tasks.append(Task(item.name, partial(_time, item, settings), key, files))

    def keep(key: str, row: GateRow) -> None:
        with suppress(OutputError):  # writing the report will report the full disk
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


def _time(item: Item, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    begin = perf_counter()
    row = check_item(item, settings, progress)
    return replace(row, seconds=perf_counter() - begin)


def check_item(item: Item, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    """Check an item; report bad input and engine failures as rows. `progress`: see `compare_scene`."""
    try:
        row = _pair(item, settings) if len(item.files) == 2 else _scene(item, settings, progress)
    except ScrewgaugeError as error:
        row = GateRow(item.name, "failed" if error.exit_status == 3 else "refused", str(error), file=item.files[0])
    return replace(row, read=(*row.read, *item.files))


def _pair(item: Item, settings: GateSettings) -> GateRow:
    return known_row(item, settings) if settings.smoke and item == known_item() else compare_pair(item, settings)


def _scene(item: Item, settings: GateSettings, progress: Callable[..., None]) -> GateRow:
    if settings.meshes and is_model(item.files[0]):
        imported_file(Path(item.files[0]), [MESHES])
    scene = load_scene(item.files[0])
    row = smoke_row(scene, settings, progress) if settings.smoke else compare_scene(scene, settings, progress)[0]
    return replace(row, scene=item.name, file=row.file or item.files[0])


def files_in(item: Item, *, meshes: bool = False) -> list[Path]:
    """Return all files of an item, including loops files and files that models refer to.

    Files that come with this package, and temporary descriptions generated from models, are omitted.
    """
    with files_read() as read, suppress(ScrewgaugeError):
        models = []
        for name in item.files:
            if is_model(name):
                models.append(Path(name))
            else:
                read += files_of(load_scene(name))
        models += filter(is_model, read)
        for model in models:
            prepare(model, meshes=meshes)
            read += filter(None, [loops_for(model)])
    every = dict.fromkeys([*map(Path, item.files), *read])
    loops = (path.with_suffix(".loops.toml") for path in [*every])
    known = (path for path in dict.fromkeys([*every, *loops]) if is_file(path) and not is_scratch(path))
    return [path for path in known if not built_in(path.absolute())]
