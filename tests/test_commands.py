import os
import re
import warnings
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from screwgauge import commands
from screwgauge.commands.execution import ENDED
from screwgauge.report.console import QUIET, Progress
from screwgauge.study.bench import forward_run, timing
from support.command import main
from support.scene import FOLDER


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def clock(*times: float) -> Iterator[float]:
    return iter(times)


def test_short_work_is_silent_in_a_pipe() -> None:
    stream, times = StringIO(), clock(0.0, 1.0, 5.0, QUIET)
    with Progress(stream, lambda: next(times)) as progress:
        for share in (0.1, 0.5, 1.0):
            progress.show("errors", share)
    assert stream.getvalue() == ""


def test_long_work_says_a_line_now_and_then_in_a_pipe() -> None:
    stream, times = StringIO(), clock(100.0, 101.0, 111.0, 112.0, 121.5)
    with Progress(stream, lambda: next(times)) as progress:
        for step, share in (("errors", 0.1), ("errors", 0.25), ("errors", 0.3), ("times", 0.5)):
            progress.show(step, share)
    assert stream.getvalue() == ("screwgauge: errors, 25% done after 11 s\nscrewgauge: times, 50% done after 22 s\n")


def test_a_terminal_has_one_line_that_is_wiped_in_the_end() -> None:
    stream = Terminal()
    with Progress(stream, lambda: 0.0) as progress:
        progress.show("errors", 0.5)
        progress.show("errors", 0.5)
        assert stream.getvalue() == f"\rerrors           {'#' * 15:<30}  50%"
    assert stream.getvalue().endswith("\r" + " " * 52 + "\r")


@pytest.mark.parametrize(
    ("arguments", "folder"),
    [
        (["run", "3ups-upu-s"], "3ups-upu-s"),
        (["bench", "3ups-upu-s"], "3ups-upu-s/bench"),
        (["bench", "a01-pendulum"], "a01-pendulum/bench"),
        (["stress"], "stress"),
    ],
)
def test_every_command_has_a_folder_of_its_own(arguments, folder, monkeypatch) -> None:
    seen: list[Path] = []

    def study(page, out, work, **more):
        seen.append(out)
        return SimpleNamespace(exit_status=0, failures={}, ok=True, broken=())

    monkeypatch.setattr(commands, "carry_out", study)
    assert main(arguments) == 0
    assert seen == [Path("screwgauge-out") / folder]


def test_models_are_written_beside_what_else_is_left_of_a_mechanism(tmp_path, inside, capsys) -> None:
    assert main(["models", "a01-pendulum"]) == 0
    assert (tmp_path / "screwgauge-out" / "a01-pendulum" / "models" / "a01-pendulum.urdf").is_file()
    assert "a01-pendulum.urdf" in capsys.readouterr().out


def test_models_of_a_scene_are_those_of_its_mechanism_under_its_gravity(tmp_path, inside):
    Path("turn.toml").write_text(
        (FOLDER / "slider-crank.toml")
        .read_text(encoding="utf-8")
        .replace("mechanism =", "gravity = [0, -1.5, 0]\nmechanism =", 1),
        encoding="utf-8",
    )
    for name, file in (("3ups-upu-s-fast", "3ups-upu-s-asymmetric.xml"), ("turn.toml", "slider-crank.xml")):
        assert main(["models", name, "--out", "m"]) == 0
        assert (tmp_path / "m" / file).is_file()
    assert 'gravity="0 -1.5 0"' in Path("m/slider-crank.xml").read_text(encoding="utf-8")
    assert main(["models", "turn.toml", "--check", "--out", "checked"]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("debug", [False, True])
def test_the_traceback_of_an_engine_is_shown_on_request(debug, monkeypatch, paper_scene, tmp_path, command) -> None:
    def broken(files):
        raise ZeroDivisionError("bad pose")

    monkeypatch.setattr("screwgauge.engines.screw.model.load", broken)
    options = ["--engines", "screw", "--quantities", "joint_position", "--out", str(tmp_path / "out")]
    said = command("run", str(paper_scene()), *options, *(["--debug"] if debug else []), status=3)
    assert "bad pose" in said.out
    assert ("Traceback" in said.err) is debug
    assert ("in broken\n" in said.err) is debug


def test_the_traceback_of_bad_input_is_shown_on_request(command) -> None:
    said = command("run", "no-such-scene", "--debug", status=2).err
    assert said.startswith("Traceback")
    assert "unknown scene 'no-such-scene'" in said


def test_no_warning_of_numpy_reaches_the_user(monkeypatch, capfd) -> None:
    def warns(options):
        np.log(np.array([0.0]))
        np.nanmean(np.array([np.nan]))
        return 0

    monkeypatch.setattr(commands, "stress", warns)
    warns.__name__ = "stress"
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["stress"]) == 0
    assert capfd.readouterr().err == ""


def test_a_limit_must_be_positive_for_every_bench(command) -> None:
    for scene in ("3ups-upu-s", "a01-pendulum"):
        assert "a limit of -1 s" in command("bench", scene, "--limit", "-1", status=2).err
    assert forward_run.FULL.budget < timing.FULL.budget


@pytest.mark.parametrize("words", [*ENDED, "bench --quick --random=5", "run 3ups-upu-s --errata --no-such-option"])
def test_what_ended_says_where_it_went(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.split()) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert re.fullmatch(r"screwgauge: .*: (is no longer part of the package|was renamed); \w.*\.\n", output.err)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("rnu slider-crank", "'run'"),
        ("diganose a.urdf b.urdf", "'diagnose'"),
        ("run slider-crank --enginse screw", "'--engines'"),
        ("check --junt=a.xml", "'--junit'"),
    ],
)
def test_a_misspelt_command_or_option_is_told_from_the_one_that_was_meant(typed, meant, command) -> None:
    said = command(*typed.split(), status=2)
    assert f"did you mean {meant}?" in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_nothing_is_rendered_so_that_no_graphics_is_needed(monkeypatch, command) -> None:
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    seen = []
    monkeypatch.setattr(commands, "list_", lambda options: seen.append(os.environ["MUJOCO_GL"]) or 0)
    commands.list_.__name__ = "list_"
    command("list")
    assert seen == ["disable"]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "r.xacro",
            '<robot xmlns:xacro="http://ros.org"><xacro:include filename="a"/></robot>',
            "xacro r.xacro > robot.urdf",
        ),
        ("m.sdf", '<sdf version="1.3"/>', "save it as SDF 1.5 to 1.12"),
    ],
)
@pytest.mark.parametrize("name_of_command", ["run", "view", "import"])
def test_files_from_which_models_are_made_are_no_unknown_scenes(name_of_command, name, text, said, command, inside):
    (inside / name).write_text(text, encoding="utf-8")
    assert said in command(name_of_command, name, status=2).err
