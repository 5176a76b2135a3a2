"""Tasks on a Dask cluster: whatever is killed runs again, and what is lost with the scheduler is asked for anew.

A worker does each task in a process of its own, as `Processes` does, so that crashes and limits cost one row there,
too. See ``harness/guide/cluster.md``. Nothing of Dask is imported before a cluster is asked.
"""

from __future__ import annotations

import hashlib
import ipaddress
import os
import tempfile
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache, lru_cache, partial
from operator import is_
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from screwgauge.problem import Progress, Report
from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError, first_few
from screwgauge.reference.files import read_bytes, read_json
from screwgauge.solution import Failure
from screwgauge.study import isolation
from screwgauge.study.address import versions
from screwgauge.study.runner import Executor, InTurn, Processes, Task

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT, PATIENCE = 10.0, 60.0  # s that a scheduler may take to answer, and to come back after it has gone
#: Tasks that a worker is given at once last about so long together [s], so that a scheduler has thousands of workers to
#: see to and not of tasks a second; and so many at most, so that none waits for the last of them.
BATCH, MOST = 1.0, 64
AHEAD = 2  # batches that wait for each thread of a worker
Files = Mapping[str, str]
"""Absolute path -> SHA-256."""


class LostError(Exception):
    """The scheduler has gone."""


@dataclass(frozen=True)
class Cluster:
    """A Dask cluster.

    Attributes:
        where: Address of its scheduler, or the file that it has written.
        limits: What each task may take.
        insecure: Reach beyond this machine without TLS.

    Raises:
        ScrewgaugeError: Dask is not installed, or the address is none, or leads beyond this machine without TLS.
    """

    where: str
    limits: isolation.Limits = field(default_factory=isolation.Limits)
    insecure: bool = False

    def __post_init__(self) -> None:
        try:
            import distributed  # noqa: F401
        except ImportError:
            what = "a cluster needs distributed, which is not installed"
            raise OutputError(what, "--cluster", "run pip install 'screwgauge[cluster]'") from None
        check_address(self.address, insecure=self.insecure)

    @property
    def address(self) -> str:
        """Address of the scheduler, as it is now."""
        if "://" in self.where or not os.path.isfile(self.where):
            return self.where if "://" in self.where else f"tcp://{self.where}"
        remedy = "name a file that --scheduler-file has made"
        address = read_json(Path(self.where), "file of a scheduler", remedy).get("address")
        if not isinstance(address, str):
            raise DescriptionError("has no address", self.where, remedy)
        return address

    def __call__(self, tasks: Mapping[str, Task], keep: Callable[[str, Any], None], report: Report) -> None:
        left, timeout, lost = dict(tasks), CONNECT, 0
        while left:
            before = len(left)
            check_address(self.address, insecure=self.insecure)
            with self._client(timeout) as client:
                timeout = PATIENCE
                try:
                    _Session(client, self.limits, left, len(tasks)).run(keep, report)
                except LostError:  # what was under way is asked for again
                    lost = 0 if len(left) < before else lost + 1
            if lost > isolation.AGAIN:
                remedy = "see its log, and run the same command again"
                raise OutputError("the scheduler loses whatever it is asked for", self.where, remedy)

    @contextmanager
    def _client(self, timeout: float) -> Iterator[Client]:
        """A client of the scheduler, which has to answer within `timeout` [s]."""
        from distributed import Client

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions, which are compared here
            try:
                client = Client(self.address, timeout=timeout, set_as_default=False)
            except (OSError, ValueError) as error:
                message = " ".join(str(error).split()) or type(error).__name__
                remedy = "start it and run the same command again: it goes on from the rows that are there"
                raise OutputError(f"no scheduler answers ({message})", self.where, remedy) from None
        try:
            yield client
        finally:
            client.close(timeout=5)


def executor(
    jobs: int | None, cluster: str | None, limits: isolation.Limits | None = None, *, insecure: bool = False
) -> Executor:
    """The executor of the options: on a cluster, in other processes, or in this one.

    Args:
        jobs: Processes at a time.
        cluster: Address of a Dask scheduler, or the file that it has written.
        limits: What each task may take; without any it runs in this process, unless there are several at a time.
    """
    if cluster is not None:
        return Cluster(cluster, limits or isolation.Limits(), insecure=insecure)
    if limits is None and jobs is None:
        return InTurn()
    return Processes(1 if jobs is None else jobs, limits or isolation.Limits())


