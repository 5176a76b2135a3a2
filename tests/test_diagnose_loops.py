"""Loops of two models are compared by the motions that they leave; velocity products are those of their library."""

from __future__ import annotations

import pytest

from support.errors import ClosureError

#: A planar four-bar in the x-z plane, closed at home.
FOUR_BAR = """<mujoco><worldbody>
<body name="crank"><joint name="a" axis="0 1 0"/><inertial pos="0 0 0.1" mass="0.5" diaginertia="2e-3 2e-3 1e-4"/>
 <body name="coupler" pos="0 0 0.2"><joint name="b" axis="0 1 0"/>
 <inertial pos="0.25 0.02 0.1" mass="1.2" diaginertia="5e-3 3e-2 2.6e-2"/></body></body>
<body name="rocker" pos="0.4 0 0"><joint name="c" axis="{axis}"/>
 <inertial pos="0.05 0 0.2" mass="0.9" diaginertia="1.3e-2 1.3e-2 1e-3"/></body></worldbody>
<equality>{loop}</equality></mujoco>"""
POINT = '<connect name="{0}" body1="coupler" body2="rocker" anchor="{1} {2} 0.2"/>'
PIN = POINT.format("d", 0.5, 0)
#: Two angles, of which the second is a polynomial of the first.
GEARED = """<mujoco><worldbody>
<body><joint name="a" axis="0 1 0"/><inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
<body><joint name="b" axis="0 1 0"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/></body>
</worldbody><equality><joint joint1="b" joint2="a" polycoef="0.1 0.5 {0} 0 0"/></equality></mujoco>"""


def four_bar(loop=PIN, axis="0 1 0"):
    return FOUR_BAR.format(loop=loop, axis=axis)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("other", "mobility", "said"),
    [
        (four_bar(PIN + POINT.format("e", 0.5, 0.1)), 1, "stated otherwise and leave the same motions"),
        (four_bar('<weld name="d" body1="coupler" body2="rocker"/>'), 0, "leave 1 degree of freedom in A, 0 in B"),
        (four_bar(""), 3, "leave 1 degree of freedom in A, 3 in B"),
        (four_bar(PIN + '<joint joint1="a"/>'), 0, "leave 1 degree of freedom in A, 0 in B"),
        (four_bar(POINT.format("d", 0.51, 0)), 1, "The motions that loops leave differ by"),
    ],
)
def test_loops_are_told_by_what_they_leave_whatever_rows_state_them(diagnosed, other, mobility, said):
    found = diagnosed(four_bar(), other)
    assert found.loops.mobility == (1, mobility)
    assert found.loops.freedoms == 3
    assert said in found.verdict
    assert found.loops.alike == ("same motions" in said)
    assert any(row.quantity == "motion that loops leave" for row in found.rows)


def test_a_closure_seen_from_its_other_end_is_the_same(diagnosed):
    found = diagnosed(four_bar(), four_bar('<connect name="d" body1="rocker" body2="coupler" anchor="0.1 0 0.4"/>'))
    assert found.same, found.verdict
    assert found.loops.row.max_abs <= 1e-13
    assert "closures and couplings leave 1 of 3 degrees of freedom" in found.notes
    scaled = found.witnesses[0].scaled
    assert scaled["constraint Jacobian"] <= 1e-12
    assert scaled["Jdot v"] <= 1e-12


@pytest.mark.slow
def test_loops_that_no_pose_closes_are_refused(diagnosed):
    far = four_bar('<connect name="d" body1="coupler" body2="world" anchor="0 0.3 0"/>')
    apart = far.replace("<connect", '<joint joint1="a" polycoef="0.5 0 0 0 0"/><joint joint1="a"/><connect')
    with pytest.raises(ClosureError, match=r"a\.xml: loops do not close from any of \d+ starts: nearest are 'joint_1'"):
        diagnosed(apart, apart)


def test_the_curvature_of_a_joint_equality_that_mujoco_leaves_out_names_its_case(diagnosed):
    curved = GEARED.format(0.7)
    found = diagnosed(curved, curved)
    assert found.verdict.startswith("The models are the same: ")  # which alone would be an AGREE
    assert "mujoco itself computes another Jdot v for A" in found.verdict
    assert "a difference of the engine, not of the model (casebook: mj-jdotv-before-3.7)" in found.verdict
    assert found.witnesses[0].scaled["constraint Jacobian"] <= 1e-12
    straight = GEARED.format(0)
    assert diagnosed(straight, straight).same
