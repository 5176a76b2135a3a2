"""Tasks for workers, which import little; and one that asks for processes where it runs."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path
from typing import Any

from screwgauge.study.cluster import executor
from screwgauge.study.runner import InTurn, Processes, Task, TaskRate, grow_table, run_tasks
from screwgauge.study.store import Journal


def square(i: int, progress: Any) -> dict[str, Any]:
    return {"i": i, "square": i * i, "text": f"{i}"}


def dies(progress: Any) -> dict[str, Any]:
    """Its process is killed, as by the kernel where memory is short."""
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def takes_its_worker(progress: Any) -> dict[str, Any]:
    os.kill(os.getppid(), signal.SIGKILL)
    return {}


def reads(name: str, progress: Any) -> dict[str, Any]:
    return {"text": Path(name).read_text(encoding="utf-8"), "file": str(Path(name))}


def limited_run() -> tuple[bool, list[str]]:
    """A run with limits, wherever that is."""
    import screwgauge

    scene = screwgauge.load_scene("slider-crank")
    found = screwgauge.run(scene.at(scene.t[:3]), ["screw"], ["joint_position"], limits=screwgauge.Limits())
    return found.ok, [*found.failures]


def tasks(n: int, *more: Task) -> list[Task]:
    return [*(Task(f"square {i}", partial(square, i)) for i in range(n)), *more]


def rows(tasks: list[Task], execute: Any, kept: Journal | None = None) -> list[dict[str, Any]]:
    kept = kept or Journal(None, "")

    def lost(name: str, reason: str) -> dict[str, Any]:
        return {"lost": f"{name}: {reason}"}

    return run_tasks(tasks, execute, lost=lost, before=kept.results, keep=kept.keep)
