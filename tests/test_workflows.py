import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import screwgauge
from support.command import CLI, main
from support.models import model_texts

ROOT = Path(__file__).parents[1]
#: Released versions, by commits: tags can be moved.
RELEASED = {
    "actions/checkout@11bd71901bbe5b1630ceea73d27597364c9af683": "v4.2.2",
    "actions/setup-python@a26af69be951a213d495a4c3e4e4022e16d87065": "v5.6.0",
    "actions/upload-artifact@ea165f8d65b6e75b540449e92b4886f43607fa02": "v4.6.2",
}
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
    mechanism = screwgauge.load_scene("slider-crank").mechanism
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes/robot.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "robot.xml").write_text(model_texts(mechanism)["slider-crank.xml"], encoding="utf-8")
    return tmp_path


@pytest.fixture
def action(somebody, tmp_path_factory):
    (step,) = [step for step in read("action.yml")["runs"]["steps"] if "screwgauge check" in step.get("run", "")]
    given = {name: f"${{{{ inputs.{name.lower()} }}}}" for name in ("WHAT", "OPTIONS")}
    assert (step["env"], step["shell"]) == (given, "bash")
    programs = tmp_path_factory.mktemp("bin")
    (programs / "screwgauge").write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{CLI}" "$@"\n', encoding="utf-8")
    (programs / "screwgauge").chmod(0o755)

    def run(what, options=""):
        path = os.pathsep.join([str(programs), os.environ["PATH"]])
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
            env={**os.environ, "PATH": path, "WHAT": what, "OPTIONS": options},
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, " ".join((done.stdout + done.stderr).split())

    return run


def hook(*args):
    (entry,) = (hook["entry"] for hook in read(".pre-commit-hooks.yaml"))
    program, *arguments = shlex.split(entry)
    assert program == "screwgauge"
    return [*arguments, *args]


def edit(somebody, by):
    model = somebody / "robot.xml"
    model.write_text(model.read_text(encoding="utf-8").replace("0.0023", f"{0.0023 * (1 + by)!r}"), encoding="utf-8")


@pytest.mark.slow
def test_the_hook_gates_somebody_s_models(somebody, command):
    assert main(hook("scenes")) == 0
    edit(somebody, 1e-6)
    assert "The judge faults mujoco" in " ".join(command(*hook("scenes"), status=1).out.split())


@pytest.mark.slow
def test_the_action_gates_somebody_s_models(somebody, action):
    assert action("scenes\n", "--smoke")[0] == 0
    edit(somebody, 1e-6)
    status, said = action("scenes\n", "--smoke")
    assert (status, "The judge faults mujoco" in said) == (1, True)


@pytest.mark.slow
def test_the_action_takes_paths_by_line_and_options_by_word(somebody, action):
    (somebody / "scenes").rename(somebody / "my scenes * $(touch owned)")
    status, said = action("my scenes * $(touch owned)\nslider-crank\n\n", "--smoke  --limit 900")
    assert (status, "slider-crank" in said, "robot" in said) == (0, True, True)
    assert not (somebody / "owned").exists()


@pytest.mark.parametrize("what", ["", " \n\n", "\n"])
def test_what_names_nothing_checks_nothing_and_fails(action, what):
    status, said = action(what, "--smoke")
    assert status != 0, said


@pytest.mark.parametrize("what", ["--help", "-h", "--smoke", "$(true)", "; true", "`true`", "../../x"])
def test_a_name_of_a_branch_is_no_option_and_no_code(action, what):
    assert action(what)[0] == 2


@pytest.mark.parametrize("options", ["--help", "-h", "--he", "--smoke\n--help"])
def test_options_that_check_nothing_fail(somebody, action, options):
    (somebody / "screwgauge.xml").write_text("<testsuites/>", encoding="utf-8")
    assert action("scenes", options)[0] != 0


def test_a_hook_without_names_checks_nothing_and_fails(somebody, command):
    assert "there is nothing to check" in command(*hook(), status=2).err


def test_nothing_is_no_name_for_python():
    with pytest.raises(screwgauge.ScrewgaugeError, match="there is nothing to check"):
        screwgauge.check(*[], smoke=True)


def test_every_action_that_is_used_is_a_released_one_or_our_own():
    texts = [(ROOT / name).read_text(encoding="utf-8") for name in (".github/workflows/ci.yml", "action.yml")]
    used = {use for text in texts for use in re.findall(r"uses: (.+)", text)}
    assert used == {f"{action} # {version}" for action, version in RELEASED.items()} | {"./"}
    assert all(re.search(r"@[0-9a-f]{40}$", action) for action in RELEASED)
    steps = [step for job in read(".github/workflows/ci.yml")["jobs"].values() for step in job["steps"]]
    inputs, (given,) = read("action.yml")["inputs"], [{*step["with"]} for step in steps if step.get("uses") == "./"]
    assert {name for name, each in inputs.items() if each.get("required")} <= given <= {*inputs}
    assert inputs["what"].keys() == {"description", "required"}


def test_the_workflow_runs_what_people_run():
    steps = [step for job in read(".github/workflows/ci.yml")["jobs"].values() for step in job["steps"]]
    assert [step["run"] for step in steps if "run" in step] == [".ci/run", ".ci/wheel"]
    assert all(os.access(ROOT / step, os.X_OK) for step in (".ci/run", ".ci/wheel"))


def test_the_action_puts_no_input_into_a_command():
    assert [step["run"] for step in read("action.yml")["runs"]["steps"] if "${{" in step.get("run", "")] == []


def test_the_action_starts_no_python_that_imports_from_the_checkout():
    commands = " ".join(step.get("run", "") for step in read("action.yml")["runs"]["steps"])
    assert re.findall(r"python\S* (\S+)", commands) == ["-P"]
