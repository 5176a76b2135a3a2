"""Isolation of jobs in separate processes, so that only the result of a job is lost if it crashes or hangs."""

from __future__ import annotations

import faulthandler
import gc
import os
import re
import resource
import signal
import sys
import warnings
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import current_process
from multiprocessing.connection import Connection
from multiprocessing.util import Finalize
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Generic, TypeVar

import numpy as np
from loky import cpu_count
from loky.process_executor import BrokenProcessPool, ProcessPoolExecutor

from screwgauge.problem import Progress, silent
from screwgauge.processes import ONE, SAFE, inherit_safely, save_time
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError, quote
from screwgauge.reference.files import why
from screwgauge.solution import Failure
from screwgauge.study.forks import Forks
from screwgauge.study.lifeline import hold, lifeline

T = TypeVar("T")
#: Memory of the machine [GB].
MACHINE = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
TICK = 0.2  # time between checks of progress and clock [s]
#: Time [s] after which an idle process ends, and after which it gets no further job: loky does not notice the crash of
#: a process that it starts to replace an idle process that ended.
IDLE, ASKED = 60.0, 30.0
#: Time [s] after its time limit at which a process ends itself, if the parent, which can report more, has not ended it.
GRACE = 5.0
LONGEST = 1e9  # longest time of a timer [s]
AGAIN = 3  # number of reruns of a job whose process was killed from outside
KILLED = re.compile("SIG(KILL|TERM|HUP)")  # a crashing engine gets a different signal, and would get it again
STEP = 200  # largest length of the name of a step
SLOW = 5.0  # time without progress after which a report states the possible cause [s]
STARTING = "{} (loading, compiling or solving its first samples)"
#: Environment of worker processes: one thread each, no imports from the current folder, and no graphics, because MuJoCo
#: would otherwise look for window libraries on import.
ENVIRONMENT = {**ONE, **SAFE, "MUJOCO_GL": "disable"}
#: Name -> executor, kept for the next job, because starting a process and importing an engine takes a second.
_EXECUTORS: dict[str, ProcessPoolExecutor] = {}
#: Name -> time at which the executor became idle [s].
_FREE: dict[str, float] = {}
_worker = False


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits for an engine that runs in its own process.

    Attributes:
        seconds: Time from start to answer, including loading [s].
        memory: Memory of the process [GB]; by default, all memory of the machine.

    Raises:
        DescriptionError: A limit is not a positive number.
    """

    seconds: float = 3600.0
    memory: float = MACHINE

    def __post_init__(self) -> None:
        for option, value, unit in (("--limit", self.seconds, "s"), ("--memory", self.memory, "GB")):
            if not 0.0 < value < np.inf:
                raise DescriptionError(f"a limit of {value:g} {unit}", option, f"use a positive number of {unit}")


def run_isolated(
    works: Mapping[str, Callable[[Progress], T | Failure]],
    limits: Limits,
    report: Callable[[str, float], None],
    *,
    lanes: Sequence[str] = (),
    keep: Callable[[str, T | Failure], None] = lambda name, result: None,
) -> dict[str, T | Failure]:
    """Run jobs in parallel, each in a worker process of its own name, or in one process per lane.

    Args:
        works: Name -> job. A job can be pickled; it is called with a function to which it passes its completed share
            and an optional step.
        report: Called with the names of the running jobs, and the completed share of all jobs.
        lanes: Names of processes, each of which runs jobs in sequence. A job whose process was killed from outside is
            run again, at most `AGAIN` times.
        keep: Called with each result as soon as it is available.

    Returns:
        The result of each job, or a failure if it crashed or exceeded a limit, in the order of the jobs; a failure
        names the last step that the job reported.

    Raises:
        ScrewgaugeError: A job raised this error, so that all other jobs were stopped; or `limits` is not a `Limits`.
    """
    if not isinstance(limits, Limits):
        raise DescriptionError(
            f"{quote(limits)} is not a Limits object", "limits", "pass screwgauge.Limits(seconds=...)"
        )
    # progress is reported through files, which survive their writer and never block
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        jobs = _Jobs(works, limits, lanes, keep, Path(folder))
        try:
            while jobs.waiting or jobs.running:
                jobs.start()
                jobs.collect()
                shares = jobs.shares()
                jobs.stop_overdue(shares)
                if jobs.running:
                    report(", ".join(jobs.steps(shares)), (len(jobs.results) + sum(shares.values())) / len(works))
        finally:
            jobs.stop()
    return {name: jobs.results[name] for name in works}


class _Jobs(Generic[T]):
    """Waiting, running and finished jobs.

    Attributes:
        running: Future -> name of a running job, name of its process, and start time.
        free: Names of idle processes, if there are lanes.
        killed: Name of a job -> number of times that its process was killed from outside.
    """

    def __init__(
        self,
        works: Mapping[str, Callable[[Progress], T | Failure]],
        limits: Limits,
        lanes: Sequence[str],
        keep: Callable[[str, T | Failure], None],
        folder: Path,
    ) -> None:
        self.works, self.limits, self.lanes, self.keep, self.folder = works, limits, lanes, keep, folder
        self.waiting, self.running = deque(works), dict[Future[T | Failure], tuple[str, str, float]]()
        self.results, self.killed = dict[str, T | Failure](), Counter[str]()
        self.free, self.most = [*reversed(lanes)], len(lanes) or cpu_count()

    def start(self) -> None:
        """Start as many waiting jobs as there are free processes."""
        while self.waiting and len(self.running) < self.most:
            name = self.waiting.popleft()
            process = self.free.pop() if self.lanes else name
            alarm = min(self.limits.seconds + GRACE, LONGEST)
            work = partial(
                _run_within, name, self.works[name], self.limits, alarm, _file(self.folder, name), os.getcwd()
            )
            self.running[_submit(process, work)] = name, process, monotonic()

    def collect(self) -> None:
        """Collect the results of finished jobs and store them."""
        for future in wait(self.running, timeout=TICK, return_when=FIRST_COMPLETED).done:
            name, process, _ = self.running.pop(future)
            self._done(name, process, _result(name, future, self.limits))

    def shares(self) -> dict[str, float]:
        """Return the completed shares of the running jobs."""
        return {name: _share(_file(self.folder, name))[0] for name, _, _ in self.running.values()}

    def steps(self, shares: Mapping[str, float]) -> list[str]:
        """Return the names of the running jobs, with a possible explanation for jobs that report no progress."""
        began = {name: begin for name, _, begin in self.running.values()}
        slow = {name for name, share in shares.items() if not share and monotonic() - began.get(name, np.inf) > SLOW}
        return [STARTING.format(name) if name in slow else name for name in shares]

    def stop_overdue(self, shares: Mapping[str, float]) -> None:
        """Stop jobs that exceed their time limit."""
        for future, (name, process, begin) in [*self.running.items()]:
            if monotonic() - begin > self.limits.seconds:
                del self.running[future]
                _stop(process)
                self._done(name, process, _limit_failure(name, self.limits, f", {shares[name]:.0%} done"))

    def stop(self) -> None:
        """Stop all running jobs."""
        for _, process, _ in self.running.values():
            _stop(process)

    def _done(self, name: str, process: str, result: T | Failure) -> None:
        self.free.append(process)
        _FREE[process] = monotonic()
        if self.lanes and isinstance(result, Failure) and KILLED.search(result.reason):
            self.killed[name] += 1
            if self.killed[name] <= AGAIN:
                self.waiting.append(name)  # last, so that a job that kills its process does not delay the others
                return
            result = replace(result, reason=f"{result.reason}, {self.killed[name]} times")
        if isinstance(result, Failure) and (step := _share(_file(self.folder, name))[1]):
            result = replace(result, engine=step)
        self.results[name] = result
        self.keep(name, result)


def call_isolated(name: str, work: Callable[[], T | Failure], limits: Limits) -> T | Failure:
    """Run a job in the process with a given name and return its result; see `run_isolated`."""
    return run_isolated({name: partial(_run_silently, work)}, limits, silent)[name]


def _run_silently(work: Callable[[], T], progress: Progress) -> T:
    """Run a job that does not report progress."""
    return work()


def is_worker() -> bool:
    """Return True in a process that runs jobs of another process."""
    return _worker


def _begin(line: Connection, environment: Mapping[str, str]) -> None:
    """Initialize a process that ends with its parent and sends its standard output to standard error.

    Args:
        environment: Environment of the parent, which may have changed since the process server started.
    """
    global _worker
    _worker = True
    os.environ.clear()
    os.environ.update(environment)
    hold(line)
    gc.freeze()  # imports of the server are not garbage, and should stay in shared memory
    save_time()
    with suppress(OSError):  # standard error may not exist
        os.dup2(2, 1)


def _run_within(
    name: str, work: Callable[[Progress], T | Failure], limits: Limits, end: float, file: Path, home: str
) -> T | Failure:
    """Run a job within its limits. The process ignores keyboard interrupts, which its parent handles.

    Args:
        end: Time after which the process ends itself [s].
        home: Current folder of the parent at submission, to which relative paths of the job refer.
    """
    os.chdir(home)
    faulthandler.disable()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # the kernel then ends the process, whatever it is doing
    signal.setitimer(signal.ITIMER_REAL, end)
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    most = int(1e9 * limits.memory)
    resource.setrlimit(resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # raised by numpy; the report states non-finite values
        try:
            return work(partial(_say, file))
        except MemoryError:
            return Failure(name, f"needs more memory than the limit of {limits.memory:.3g} GB; --memory changes it")
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def _submit(name: str, work: Callable[[], T]) -> Future[T]:
    """Submit a job to the process with a given name; start a new process if none exists or it crashed."""
    if current_process().daemon:  # a daemon, e.g. a Dask worker, may have no children; here, the lifeline ends them
        current_process().daemon = False
        Finalize(None, _stop_all, exitpriority=100)  # before the process waits for its children
    if name in _EXECUTORS and monotonic() - _FREE.get(name, 0.0) > ASKED:
        _stop(name)
    with inherit_safely(ENVIRONMENT):
        try:
            future: Future[T] = _EXECUTORS[name].submit(work)
        except (KeyError, BrokenProcessPool):
            _EXECUTORS[name] = _executor()
            future = _EXECUTORS[name].submit(work)
    return future


def _executor() -> ProcessPoolExecutor:
    """Start a process that waits for jobs.

    Raises:
        ScrewgaugeError: The system has no space for the semaphores of the process, or lacks /proc, which is needed to
            terminate it.
    """
    remedy = "mount it as usual, or call screwgauge.run from Python, which does not start processes"
    if sys.platform == "linux" and not os.path.exists("/proc/self/stat"):
        raise ScrewgaugeError("is missing, but is needed to monitor and terminate processes", "/proc", remedy)
    try:
        return ProcessPoolExecutor(
            max_workers=1, timeout=IDLE, context=Forks(), initializer=_begin, initargs=(lifeline(), {**os.environ})
        )
    except OSError as error:
        raise ScrewgaugeError(f"has no space for more semaphores ({why(error)})", "/dev/shm", remedy) from None


def _stop(name: str) -> None:
    """Terminate the process with a given name, whatever it is doing."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # loky warns if it cannot list the children of the process
        _EXECUTORS.pop(name).shutdown(kill_workers=True)


