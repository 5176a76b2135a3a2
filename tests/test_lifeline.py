import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic

import pytest

from screwgauge import Limits
from screwgauge.study import isolation as processes
from support import bad_works
from support.engines import run_isolated, silent

#: A program that puts work into processes and waits for it.
PARENT = """
import sys
from functools import partial
from pathlib import Path

from support import bad_works

kind, folder = sys.argv[1], Path(sys.argv[2])
if kind == "program":
    import subprocess
    from concurrent.futures import ThreadPoolExecutor

    from screwgauge.study.lifeline import end_with_thread

    code = f"from support import bad_works; from pathlib import Path; bad_works.spins_in_c(None, Path({str(folder)!r}))"
    with ThreadPoolExecutor(2) as pool:
        for _ in range(2):
            pool.submit(subprocess.run, [sys.executable, "-c", code], preexec_fn=end_with_thread())
else:
    from screwgauge.study.isolation import Limits, run_isolated

    work = partial(getattr(bad_works, kind), folder=folder)
    run_isolated({"one": work, "two": work}, Limits(), lambda name, share: None)
"""


def until(true: Callable[[], bool], most: float = 30.0) -> bool:
    end = monotonic() + most
    while not (found := true()) and monotonic() < end:
        os.sched_yield()
    return found


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="processes as Linux shows them")
@pytest.mark.parametrize("kind", ["spins", "spins_in_c", "waits", "program"])
def test_what_runs_for_a_parent_that_is_killed_ends(kind, tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, "-c", PARENT, kind, str(tmp_path)], env=environment)
    try:
        assert until(lambda: len([*tmp_path.glob("*.pid")]) == 2, 60.0)
        children = [int(file.stem) for file in tmp_path.glob("*.pid")]
        assert all(map(alive, children))
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    try:
        assert until(lambda: not any(map(alive, children)))
    finally:
        for child in filter(alive, children):
            os.kill(child, signal.SIGKILL)


def test_a_thread_that_has_ended_takes_no_process_with_it():
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(run_isolated, {"thread": bad_works.fine}, Limits(), silent).result()
    assert run_isolated({"thread": bad_works.fine}, Limits(), silent) == first


@pytest.mark.slow
def test_a_process_keeps_its_own_limit_of_time(monkeypatch):
    monkeypatch.setattr(processes, "GRACE", -59.9)  # long before the parent does
    (found,) = run_isolated({"own-limit": bad_works.spin_in_c}, Limits(seconds=60.0), silent).values()
    assert found.reason == "stopped at the time limit of 60 s; --limit changes it"


def test_the_limit_of_a_work_does_not_outlast_it():
    works = {"early": bad_works.fine}
    first = run_isolated(works, Limits(seconds=1e300), silent)
    assert run_isolated(works, Limits(), silent) == first
    assert run_isolated({"early": bad_works.timer}, Limits(seconds=7.0), silent)["early"] > 7.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_progress_that_cannot_be_written_costs_no_result(monkeypatch):
    assert run_isolated({"fine": bad_works.says_where_nothing_can_be_written}, Limits(), silent) == {"fine": "done"}
