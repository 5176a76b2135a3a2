"""On a Dask cluster rows are those of this machine: none is lost, none is there twice, whoever dies."""

from __future__ import annotations

import os
import signal
from functools import partial

import pytest

pytest.importorskip("distributed")

from screwgauge.study import cluster as study
from screwgauge.study.cluster import Cluster, check_address, on_worker
from screwgauge.study.isolation import Limits
from support import tasks as support
from support.errors import DescriptionError, OutputError
from support.tasks import InTurn, Journal, Task, rows, tasks

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def local():
    """Two workers on the loopback."""
    import dask
    from distributed import LocalCluster

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as found,
    ):
        yield found


class Interfering(Journal):
    """A journal beside which something happens after so many rows."""

    def __init__(self, after: int, what) -> None:
        super().__init__(None, "")
        self.after, self.what, self.keys = after, what, list[str]()

    def keep(self, key, result) -> None:
        super().keep(key, result)
        self.keys.append(key)
        if len(self.keys) == self.after:
            self.what()


@pytest.mark.slow
def test_rows_are_those_of_this_machine_though_a_worker_is_killed(local):
    def kill() -> None:
        from distributed import Client

        with Client(local.scheduler_address, set_as_default=False) as client:
            os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

    kept = Interfering(20, kill)
    assert rows(tasks(200), Cluster(local.scheduler_address), kept) == rows(tasks(200), InTurn())
    assert len(kept.keys) == len({*kept.keys}) == 200


@pytest.mark.slow
def test_what_a_scheduler_has_lost_is_asked_for_again(local, monkeypatch):
    futures, submit = [], study._Session._submit

    def submitted(self, names):
        futures.append(submit(self, names))
        return futures[-1]

    monkeypatch.setattr(study._Session, "_submit", submitted)
    kept = Interfering(20, lambda: [future.cancel() for future in futures])
    assert rows(tasks(200), Cluster(local.scheduler_address), kept) == rows(tasks(200), InTurn())
    assert len(kept.keys) == len({*kept.keys}) == 200


@pytest.mark.slow
def test_a_task_that_takes_its_worker_with_it_is_a_row_and_the_others_are_there(local):
    odd = [Task("killed", support.dies), Task("taken", support.takes_its_worker)]
    found = rows([*odd, *tasks(5)], Cluster(local.scheduler_address))
    assert found[:2] == [
        {"lost": "killed: crashed: its process got SIGKILL, 4 times"},
        {"lost": "taken: its worker was killed, 2 times"},
    ]
    assert [row["i"] for row in found[2:]] == [*range(5)]


@pytest.mark.slow
def test_engines_have_limits_in_a_worker(local):
    from distributed import Client

    with Client(local.scheduler_address, set_as_default=False) as client:
        assert client.submit(support.limited_run, pure=False).result() == (True, [])


@pytest.mark.slow
def test_a_worker_with_another_version_is_refused_by_name(local, monkeypatch):
    here = study.versions()
    monkeypatch.setattr(study, "versions", lambda: here | {"pin": "0.1", "mujoco": "0.2"})
    with pytest.raises(DescriptionError, match=r"other versions than here on tcp://127.*: pin .* in place of 0\.1"):
        rows(tasks(2), Cluster(local.scheduler_address))


def test_a_worker_that_comes_later_looks_for_itself():
    with pytest.raises(DescriptionError, match=r"a worker: mujoco .* in place of 0\.2"):
        on_worker([], Limits(), study.versions() | {"mujoco": "0.2"}, "/", ())


@pytest.mark.parametrize("absolute", [False, True])
def test_files_travel_by_their_content(absolute, tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text("far")
    monkeypatch.chdir(tmp_path)
    name = str(tmp_path / "a.txt") if absolute else "a.txt"
    at_home = support.reads(name, None)
    (tmp_path / "a.txt").unlink()
    works = [("a", partial(support.reads, name), {str(tmp_path / "a.txt"): "hash"})]
    found = on_worker(works, Limits(), study.versions(), str(tmp_path), ("hash",), b"far")[1]
    assert found == {"a": at_home}
    assert os.getcwd() == str(tmp_path)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tcp://[::1]:1", "tcp://localhost:2", "tls://10.0.0.1:3"])
def test_this_machine_and_tls_are_reached(address):
    check_address(address)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("tcp://10.0.0.1:8786", "beyond this machine and not encrypted"),
        ("tcp://scheduler.example:8786", "beyond this machine and not encrypted"),
        ("tcp://127.0.0.1", "is no address"),
        ("tcp://127.0.0.1:x", "is no address"),
        ("http://127.0.0.1:80", "is no address"),
        ("tcp://127.0.0.1.example:80", "beyond this machine and not encrypted"),
    ],
)
def test_nothing_else_is(address, said):
    with pytest.raises(DescriptionError, match=said):
        check_address(address)


def test_a_trusted_network_is_reached_if_that_is_said():
    check_address("tcp://10.0.0.1:8786", insecure=True)


def test_the_file_of_a_scheduler_is_read_as_an_address_is(tmp_path):
    (tmp_path / "s.json").write_text('{"address": "tcp://10.0.0.1:1"}')
    with pytest.raises(DescriptionError, match="not encrypted"):
        Cluster(str(tmp_path / "s.json"))
    (tmp_path / "s.json").write_text("{}")
    with pytest.raises(DescriptionError, match="has no address"):
        Cluster(str(tmp_path / "s.json"))


@pytest.mark.slow
def test_no_scheduler_is_one_sentence_that_says_how_to_go_on(monkeypatch):
    monkeypatch.setattr(study, "PATIENCE", 0.1)
    with pytest.raises(OutputError, match=r"no scheduler answers .*run the same command again: .* 0 rows"):
        rows(tasks(1), Cluster("tcp://127.0.0.1:1"))
