import numpy as np
import pytest
import test_known_mechanisms as known

import screwgauge
from screwgauge import load_scene
from support.engines import IN_DOUBLES
from support.scene import GIVEN, TABLE, scene_names
from support.tolerances import AGREE, LINEAR, RECURSIVE


@pytest.fixture(scope="module", params=["3ups-upu-s", "3ups-upu-s-eq55", "3ups-upu-s-fast", "3ups-upu-s-offset"])
def results(request):
    scene = screwgauge.load_scene(request.param)
    rows = np.unique(np.linspace(0, len(scene.motion) - 1, 31).astype(int))
    return screwgauge.run(scene.at(scene.t[rows]), engines=IN_DOUBLES)


def test_all_built_in_scenes_are_tested():
    given = {name for name in scene_names() if not load_scene(name).simulated}
    here = {"3ups-upu-s", "3ups-upu-s-eq55", "3ups-upu-s-fast", "3ups-upu-s-offset"}
    assert given == here | {*known.NAMES}


@pytest.mark.sampled(2)
@pytest.mark.slow
def test_every_pair_agrees_in_every_quantity(results):
    assert not results.failures
    pairs = results.pairs[~results.pairs["quantity"].str.startswith("tree_force")]
    assert pairs["max_scaled"].max() < LINEAR, pairs.loc[pairs["max_scaled"].idxmax()].to_dict()
    assert set(zip(pairs["a"], pairs["b"], strict=True)) == {
        (a, b) for i, a in enumerate(IN_DOUBLES) for b in IN_DOUBLES[i + 1 :]
    }
    assert set(results.pairs["quantity"]) == set(GIVEN)


def test_recursive_newton_euler_and_mj_inverse_agree(results):
    pairs = results.pairs[results.pairs["quantity"] == "tree_force"]
    assert pairs["max_scaled"].max() < RECURSIVE
    assert ("pinocchio-full", "mujoco-full") in set(zip(pairs["a"], pairs["b"], strict=True))


def test_soft_equality_stays_within_its_derived_tolerance(results):
    pairs = results.pairs[results.pairs["quantity"] == "tree_force_soft"]
    assert pairs["ok"].all()
    assert pairs["tolerance"].max() < 1e-9


def test_every_engine_satisfies_the_judge(results):
    assert set(results.judge["engine"]) == set(IN_DOUBLES)
    assert results.judge["max_scaled"].max() < AGREE, results.judge.loc[results.judge["max_scaled"].idxmax()].to_dict()


def test_components_are_those_of_the_contract(results):
    counts = {name: len(results.components(name, "screw")) for name in GIVEN}
    of = {"joint": 26, "body": 27, "tree": 14, "independent": 2, "actuator": 4, "reaction": 52}
    assert counts == {name: of[TABLE[name].of] for name in GIVEN}
    assert len(results.components("tree_force", "mujoco-full")) == 26
    joints = results.components("joint_position")
    assert joints[:6] == ("leg1.q1", "leg1.q2", "leg1.q3", "leg1.q4", "leg1.q5", "leg2.q1")
    assert joints[-4:] == ("leg4.q6", "s.q1", "s.q2", "s.q3")
    assert results.components("com_acceleration")[-3:] == ("platform.x", "platform.y", "platform.z")
    assert results.components("actuator_force") == ("leg1", "leg2", "leg3", "leg4")
    assert results.components("generalized_force") == ("a", "b")


def test_whole_result_is_ok(results):
    assert results.ok
    assert results.exit_status == 0
