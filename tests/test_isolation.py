import errno
import os
import pickle
import signal
import subprocess
from dataclasses import replace
from functools import partial
from importlib import import_module

import numpy as np
import pytest

import screwgauge
from screwgauge import Limits, ScrewgaugeError
from screwgauge.study import isolation
from support import bad_works
from support.command import main
from support.engines import ENGINES, Failure, Values, check_same, further_engines, run_isolated, silent
from support.errors import ModelFileError, UnknownNameError
from support.processes import python

pytestmark = pytest.mark.usefixtures("isolated")


@pytest.fixture(scope="module")
def ended():
    names = ("fine", "segfault", "abort", "leave", "odd", "hog")
    works = {name: getattr(bad_works, name) for name in names}
    return run_isolated(works, Limits(memory=0.5), silent)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("segfault", "crashed: its process received SIGSEGV"),
        ("abort", "crashed: its process received SIGABRT"),
        ("leave", "crashed: its process exited with status 0"),
        ("hog", "needs more memory than the limit of 0.5 GB; --memory changes it"),
    ],
)
def test_what_ends_its_process_says_how(name, reason, ended):
    assert ended[name].reason == reason
    assert ended[name].engine == name


@pytest.mark.parametrize("command", ["run", "import"])
@pytest.mark.parametrize("lacking", ["/dev/shm", "/proc"])
def test_a_system_without_the_folders_of_processes_is_named_in_one_sentence(
    lacking, command, monkeypatch, inside, refused, capfd
):
    def refuse(*arguments):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(isolation, "_EXECUTORS", {})
    if lacking == "/dev/shm":
        monkeypatch.setattr(import_module("_multiprocessing"), "SemLock", refuse)
    else:
        real = os.path.exists
        monkeypatch.setattr(os.path, "exists", lambda path: not str(path).startswith("/proc") and real(path))
    assert main(["models", "slider-crank", "--out", "."]) == 0
    capfd.readouterr()
    assert refused(command, "slider-crank.xml").startswith(f"screwgauge: {lacking}: ")


def test_what_cannot_be_told_is_a_failure(ended):
    assert "pickle" in ended["odd"].reason


def test_the_others_go_on_in_the_order_asked_for(ended):
    assert [*ended] == ["fine", "segfault", "abort", "leave", "odd", "hog"]
    assert ended["fine"] not in (0, os.getpid())


def test_a_process_is_asked_again_and_one_that_crashed_is_made_anew(ended):
    again = run_isolated({"fine": bad_works.fine, "segfault": bad_works.fine}, Limits(), silent)
    assert again["fine"] == ended["fine"]
    assert not isinstance(again["segfault"], Failure)


@pytest.mark.slow
def test_what_never_ends_is_stopped_and_the_next_one_is_not():
    (found,) = run_isolated({"fine": bad_works.hang}, Limits(seconds=0.3), silent).values()
    assert found.reason.startswith("stopped at the time limit of 0.3 s, ")
    assert found.reason.endswith("--limit changes it")
    (pid,) = run_isolated({"fine": bad_works.fine}, Limits(), silent).values()
    assert not isinstance(pid, Failure)


@pytest.mark.slow
def test_progress_is_that_of_all(tmp_path):
    seen, said = tmp_path / "seen", []

    def report(step: str, share: float) -> None:
        said.append((step, share))
        if share:
            seen.touch()

    works = {"fine": partial(bad_works.until_seen, seen=seen)}
    assert run_isolated(works, Limits(), report) == {"fine": "seen"}
    assert said[-1] == ("fine", 0.5)


@pytest.mark.slow
def test_work_that_has_long_said_nothing_may_be_compiling(monkeypatch):
    monkeypatch.setattr(isolation, "SLOW", 0.0)
    said = set()
    run_isolated({"slow": bad_works.hang}, Limits(seconds=0.5), lambda step, share: said.add(step))
    assert [step for step in said if step.startswith("slow (") and "compiling" in step]


def test_processes_are_forks_of_one_that_is_replaced_when_it_was_killed():
    first, second = run_isolated(dict.fromkeys(("fork 1", "fork 2"), bad_works.server), Limits(), silent).values()
    assert first == second != os.getpid()
    os.kill(first, signal.SIGKILL)
    os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
    (third,) = run_isolated({"fork 3": bad_works.server}, Limits(), silent).values()
    assert third not in (first, os.getpid())


def test_a_process_has_the_environment_that_its_parent_has_when_it_starts(monkeypatch):
    for value in ("before", "after"):
        monkeypatch.setenv("SCREWGAUGE_TEST", value)
        before = {**os.environ}
        assert run_isolated({value: bad_works.variable}, Limits(), silent) == {value: f"{value}disable"}
        assert os.environ == before


