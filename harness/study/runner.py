"""The runner: tasks, where they run (here or in other processes; `cluster` has the third), and rows kept as they come.

What a task does, and what its row is, is for each study to say.
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
    """A task, of which a row is the result.

    Attributes:
        name: One of its own among all tasks.
        work: Takes a progress and returns the row. It pickles.
        key: What a journal knows the row by; the name if empty.
        files: Those that it reads and that do not come with the package, for machines that must have them, too.
    """

    name: str
    work: Callable[[Progress], Any]
    key: str = ""
    files: Sequence[Path] = ()


class Executor(Protocol):
    """Runs tasks."""

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        """Calls `keep` with the name and row of each task as soon as it is done, or with a `Failure`.

        Raises:
            ScrewgaugeError: Raised by a task; the others are stopped.
        """


def _unseen(share: float, step: str = "") -> None:
    """Progress within a task that is not shown."""


class InTurn:
    """Runs tasks in this process, one after the other."""

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        for i, (name, task) in enumerate(tasks.items()):
            report(name, i / len(tasks))
            keep(name, task.work(_unseen))


@dataclass(frozen=True)
class Processes:
    """Runs tasks in `jobs` processes of this machine at a time, which crash or hang at the cost of one row.

    Raises:
        DescriptionError: There are less than one.
    """

    jobs: int = 1
    limits: isolation.Limits = field(default_factory=isolation.Limits)

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise DescriptionError(f"{self.jobs} tasks at a time", "-j", "give a positive number")

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        works = {name: task.work for name, task in tasks.items()}
        if works:
            lanes = [f"lane-{i + 1}" for i in range(min(self.jobs, len(works)))]
            isolation.isolated(works, self.limits, report, lanes=lanes, keep=keep)


def run_tasks(
    tasks: Iterable[Task],
    execute: Executor,
    *,
    lost: Callable[[str, str], Row],
    before: Mapping[str, Row] | None = None,
    keep: Callable[[str, Row], None] = lambda key, row: None,
    progress: Report = silent,
) -> list[Row]:
    """The rows of all tasks, in their order.

    Args:
        lost: Makes a row of the name of a task that crashed, met a limit or raised something, and of the reason.
        before: Key -> row of tasks that are not done again, see `Journal.rows`.
        keep: Takes the key of a task and its row as soon as it is done, see `Journal.keep`.
        progress: Takes what is under way with the rate and the remaining time, and the share that is done.

    Raises:
        ScrewgaugeError: Raised by a task, or by `keep`.
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

    execute(todo, done, lambda step, share: progress(pace.shown(step), share))
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
    """Return the rows of tasks as CSV. Those that the same code has made for this file before are not made again.

    Args:
        file: The table that they are for; it is neither read nor written.
        tasks: Each returns a list of rows.
        lost: As `run_tasks` takes it.
        about: What rows depend on besides the names of their tasks, as `address` takes it.

    Raises:
        ScrewgaugeError: Raised by a task.
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

    def shown(self, step: str) -> str:
        """A step with the rate and the remaining time, once there are some."""
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
