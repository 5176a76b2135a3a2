import shutil
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.data import DATA, data
from support.engines import IN_DOUBLES
from support.judging import agreed
from support.scene import GivenMotion
from support.tolerances import LINEAR, ROUNDING


@pytest.fixture(scope="module", params=["four-bar", "slider-crank", "rscr"])
def results(request):
    return screwgauge.run(screwgauge.load_scene(DATA / f"{request.param}-scene.toml"), engines=IN_DOUBLES)


@pytest.mark.slow
def test_all_engines_agree_and_satisfy_the_judge(results):
    agreed(results)


def test_redundant_constraints_are_counted_and_what_they_leave_open_is_not_compared():
    results = screwgauge.run(screwgauge.load_scene(DATA / "four-bar-scene.toml"), engines=IN_DOUBLES[:2])
    assert results.mobility["kutzbach"] == -2
    assert results.mobility["mobility"] == 1
    assert results.mobility["overconstraints"] == 3
    rows = results.errors[results.errors["quantity"] == "reaction"].set_index("component")
    assert rows.loc["b.mx", "rule"] == "undetermined"
    assert rows.loc["b.fx", "rule"] == "min_norm"
    assert rows.loc["b.fx", "unique"]


def test_a_mechanism_without_loops_with_a_thin_rod_and_a_point():
    scene = screwgauge.load_scene(DATA / "pendulum-scene.toml")
    results = screwgauge.run(scene, engines=["screw", "pinocchio"])
    assert results.ok
    t = scene.t
    a = results.values("joint_position")[:, 0]
    assert a == pytest.approx(7 * t - 3 * t**2, abs=LINEAR)  # more than a turn
    assert a.max() > np.pi


def test_a_hanging_pendulum_carries_its_weight():
    scene = screwgauge.load_scene(DATA / "pendulum-scene.toml").at([0.0])
    still = replace(scene, task=GivenMotion(np.zeros(1), np.array([[0.3, 0.0]]), np.zeros((1, 2)), np.zeros((1, 2))))
    results = screwgauge.run(still, engines=["screw", "pinocchio"])
    assert results.values("generalized_force")[0] == pytest.approx([9.81 * np.sin(0.3) * 2.5, 0.0], abs=ROUNDING)
    reactions = dict(zip(results.components("reaction"), results.values("reaction")[0], strict=True))
    assert reactions["a.fz"] == pytest.approx(2 * 9.81, abs=ROUNDING)


def test_a_body_that_mujoco_cannot_load_is_a_row_and_no_crash(tmp_path):
    text = data("pendulum.toml")
    light = text.replace("{ xx = 0, yy = 0, zz = 0 }", "{ xx = 3e-16, yy = 3e-16, zz = 3e-16 }")
    (tmp_path / "pendulum.toml").write_text(light, encoding="utf-8")
    shutil.copy(DATA / "pendulum-scene.toml", tmp_path)
    results = screwgauge.run(screwgauge.load_scene(tmp_path / "pendulum-scene.toml"), engines=["screw", "mujoco"])
    assert results.exit_status == 3
    assert "inertia of moving bodies" in results.failures["mujoco"].reason
    assert "/" not in results.failures["mujoco"].reason.split(":")[1]


def test_angles_of_the_four_bar_satisfy_its_loop_equations():
    results = screwgauge.run(
        screwgauge.load_scene(DATA / "four-bar-scene.toml"), engines=["screw"], quantities=["joint_position"]
    )
    columns = dict(zip(results.components("joint_position"), results.values("joint_position").T, strict=True))
    crank, coupler = columns["a"], columns["a"] + columns["b"]
    rocker = coupler + columns["c"]
    x = 0.3 * np.cos(crank) + 0.6 * np.cos(coupler) - 0.3 * np.cos(rocker)
    y = 0.3 * np.sin(crank) + 0.6 * np.sin(coupler) - 0.3 * np.sin(rocker)
    assert np.abs([x - 0.6, y]).max() < ROUNDING
