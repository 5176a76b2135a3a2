import os
import re
import tomllib
from pathlib import Path

import pytest

import screwgauge
from support.claims import table
from support.command import loaded_after
from support.mechanism import load_mechanism
from support.models import model_texts

pytest_plugins = ["pytester"]

ROBOT = "slider-crank"
SCENE = """mechanism = "../robot.toml"
motion.crank = { harmonics = [[6, 0, 1.2]], polynomial = [0.2, 3] }
time.times = [0.1, 0.25, 0.4]
quantities = ["joint_position", "actuator_force"]
engines = ["pinocchio", "mujoco"]
models = { pinocchio = "../robot.urdf", mujoco = "../robot.xml" }
"""
TEST = """
def test_robot(screwgauge):
    screwgauge.check("scenes/robot.toml").assert_ok()
"""
ENGINES = ("pinocchio", "mujoco", "numpy", "pandas", "scipy")


@pytest.fixture(scope="module", autouse=True)
def loaded():
    assert screwgauge.check(ROBOT, smoke=True).ok


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    mechanism = load_mechanism(ROBOT)
    models = {name.replace(ROBOT, "robot"): text for name, text in model_texts(mechanism).items() if "full" not in name}
    return {**models, "robot.toml": Path(mechanism.where).read_text(encoding="utf-8"), "scenes/robot.toml": SCENE}


@pytest.fixture
def repository(tmp_path, files):
    """A folder with the robot."""
    (tmp_path / "scenes").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.fixture
def tested(pytester, repository, monkeypatch):
    """Runs pytest in that folder."""
    monkeypatch.chdir(repository)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # others take seconds to load
    return lambda *options: pytester.runpytest_inprocess("-p", "screwgauge.pytest_plugin", "-p", "xdist", *options)


CHANGES = table("gate")["changes"]


def change(repository: Path, file: str, old: str, new: str) -> None:
    text = (repository / file).read_text(encoding="utf-8")
    (repository / file).write_text(changed := re.sub(old, new, text, flags=re.DOTALL), encoding="utf-8")
    assert changed != text


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGES)
def test_a_change_fails_the_gate_and_is_named(name, repository):
    *where, facts = CHANGES[name]
    change(repository, *where)
    with pytest.raises(AssertionError) as error:
        screwgauge.check(repository / "scenes").assert_ok()
    assert [fact for fact in facts if fact not in str(error.value)] == []


@pytest.mark.slow
def test_fixture_and_scenes_pass_then_fail_without_a_traceback(tested, repository):
    (repository / "test_robot.py").write_text(TEST, encoding="utf-8")
    tested(repository, "--screwgauge", repository / "scenes").assert_outcomes(passed=2)
    *where, facts = CHANGES["an inertia by 1e-6"]
    change(repository, *where)
    found = tested(repository, "--screwgauge", repository / "scenes", "-rf")
    found.assert_outcomes(failed=2)
    text = found.stdout.str()
    of_scene = text[text.index("_ scene robot _") :].split("\n====")[0]
    assert all(fact in of_scene for fact in facts)
    assert ".py" not in of_scene
    assert "scenes/robot.toml::screwgauge" in text


@pytest.mark.slow
def test_scenes_are_tests_of_their_own_on_many_workers(tested, repository):
    (repository / "scenes/again.toml").write_text(SCENE, encoding="utf-8")
    found = tested("--screwgauge", "scenes", "-n1")
    found.assert_outcomes(passed=2)


def test_a_folder_that_pytest_would_not_look_into_is_collected(tested, repository):
    (repository / "scenes").rename(repository / "build")
    found = tested(repository, "--screwgauge", repository / "build", "--collect-only", "-q")
    assert found.stdout.str().count("::screwgauge") == 1


@pytest.mark.parametrize(("folder", "said"), [("none", "none is not a folder"), ("empty", "contains no scene")])
def test_a_folder_without_scenes_is_no_pass(folder, said, tested, repository):
    (repository / "empty").mkdir()
    found = tested("--screwgauge", repository / folder)
    assert found.ret == pytest.ExitCode.USAGE_ERROR
    assert said in found.stderr.str()


def test_nothing_heavy_is_imported_before_it_is_used():
    assert loaded_after("import screwgauge.pytest_plugin", *ENGINES) == set()


def test_the_plugin_is_an_entry_point():
    project = Path(__file__).parents[1] / "pyproject.toml"
    points = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["entry-points"]
    assert points == {"pytest11": {"screwgauge": "screwgauge.pytest_plugin"}}


def test_what_lies_in_a_folder_of_scenes_does_not_stop_the_collection(repository):
    from screwgauge.pytest_plugin import _scenes

    os.mkfifo(repository / "scenes" / "x.toml")
    (repository / "scenes" / "y.toml").symlink_to("/dev/zero")
    assert [path.name for path in _scenes(repository / "scenes")] == ["robot.toml", "x.toml", "y.toml"]
    with pytest.raises(AssertionError, match=r"x\.toml: .* regular file"):
        screwgauge.check(repository / "scenes").assert_ok()
