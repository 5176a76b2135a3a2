import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("distributed")

import dask

from screwgauge.study import cluster as study
from screwgauge.study.cluster import Cluster
from screwgauge.study.isolation import Limits
from support import tasks as support
from support.errors import DescriptionError, OutputError
from support.tasks import Journal, Processes, Task, rows, tasks

pytestmark = pytest.mark.filterwarnings("ignore")
#: Prints the address of a cluster with one worker, and runs until it is killed.
SCHEDULER = """
import sys, distributed
cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None)
print(cluster.scheduler_address, flush=True)
sys.stdin.read()
"""


@contextmanager
def cluster(workers: int, failures: int = 1) -> Iterator[str]:
    """A cluster on the loopback; Dask blames a task after some deaths."""
    from distributed import LocalCluster

    options = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with dask.config.set({"distributed.scheduler.allowed-failures": failures}), LocalCluster(**options) as found:
        yield found.scheduler_address


@pytest.fixture(scope="module")
def local() -> Iterator[str]:
    with cluster(2) as address:
        yield address


class Interfering(Journal):
    def __init__(self, after: int, what: Callable[[], Any], place: Path | None = None) -> None:
        super().__init__(place, "")
        self.after, self.what, self.keys = after, what, list[str]()

    def keep(self, key: str, result: Any) -> None:
        super().keep(key, result)
        self.keys.append(key)
        if len(self.keys) == self.after:
            self.what()


