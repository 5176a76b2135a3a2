import ast
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.engines import registry
from support.engines import get_engine
from support.errors import DescriptionError
from support.report import verdict

FORCES = ("joint_acceleration", "com_acceleration", "tree_force", "actuator_force", "reaction", "mass_matrix")


def few(name):
    scene = screwgauge.load_scene(name)
    return scene.at(np.linspace(scene.t[0], scene.t[-1], 7)[1:-1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "3ups-upu-s"])
@pytest.mark.parametrize("method", ["mjx", "mjx@float32", "mjwarp@float32"])
def test_a_port_agrees_in_its_number_type(method, name):
    if not get_engine(method).installed:
        pytest.skip(f"{get_engine(method).package} is not installed")
    results = screwgauge.run(few(name), engines=["screw", method], quantities=FORCES)
    assert results.ok, verdict(results).text


@pytest.mark.slow
def test_a_port_adds_the_force_of_a_load_to_what_joints_transmit():
    if not get_engine("mjx").installed:
        pytest.skip("mujoco-mjx is not installed")
    scene = few("slider-crank")
    forces = [
        screwgauge.run(each, engines=["mjx"], quantities=["reaction"]).values("reaction", "mjx")
        for each in (scene, scene.under(loads=[]))
    ]
    assert np.abs(forces[0] - forces[1]).max() > 1.0


def test_a_port_in_float32_alone_is_named_so():
    with pytest.raises(DescriptionError, match="use 'mjwarp@float32'"):
        screwgauge.run(few("slider-crank"), engines=["screw", "mjwarp"])


def test_a_port_imports_nothing_of_this_package_but_what_every_engine_may():
    source = (Path(registry.__file__).parent / "mujoco" / "ports.py").read_text(encoding="utf-8")
    modules = [node.module for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)]
    assert {each for each in modules if each.partition(".")[0] == "screwgauge"} == {"screwgauge.plugins"}