def _stop_all() -> None:
    for name in [*_EXECUTORS]:
        _stop(name)


def _limit_failure(name: str, limits: Limits, how_far: str = "") -> Failure:
    return Failure(name, f"stopped at the time limit of {limits.seconds:g} s{how_far}; --limit changes it")


def _result(name: str, future: Future[T | Failure], limits: Limits) -> T | Failure:
    """Return the result of a job, or a failure that describes how the job's process ended."""
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, ScrewgaugeError):
        raise error
    if isinstance(error, BrokenProcessPool):
        if signal.SIGALRM.name in str(error):
            return _limit_failure(name, limits)
        return Failure(name, f"crashed: {_describe_end(str(error))}", str(error))
    return Failure(name, f"{type(error).__name__}: {' '.join(str(error).split())}", str(error.__cause__ or ""))


def _describe_end(message: str) -> str:
    """Describe how a process ended, based on loky's error message."""
    if match := re.search(r"SIG[A-Z]+", message):
        return f"its process received {match[0]}"
    if match := re.search(r"EXIT\((\d+)\)", message):
        return f"its process exited with status {match[1]}"
    return " ".join(message.split())


def _file(folder: Path, name: str) -> Path:
    return folder / f"{name}.share"


def _say(file: Path, share: float, step: str = "") -> None:
    """Write the progress of a job; ignore a full disk."""
    with suppress(OSError):
        file.write_text(f"{share:.4f} {step[:STEP]}", encoding="utf-8")


def _share(file: Path) -> tuple[float, str]:
    """Read the last written share and step; 0 if nothing is written yet, or the file is incomplete or malformed."""
    try:
        share, _, step = file.read_text(encoding="utf-8").partition(" ")
        return (float(share) if 0.0 <= float(share) <= 1.0 else 0.0), step
    except (OSError, ValueError):
        return 0.0, ""
