import numpy as np
import pytest

from support.freedoms import (
    chain_constraints,
    exchange,
    mobility,
    output_constraints,
    output_freedoms,
    reciprocal_screws,
)
from support.geometry import linear
from support.mechanism import serial_chains
from support.solve import at_home, chain_screws, layout, posed
from support.tolerances import ROUNDING

R, L, THETA = 0.8, 0.6, np.pi / 6


@pytest.fixture
def home(paper):
    return at_home(paper)


def spans_the_same(found, expected) -> bool:
    return linear.rank(np.hstack([found, expected])) == linear.rank(found) == linear.rank(expected)


def test_screws_of_the_upu_chain_are_those_of_eq_6(home):
    lay, q = home
    s, c = np.sin(THETA), np.cos(THETA)
    expected = np.array(
        [
            [1, 0, 0, 0, 0, 0],
            [0, 1, 0, 0, 0, R],
            [0, 0, 0, -s, 0, c],
            [c, 0, s, 0, -R * s + L, 0],
            [0, 1, 0, -L * c, 0, R - L * s],
        ]
    ).T
    assert np.abs(chain_screws(lay, q, serial_chains(lay.mechanism)[0])[0] - expected).max() < ROUNDING


def test_upu_chain_constrains_by_the_force_of_eq_9(home):
    (found,) = chain_constraints(*home)[0].T
    assert found / found[1] == pytest.approx([0, 1, 0, 0, 0, R - L / np.sin(THETA)], abs=ROUNDING)


def test_ups_chains_constrain_nothing_eq_10(home):
    assert [c.shape[1] for c in chain_constraints(*home)] == [1, 0, 0, 0, 3]


def test_s_chain_constrains_by_three_forces_through_o_eq_11(home):
    assert spans_the_same(chain_constraints(*home)[4], np.eye(6)[:, :3])


def test_platform_constraints_are_those_of_eq_12(home):
    expected = np.eye(6)[:, :4].copy()
    expected[:, 3] = [0, 1, 0, 0, 0, R - L / np.sin(THETA)]
    assert spans_the_same(output_constraints(*home), expected)


def test_platform_turns_about_x_and_y_at_home_eq_14(home):
    assert spans_the_same(output_freedoms(*home), np.eye(6)[:, :2])


def test_second_free_axis_turns_with_the_platform(paper):
    """Erratum: eq. (14) holds at a = 0 only; the second free axis is (0, cos a, sin a)."""
    lay = layout(paper)
    a = 0.3
    expected = np.zeros((6, 2))
    expected[0, 0], expected[1:3, 1] = 1.0, [np.cos(a), np.sin(a)]
    assert spans_the_same(output_freedoms(lay, posed(lay, a, 0.1)), expected)


def test_reciprocal_screws_do_no_work_at_any_pose(paper):
    lay = layout(paper)
    q = posed(lay, 0.25, -0.1)
    for chain in serial_chains(paper):
        S = chain_screws(lay, q, chain)[0]
        wrenches = reciprocal_screws(S)
        assert np.abs(exchange(S).T @ wrenches).max(initial=0.0) < ROUNDING
        assert wrenches.shape[1] == 6 - linear.rank(S)


def test_counts_of_the_paper(paper):
    lay = layout(paper)
    found = mobility(lay, posed(lay, 0.2, 0.1))
    assert (found.bodies, found.joint_freedoms, found.kutzbach, found.mobility) == (9, 26, 2, 2)
    assert (found.constraints, found.constraint_rank, found.overconstraints) == (52, 52, 0)
    assert found.actuation_redundancy == 2


def test_actuator_forces_are_not_unique_but_some_reactions_are(paper):
    lay = layout(paper)
    found = mobility(lay, posed(lay, 0.2, 0.1))
    unique = dict(zip(found.names, found.unique, strict=True))
    assert not any(unique[name] for name in paper.actuator_names)
    assert not unique["s.fz"]
    assert unique["leg2.slide.mz"]
