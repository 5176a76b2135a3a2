from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from campaigns import compiled

import screwgauge
from screwgauge.engines.screw.compiled import Solver
from screwgauge.reference.equations.rounding import loop_lengths, stretch
from support.equations import gain
from support.mechanism import four_bars, load_mechanism
from support.scene import GIVEN
from support.solve import TracedWork, home_equations, layout, positions
from support.traced import Lanes, reduce_program

FORCES = ("generalized_force", "actuator_force")


def chain(n, folder):
    file = folder / f"{n}.toml"
    file.write_text(four_bars(n, driven=True), encoding="utf-8")
    return file


@pytest.mark.slow
def test_eight_four_bars_are_answered_by_the_program_within_its_estimates(tmp_path):
    scene = compiled.near_home(chain(8, tmp_path), 100)
    solver = Solver(scene, [name for name in GIVEN if name != "reaction"], "numpy", 1, mode=(False, True))
    count, mine = compiled.by_program(solver, scene.motion)
    assert count == 100
    theirs = {name: x for name, x in compiled.by_array(scene, scene.motion).items() if name in mine}
    assert 0.0 < compiled.furthest(mine, theirs, solver.first.units)[0] <= 1.0


def test_the_gain_of_a_chain_is_that_of_its_loops(tmp_path):
    """Closing errors add up with the root of the number of loops."""
    gains = []
    for n in (4, 16):
        lay = layout(load_mechanism(chain(n, tmp_path)))
        system, y = home_equations(lay), lay.mechanism.home[None, lay.mechanism.independent_columns] + 0.1
        gains.append(float(np.sqrt(gain(system.closing_system(positions(lay, y, np.zeros(1))))[0])))
    assert 1.5 < gains[1] / gains[0] < 2.5


def test_loops_have_their_own_lengths(tmp_path):
    lay = layout(load_mechanism(chain(3, tmp_path)))
    assert np.allclose(loop_lengths(lay), 2.0**0.5)
    assert len(loop_lengths(lay)) == 3
    assert stretch(lay) == pytest.approx(5.0**0.5)  # from the first pivot to the farthest link's end


@pytest.mark.slow
def test_operations_grow_by_the_same_with_every_loop(tmp_path):
    counts = []
    for n in (4, 8, 12):
        scene = compiled.near_home(chain(n, tmp_path), 20)
        work = TracedWork(layout(scene.mechanism), scene.problem(FORCES), scene.motion, "numpy")
        counts.append(len(work.traced.program.code))
    first, second = (b - a for a, b in pairwise(counts))
    assert second == pytest.approx(first, rel=0.02)


@pytest.fixture(scope="module")
def followed():
    scene = screwgauge.load_scene("stewart-legs").at(np.linspace(0.0, 1.0, 201))
    return scene, TracedWork(layout(scene.mechanism), scene.problem(["joint_position"]), scene.motion, "numpy")


@pytest.mark.slow
def test_parts_go_on_from_each_other_and_leaps_are_walked(followed):
    scene, work = followed
    work, motion = work.copy(), scene.motion
    expected = compiled.by_array(scene, motion)["joint_position"][0]
    for rows in (slice(0, 90), slice(90, 201), slice(20, 90)):
        some = motion.part(rows)
        values = work.part(some, work.predict(some)).values["joint_position"]
        assert np.abs(values - expected[rows]).max() < 1e-12
        assert not work.by_array.total()


def test_poses_far_from_their_predictions_are_predicted_from_nearer(followed):
    scene, work = followed
    work = work.copy()
    guess = work.predict(scene.motion)
    before = len(work.work.mode.continuation.anchors)
    far = replace(guess, z=guess.z + 0.05 * np.eye(*guess.z.shape))
    values = work.part(scene.motion, far).values["joint_position"]
    assert not work.by_array.total()
    assert len(work.work.mode.continuation.anchors) > before
    assert np.abs(values - compiled.by_array(scene, scene.motion)["joint_position"][0]).max() < 1e-12


def test_a_program_for_some_outputs_computes_these_and_no_more(followed):
    _, work = followed
    program = work.traced.program
    rows = [0, 5, *range(len(program.outputs) - 3, len(program.outputs))]
    given = np.random.default_rng(1).uniform(-0.3, 0.3, (program.inputs, 4))
    whole, some = np.empty((len(program.outputs), 4)), np.empty((len(rows), 4))
    less = reduce_program(program, rows)
    Lanes(program).bind([given], [whole])()
    Lanes(less).bind([given], [some])()
    assert np.array_equal(some, whole[rows], equal_nan=True)
    assert len(reduce_program(program, []).code) == 0 < len(less.code) < len(program.code)
