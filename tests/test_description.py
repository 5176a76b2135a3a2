import re
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.geometry import rotation_matrix
from support.mechanism import Mechanism, actuator_names, load_mechanism
from support.planar import Bar, four_bar
from support.solve import home_equations, layout
from support.tolerances import PLACED

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
STEPS = {"matrix": QUARTER.tolist()}, {"axis": [1, 0, 0], "angle": "pi/2"}
ABOUT_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
#: In place of joint b: beside its rotation another, or a slide, by 0.3 which the frame of the child takes back.
RESTING = (
    ("axes = [[0, -1, 0], [0, 0, 1]]\nchild_frame.rotation = { axis = [0, 0, 1], angle = 0.3 }", "U", "[0.0, 0, 0]"),
    ("axes = [[0, -1, 0]]", "C", "[0.0, -0.3, 0]"),
)


@pytest.mark.parametrize(("steps", "expected"), [(STEPS, QUARTER @ ABOUT_X), (STEPS[::-1], ABOUT_X @ QUARTER)])
def test_rotations_are_multiplied_from_left_to_right(steps, expected):
    assert np.abs(rotation_matrix([*steps], "") - expected).max() < PLACED


def test_actuators_are_named_by_all_but_the_last_part_where_that_is_unique(paper: Mechanism):
    slide = paper.actuators[0]
    names = "left.leg.slide", "right.leg.slide", "arm.turn", "arm.lift"
    assert actuator_names([replace(slide, name=name) for name in names]) == ("left.leg", "right.leg", *names[2:])


@pytest.mark.slow
@pytest.mark.parametrize(("axes", "kind", "taken_back"), RESTING)
def test_a_coordinate_that_rests_keeps_its_home_that_is_not_zero(axes, kind, taken_back, write):
    bars = [Bar(0.2), Bar(0.5, com=(0.25, 0.01, 0.02)), Bar(0.4)]
    text = four_bar(bars, 0.4, 0.9)
    joint = text[text.index("[joints.b]") : text.index("[joints.c]")]
    twisted = joint.replace('"R"', f'"{kind}"').replace("axes = [[0, -1, 0]]", axes).replace("[0.0, 0, 0]", taken_back)
    twisted = re.sub(r"home = \[(.*)\]", r'home = [\1, 0.3]\ncoordinates = ["b.turn", "b.rests"]', twisted)
    write("m.toml", 'name = "twisted"\n[independent]\ncrank = "a"\n' + text.replace(joint, twisted))
    scene = write("s.toml", 'mechanism = "m.toml"\nmotion.crank.polynomial = [0.9, 3]\ntime.times = [0, 0.1]\n')
    mechanism = load_mechanism(scene.parent / "m.toml")
    rests = home_equations(layout(mechanism)).fixed
    assert [mechanism.coordinates[i] for i in rests] == ["b.rests"]
    results = screwgauge.run(screwgauge.load_scene(scene))
    assert results.ok, results
    column = results.components("joint_position").index("b.rests")
    for engine in results.solutions:
        assert results.values("joint_position", engine=engine)[:, column] == pytest.approx(0.3, abs=PLACED)
