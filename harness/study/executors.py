"""Executors: where tasks run, in this process, in others of this machine, or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from screwgauge.problem import Progress
from screwgauge.reference.errors import DescriptionError
from screwgauge.study import isolation

Report = Callable[[str, float], None]
"""Takes the name of a step and the share of it that is done, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Task:
    """What makes a row.

    Attributes:
        name: One of its own among all tasks.
        work: Takes a progress and returns the row. It pickles.
        key: What a journal knows the row by; the name if empty.
        files: The files that it reads, for machines that may not have them.
    """

    name: str
    work: Callable[[Progress], Any]
    key: str = ""
    files: Callable[[], Iterable[Path]] = tuple


class Executor(Protocol):
    """Does tasks."""

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        """Hands over the row of each task by its name as soon as it is there, or a `Failure`.

        Raises:
            ScrewgaugeError: Raised by a task; the others are stopped.
        """


class InTurn:
    """In this process, one after the other."""

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        for i, (name, task) in enumerate(tasks.items()):
            report(name, i / len(tasks))
            keep(name, task.work(lambda share, step="": None))


@dataclass(frozen=True)
class Processes:
    """In processes of this machine, so many at a time, which crash or hang at the cost of one row.

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
        lanes, kept = [f"lane-{i + 1}" for i in range(min(self.jobs, len(works)))], set[str]()

        def once(name: str, result: Any) -> None:
            kept.add(name)
            keep(name, result)

        results = isolation.isolated(works, self.limits, report, lanes=lanes, keep=once) if works else {}
        for name in results.keys() - kept:
            keep(name, results[name])


def executor(
    jobs: int | None, cluster: str | None, limits: isolation.Limits | None = None, *, insecure: bool = False
) -> Executor:
    """The executor that options ask for: on a cluster, in processes, or in this one.

    Args:
        jobs: Processes at a time.
        cluster: Address of a Dask scheduler, or the file that it has written.
        limits: What each task may take; without any it runs in this process, unless there are several at a time.
    """
    if cluster is not None:
        from screwgauge.study.cluster import Cluster

        return Cluster(cluster, limits or isolation.Limits(), insecure=insecure)
    if limits is None and jobs is None:
        return InTurn()
    return Processes(1 if jobs is None else jobs, limits or isolation.Limits())
