"""Loops are closed before anything is compared, at the same poses in both models; what does not close is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwgauge
from support.errors import ClosureError
from support.mechanism import load_mechanism
from support.models import expected_reading
from support.readings import plant, residual_at_home

#: A planar four-bar in the x-z plane with its loop open: `reach` is where the rocker ends [m].
FOUR_BAR = """name = "four-bar"
independent.crank = "a"
[bodies]
crank = {{ mass = 0.5, com = [0, 0, 0.1], inertia = {{ xx = 2e-3, yy = 2e-3, zz = 1e-4 }} }}
coupler = {{ mass = 1.2, com = [0.25, 0.02, 0.1], inertia = {{ xx = 5e-3, yy = 3e-2, zz = 2.6e-2 }} }}
rocker = {{ mass = 0.9, com = [0.05, 0, 0.2], inertia = {{ xx = 1.3e-2, yy = 1.3e-2, zz = 1e-3 }} }}
[joints]
a = {{ kind = "R", parent = "ground", child = "crank", axes = [[0, 1, 0]], actuated = true }}
b = {{ kind = "R", parent = "crank", child = "coupler", axes = [[0, 1, 0]], parent_frame.position = [0, 0, 0.2] }}
c = {{ kind = "R", parent = "ground", child = "rocker", axes = [[0, 1, 0]], parent_frame.position = [0.4, 0, 0] }}
[joints.d]
kind = "R"
parent = "coupler"
child = "rocker"
axes = [[0, 1, 0]]
parent_frame.position = [0.5, 0, 0.2]
child_frame.position = [0.1, 0, {reach}]
"""
#: The same as an MJCF, closed by sites, which need not be closed at home.
SITES = """<mujoco model="four-bar"><worldbody>
<body name="crank"><joint name="a" axis="0 1 0"/><inertial pos="0 0 .1" mass=".5" diaginertia="2e-3 2e-3 1e-4"/>
 <body name="coupler" pos="0 0 .2"><joint name="b" axis="0 1 0"/><site name="s" pos=".5 0 .2"/>
 <inertial pos=".25 .02 .1" mass="1.2" diaginertia="5e-3 3e-2 2.6e-2"/></body></body>
<body name="rocker" pos=".4 0 0"><joint name="c" axis="0 1 0"/><site name="t" pos=".1 0 {0}"/>
 <inertial pos=".05 0 .2" mass=".9" diaginertia="1.3e-2 1.3e-2 1e-3"/></body></worldbody>
<equality><connect name="d" site1="s" site2="t"/></equality></mujoco>"""
CARRIAGES = """<mujoco><worldbody>
<body name="u"><joint name="a" type="slide" axis="1 0 0"/><site name="s" pos=".2 0 0"/>
 <inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/></body>
<body name="v"><joint name="b" type="slide" axis="1 0 0"/><site name="t" pos="{} 0 0"/>
 <inertial pos="0 0 0" mass="2" diaginertia=".01 .01 .01"/></body></worldbody>
