"""Errata 1 to 3: screws and mobility."""

import numpy as np
from paper import mobility
from paper.erratum import about

from screwgauge.reference.graph import serial_chains
from support.solve import chain_screws
from support.tolerances import ROUNDING


def test_eq_6_is_the_upu_chain_at_home(case):
    chain = serial_chains(case.lay.mechanism)[0]
    screws = chain_screws(case.lay, case.at.q[:1], chain)[0]
    printed = mobility.upu_screws(np.pi / 6, R=0.8, L=0.6)
    assert np.abs(screws[:, :3] - printed[:, :3]).max() < ROUNDING
    # Table 2 turns the wrist, but not the plane that its two axes span
    assert np.linalg.matrix_rank(np.hstack([screws, printed]), tol=ROUNDING) == 5


def test_1_no_constraint_is_redundant_but_two_actuators_are(case):
    (row,) = mobility.overconstraint(case)
    assert (row.printed.value, row.right.value, row.effect) == (2, 0, 2)
    assert row.printed.words == "56 unknowns less 54 equations"


def test_2_the_second_free_axis_turns_with_the_platform(case):
    (row,) = mobility.free_axes(case)
    assert row.effect == about(0.4)
    assert row.right.value < ROUNDING


def test_3_the_wrench_of_the_upu_chain_is_right_but_for_an_upright_leg(case):
    leaning, upright, terms = mobility.reciprocal_screws(case)
    assert max(leaning.printed.value, leaning.right.value) < ROUNDING
    assert (upright.printed.value, upright.right.value, upright.effect) == (1, 0, 1)
    assert (terms.printed.value, terms.right.value) == (7, 6)
