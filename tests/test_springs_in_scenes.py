import numpy as np
import pytest

import screwgauge
from support.command import main
from support.data import data
from support.engines import IN_DOUBLES
from support.judging import judge
from support.solve import layout, moved, whole_system
from support.tolerances import DENSE

ACTING = data("springs-and-motors.toml")
MOTION = data("crossing-scene.toml")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "sprung.toml"
    path.write_text(MOTION + ACTING.format(cut="leg3.q5"), encoding="utf-8")
    return screwgauge.load_scene(path)


@pytest.fixture(scope="module")
def results(scene):
    return screwgauge.run(scene, engines=(*IN_DOUBLES, "lagrange"))


@pytest.mark.slow
def test_all_engines_agree_and_the_judge_is_content(results):
    assert results.pairs[~results.pairs["ok"]].empty
    assert results.judge[~results.judge["ok"]].empty
    assert results.ok
    assert {"actuator_force", "reaction", "generalized_force"} <= set(results.pairs["quantity"])


def test_springs_and_motors_make_a_difference(scene, results):
    bare = screwgauge.run(scene.under(springs=(), motors=()), engines=["screw"])
    for quantity in ("generalized_force", "actuator_force", "reaction"):
        assert np.abs(bare.values(quantity) - results.values(quantity, "screw")).max() > 10.0
    for quantity in ("joint_acceleration", "tree_force"):  # gravity and inertia only
        assert np.array_equal(bare.values(quantity), results.values(quantity, "screw"))


@pytest.mark.parametrize("missing", ["springs", "motors"])
def test_judge_misses_what_is_left_out(scene, results, missing):
    problem = scene.under(**{missing: ()}).problem(())
    found = judge(scene.mechanism, problem, results.solutions["mujoco"])
    assert {"newton_euler", "power_balance", "virtual_work"} <= set(found[~found["ok"]]["residual"])


def test_forward_dynamics_gives_the_accelerations_back(scene, results):
    lay, motion = layout(scene.mechanism), scene.motion
    f = results.values("actuator_force", "pinocchio")
    at = moved(lay, motion.y, motion.yd, applied=scene.applied, t=motion.t, actuators=f)
    assert np.abs(at.ydd - motion.ydd).max() < DENSE


def test_the_balance_of_all_bodies_knows_springs_and_motors(scene, results):
    f = whole_system(layout(scene.mechanism), scene.problem(["actuator_force"])).values["actuator_force"].array
    assert np.abs(f - results.values("actuator_force", "screw")).max() < DENSE


def test_truth_refuses_with_one_sentence(scene):
    results = screwgauge.run(scene, engines=["screw", "truth"], quantities=["actuator_force"])
    assert results.failures["truth"].reason.startswith("truth does not support springs and motors")
    assert [*results.solutions] == ["screw"]
    assert results.exit_status == 3


def test_bench_refuses_with_one_sentence(write, tmp_path, capsys):
    path = write("sprung.toml", MOTION + ACTING.format(cut="leg3.q5"))
    assert main(["bench", str(path), "--out", str(tmp_path / "out"), "--quick"]) == 2
    assert "does not support springs or motors" in capsys.readouterr().err
