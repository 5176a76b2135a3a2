from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.scene import load_scene
from support.solve import ScrewModel, layout
from support.traced import Arcs, Factors, NotTraceableError, Trace

SAMPLES = 200
QUANTITIES = ("joint_velocity", "joint_acceleration", "generalized_force")
#: Relative to the largest of a quantity: the same equations in other orders of elimination.
SAME = 1e-12


def full_turn(name):
    scene = load_scene(name)
    (home,) = scene.mechanism.home[scene.mechanism.independent_columns]
    t = np.linspace(0.0, 1.0, SAMPLES)
    y, yd, ydd = (2.0 * np.pi * x[:, None] for x in (t * t * (3.0 - 2.0 * t), 6.0 * (t - t * t), 6.0 - 12.0 * t))
    return replace(scene, task=type(scene.motion)(t, home + y, yd, ydd), drive=None, text={})


@pytest.mark.parametrize("name", ["bennett", "double-cardan"])
def test_programs_answer_all_samples_of_a_full_turn(name):
    scene = full_turn(name)
    engine, motion = ScrewModel(layout(scene.mechanism)), scene.motion
    arrays = engine.solve(scene.problem(QUANTITIES))
    solver = screwgauge.compile(scene, QUANTITIES, backend="numpy")
    assert len(solver.first.traced.arcs) > 1
    answer = solver(motion.y, motion.yd, motion.ydd)
    assert answer.by_array == {}
    for quantity in QUANTITIES:
        exact = arrays.values[quantity].array
        assert np.abs(answer[quantity] - exact).max() <= SAME * np.abs(exact).max()


def some(trace):
    return {(0, 0): trace.input(np.array([0.0, 1.0, 2.0])), (1, 0): trace.input(np.array([1.0, 0.0, 0.0]))}


def test_pivots_are_chosen_for_most_of_the_samples_if_others_may_be_left():
    trace = Trace()
    trace.kept = np.ones(3, dtype=bool)
    assert Factors(some(trace), [1.0, 1.0], [1.0], [[0]]).pivots == [(0, 0)]
    assert trace.kept.tolist() == [False, True, True]
    with pytest.raises(NotTraceableError, match="no pivot stays large"):
        Factors(some(Trace()), [1.0, 1.0], [1.0], [[0]])


class Known:
    checks = 1

    def __init__(self, value, gain):
        self.value, self.gain, self.program = value, gain, self

    def bind(self, inputs, outputs, weights=None):
        def run():
            outputs[0][0], outputs[-1][-1] = self.value, self.gain(inputs[0][0])
            return weights is None or not (weights @ outputs[-1] > 1.0).any()

        return run

    def copy(self):
        return Known(self.value, self.gain)


@pytest.mark.parametrize("copied", [False, True])
def test_each_sample_is_answered_where_gains_are_small(copied):
    x, out, checks = np.arange(6.0)[None], np.empty((1, 6)), np.empty((1, 6))
    arcs = Arcs(
        [Known(1.0, lambda x: x), Known(2.0, lambda x: 4.0 - x), Known(3.0, lambda x: 0.0 * x + 1.5)], [2.0, 1.0, 0.0]
    )
    run = (arcs.copy() if copied else arcs).bind([x], [out, checks], np.array([1.0 / 1.8]))
    assert not run()
    assert out[0].tolist() == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    assert checks[0].tolist() == [0.0, 1.0, 2.0, 1.0, 0.0, -1.0]
    x[0] = np.linspace(0.0, 1.0, 6)
    assert run()
    assert (out == 1.0).all()


def test_numbers_that_are_none_are_tried_again():
    x, out, checks = np.zeros((1, 2)), np.empty((1, 2)), np.empty((1, 2))
    arcs = Arcs([Known(1.0, lambda x: np.where(np.arange(2), x, np.nan)), Known(2.0, lambda x: x + 1.0)], [2.0, 2.0])
    assert arcs.bind([x], [out, checks])()
    assert out[0].tolist() == [2.0, 1.0]
    doubtful = Arcs([Known(1.0, lambda x: x + np.nan), Known(2.0, lambda x: x + np.nan)], [2.0, 2.0])
    assert not doubtful.bind([x], [out, checks], np.ones(1))()
