"""The cause of torques that no reading explains is fitted: property, place, size, and what cannot be told from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support.causes import fitted
from support.diagnosis import Change, applied
from support.geometry import rotation
from support.mechanics import inverse_dynamics
from support.readings import draw, plant, read
from support.robots import mjcf, tree

CHANGES = {
    "mass of link4": lambda r: Change("link4", "mass", np.array(1.05 * r.bodies["link4"].mass)),
    "centre of mass of link4": lambda r: Change("link4", "com", r.bodies["link4"].com + 0.01),
    "inertia of link4": lambda r: Change("link4", "inertia", 1.1 * r.bodies["link4"].inertia),
    "armature of joint2": lambda r: Change("joint2", "armature", np.array(0.05)),
    "damping of joint2": lambda r: Change("joint2", "damping", np.array(1.7)),
    "dry friction of joint2": lambda r: Change("joint2", "friction", np.array(1.7)),
    "sign of joint2": lambda r: Change("joint2", "sign", np.array(-1.0)),
    "zero of joint2": lambda r: Change("joint2", "zero", np.array(0.3)),
    "axis of joint2": lambda r: Change(
        "joint2", "axis", rotation(np.array([0.6, 0.0, 0.8]), np.array(0.1)) @ r.joints["joint2"].screw[:3]
    ),
    "gravity": lambda r: Change("", "gravity", np.array([0.0, 0.3, -9.7])),
}


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """All joints turn, and nothing is fixed."""
    file = tmp_path_factory.mktemp("robot") / "robot.xml"
    file.write_text(mjcf([replace(part, kind="revolute", near=i - 1) for i, part in enumerate(tree(5, 5))]))
    return read(file, "mujoco")


def box(reading, change):
    """States of a reading, and torques that it has after a change."""
    states = draw(reading, 12)
    return states, inverse_dynamics(plant(applied(reading, [change])), states)


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGES)
def test_a_cause_is_fitted(robot, name):
    change = CHANGES[name](robot)
    best, *others = fitted(robot, *box(robot, change))
    named = [best.name, *best.alike]
    assert name in named
    assert best.share == pytest.approx(1.0, rel=1e-8, abs=0)
    fit = next(fit for fit in (best, *others) if fit.name == name)
    if not fit.unseen:
        assert fit.changes[0].value == pytest.approx(change.value, rel=1e-5, abs=1e-6)


def test_what_no_single_cause_explains_is_not_explained(robot):
    states = draw(robot, 12)
    torques = inverse_dynamics(plant(robot), states) + np.random.default_rng(0).normal(size=(12, 5))
    assert fitted(robot, states, torques)[0].share < 0.5


def test_torques_that_agree_have_no_cause(robot):
    states = draw(robot, 12)
    assert fitted(robot, states, inverse_dynamics(plant(robot), states)) == []
