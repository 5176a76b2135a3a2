from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

import screwgauge
from support.models import write_models

pytestmark = pytest.mark.slow

OTHERS = [
    ("a02-fourbar-2", "0 0 0"),
    ("a02-fourbar-2", "0 9.81 0"),
    ("a05-governor", "0 0 9.81"),
    ("3ups-upu-s", "0 0 0"),
]


@pytest.fixture
def under(tmp_path):
    def make(name: str, gravity: str = ""):
        scene = screwgauge.load_scene(name).at([0.0, 0.01])
        write_models(scene.mechanism, tmp_path, gravity=scene.applied.g)
        path = tmp_path / f"{scene.mechanism.name}.xml"
        tree = ET.parse(path)
        if gravity:
            tree.getroot().find("option").set("gravity", gravity)
        tree.write(path)
        return replace(scene, models={"mujoco": path})

    return make


@pytest.mark.slow
@pytest.mark.parametrize(("name", "gravity"), OTHERS)
def test_another_gravity_is_noticed_and_judged(name, gravity, under):
    results = screwgauge.run(under(name, gravity), engines=["screw", "mujoco"])
    assert results.exit_status == 1
    assert not results.pairs["ok"].all()
    assert set(results.judge[~results.judge["ok"]]["engine"]) == {"mujoco"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a05-governor", "a02-fourbar-2"])
def test_a_file_that_says_the_same_gravity_agrees(name, under):
    assert screwgauge.run(under(name), engines=["screw", "mujoco"]).ok