def kill_a_worker(address: str) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.parametrize("n", [60, pytest.param(500, marks=pytest.mark.thorough)])
def test_rows_are_those_of_processes_though_a_worker_is_killed_half_way(n, local, isolated):
    kept = Interfering(n // 2, partial(kill_a_worker, local))
    assert rows(tasks(n), Cluster(local), kept) == rows(tasks(n), Processes(2))
    assert len(kept.keys) == len({*kept.keys}) == n


@pytest.mark.slow
def test_where_the_scheduler_dies_the_same_command_goes_on(tmp_path, cache_folder):
    def command(after: int) -> tuple[list[dict[str, Any]], Interfering]:
        more = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen([sys.executable, "-c", SCHEDULER], env=environment, **more) as scheduler:
            try:
                kept = Interfering(after, scheduler.kill, tmp_path)
                return rows(asked, Cluster(scheduler.stdout.readline().strip()), kept), kept
            finally:
                scheduler.kill()

    asked = [Task(f"{i}", partial(support.appends, tmp_path / f"{i}", i)) for i in range(100)]
    with pytest.raises(OutputError, match="the same command again"):
        command(10)
    before = Journal(tmp_path, "").results
    found, kept = command(-1)
    assert found == [{"i": i} for i in range(100)]
    assert 10 <= len(before) < 100
    assert {*kept.keys} == {task.name for task in asked} - before.keys()
    assert {(tmp_path / name).read_text() for name in before} == {"done\n"}


@pytest.mark.slow
def test_rows_that_came_are_kept_where_the_scheduler_is_lost_among_them(local, monkeypatch):
    fetched, result = [], study._result

    def lost(future, timeout):
        if len(fetched) == 3:
            raise ConnectionError
        fetched.append(result(future, timeout))
        return fetched[-1]

    monkeypatch.setattr(study, "_result", lost)
    kept = Journal(None, "")
    with pytest.raises(OutputError, match="the same command again"):
        rows(tasks(40), Cluster(local), kept)
    assert [*kept.results.values()] == fetched


@pytest.mark.slow
def test_a_task_that_takes_its_worker_with_it_is_a_row_and_the_others_are_there():
    odd = [Task("killed", support.dies), Task("taken", support.takes_its_worker)]
    with cluster(1, failures=0) as address:
        found = rows([*odd, *tasks(5)], Cluster(address))
    assert found[:2] == [
        {"lost": "killed: crashed: its process received SIGKILL, 4 times"},
        {"lost": "taken: its worker was killed 1 times"},
    ]
    assert [row["i"] for row in found[2:]] == [*range(5)]


@pytest.mark.slow
def test_an_interrupt_cancels_what_is_queued(local, tmp_path):
    def interrupt() -> None:
        raise KeyboardInterrupt

    file = tmp_path / "done"
    queued = [Task(f"{i}", partial(support.appends, file, i)) for i in range(300)]
    with pytest.raises(KeyboardInterrupt):
        rows(queued, Cluster(local), Interfering(1, interrupt))
    rows(tasks(4), Cluster(local))
    assert len(file.read_text().splitlines()) < len(queued)


@pytest.mark.slow
def test_tasks_have_limits_of_time_and_memory_and_engines_processes_of_their_own(local):
    endless = rows([Task("endless", support.endless)], Cluster(local, Limits(seconds=1.0)))
    greedy = rows([Task("greedy", support.greedy)], Cluster(local, Limits(memory=1.0)))
    assert "endless: stopped at the time limit of 1 s" in endless[0]["lost"]
    assert "greedy: needs more memory" in greedy[0]["lost"]
    assert rows([Task("run", support.limited_run)], Cluster(local)) == [{"ok": True, "failures": []}]


@pytest.mark.slow
def test_progress_tells_how_many_workers_there_are(local):
    seen = list[tuple[str, float]]()
    some = {task.name: task for task in tasks(3)}
    Cluster(local)(some, lambda name, row: None, lambda step, share: seen.append((step, share)))
    assert {step for step, share in seen} == {"2 workers"}
    assert [share for step, share in seen] == sorted(share for step, share in seen)
    assert seen[-1][1] == 1.0


@pytest.mark.slow
def test_a_worker_with_another_version_is_refused_by_name(local, monkeypatch):
    here = study.versions()
    monkeypatch.setattr(study, "versions", lambda: here | {"pin": "0.1", "engine x": "1"})
    with pytest.raises(
        DescriptionError, match=r"the worker \S+ has pin \S+ instead of 0\.1, engine x None instead of 1;"
    ):
        rows(tasks(2), Cluster(local))


@pytest.mark.parametrize("machine", ["the scheduler", "tcp://10.0.0.1:1"])
def test_another_version_of_dask_is_refused_before_any_task(machine):
    same = {"packages": {"dask": "2026.1", "numpy": "2.0", "lz4": None}}
    other = {"packages": {"dask": "2025.1", "numpy": None}}
    scheduler, worker = (other, same) if machine == "the scheduler" else (same, other)
    found = {"client": same, "scheduler": scheduler, "workers": {"tcp://10.0.0.1:1": worker}}
    client = SimpleNamespace(get_versions=None, sync=lambda call, **options: found)
    with pytest.raises(DescriptionError, match=f"{machine} has dask 2025.1 instead of 2026.1;"):
        study._check_versions(client)


@pytest.mark.slow
def test_files_are_read_in_the_folder_of_the_command(local, tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text("content")
    monkeypatch.chdir(tmp_path)
    task = Task("a", partial(support.reads, "a.txt"), files=[Path("a.txt")])
    assert rows([task], Cluster(local)) == [{"text": "content"}]


@pytest.mark.parametrize("content", [None, "other"])
def test_a_worker_that_has_not_the_same_file_is_refused(content, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "a.txt"
    if content is not None:
        file.write_text(content)
    with pytest.raises(DescriptionError, match=r"a\.txt: is missing or differs"):
        study._with_files(partial(support.reads, "a.txt"), str(tmp_path), {str(file): "digest"}, lambda *said: None)


@pytest.mark.parametrize(
    "where",
    [
        "",
        "foo",
        "tcp://127.0.0.1:x",
        "http://127.0.0.1:80",
        "tls://127.0.0.1:1",
        "tcp://127.0.0.1:1",
        "{}",
        '{"address": 3}',
    ],
)
def test_an_address_at_which_no_scheduler_answers_is_refused(where, tmp_path):
    if where.startswith("{"):
        (tmp_path / "scheduler.json").write_text(where)
        where = str(tmp_path / "scheduler.json")
    with dask.config.set({study.ANSWER: "0.1s"}), pytest.raises(DescriptionError, match=r"no scheduler responds \(\w"):
        rows(tasks(1), Cluster(where))


def test_a_scheduler_that_must_be_reached_by_tls_is_not_reached_without(local):
    with (
        dask.config.set({"distributed.comm.require-encryption": True}),
        pytest.raises(DescriptionError, match=r"no scheduler responds .*encryption required"),
    ):
        rows(tasks(1), Cluster(local))


@pytest.mark.slow
def test_a_cluster_without_workers_is_not_waited_for():
    said = pytest.raises(OutputError, match=r"no worker for 0\.3 s; start workers")
    with cluster(0) as address, dask.config.set({study.WORKERS: "0.3s"}), said:
        rows(tasks(1), Cluster(address))


def test_a_cluster_without_dask_says_what_to_install(monkeypatch):
    monkeypatch.setattr(study, "find_spec", lambda name: None)
    with pytest.raises(OutputError, match=r"pip install 'screwgauge\[cluster\]'"):
        Cluster("tcp://127.0.0.1:1")
