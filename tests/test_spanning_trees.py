from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import load_scene
from support.mechanism import load_mechanism
from support.numbers import ROUNDINGS, Forward, State, acting, conditions, errors_of, in_floats, state, swinging, trees

#: Of so many trees of a built-in and of a random mechanism, drawn where there are more.
MOST, DRAWN = 72, 16
NAMES = ("five-bar", "slider-crank", "spatial-slider-crank", "bennett", "rccc", "screw-press", "double-cardan")
LARGER = ("3-rrr", "3-rps", "3-upu", "sarrus", "delta", "3ups-upu-s", "stewart-legs", "a03-andrews")
FAMILIES = ("planar-5", "rsur", "rscr", "7r", "mixed-loop", "spatial-ladder", "geared-loop", "redundant", "n-ups")
FAMILIES += ("3-rrr-spherical", "6-pus", "rrsrr", "rssr", "underactuated")


def check(at: State, most: int = MOST) -> int:
    """Compare random trees with the default one; return how often an independent coordinate was cut. Reactions are
    compared where actuators supply the motion; else bodies are out of balance.
    """
    every, mechanism = trees(at.lay.mechanism), at.lay.mechanism
    driven = len(mechanism.actuators) >= len(mechanism.independent)
    right, cut = _all(at, driven), 0
    for i in np.random.default_rng(0).permutation(len(every))[:most]:
        other = at.over(every[i])
        bound = ROUNDINGS * np.finfo(float).eps * max(*conditions(other), *conditions(at))
        errors = errors_of(at, _all(other, driven), right)
        assert {name: error for name, error in errors.items() if not error <= bound} == {}, every[i]
        cut += any(column in other.loops.owner for column in other.loops.y_columns)
    return cut


def _all(at: State, driven: bool):
    found = in_floats(at, np.float64) | in_floats(at, np.float64, Forward)
    if not driven:
        del found["reaction"]
    return found


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", [*NAMES, *(pytest.param(name, marks=pytest.mark.slow) for name in LARGER)])
def test_every_tree_of_a_mechanism_under_all_kinds_of_forces_gives_the_same(name):
    mechanism = load_mechanism(name)
    assert check(swinging(mechanism, acting(mechanism), 2)) > 0


@pytest.mark.sampled(4)
@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_every_tree_of_a_random_mechanism_gives_the_same(family):
    check(state(screwgauge.random(2, family)), DRAWN)


@pytest.mark.slow
def test_every_tree_gives_the_same_under_the_rule_of_eq_56():
    check(state(replace(load_scene("3ups-upu-s"), rule="spherical_axial"), 2))


def test_trees_of_a_ring_are_as_many_as_its_joints():
    assert len(trees(load_mechanism("five-bar"))) == 5
    assert len(trees(load_mechanism("3-rrr"))) == 27
