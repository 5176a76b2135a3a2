"""Task runner: executors that run tasks here or in separate processes (`cluster` has a third), and a log of rows.

Each study defines its tasks and rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any, Protocol, TypeVar

import pandas as pd

from screwgauge.problem import Progress, Report, silent
from screwgauge.reference.errors import DescriptionError
from screwgauge.solution import Failure
from screwgauge.study import isolation
from screwgauge.study.address import address
from screwgauge.study.store import Journal

Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class Task:
    """Task that produces a row.

    Attributes:
        name: Unique name.
        work: Function that takes a progress function and returns the row. It can be pickled.
        key: Key of the row in a journal; the name if empty.
        files: External files that the task reads, which other machines also need.
    """

    name: str
    work: Callable[[Progress], Any]
    key: str = ""
    files: Sequence[Path] = ()


class Executor(Protocol):
    """Executor of tasks."""

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        """Run tasks; call `keep` with the name and row, or `Failure`, of each task as soon as it is done.

        Raises:
            ScrewgaugeError: A task raised this error, and all other tasks were stopped.
        """


def _ignore_progress(share: float, step: str = "") -> None:
    """Ignore progress within a task."""


class InTurn:
    """Executor of tasks in this process, one after another."""

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        for i, (name, task) in enumerate(tasks.items()):
            report(name, i / len(tasks))
            keep(name, task.work(_ignore_progress))


@dataclass(frozen=True)
class Processes:
    """Executor of tasks in `jobs` parallel processes of this machine; a crash or hang affects only one row.

    Raises:
        DescriptionError: `jobs` is less than one.
    """

    jobs: int = 1
    limits: isolation.Limits = field(default_factory=isolation.Limits)

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise DescriptionError(f"cannot run {self.jobs} tasks at a time", "-j", "use a positive number")

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        works = {name: task.work for name, task in tasks.items()}
        if works:
            lanes = [f"lane-{i + 1}" for i in range(min(self.jobs, len(works)))]
            isolation.run_isolated(works, self.limits, report, lanes=lanes, keep=keep)


def run_tasks(
    tasks: Iterable[Task],
    execute: Executor,
    *,
    lost: Callable[[str, str], Row],
    before: Mapping[str, Row] | None = None,
    keep: Callable[[str, Row], None] = lambda key, row: None,
    progress: Report = silent,
) -> list[Row]:
    """Run all tasks; return their rows in order.

    Args:
        lost: Function that makes a row from the name of a task that crashed, exceeded a limit or raised an error, and
            the reason.
        before: Key -> row, for tasks that need not be run again, see `Journal.rows`.
        keep: Called with the key of a task and its row as soon as the task is done, see `Journal.keep`.
        progress: Called with a string that states step, rate and remaining time, and with the completed share.

    Raises:
        ScrewgaugeError: A task, or `keep`, raised this error.
    """
    named = {task.name: task for task in tasks}
    keys = {name: task.key or name for name, task in named.items()}
    rows = {name: before[key] for name, key in keys.items() if before and key in before}
    todo = {name: task for name, task in named.items() if name not in rows}
    pace = TaskRate(len(todo))

    def done(name: str, result: Row | Failure) -> None:
        if isinstance(result, Failure):
            step = f"{result.engine}: " * (result.engine != name)
            result = lost(name, f"{step}{result.reason}")
        rows[name] = result
        pace.done += 1
        keep(keys[name], result)

    execute(todo, done, lambda step, share: progress(pace.add_rate(step), share))
    return [rows[name] for name in named]


def grow_table(
    file: Path,
    columns: Sequence[str],
    tasks: Iterable[Task],
    execute: Executor,
    lost: Callable[[str, str], Mapping[str, Any]],
    progress: Report = silent,
    about: object = None,
) -> str:
    """Return the rows of tasks as CSV, reusing rows that the same code has already computed for this file.

    Args:
        file: File of the table, which is neither read nor written.
        tasks: Tasks that each return a list of rows.
        lost: See `run_tasks`.
        about: Further data that affect the rows, see `address`.

    Raises:
        ScrewgaugeError: A task raised this error.
    """
    kept = Journal(file, address("table", columns, about))
    rows = run_tasks(
        tasks,
        execute,
        lost=lambda name, reason: [lost(name, reason)],
        before={key: record["rows"] for key, record in kept.results.items()},
        keep=lambda key, rows: kept.keep(key, {"rows": rows}),
        progress=progress,
    )
    frame = pd.DataFrame([row for each in rows for row in each], columns=[*columns])
    return frame.to_csv(index=False)


class TaskRate:
    """Rate at which tasks finish."""

    def __init__(self, n: int, clock: Callable[[], float] = monotonic) -> None:
        self.n, self.clock, self.done, self.began = n, clock, 0, clock()

    def add_rate(self, step: str) -> str:
        """Append the rate and the remaining time to a step, once they are known."""
        passed = self.clock() - self.began
        if self.done < 2 or passed <= 0.0:
            return step
        rate = self.done / passed
        return f"{step} ({self.done} of {self.n}, {rate:.2g}/s, {_duration((self.n - self.done) / rate)} left)"


def _duration(seconds: float) -> str:
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
