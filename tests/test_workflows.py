"""The action, the hook and this project's own workflow say what is there, and their commands gate somebody's models."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path

import pytest
import yaml

import screwgauge
from support.command import main
from support.models import model_texts

ROOT = Path(__file__).parents[1]
#: Major versions, which their owners move along.
RELEASED = {"actions/checkout@v4", "actions/setup-python@v5", "actions/upload-artifact@v4"}
SCENE = """mechanism = "slider-crank"
motion.crank.polynomial = [0.2, 3]
time.times = [0.1, 0.4]
quantities = ["actuator_force"]
engines = ["mujoco"]
models.mujoco = "../robot.xml"
"""


def read(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


@pytest.fixture
def somebody(tmp_path, inside):
    """Somebody's repository, in which a shell stands."""
    mechanism = screwgauge.load_scene("slider-crank").mechanism
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes/robot.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "robot.xml").write_text(model_texts(mechanism)["slider-crank.xml"], encoding="utf-8")
    return tmp_path


def commands():
    """What the action runs, and the hook with the arguments that a user gives."""
    (check,) = [step for step in read("action.yml")["runs"]["steps"] if step.get("run", "").startswith("screwgauge")]
    assert {*re.findall(r"\$(\w+)", check["run"])} == {*check["env"]}
    (hook,) = read(".pre-commit-hooks.yaml")
    return {"action": check["run"], "hook": f"{hook['entry']} scenes"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["action", "hook"])
def test_commands_gate_somebody_s_models(name, somebody, monkeypatch, command):
    monkeypatch.setenv("WHAT", "scenes")
    monkeypatch.setenv("OPTIONS", "--smoke")
    program, *arguments = shlex.split(os.path.expandvars(commands()[name]))
    assert program == "screwgauge"
    assert main(arguments) == 0
    model = somebody / "robot.xml"
    model.write_text(model.read_text(encoding="utf-8").replace("0.0023", f"{0.0023 * (1 + 1e-6)!r}"), encoding="utf-8")
    assert "The judge faults mujoco" in " ".join(command(*arguments, status=1).out.split())


def test_every_action_that_is_used_is_a_released_one_or_our_own():
    steps = [step for job in read(".github/workflows/ci.yml")["jobs"].values() for step in job["steps"]]
    used = {step["uses"] for step in [*steps, *read("action.yml")["runs"]["steps"]] if "uses" in step}
    assert used == RELEASED | {"./"}
    given = {key for step in steps if step.get("uses") == "./" for key in step["with"]}
    assert given <= {*read("action.yml")["inputs"]}


def test_the_workflow_runs_what_people_run():
    steps = [step for job in read(".github/workflows/ci.yml")["jobs"].values() for step in job["steps"]]
    assert [step["run"] for step in steps if "run" in step] == [".ci/run", ".ci/wheel"]
    assert all(os.access(ROOT / step, os.X_OK) for step in (".ci/run", ".ci/wheel"))


def test_the_action_puts_no_input_into_a_command():
    assert [step["run"] for step in read("action.yml")["runs"]["steps"] if "${{" in step.get("run", "")] == []
