import numpy as np
import pytest
from paper import dynamics
from paper.erratum import about

BALANCED = 1e-9  # N m, and % of the largest: forces of 1 kN, solved for with conditions below a hundred


def test_12_the_sign_of_gravity_is_right_only_for_g_along_z(case, forces):
    generalized, driving = dynamics.gravity(case, forces)
    assert generalized.effect == about(2 * 17.0)  # N m: gravity makes 17 of them, here with the wrong sign
    assert driving.effect > 20.0


def test_13_no_reading_of_the_lever_arms_is_right(case, forces):
    *readings, point = dynamics.levers(case, forces)
    assert len(readings) == 5  # two for (53), two for (54); one reading of (55) is right
    for row in readings:
        assert row.effect > 50.0
        assert row.right.value < BALANCED
    assert point.effect > 50.0
    assert dynamics.imbalance(case, forces, "from", "platform") < BALANCED


def test_14_the_wrist_of_the_upu_leg_bears_a_moment(case, forces):
    leg, lever, sum_of_moments = dynamics.platform(case, forces)
    assert leg.effect == about(325.0)
    assert lever.effect > 500.0
    assert sum_of_moments.effect > 500.0
    assert sum_of_moments.right.value < BALANCED


@pytest.mark.slow
def test_15_eq_56_is_two_equations_which_are_singular_and_make_large_forces(axial):
    equations, singular, _, ratio, at_628, at_6283, condition = dynamics.one_dimension(axial)
    assert (equations.printed.value, equations.right.value) == (1, 2)
    assert (singular.printed.value, singular.right.value) == (4, 0)
    assert ratio.effect == about(7.05)
    assert at_628.effect == about(7.4e8)
    assert at_6283.effect == about(2.2e11)
    assert condition.printed.value == about(325.0)
    assert condition.right.value < 100.0


def test_16_a_wide_matrix_has_a_right_inverse(case, forces):
    count, share = dynamics.right_inverse(case, forces)
    assert (count.printed.value, count.right.value, count.effect) == (54, 56, 2)
    assert share.effect > 100.0
    assert share.right.value < BALANCED


def test_the_papers_case_is_statics(case):
    reach = dynamics.Reach(case)
    assert reach.load == pytest.approx(1000.0, rel=1e-6)
    assert reach.gravity == pytest.approx(17.0, rel=0.01)
    assert reach.inertia == pytest.approx(0.7, rel=0.03)
    assert reach.joint_error > 10.0
    assert reach.bracket < 1e-4 * reach.driving  # a wrong Lie bracket does not show in Fig. 11


def test_forces_are_those_of_the_solver(case, forces):
    assert np.abs(forces.actuator - case.driving(forces.W)).max() < BALANCED