def check_address(address: str, *, insecure: bool = False) -> None:
    """Refuses to reach beyond this machine without TLS: whoever reads the line reads all, and whoever writes runs code.

    Raises:
        DescriptionError: It would.
    """
    parts = urlsplit(address)
    try:
        host, known = parts.hostname or "", parts.scheme in ("tcp", "tls", "ws", "wss") and bool(parts.port)
    except ValueError:  # a port that is none
        host, known = "", False
    if not host or not known:
        remedy = "write tcp://127.0.0.1:8786, say, or name a file"
        raise DescriptionError(f"'{address}' is no address", "--cluster", remedy)
    try:
        near = ipaddress.ip_address(host).is_loopback
    except ValueError:
        near = host == "localhost"
    if not (near or insecure or parts.scheme in ("tls", "wss")):
        remedy = "use tls:// (see harness/guide/cluster.md), or add --insecure in a network that you trust"
        raise DescriptionError(f"{address} is beyond this machine and not encrypted", "--cluster", remedy)


class _Session:
    """Tasks on one connection to a scheduler."""

    def __init__(self, client: Client, limits: isolation.Limits, left: dict[str, Task], n: int) -> None:
        self.client, self.limits, self.left, self.n = client, limits, left, n
        self.expected, self.waiting = versions(), deque(left)
        self.alone, self.suspects = deque[str](), set[str]()
        self.blobs: dict[str, Future] = {}
        self.running: dict[Future, list[str]] = {}
        self.seconds, self.done, self.threads, self.looked = 0.0, 0, 1, 0

    def run(self, keep: Callable[[str, Any], None], report: Report) -> None:
        """Runs the tasks in `left`; each is removed from it when it is done. Raises `LostError`, as all below do."""
        from distributed import as_completed

        report("workers", 1.0 - len(self.left) / self.n)
        self._refuse()
        completed = as_completed(loop=self.client.loop)
        self._fill(completed)
        for future in completed:
            for name, result in self._results(future, self.running.pop(future)).items():
                if self.left.pop(name, None) is not None:  # none is there twice, whatever a scheduler does
                    keep(name, result)
            self._fill(completed)
            report(f"{self.threads} workers", 1.0 - len(self.left) / self.n)
        if self.left:
            raise LostError

    def _fill(self, completed: Any) -> None:
        """Submits batches. Tasks of a worker that died wait until all others are done, and then go one by one.

        The scheduler blames every task that a dead worker held: a suspect must not share its worker.
        """
        self.looked += 1
        if self.looked % max(1, self.threads // 10) == 0:  # workers come and go; asking takes a millisecond
            self.threads = max(1, sum(self._asked(self.client.nthreads).values()))
        while len(self.running) < AHEAD * self.threads + 1:
            if self.waiting:
                mean = self.seconds / self.done if self.done else BATCH
                # towards the end less at once, so that all workers end together
                fair = max(1, len(self.waiting) // (2 * self.threads))
                size = max(1, min(MOST, fair, round(BATCH / max(mean, 1e-6))))
                names = [self.waiting.popleft() for _ in range(min(size, len(self.waiting)))]
            elif self.alone and not self.running:
                names = [self.alone.popleft()]
            else:
                break
            future = self._asked(partial(self._submit, names))
            self.running[future] = names
            completed.add(future)

    def _submit(self, names: Sequence[str]) -> Future:
        works, blobs = [], dict[str, Any]()
        for name in names:
            task, files = self.left[name], dict[str, str]()
            for path in task.files():
                data = read_bytes(path, "MB of CSV")
                digest = files[os.path.abspath(path)] = hashlib.sha256(data).hexdigest()
                if digest not in self.blobs:  # a task, so that a worker that has it may die
                    self.blobs[digest] = self.client.submit(bytes, data, key=f"screwgauge-file-{digest}")
                blobs[digest] = self.blobs[digest]
            works.append((name, task.work, files))
        job = partial(on_worker, works, self.limits, self.expected, os.getcwd(), tuple(blobs))
        return self.client.submit(job, *blobs.values(), pure=False)

    def _results(self, future: Future, names: list[str]) -> dict[str, Any]:
        """Results of a batch by name; empty if its worker died and its tasks go alone."""
        from distributed import CancelledError, KilledWorker
        from distributed.comm import CommClosedError

        try:
            seconds, results = future.result()
        except KilledWorker as error:
            if not self.suspects.issuperset(names):
                self.suspects.update(names)
                self.alone.extend(names)
                return {}
            return {names[0]: Failure(names[0], f"its worker was killed, {error.allowed_failures + 1} times")}
        except (CancelledError, CommClosedError, TimeoutError):
            raise LostError from None
        except ScrewgaugeError:
            raise
        except Exception as error:
            message = " ".join(f"{type(error).__name__}: {error}".split())
            raise DescriptionError(f"a worker cannot do it ({message:.300})", "--cluster", "see its log") from error
        self.seconds += seconds
        self.done += len(names)
        return dict(results)

    def _refuse(self) -> None:
        """Refuses workers with other versions."""
        try:
            answers = self._asked(partial(self.client.run, differences, self.expected))
        except ImportError as error:
            raise DescriptionError(f"a worker has no screwgauge ({error})", "--cluster", "install it there") from None
        if odd := [f"{worker}: {first_few(odds, 3)}" for worker, odds in answers.items() if odds]:
            _refuse_versions(first_few(odd, 2, "; "))

    @staticmethod
    def _asked(call: Callable[[], Any]) -> Any:
        """The scheduler's answer."""
        try:
            return call()
        except (OSError, RuntimeError) as error:  # of Dask's comm, and of a client that is closed
            raise LostError from error


def _refuse_versions(where: str) -> None:
    raise DescriptionError(f"other versions than here on {where}", "--cluster", "install the same on all machines")


def differences(expected: Mapping[str, str]) -> list[str]:
    """Versions here that differ from the expected ones, in words."""
    return _differences(tuple(expected.items()))


@lru_cache(maxsize=4)
def _differences(expected: tuple[tuple[str, str], ...]) -> list[str]:
    local = versions()
    odd = {name: wanted for name, wanted in expected if local.get(name) != wanted}
    return [f"{name} {local.get(name)} in place of {wanted}" for name, wanted in odd.items()]


def on_worker(
    works: Sequence[tuple[str, Callable[[Progress], Any], Files]],
    limits: isolation.Limits,
    expected: Mapping[str, str],
    home: str,
    hashes: Sequence[str],
    *blobs: bytes,
) -> tuple[float, dict[str, Any]]:
    """Runs a batch on a worker: tasks one after the other, in a process that belongs to this thread.

    Args:
        works: Name, work and files of each.
        expected: See `versions`.
        home: The folder in which paths are meant.
        hashes: Of `blobs`, the contents of all files.

    Returns:
        How long it took [s], and results by name.

    Raises:
        DescriptionError: Versions differ: the worker has come after they were compared.
    """
    if odd := differences(expected):
        _refuse_versions(f"a worker: {first_few(odd, 3)}")
    begin, contents = perf_counter(), dict(zip(hashes, blobs, strict=True))
    tasks: dict[str, Callable[[Progress], Any]] = {}
    for name, work, files in works:
        tasks[name] = partial(_in_tree, work, _tree(files, contents, home), home) if files else work
    lane = f"dask-{threading.get_ident()}"
    results = isolation.isolated(tasks, limits, lambda step, share: None, lanes=[lane])
    return perf_counter() - begin, results


def _tree(files: Files, contents: Mapping[str, bytes], home: str) -> str:
    """A folder with files at the paths of the machine that they come from; made once in a worker."""
    digest = hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest()
    root = Path(_scratch().name) / digest
    if not root.exists():
        stage = Path(tempfile.mkdtemp(dir=_scratch().name))
        for name, content in files.items():
            path = stage / name.lstrip("/")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(contents[content])
        (stage / home.lstrip("/")).mkdir(parents=True, exist_ok=True)
        with suppress(OSError):  # another thread was quicker
            stage.rename(root)
    return str(root)


@cache
def _scratch() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="screwgauge-")


def _in_tree(work: Callable[[Progress], Any], root: str, home: str, progress: Progress) -> Any:
    """Does a task on the copied files, with the paths of the machine that they come from in its result."""
    before = os.getcwd()
    os.chdir(root + home)
    try:
        absolute = partial(_absolute, root)
        return _translated(_translated(work, absolute)(progress), lambda text: text.replace(root, ""))
    finally:
        os.chdir(before)


def _absolute(root: str, text: str) -> str:
    """A path below `root` where there is such a file or folder, else the text itself."""
    return root + text if text.startswith("/") and os.path.exists(root + text) else text


def _translated(value: Any, of: Callable[[str], str]) -> Any:
    """A value or bound call with `of` applied to every text and path in it; the same object where nothing changes."""
    if isinstance(value, str | Path):
        text = of(str(value))
        return value if text == str(value) else type(value)(text)
    if isinstance(value, partial):
        return partial(value.func, *_translated(value.args, of), **_translated(value.keywords, of))
    if type(value) in (list, tuple):
        items = [_translated(each, of) for each in value]
        return value if all(map(is_, items, value)) else type(value)(items)
    if isinstance(value, Mapping):
        entries = {_translated(key, of): _translated(each, of) for key, each in value.items()}
        same = all(map(is_, entries, value)) and all(map(is_, entries.values(), value.values()))
        return value if same else entries
    if is_dataclass(value) and not isinstance(value, type):
        before = {each.name: getattr(value, each.name) for each in fields(value) if each.init}
        after = {name: _translated(each, of) for name, each in before.items()}
        return value if all(map(is_, after.values(), before.values())) else replace(value, **after)
    return value
