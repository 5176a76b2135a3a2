from functools import partial

import pytest

from support import tasks as support
from support.bench import journals
from support.tasks import InTurn, Journal, Processes, Task, TaskRate, executor, grow_table, rows, tasks

STOPPED = 25


def test_rows_are_those_of_the_tasks_in_their_order():
    assert [row["square"] for row in rows(tasks(4), InTurn())] == [0, 1, 4, 9]


@pytest.mark.slow
def test_processes_make_the_same_rows(isolated):
    assert rows(tasks(20), Processes(2)) == rows(tasks(20), InTurn())


@pytest.mark.slow
def test_a_task_whose_process_is_killed_runs_again_three_times_and_is_then_a_row(isolated):
    found = rows(tasks(4, Task("killed", support.dies)), Processes(2))
    assert [row["i"] for row in found[:4]] == [0, 1, 2, 3]
    assert found[4] == {"lost": "killed: crashed: its process received SIGKILL, 4 times"}


def test_interrupted_work_goes_on_with_the_tasks_that_have_no_row(tmp_path, cache_folder):
    done = list[int]()

    def stops(i, progress):
        if len(done) == STOPPED:
            raise KeyboardInterrupt
        done.append(i)
        return support.square(i, progress)

    asked = [Task(f"square {i}", partial(stops, i)) for i in range(40)]
    with pytest.raises(KeyboardInterrupt):
        rows(asked, InTurn(), Journal(tmp_path, "address"))
    done.insert(0, -1)  # so that it does not stop again
    kept = Journal(tmp_path, "address")
    assert rows(asked, InTurn(), kept) == rows(tasks(40), InTurn())
    assert done[1:] == [*range(40)]
    kept.remove()
    assert not journals()


def test_a_table_is_made_of_rows_of_the_same_code_and_of_what_was_asked(tmp_path, cache_folder, monkeypatch):
    asked = list[str]()

    def make(name, progress):
        asked.append(name)
        return [{"name": name}]

    def grown(names, about=""):
        some = [Task(name, partial(make, name)) for name in names]
        return grow_table(tmp_path / "x.csv", ["name"], some, InTurn(), lambda name, why: {}, about=about).split()

    (tmp_path / "x.csv").write_text("name\nforged\n", encoding="utf-8")
    assert grown("ab") == ["name", "a", "b"]
    assert grown("abc") == ["name", "a", "b", "c"]
    assert asked == ["a", "b", "c"]
    grown("a", "other settings")
    monkeypatch.setattr("screwgauge.study.address._code", lambda: "other code")
    grown("b")
    assert asked == ["a", "b", "c", "a", "b"]


def test_long_work_says_its_rate_and_what_is_left():
    now = iter([0.0, 1.0, 10.0, 20.0])
    pace = TaskRate(1000, lambda: next(now))
    assert pace.add_rate("scene") == "scene"
    pace.done = 5
    assert pace.add_rate("scene") == "scene (5 of 1000, 0.5/s, 33 min left)"
    pace.done = 1000
    assert pace.add_rate("scene") == "scene (1000 of 1000, 50/s, 0 s left)"


def test_options_say_where_tasks_run():
    assert executor(None, None).__class__ is InTurn
    assert executor(3, None) == Processes(3)
