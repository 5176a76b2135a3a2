from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.data import data
from support.engines import Solution, Values, solve
from support.judging import judge
from support.scene import States

MOTION = ("joint_position", "joint_velocity", "joint_acceleration")

DRIVEN = data("driven-four-bar-scene.toml")


@pytest.fixture
def driven(write):
    return screwgauge.load_scene(write("driven.toml", DRIVEN))


def answered(scene, **changes: object) -> Solution:
    return solve(scene.under(**changes), ["screw"], MOTION)[0]["screw"]


def judged(scene, solution: Solution):
    return judge(scene.mechanism, scene.problem(()), solution).set_index("residual")


def test_a_right_motion_passes(driven):
    rows = judged(driven, answered(driven))
    assert rows["ok"].all()
    assert rows.loc["virtual_work", "max_scaled"] < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize("what", ["motors", "springs", "loads"])
def test_forces_of_another_scene_fail_though_their_energy_may_balance(driven, what):
    acting = driven.applied
    others = {
        "motors": tuple(replace(motor, course=motor.course.times(-1.0)) for motor in acting.motors),
        "springs": (replace(acting.springs[0], damping=0.0), acting.springs[1]),
        "loads": tuple(replace(load, force=-load.force) for load in acting.loads),
    }
    rows = judged(driven, answered(driven, **{what: others[what]}))
    assert not rows.loc["virtual_work", "ok"]


def test_an_acceleration_that_is_slightly_off_is_found(driven):
    right = answered(driven)
    values = right.values["joint_acceleration"]
    wrong = Values(values.components, values.units, values.array * (1 + np.array([[0.0], [1e-9], [0.0]])))
    rows = judged(driven, replace(right, values={**right.values, "joint_acceleration": wrong}))
    assert not rows.loc["virtual_work", "ok"]
    assert rows.loc["virtual_work", "worst_t"] == 0.1


def test_the_energy_of_a_motion_that_is_looked_at_from_later_on_balances(driven):
    later = driven.at([0.1, 0.2])
    rows = judged(later, answered(later))
    assert rows["ok"].all()
    assert "energy_balance" in rows.index


def test_what_was_not_reached_is_not_judged(driven):
    whole = answered(driven)
    values = {name: Values(has.components, has.units, has.array.copy()) for name, has in whole.values.items()}
    for has in values.values():
        has.array.setflags(write=True)
        has.array[2:] = np.nan
    rows = judged(driven, replace(whole, values=values, rows=np.arange(2), stopped="here"))
    assert rows["ok"].all()
    assert np.isfinite(rows["max_scaled"]).all()
    assert rows["worst_t"].max() <= 0.1


def test_states_of_an_open_tree_are_not_judged(driven):
    problem = replace(driven.problem(()), task=States(("a0",), np.zeros((1, 1)), np.zeros((1, 1))))
    with pytest.raises(TypeError, match="motion over time"):
        judge(driven.mechanism, problem, Solution("screw", "", {}, np.ones(1)))
