import numpy as np
from paper import kinematics
from paper.erratum import about

from support.tolerances import CLOSED, ROUNDING

SOLVED = 1e-10  # %: a share of 1e-12 that linear equations of conditions below a hundred leave
DIFFERENCES = 1e-5  # %: positions of 0.5 m, rounded to 1e-16, over (2 ms)^2, against accelerations of 0.1 m/s^2


def test_4_nothing_may_be_subtracted_from_a_twist_about_o(case):
    (row,) = kinematics.subtraction(case)
    assert row.effect == about(0.104)
    assert row.right.value < ROUNDING


def test_5_eq_24_puts_the_legs_ends_elsewhere(case):
    at_home, after_1_s, most, constant, axis = kinematics.joint_places(case)
    assert at_home.effect == about(0.60)
    assert after_1_s.effect == about(0.0515)
    assert most.effect == about(0.21)
    assert constant.effect > 0.2
    assert axis.effect == about(0.4)  # the angle a, by which joint 1 turns, at its most
    assert max(row.right.value for row in (at_home, after_1_s, most, constant, axis)) < ROUNDING


def test_9_the_first_row_of_the_bracket_is_angular(case):
    (row,) = kinematics.bracket(case)
    assert row.effect == about(17.5)
    assert row.right.value < SOLVED


def test_10_the_last_bracket_joins_the_last_two_joints(case):
    (row,) = kinematics.last_bracket(case)
    assert row.effect == about(4.8)
    assert row.right.value < SOLVED


def test_11_a_leg_does_not_turn_about_o(case):
    (row,) = kinematics.point_acceleration(case)
    assert row.effect == about(6.9)
    assert row.right.value < DIFFERENCES


def test_17_eq_60_is_no_motion_of_the_platform(case):
    velocity, derivative, acceleration, place = kinematics.given_motion(case)
    assert velocity.effect == about(0.039)
    assert derivative.effect == about(0.28)
    assert acceleration.effect > 0.2
    assert place.effect == about(0.21)
    assert max(row.right.value for row in (velocity, acceleration, place)) < ROUNDING
    assert derivative.right.value < 1e-9  # rad/s^2: rounding of rates of 0.2 rad/s over 20 us


def test_18_two_halves_of_a_leg_are_too_short(case):
    (row,) = kinematics.leg_halves(case)
    assert row.effect == about(0.264)
    assert row.measure.endswith("0.315 to 0.864 m")


def test_every_chain_carries_its_bodies_as_the_closed_mechanism_moves_them(case):
    beta, along = kinematics.chain_accelerations(case)
    assert np.abs(case.side.scatter(beta, case.beta.shape[1]) - case.beta).max() < CLOSED
    assert np.abs(along[:, :, -1] - case.A[:, None, -1]).max() < CLOSED
