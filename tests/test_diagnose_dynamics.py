"""Own dynamics of a reading: a third witness beside Pinocchio and MuJoCo, and what it is linear in."""

from dataclasses import replace

import numpy as np
import pytest

from support import robots
from support.data import data
from support.diagnosis import ask_library, compare_tree
from support.mechanics import (
    STANDARD,
    admissible_projector,
    armature_force,
    close_loops,
    dynamics,
    inverse_dynamics,
    passive_force,
    unmodelled_forces,
)
from support.mechanism import GROUND, PolynomialSum
from support.readings import (
    ClosureReading,
    CouplingReading,
    TreeStates,
    closure_gaps,
    closure_rows,
    draw,
    gap_bias,
    gaps_and_rows,
    move,
    move_joints,
    read,
    residual_at_home,
    tree_of,
)
from support.regressors import gravity_regressor, inertial_regressor, parameters, passive_regressor

#: Every kind of joint, two on one body, a branch, everything that a joint can have.
ZOO = data("zoo.xml")


@pytest.fixture
def zoo(write):
    return write("zoo.xml", ZOO.format(gravcomp='gravcomp="0.4"'))


def known(path, library):
    reading = read(path, library)
    return replace(reading, gravity=STANDARD if reading.gravity is None else reading.gravity)


@pytest.mark.parametrize(("form", "library"), [(0, "pinocchio"), (0, "mujoco"), (1, "pinocchio"), (1, "mujoco")])
def test_a_library_computes_what_follows_from_its_reading(tmp_path, form, library):
    path = robots.write(tmp_path)[form]
    tree = tree_of(known(path, library))
    states = draw(tree.reading, 8, seed=3)
    scaled = compare_tree(ask_library(path, library, tree, states), tree, states)
    assert max(scaled.values()) <= 1e-12, scaled


@pytest.mark.parametrize("library", ["pinocchio", "mujoco"])
def test_so_it_is_with_every_kind_of_joint(zoo, tmp_path, library):
    if library == "pinocchio":  # reads no gravcomp
        zoo.write_text(ZOO.format(gravcomp=""), encoding="utf-8")
    tree = tree_of(known(zoo, library))
    states = draw(tree.reading, 8, seed=3)
    scaled = compare_tree(ask_library(zoo, library, tree, states), tree, states)
    assert max(scaled.values()) <= 1e-12, scaled


def test_torques_are_linear_in_what_the_regressors_say(zoo):
    tree = tree_of(known(zoo, "mujoco"))
    states = draw(tree.reading, 6)
    motion = move(tree, states)
    values = parameters(tree.mass, tree.com, tree.inertia)
    rigid = np.einsum("nibk,bk->ni", inertial_regressor(tree, motion), values)
    whole = inverse_dynamics(tree, states)
    others = armature_force(tree, states) + passive_force(tree, states)
    assert np.abs(rigid + others - whole).max() <= 1e-13 * np.abs(whole).max()
    entries = passive_regressor(tree, states)
    part = tree.freedoms["h"]
    joint = tree.reading.joints["h"]
    own = sum(getattr(joint, name) * force[:, part] for name, force in entries.items())
    assert np.abs(own - others[:, part]).max() <= 1e-14 * np.abs(others).max()
    weight = gravity_regressor(tree, motion) @ tree.reading.gravity
    assert np.abs(weight - dynamics(tree, states).gravity).max() <= 1e-14 * np.abs(weight).max() * 10


def test_the_mass_matrix_is_what_accelerations_cost(zoo):
    tree = tree_of(known(zoo, "mujoco"))
    states = draw(tree.reading, 4)
    M, still = dynamics(tree, states).mass_matrix, TreeStates(states.q, 0.0 * states.qd, 0.0 * states.qdd)
    for i, unit in enumerate(np.eye(M.shape[1])):
        column = inverse_dynamics(tree, replace(still, qdd=still.qdd + unit)) - inverse_dynamics(tree, still)
        assert np.abs(column - M[:, :, i]).max() <= 1e-13 * np.abs(M).max()


def test_rows_of_closures_are_rates_of_their_gaps(zoo):
    tree = tree_of(known(zoo, "mujoco"))
    # near home the rate of a rotation vector is the angular velocity
    reading = tree.reading
    states = draw(reading, 1)
    home = np.array([[0, 0, 0, 1, 0, 0, 0, reading.joints["h"].home, 0, 1, 0, 0, 0, 0]], dtype=float)
    assert home.shape == states.q.shape
    rows = closure_rows(move(tree, replace(states, q=home)))
    h = 1e-6
    for column, place in ((6, 7), (7, 8), (11, 13)):  # the hinge, the slide, the other hinge
        step = np.zeros_like(home)
        step[0, place] = h
        ends = [closure_gaps(move(tree, replace(states, q=home + sign * step))) for sign in (1, -1)]
        for name, row in rows.items():
            assert np.abs((ends[0][name] - ends[1][name]) / (2 * h) - row[:, :, column]).max() < 1e-8, name
    assert max(residual_at_home(tree).values()) < 1e-15


def test_closed_states_are_closed_and_move_so_to_second_order(zoo):
    """A point between two branches, a whole frame of the ground, and a coupling; the base is free."""
    reading = known(zoo, "mujoco")
    weld = ClosureReading("weld", GROUND, reading.bodies["d"].pose, "d", np.eye(4))
    bent = CouplingReading("h2", PolynomialSum(0.1, {"h": np.array([0.7, 0.3])}))
    tree = tree_of(replace(reading, closures={"point": reading.closures["point"], "d": weld}, couplings={"bent": bent}))
    states, fits = close_loops(tree, draw(tree.reading, 12, seed=5))
    assert fits.sum() == len(states.q) >= 4
    assert np.abs(states.qd).max() > 0.1
    projector, _ = admissible_projector(gaps_and_rows(tree, states)[1], np.zeros(states.qd.shape[1], dtype=bool), 1.0)
    assert np.trace(projector, axis1=1, axis2=2) == pytest.approx(2.0)  # of 12, less 3, 6 and 1
    h, free = 1e-3, tree.freedoms["f"]
    step = h * states.qd + 0.5 * h**2 * states.qdd
    w, v = states.qd[:, free][:, :3], states.qd[:, free][:, 3:]
    step[:, free.start + 3 : free.stop] += 0.5 * h**2 * np.cross(w, v)  # the axes turn with the body
    gap = np.abs(gaps_and_rows(tree, replace(states, q=move_joints(tree, states.q, step)))[0]).max()
    assert gap <= 1e-6 * np.abs(states.qd).max() ** 3
    assert gap < 0.01 * h**2 * np.abs(gap_bias(tree, states)).max()


def test_a_medium_is_said_not_to_be_modelled(zoo):
    reading = replace(known(zoo, "mujoco"), medium=(1.2, 0.0))
    assert "density 1.2" in unmodelled_forces(reading)[0]
    assert unmodelled_forces(replace(reading, medium=(0.0, 0.0))) == ()
