"""Tasks for workers, which import little; and one that asks for processes where it runs."""

import os
import signal
from functools import partial
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

from screwgauge.study.cluster import executor
from screwgauge.study.runner import InTurn, Processes, Task, TaskRate, grow_table, run_tasks
from screwgauge.study.store import Journal


def square(i: int, progress: Any) -> dict[str, Any]:
    return {"i": i, "square": i * i, "text": f"{i}"}


def dies(progress: Any) -> dict[str, Any]:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def takes_its_worker(progress: Any) -> dict[str, Any]:
    worker = parent_process()
    assert worker is not None
    os.kill(worker.pid, signal.SIGKILL)
    return {}


def reads(name: str, progress: Any) -> dict[str, Any]:
    return {"text": Path(name).read_text(encoding="utf-8")}


def appends(file: Path, i: int, progress: Any) -> dict[str, Any]:
    with file.open("a", encoding="utf-8") as opened:
        opened.write("done\n")
    return {"i": i}


def endless(progress: Any) -> dict[str, Any]:
    while True:
        pass


def greedy(progress: Any) -> dict[str, Any]:
    return {"size": len(bytearray(10**10))}


def limited_run(progress: Any) -> dict[str, Any]:
    import screwgauge

    scene = screwgauge.load_scene("slider-crank")
    found = screwgauge.run(scene.at(scene.t[:3]), ["screw"], ["joint_position"], limits=screwgauge.Limits())
    return {"ok": found.ok, "failures": [*found.failures]}


def tasks(n: int, *more: Task) -> list[Task]:
    return [*(Task(f"square {i}", partial(square, i)) for i in range(n)), *more]


def rows(tasks: list[Task], execute: Any, kept: Journal | None = None) -> list[dict[str, Any]]:
    kept = kept or Journal(None, "")

    def lost(name: str, reason: str) -> dict[str, Any]:
        return {"lost": f"{name}: {reason}"}

    return run_tasks(tasks, execute, lost=lost, before=kept.results, keep=kept.keep)