@pytest.mark.slow
def test_a_script_that_runs_a_scene_is_not_run_again_by_processes(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "print('begun', flush=True)\n"
        "import screwgauge\n"
        "scene = screwgauge.load_scene('slider-crank').at([0.0])\n"
        "assert screwgauge.run(scene, ['screw', 'mujoco'], ['joint_position'], limits=screwgauge.Limits()).ok\n",
        encoding="utf-8",
    )
    done = subprocess.run(python(str(script)), capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("begun\n", "")


def test_bad_input_is_raised_as_it_is():
    with pytest.raises(UnknownNameError, match=r"own.xml: .*'leg5'; .*'leg4'\? .* leg4\.$") as caught:
        run_isolated({"fine": bad_works.refuse}, Limits(), silent)
    assert caught.value.where == "own.xml"


@pytest.mark.parametrize(("limits", "said"), [({"seconds": 0.0}, "a limit of 0 s"), ({"memory": np.inf}, "inf GB")])
def test_a_limit_is_a_positive_number(limits, said):
    with pytest.raises(ScrewgaugeError, match=said):
        Limits(**limits)


def test_what_travels_stays_read_only():
    values = pickle.loads(pickle.dumps(Values(("a",), ("m",), np.zeros((2, 1)))))
    with pytest.raises(ValueError, match="read-only"):
        values.array[0, 0] = 1.0


@pytest.mark.slow
def test_a_run_is_the_same_wherever_it_runs(paper_scene):
    scene = screwgauge.load_scene(paper_scene())
    there, here = (
        screwgauge.run(scene, ["screw"], ["joint_position", "reaction"], limits=limits) for limits in (Limits(), None)
    )
    check_same(there.solutions["screw"], here.solutions["screw"])
    assert there.exit_status == 0


@pytest.mark.slow
def test_a_crash_is_one_sentence_and_exit_3(monkeypatch, paper_scene, tmp_path, command, no_progress):
    monkeypatch.setitem(ENGINES, "mujoco", replace(ENGINES["mujoco"], source="support.aborts_on_import:load"))
    options = ["--engines", "screw,mujoco", "--quantities", "joint_position", "--out", str(tmp_path / "out")]
    printed = command("run", str(paper_scene()), *options, status=3)
    assert printed.err == ""
    assert "mujoco: crashed: its process received SIGABRT" in " ".join(printed.out.split())


@pytest.mark.slow
def test_an_engine_of_another_package_that_ends_whoever_imports_it_is_a_row(paper_scene):
    with further_engines({"bad": "support.aborts_on_import:ENGINE"}):
        results = screwgauge.run(screwgauge.load_scene(paper_scene()), ["bad"], ["joint_position"], limits=Limits())
    assert results.failures["bad"].reason == "crashed: its process received SIGABRT"


@pytest.mark.slow
def test_limits_are_options_of_the_command(monkeypatch, paper_scene, tmp_path, command, no_progress):
    monkeypatch.setitem(ENGINES, "mujoco", replace(ENGINES["mujoco"], source="support.bad_works:load_hang"))
    options = [
        "--engines",
        "mujoco",
        "--quantities",
        "joint_position",
        "--limit",
        "0.3",
        "--out",
        str(tmp_path / "out"),
    ]
    assert "mujoco: stopped at the time limit of 0.3 s" in " ".join(
        command("run", str(paper_scene()), *options, status=3).out.split()
    )
    assert "a limit of -1 GB" in command("run", str(paper_scene()), "--memory", "-1", status=2).err


@pytest.mark.slow
def test_a_model_file_of_ones_own_is_bad_input_there_too(paper_scene, tmp_path):
    (tmp_path / "own.urdf").write_text("no robot", encoding="utf-8")
    scene = replace(screwgauge.load_scene(paper_scene()), models={"pinocchio": tmp_path / "own.urdf"})
    with pytest.raises(ModelFileError, match=r"own\.urdf"):
        screwgauge.run(scene, engines=["pinocchio"], limits=Limits())


def test_a_number_in_the_place_of_limits_is_refused():
    with pytest.raises(screwgauge.ScrewgaugeError, match=r"limits: 60 .*; pass screwgauge\.Limits"):
        screwgauge.run(screwgauge.load_scene("slider-crank"), limits=60)


@pytest.mark.slow
def test_a_process_is_asked_again_soon_and_replaced_before_it_may_have_ended(monkeypatch):
    monkeypatch.setattr("screwgauge.study.isolation._FREE", free := {})
    first, second = (run_isolated({"one": bad_works.fine}, Limits(), silent)["one"] for _ in range(2))
    free["one"] -= 1e3
    third = run_isolated({"one": bad_works.fine}, Limits(), silent)["one"]
    assert first == second != third
