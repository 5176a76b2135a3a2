"""Freedoms that no actuator drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import screwgauge
from support.judging import judge
from support.scene import GivenMotion, sampled

SCENE = "3ups-upu-s"


def motion(idle: tuple[int, ...], *, off: float = 0.0) -> GivenMotion:
    """The motion of a scene whose second coordinate is `off` in acceleration."""
    whole = sampled(SCENE, slice(0, 40, 10)).motion
    return replace(whole, ydd=whole.ydd + np.array([0.0, off]), idle=idle)


def test_parts_keep_idle_coordinates_and_order_moves_them():
    one = motion((1,))
    assert one.part(slice(0, 2)).idle == (1,)
    turned = one.ordered([1, 0])
    assert turned.idle == (0,)
    assert turned.drive is not None
    np.testing.assert_array_equal(turned.y[:, 0], one.y[:, 1])


def test_judge_does_not_ask_for_accelerations_of_idle_coordinates():
    scene = sampled(SCENE, slice(0, 40, 10))
    quantities = ["joint_position", "joint_velocity", "joint_acceleration"]
    solution = screwgauge.run(scene, engines=["screw"], quantities=quantities).solutions["screw"]

    def faults(idle: tuple[int, ...]) -> set[str]:
        table = judge(scene.mechanism, replace(scene.problem(quantities), task=motion(idle, off=1.0)), solution)
        return set(table["worst_component"][~table["ok"]])

    assert faults(()) == {f"{[*scene.mechanism.independent][1]} as asked"}
    assert not faults((1,))
