"""Execution of tasks on a Dask cluster, which queues tasks, reassigns the tasks of dead workers, and supports TLS.

Like `Processes`, a worker runs each task in a separate process, so that a crash or an exceeded limit affects only one
row. The journal of a command stores each row as it arrives. If the scheduler stops, so does the command; when rerun, it
resumes from its journal. See ``harness/guide/cluster.md``. Dask is imported only when a cluster is used.
"""

from __future__ import annotations

import asyncio
import os
import platform
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

from screwgauge.problem import Progress, Report
from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError, first_few
from screwgauge.reference.files import digest, is_file, read_json
from screwgauge.solution import Failure
from screwgauge.study import isolation
from screwgauge.study.address import versions
from screwgauge.study.runner import Executor, InTurn, Processes, Task

if TYPE_CHECKING:
    from distributed import Client, Future

TICK = 0.1  # time between checks for results [s]
#: Names of Dask's settings for the timeout of a scheduler's response, and for the longest time without workers.
ANSWER, WORKERS = "distributed.comm.timeouts.connect", "distributed.scheduler.no-workers-timeout"
PATIENCE = "60s"  # default of `WORKERS`
AGAIN = "and run the same command again; it resumes from the existing rows"


@dataclass(frozen=True, slots=True)
class Cluster:
    """Executor of tasks on a Dask cluster.

    Attributes:
        where: Address of the scheduler, or path of the file that the scheduler wrote.
        limits: Time and memory limits of each task.

    Raises:
        OutputError: Dask is not installed.
    """

    where: str
    limits: isolation.Limits = field(default_factory=isolation.Limits)

    def __post_init__(self) -> None:
        if find_spec("distributed") is None:
            what = "a cluster needs distributed, which is not installed"
            raise OutputError(what, "--cluster", "run pip install 'screwgauge[cluster]'")

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        if not tasks:
            return
        from distributed import CancelledError, Client

        address = _address(self.where)
        try:
            with Client(address, set_as_default=False) as client:
                _check_versions(client)
                self._run(client, tasks, keep, report)
        except (OSError, CancelledError):
            raise OutputError("the scheduler no longer responds", self.where, f"restart it {AGAIN}") from None

    def _run(self, client: Client, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        """Run tasks together; rerun tasks whose workers died, one at a time.

        Dask blames a worker's death on all of its tasks; only a task that ran alone has certainly killed its worker.
        """
        from distributed import KilledWorker

        groups, done = [tasks], 0

        def tell(workers: int) -> None:
            report(f"{workers} worker{'s' * (workers != 1)}", done / len(tasks))

        while groups:
            group = groups.pop()
            for name, result in self._results(client, self._submit(client, group), tell):
                if isinstance(result, KilledWorker) and len(group) > 1:
                    groups.append({name: group[name]})
                    continue
                if isinstance(result, KilledWorker):
                    result = Failure(name, f"its worker was killed {result.allowed_failures + 1} times")
                keep(name, result)
                done += 1

    def _submit(self, client: Client, tasks: Mapping[str, Task]) -> dict[Future, str]:
        """Submit tasks to the scheduler; return future -> name."""
        expected, home = versions(), os.getcwd()
        futures = {}
        for name, task in tasks.items():
            files = {os.path.abspath(path): digest(path) for path in task.files}
            work = partial(_with_files, task.work, home, files) if files else task.work
            futures[client.submit(on_worker, name, work, self.limits, expected, pure=False)] = name
        return futures

    def _results(
        self, client: Client, names: dict[Future, str], tell: Callable[[int], None]
    ) -> Iterator[tuple[str, Any]]:
        """Yield each result with its name as soon as it is available.

        Args:
            names: Names of the pending futures; each future is removed when it is done, so that its worker forgets the
                result.
            tell: Called with the number of workers several times a second.

        Raises:
            OutputError: The cluster had no worker for too long.
            OSError: The scheduler did not respond.
        """
        import dask
        from dask.utils import parse_timedelta
        from distributed import as_completed

        timeout = dask.config.get(ANSWER)
        patience, seen = parse_timedelta(dask.config.get(WORKERS) or PATIENCE), monotonic()
        completed = as_completed(names, loop=client.loop)
        while True:
            workers = len(client.sync(client.nthreads, callback_timeout=timeout))
            tell(workers)
            if not names:
                return
            seen = monotonic() if workers else seen
            if monotonic() - seen > patience:
                raise OutputError(f"has had no worker for {patience:g} s", self.where, f"start workers {AGAIN}")
            for future in completed.next_batch(block=False):
                try:
                    result = _result(future, timeout)
                except TimeoutError:  # the worker with the result died, and another one computes it again
                    completed.add(future)
                else:
                    yield names.pop(future), result
            sleep(TICK)


def executor(jobs: int | None, cluster: str | None, limits: isolation.Limits | None = None) -> Executor:
    """Return the executor selected by options: on a cluster, in separate processes, or in this process.

    Args:
        jobs: Number of parallel processes.
        cluster: Address of a Dask scheduler, or path of the file that the scheduler wrote.
        limits: Limits of each task; without limits, tasks run in this process, unless several run in parallel.
    """
    if cluster is not None:
        return Cluster(cluster, limits or isolation.Limits())
    if limits is None and jobs is None:
        return InTurn()
    return Processes(1 if jobs is None else jobs, limits or isolation.Limits())


def _address(where: str) -> str:
    """Return the address of a scheduler after checking that it responds: a Dask client that cannot connect hangs.

    Raises:
        DescriptionError: No scheduler responds, or only one of Dask's configuration and the scheduler uses TLS.
    """
    from distributed import Security
    from distributed.comm import connect

    remedy = (
        "start one; pass its address, such as tcp://127.0.0.1:8786, or the file from dask scheduler --scheduler-file"
    )
    address = read_json(Path(where), "file of a scheduler", remedy).get("address") if is_file(Path(where)) else where

    async def answer() -> None:
        await (await connect(address, **Security().get_connection_args("client"))).close()

    try:
        asyncio.run(answer())
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise DescriptionError(f"no scheduler responds ({_line(error)})", where, remedy) from None
    return str(address)


def _check_versions(client: Client) -> None:
    """Reject a scheduler or workers whose Python, Dask or numpy versions differ from the local versions."""
    import dask

    found = client.sync(client.get_versions, callback_timeout=dask.config.get(ANSWER))
    for machine, other in {"the scheduler": found["scheduler"], **found["workers"]}.items():
        there = {name: version for name, version in other["packages"].items() if version}
        _compare({name: found["client"]["packages"][name] for name in there}, there, machine)


def _compare(here: Mapping[str, str], there: Mapping[str, str], machine: str) -> None:
    """Reject a machine whose versions differ from the local versions."""
    odd = {name: version for name, version in here.items() if there.get(name) != version}
    if odd:
        words = first_few((f"{name} {there.get(name)} instead of {version}" for name, version in odd.items()), 3)
        remedy = "install the same versions on all machines"
        raise DescriptionError(f"{machine} has {words}", "--cluster", remedy)


def _result(future: Future, timeout: str) -> Any:
    """Return the result of a finished task, or the error `KilledWorker` if its workers were killed.

    Raises:
        ScrewgaugeError: The task raised this error, or the worker cannot run it.
        TimeoutError: The result or the scheduler is lost.
        OSError: The scheduler is lost.
    """
    from distributed import KilledWorker

    if future.status != "error":
        return future.result(timeout)
    error = future.exception(timeout)
    if isinstance(error, KilledWorker):
        return error
    if isinstance(error, ScrewgaugeError):
        raise error
    what = f"the cluster cannot run the tasks ({_line(error).partition('. ')[0]})"
    raise DescriptionError(what, "--cluster", "check the logs of its scheduler and workers")


def on_worker(name: str, work: Callable[[Progress], Any], limits: isolation.Limits, expected: Mapping[str, str]) -> Any:
    """Run a task on a worker, in a separate process reserved for this thread.

    Args:
        expected: Versions required on this machine, see `versions`; checked here because workers may join at any time.

    Raises:
        DescriptionError: Versions on this machine differ from the expected ones.
    """
    _compare(expected, _versions(), f"the worker {platform.node()}")
    lane = f"dask-{threading.get_ident()}"
    return isolation.run_isolated({name: work}, limits, lambda step, share: None, lanes=[lane])[name]


_versions = cache(versions)


def _with_files(work: Callable[[Progress], Any], home: str, files: Mapping[str, str], progress: Progress) -> Any:
    """Run a task in the client's current folder, provided that this machine has the same files.

    Args:
        files: Absolute path -> digest on the client.

    Raises:
        DescriptionError: A file is missing, or differs from the client's copy.
    """
    with suppress(OSError):
        os.chdir(home)
    for path, content in files.items():
        if not is_file(Path(path)) or digest(Path(path)) != content:
            what = f"is missing or differs on the worker {platform.node()}"
            raise DescriptionError(what, path, "share the folder with all workers")
    return work(progress)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
