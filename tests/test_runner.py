"""Tasks become rows, once each and in their order, wherever they run; what was there when it stopped is taken up."""

from __future__ import annotations

import json
from functools import partial

import pytest

from support import tasks as support
from support.errors import OutputError
from support.tasks import InTurn, Journal, Processes, Task, TaskRate, executor, rows, tasks

SEALED = 25


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr("screwgauge.study.store.SEAL", 10)


def test_rows_are_those_of_the_tasks_in_their_order():
    assert [row["square"] for row in rows(tasks(4), InTurn())] == [0, 1, 4, 9]


@pytest.mark.slow
def test_processes_make_the_same_rows(isolated):
    assert rows(tasks(20), Processes(2)) == rows(tasks(20), InTurn())


@pytest.mark.slow
def test_a_task_whose_process_is_killed_runs_again_three_times_and_is_then_a_row(isolated):
    found = rows(tasks(4, Task("killed", support.dies)), Processes(2))
    assert [row["i"] for row in found[:4]] == [0, 1, 2, 3]
    assert found[4] == {"lost": "killed: crashed: its process got SIGKILL, 4 times"}


def test_interrupted_work_goes_on_with_the_tasks_that_have_no_row(tmp_path, small_parts):
    done = list[int]()

    def stops(i, progress):
        if len(done) == SEALED:
            raise KeyboardInterrupt
        done.append(i)
        return support.square(i, progress)

    asked = [Task(f"square {i}", partial(stops, i)) for i in range(40)]
    with pytest.raises(KeyboardInterrupt):
        rows(asked, InTurn(), Journal(tmp_path / "x.jsonl", "stamp"))
    assert len([*(tmp_path / "x.parts").glob("*.parquet")]) == 2
    done.insert(0, -1)  # so that it does not stop again
    kept = Journal(tmp_path / "x.jsonl", "stamp")
    assert rows(asked, InTurn(), kept) == rows(tasks(40), InTurn())
    assert done[1:] == [*range(40)]
    kept.remove()
    assert [*tmp_path.iterdir()] == []


def test_parts_keep_every_kind_of_entry(tmp_path, small_parts):
    kept = Journal(tmp_path / "x.jsonl", "stamp")
    odd = [{"a": 1}, {"a": "1", "b": None}, {"b": [1.5, {"c": float("inf")}]}, {"a": True, "d": {}}, {}]
    for i in range(10):
        kept.keep(f"{i}", odd[i % 5])
    assert json.loads((tmp_path / "x.jsonl").read_text()) == {"stamp": "stamp"}
    assert [*Journal(tmp_path / "x.jsonl", "stamp").results.values()] == odd * 2


def test_what_is_in_a_part_and_in_the_log_is_one_row(tmp_path, small_parts):
    kept = Journal(tmp_path / "x.jsonl", "stamp")
    for i in range(9):
        kept.keep(f"{i}", {"i": i})
    log = (tmp_path / "x.jsonl").read_text()
    kept.keep("9", {"i": 9})
    (tmp_path / "x.jsonl").write_text(log)  # as if it had been stopped between the two
    assert [*Journal(tmp_path / "x.jsonl", "stamp").results] == [f"{i}" for i in range(10)]


def test_parts_of_another_stamp_go_and_a_broken_one_is_refused(tmp_path, small_parts):
    for i in range(10):
        (kept := Journal(tmp_path / "x.jsonl", "old")).keep(f"{i}", {"i": i})
    (part,) = (tmp_path / "x.parts").iterdir() if kept.results else ()
    whole = part.read_bytes()
    part.write_bytes(whole[:-20])
    with pytest.raises(OutputError, match="is no part of a journal"):
        Journal(tmp_path / "x.jsonl", "old")
    assert Journal(tmp_path / "x.jsonl", "new").results == {}
    assert not part.exists()


def test_long_work_says_its_rate_and_what_is_left():
    now = iter([0.0, 1.0, 10.0, 20.0])
    pace = TaskRate(1000, lambda: next(now))
    assert pace.shown("scene") == "scene"
    pace.done = 5
    assert pace.shown("scene") == "scene (5 of 1000, 0.5/s, 33 min left)"
    pace.done = 1000
    assert pace.shown("scene") == "scene (1000 of 1000, 50/s, 0 s left)"


def test_options_say_where_tasks_run():
    assert executor(None, None).__class__ is InTurn
    assert executor(3, None) == Processes(3)
