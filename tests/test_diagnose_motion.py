from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from screwgauge.diagnosis.explanation import explain
from screwgauge.diagnosis.libraries import compare_dynamics
from screwgauge.diagnosis.machine.alignment import find_partners
from screwgauge.diagnosis.model import check_loops, load_side, match_cuts
from screwgauge.diagnosis.motion import follow, partners_of
from screwgauge.diagnosis.shares import Torques, with_gravity
from screwgauge.models.kinematics import tree_of
from screwgauge.models.machine import machine_of
from screwgauge.models.poses import matrix
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import quaternion_rotation
from screwgauge.witness.kinematics import move
from support.mechanism import load_mechanism
from support.models import write_models

NAMES = ["3ups-upu-s", "delta", "3-rrr", "stewart", "bennett"]


def pair_of(first, second):
    a, b = check_loops(match_cuts(load_side(first), load_side(second)))
    return explain(a.posed, b.posed, find_partners(a.posed, b.posed)).pair


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    @cache
    def made(name, turned=False):
        folder = tmp_path_factory.mktemp(name)
        write_models(load_mechanism(name), folder)
        files = folder / f"{name}.urdf", folder / f"{name}-full.xml"
        return pair_of(*files[:: -1 if turned else 1])

    return made


def turn(quaternion):
    return quaternion_rotation(quaternion / np.linalg.norm(quaternion))


def reframed(reading, seed=0):
    random = np.random.default_rng(seed)
    X = {name: matrix(random.normal(size=3), turn(random.normal(size=4))) for name in reading.bodies}

    def body(one, T):
        R, back = T[:3, :3], np.linalg.inv(T)
        fixed = {n: back @ each for n, each in one.fixed.items()}
        com, inertia = R.T @ (one.com - T[:3, 3]), R.T @ one.inertia @ R
        return replace(one, pose=one.pose @ T, com=com, inertia=inertia, fixed=fixed, parts={})

    def end(name, T):
        return np.linalg.inv(X[name]) @ T if name in X else T

    closures = {
        name: replace(c, first_frame=end(c.first, c.first_frame), second_frame=end(c.second, c.second_frame))
        for name, c in reading.closures.items()
    }
    return replace(reading, bodies={n: body(b, X[n]) for n, b in reading.bodies.items()}, closures=closures)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("turned", [False, True])
def test_bodies_of_another_cut_follow_their_partners(pair, name, turned):
    both = pair(name, turned)
    states = Torques(with_gravity(both.a.reading), 1).states
    leader, tree, same = tree_of(both.a.reading), tree_of(both.b.reading), partners_of(both)
    there, _, fits = follow(leader, states, tree, same)
    assert len(fits) > 10
    assert fits.all()
    one, two = move(leader, states).bodies, move(tree, there).bodies
    for body, other, T in same[0]:
        if GROUND in (body, other):
            continue
        i, j = [*both.a.reading.bodies].index(body), [*both.b.reading.bodies].index(other)
        ours, theirs = one.part(slice(i, i + 1)), two.part(slice(j, j + 1))
        ours = ours.shift(ours.R @ T[:3, 3])
        off = [np.abs(getattr(ours, key) - getattr(theirs, key)).max() for key in "pwvba"]
        assert max(off) < 1e-9


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("turned", [False, True])
def test_torques_agree_along_motions_that_the_loops_admit(pair, name, turned):
    assert compare_dynamics(pair(name, turned), 0).scaled < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_frames_of_bodies_make_no_difference(pair, name):
    both = pair(name)
    b = reframed(both.b.reading)
    again = explain(both.a.reading, b, find_partners(both.a.reading, b)).pair
    assert compare_dynamics(again, 0).scaled < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_mass_shows(pair, name):
    both = pair(name)
    reading = both.b.reading
    heaviest = max(reading.bodies, key=lambda each: reading.bodies[each].mass)
    body = reading.bodies[heaviest]
    bodies = {**reading.bodies, heaviest: replace(body, mass=1.3 * body.mass)}
    wrong = replace(both, b=machine_of(replace(reading, bodies=bodies)))
    assert compare_dynamics(wrong, 0).scaled > 1e-4


@pytest.mark.parametrize("name", NAMES)
def test_a_tree_that_cannot_follow_is_not_compared(pair, name):
    """B has one of its bodies turned against all of its joints and closures."""
    both = pair(name)
    placed = dict(both.placed)
    placed[max(both.bodies, key=lambda each: both.a.bodies[each].matter.mass)] = matrix([0.1, 0, 0], np.eye(3))
    wrong = replace(both, placed=placed)
    assert compare_dynamics(wrong, 0) is None
