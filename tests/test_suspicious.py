from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from screwgauge.models.readings.read import implausible as implausible_reading
from support.geometry import rotation
from support.mechanism import (
    Body,
    Frame,
    Mechanism,
    implausible,
    load_mechanism,
    mechanism_names,
    read_mechanism,
    suspicious,
)
from support.models import write_models
from support.readings import read

#: Two hinges along z, a metre apart, with what follows put in place.
ARM = """
name = "arm"
[independent]
q1 = "a"
q2 = "b"
[bodies.one]
mass = 1
com = {com}
inertia = {{ xx = {xx}, yy = 0.02, zz = 0.02 }}
[bodies.two]
mass = 1
com = [0.5, 0, 0]
inertia = {{ xx = 0.01, yy = 0.02, zz = 0.02 }}
[joints.a]
kind = "R"
parent = "ground"
child = "one"
axes = [[0, 0, 1]]
[joints.b]
kind = "R"
parent = "one"
child = "two"
axes = [{axis}]
parent_frame.position = {at}
"""
PLAIN = {"com": [0.4, 0.1, 0], "xx": 0.01, "axis": [0, 0, 1], "at": [1, 0, 0]}


@pytest.fixture
def sentences(write):
    def found(**changes) -> list[str]:
        file = write("arm.toml", ARM.format(**{**PLAIN, **changes}))
        return [one.sentence for one in suspicious(read_mechanism(file, None))]

    return found


def test_a_plain_arm_is_not_suspicious(sentences) -> None:
    assert sentences() == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"com": [0.4, 2.5, 0]}, "the centre of mass of one is 2.5 m away from its joints; its joints are 1 m apart"),
        ({"axis": ["sin(0.001)", 0, "cos(0.001)"]}, "the axes of a and b are parallel but for 0.001 rad"),
        ({"axis": ["cos(1e-6)", 0, "sin(1e-6)"]}, "the axes of a and b are at right angles but for 1e-06 rad"),
        ({"axis": [1, 0, 0], "at": [0, 0.0004, 0.3]}, "the axes of a and b miss each other by 0.0004 m"),
        ({"at": [0, 0, 1]}, "a and b turn about the same axis"),
        ({"at": [0, 0, 0], "com": [0, 0, 0], "axis": [1, 0, 0]}, "one has no length: joints and centre of mass are at"),
        ({"xx": 0.02}, "one has 0.02 kg m^2 about every axis, as a ball or a placeholder has it"),
    ],
)
def test_what_is_odd_is_said(sentences, changes, said) -> None:
    (sentence,) = sentences(**changes)
    assert sentence.startswith(said)


@pytest.mark.parametrize("changes", [{"axis": ["sin(0.1)", 0, "cos(0.1)"]}, {"axis": [1, 0, 0], "at": [0, 0.1, 0.3]}])
def test_clear_angles_and_distances_are_meant(sentences, changes) -> None:
    assert sentences(**changes) == []


CARRIAGE = """
name = "carriage"
independent = { x = "x", y = "y" }
[bodies]
bridge = { mass = 2, com = [0, 0, 0], inertia = { xx = 500, yy = 500, zz = 500 } }
carriage = { mass = 1, com = [0, 0.1, 0], inertia = { xx = 300, yy = 300, zz = 300 } }
[joints]
x = { kind = "P", parent = "ground", child = "bridge", axes = [[1, 0, 0]], actuated = true }
y = { kind = "KIND", parent = "bridge", child = "carriage", axes = [[0, 1, 0]], actuated = true }
"""


@pytest.mark.parametrize(("kind", "odd"), [("P", []), ("R", ["carriage", "carriage"])])
def test_inertia_of_a_body_that_never_turns_is_not_suspicious(kind, odd, write, tmp_path) -> None:
    mechanism = load_mechanism(write("carriage.toml", CARRIAGE.replace("KIND", kind)))
    assert [one.body for one in suspicious(mechanism)] == odd
    assert len(implausible(mechanism)) == bool(odd)
    write_models(mechanism, tmp_path)
    for name, library in (("carriage.urdf", "pinocchio"), ("carriage.xml", "mujoco")):
        assert len(implausible_reading(read(tmp_path / name, library))) == bool(odd)


def test_a_body_without_mass_is_said(paper: Mechanism) -> None:
    bodies = [Body(b.name, 0.0, np.zeros(3), np.zeros((3, 3))) if b.name == "leg2.lower" else b for b in paper.bodies]
    (one,) = suspicious(replace(paper, bodies=tuple(bodies)))
    assert (one.body, one.sentence) == ("leg2.lower", "leg2.lower has no mass of its own")


@pytest.mark.parametrize("name", [name for name in mechanism_names() if name not in ("a05-governor", "screw-press")])
def test_mechanisms_that_are_right_are_not_suspicious(name: str) -> None:
    assert suspicious(load_mechanism(name)) == ()


def test_frames_that_are_turned_make_no_difference(sentences, write) -> None:
    file = write("arm.toml", ARM.format(**PLAIN))
    mechanism = read_mechanism(file, None)
    R = rotation(np.array([1.0, 0.0, 0.0]), np.array([0.002]))[0]
    turned = replace(mechanism.joints[1], parent_frame=Frame(np.array([1.0, 0.0, 0.0]), R))
    (one,) = suspicious(replace(mechanism, joints=(mechanism.joints[0], turned)))
    assert one.sentence == "the axes of a and b are parallel but for 0.002 rad"
