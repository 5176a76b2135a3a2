"""Loops as Gazebo's physics tests have them, in files of our own, move alike in four engines of three formulations."""

import pytest

import screwgauge
from support.data import DATA

ENGINES = ("screw", "pinocchio", "mujoco", "lagrange")
#: Digits of all forces and motions that are unique; those of springs that close loops are fewer.
DIGITS = 13.0


@pytest.mark.sampled(4)
@pytest.mark.parametrize("model", ["four-bar", "mimics", "free-loop", "anchored-loop"])
def test_four_engines_agree_on_a_loop_of_an_sdf(model):
    results = screwgauge.run(screwgauge.load_scene(DATA / "gazebo" / f"{model}.sdf"), engines=ENGINES)
    assert results.ok, results
    assert not results.failures
    exact = results.errors[results.errors["unique"] & (results.errors["quantity"] != "tree_force_soft")]
    assert exact["max_scaled"].max() < 10**-DIGITS
    assert {*exact["a"], *exact["b"]} == {*ENGINES}
