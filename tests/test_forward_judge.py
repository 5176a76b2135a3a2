"""The judge of an integrated motion finds what energy cannot see: forces of the wrong sign with their own work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge.engines.screw.forward import integrate
from screwgauge.judging.judge import judge
from screwgauge.scene.start import make_problem
from screwgauge.study.forward import integrated, started

DRIVEN = """
mechanism = "a02-fourbar-2"
engines = ["screw"]
gravity = [0, -9.81, 0]
[time]
times = [0.0, 0.1, 0.2]
[forward]
rates = { crank = -1 }
[[motors]]
coordinate = "a0"
offset = 2
harmonics = [[5, 1, 0]]
[[springs]]
coordinate = "a1"
stiffness = 3
damping = 0.5
[[springs]]
first = "ground"
first_point = [0.5, 0.3, 0]
second = "bar1"
second_point = [0.4, 0.1, 0]
stiffness = 20
rest = 0.3
[[loads]]
on = "bar1"
by = "environment"
force = [1, 2, 0]
"""


@pytest.fixture
def driven(write):
    return screwgauge.load_scene(write("driven.toml", DRIVEN))


def judged(scene, **changes: object):
    start = started(scene)
    found = integrate(replace(make_problem(scene, start, scene.mechanism_file, None), **changes))
    return judge(scene.mechanism, scene.problem(()), integrated(scene, found)).set_index("residual")


def test_a_right_motion_passes(driven):
    rows = judged(driven)
    assert rows["ok"].all()
    assert rows.loc["virtual_work", "max_scaled"] < 1e-14


@pytest.mark.parametrize("what", ["motors", "springs", "loads"])
def test_forces_of_another_scene_fail_though_their_energy_may_balance(driven, what):
    motors = tuple(replace(motor, polynomial=-motor.polynomial) for motor in driven.motors)
    springs = (replace(driven.springs[0], damping=0.0), driven.springs[1])
    loads = tuple(replace(load, force=-load.force) for load in driven.loads)
    rows = judged(driven, **{what: {"motors": motors, "springs": springs, "loads": loads}[what]})
    assert not rows.loc["virtual_work", "ok"]


def test_an_acceleration_that_is_slightly_off_is_found(driven):
    start = started(driven)
    found = integrate(make_problem(driven, start, driven.mechanism_file, None))
    wrong = replace(found, a=found.a * (1 + np.array([[0.0], [1e-9], [0.0]])))
    rows = judge(driven.mechanism, driven.problem(()), integrated(driven, wrong)).set_index("residual")
    assert not rows.loc["virtual_work", "ok"]
    assert rows.loc["virtual_work", "worst_t"] == 0.1
