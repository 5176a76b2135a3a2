"""A repository of somebody else gates its models by pytest: it passes, then each of ten changes fails it, with words."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.generate import model_texts

pytest_plugins = ["pytester"]

ROBOT = "slider-crank"
SCENE = """mechanism = "robot.toml"
motion.crank = { harmonics = [[6, 0, 1.2]], polynomial = [0.2, 3] }
time.times = [0.1, 0.25, 0.4]
quantities = ["joint_position", "actuator_force"]
engines = ["pinocchio", "mujoco"]
models = { pinocchio = "robot.urdf", mujoco = "robot.xml" }
"""
TEST = """
def test_robot(screwgauge):
    screwgauge.check("scenes/robot-scene.toml").assert_ok()
"""


@pytest.fixture(scope="module")
def models() -> dict[str, str]:
    """Model files of somebody's robot: file name -> text."""
    mechanism = load_mechanism(ROBOT)
    texts = {name.replace(ROBOT, "robot"): text for name, text in model_texts(mechanism).items() if "full" not in name}
    return {**texts, "robot.toml": Path(mechanism.where).read_text(encoding="utf-8"), "robot-scene.toml": SCENE}


@pytest.fixture
def plugin(request):
    """The plugin, where it is not installed as one."""
    return [] if request.config.pluginmanager.has_plugin("screwgauge") else ["-p", "screwgauge.pytest_plugin"]


@pytest.fixture
def repository(pytester, models, plugin):
    """A repository with a robot in `scenes`; returns what runs its tests."""
    (pytester.path / "scenes").mkdir()
    for name, text in models.items():
        (pytester.path / "scenes" / name).write_text(text, encoding="utf-8")
    return lambda *options: pytester.runpytest_inprocess("-p", "no:cacheprovider", *plugin, *options)


CHANGES = [
    ("robot.xml", "0.0021 0.0023 0 0 0", f"0.0021 {0.0023 * (1 + 1e-6)!r} 0 0 0", "x"),
    ("robot.urdf", r'  <joint name="slide".*?</joint>.*?</link>\n', "", "x"),
    ("robot.xml", 'mass="0.6"', 'mass="0.601"', "x"),
    ("robot.xml", 'pos="0.12 0 0"', 'pos="0.12 0.001 0"', "x"),
    ("robot.xml", 'pos="0.3 0', 'pos="0.301 0', "x"),
    ("robot.xml", 'name="rod" pos="0.1 0 0"', 'name="rod" pos="0.11 0 0"', "x"),
    ("robot.xml", 'name="pin" type="hinge" axis="0 0 1"', 'name="pin" type="hinge" axis="0 0 -1"', "x"),
    ("robot.xml", 'name="crank" type="hinge"', 'name="crank" type="hinge" armature="0.001"', "x"),
    ("robot.xml", 'name="crank" type="hinge"', 'name="crank" type="hinge" damping="0.1"', "x"),
    ("robot.urdf", '<mass value="0.8" />', '<mass value="8" />', "x"),
    ("robot.urdf", '<link name="rod">', '<link name="rad">', "x"),
    ("robot.loops.toml", 'parent_points = [[0.3,', 'parent_points = [[0.31,', "x"),
    ("robot.xml", '<connect name="wrist.1" site1="wrist@parent1" site2="wrist@child1" />', "", "x"),
    ("robot.xml", '</worldbody>', "", "x"),
    ("robot.xml", 'motor name="crank" joint="crank"', 'motor name="crank" joint="crank" gear="2"', "x"),
    ("robot-scene.toml", '"robot.xml"', '"none.xml"', "x"),
]


@pytest.mark.parametrize(("file", "old", "new", "said"), CHANGES)
def test_(file, old, new, said, repository, pytester):
    path = pytester.path / "scenes" / file
    text = path.read_text(encoding="utf-8")
    changed = re.sub(old, new, text, count=0, flags=re.DOTALL)
    assert changed != text
    path.write_text(changed, encoding="utf-8")
    found = repository("--screwgauge", "scenes")
    t=found.stdout.str()
    print(file, old, found.ret, "\n>>>>", t[t.index("___"):])
    assert 0