<equality><connect name="d" site1="s" site2="t"/></equality></mujoco>"""
FAR = 3.0  # [m] nothing reaches there


def four_bar(write, reach: float):
    return write(f"reach-{reach}.toml", FOUR_BAR.format(reach=reach))


def sites(write, reach: float):
    return write(f"reach-{reach}.xml", SITES.format(reach))


def test_poses_of_a_description_follow_its_tree_so_that_a_gap_shows(write):
    mechanism = load_mechanism(four_bar(write, 0.5), closed=False)
    for cut in ("minimal", "full"):
        gaps = residual_at_home(plant(expected_reading(mechanism, cut, np.zeros(3))))
        assert max(gaps.values()) == pytest.approx(0.1, abs=1e-15)


@pytest.mark.parametrize("sides", [("open", "closed"), ("closed", "open"), ("open", "open")])
def test_a_description_that_closes_nowhere_is_refused_as_by_models(sides, write, refused):
    files = {"closed": four_bar(write, 0.4), "open": four_bar(write, FAR)}
    said = refused("diagnose", *(files[side] for side in sides))
    assert said == refused("models", files["open"])
    assert re.search(r"reach-3.0.toml: no pose closes its loops: .* 'd' by \S+ m;", said)


def test_two_legs_of_which_one_ends_elsewhere_differ_where_it_ends(write):
    """Walking all joints, not the tree alone, took the pose of each body from the leg that comes first."""
    moved = 'extends = "five-bar"\nname = "moved"\njoints.tip.child_frame.position = [0.06, 0.3, 0]\n'
    found = screwgauge.diagnose(write("moved.toml", moved), "five-bar")
    assert any(
        "tip: its frame on right.rod is elsewhere in B, shifted by -60 mm" in d.sentence for d in found.differences
    )
    assert any("home was solved for" in note for note in found.notes)


@pytest.mark.slow
def test_models_that_close_nowhere_are_refused_with_loop_size_and_file(write):
    with pytest.raises(ClosureError, match=r"reach-3.0.xml: loops do not close .*'d' by \S+ m"):
        screwgauge.diagnose(sites(write, FAR), sites(write, FAR))


@pytest.mark.slow
@pytest.mark.parametrize("reaches", [(0.4, FAR), (FAR, 0.4)])
def test_one_model_that_closes_nowhere_differs_and_is_named(reaches, write):
    found = screwgauge.diagnose(*(sites(write, reach) for reach in reaches))
    assert found.exit_status == 1
    side = "AB"[reaches.index(FAR)]
    assert re.search(rf"In {side} loops do not close from any of \d+ starts: nearest are 'd' by \S+ m\.", found.verdict)
    assert "leave the same motions" not in found.verdict
    assert "d: its frame on rocker is elsewhere in B, shifted by " in found.verdict


def test_a_model_that_closes_elsewhere_is_compared_closed_and_its_gap_is_said(write):
    found = screwgauge.diagnose(sites(write, 0.5), sites(write, 0.5))
    assert found.same, found.verdict
    assert found.loops.mobility == (1, 1)
    gap = "A and B are open at home as written: 'd' by 0.1 m"
    assert f"{gap}; loops are compared where they are closed" in found.notes


def test_loops_are_never_said_to_leave_the_same_motions_at_different_points(write):
    found = screwgauge.diagnose(sites(write, 0.4), sites(write, 0.5))
    assert not found.same
    assert not found.loops.alike
    assert re.fullmatch(r"'d' by 0.1\d* m", found.loops.opened)
    assert "leave the same motions" not in found.verdict
    assert "at home open by 0.1 m in B, closed in A" in found.verdict
    assert f"Poses that close A leave B open: {found.loops.opened}." in found.verdict


def test_a_loop_that_leaves_the_same_velocities_at_other_poses_is_another_loop(write):
    """Two carriages on one line, coupled by a point: the offset changes no velocity."""
    a, b = (write(f"{name}.xml", CARRIAGES.format(x)) for name, x in (("a", 0.2), ("b", 0.3)))
    found = screwgauge.diagnose(a, b)
    assert found.loops.row.max_abs <= 1e-14
    assert not found.loops.alike
    assert not found.same
    assert "leave the same motions" not in found.verdict
    assert "Poses that close A leave B open: 'd' by 0.1 m." in found.verdict


BAR = (
    '<mujoco><compiler angle="radian"/><worldbody><body name="crank"><joint name="a" axis="0 1 0"{}/>@'
    '<body name="rod" pos="0 0 0.2"><joint name="b" axis="0 1 0"{}/>@</body></body>'
    '<body name="rocker" pos="0.35 0 0"><joint name="c" axis="0 1 0"{}/>@</body></worldbody>'
    '<equality><connect name="loop" body1="rod" body2="rocker" anchor="0.3 0 0.1"/></equality></mujoco>'
).replace("@", '<inertial pos="0.1 0 0.02" mass="1" diaginertia="0.01 0.02 0.02"/>')


@pytest.mark.parametrize("zeros", [("0.3", "0", "0"), ("0.3", "-0.2", "1")])
def test_loops_are_the_same_where_coordinates_count_from_elsewhere(zeros, write):
    a, b = write("a.xml", BAR.format("", "", "")), write("b.xml", BAR.format(*(f' ref="{zero}"' for zero in zeros)))
    found = screwgauge.diagnose(a, b)
    assert {each.kind for each in found.differences} == {"convention"}
    assert found.loops.alike
    assert "open" not in found.verdict
