from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import screwgauge
from support.acting import Applied, Course, JointSpring, Load, Motor, PointSpring
from support.engines import Problem
from support.mechanism import load_mechanism
from support.scene import InitialValue, Integration
from support.solve import ScrewModel, TracedForward, layout, moved
from support.traced import NotTraceableError

MOTION = frozenset(("joint_position", "joint_velocity", "joint_acceleration"))


def backends():
    try:
        import llvmlite  # noqa: F401
    except ImportError:
        return ["numpy"]
    return ["numpy", "llvm"]


def everything(lay):
    mechanism, n = lay.mechanism, len(lay.mechanism.bodies)
    first, last = mechanism.bodies[0].name, mechanism.bodies[n - 1].name
    tree = mechanism.coordinates[mechanism.independent_columns[0]]
    return Applied(
        gravity=np.array([1.0, -2.0, -9.0]),
        loads=(
            Load(last, None, np.array([3.0, -4.0, 5.0]), np.array([0.3, 0.2, -0.1])),
            Load(first, np.array([0.1, 0.2, 0.3]), np.array([-2.0, 1.0, 0.5]), np.zeros(3)),
        ),
        springs=(
            JointSpring(tree, 3.0, 0.2, 0.7),
            PointSpring("ground", np.array([2.0, 1.0, 3.0]), last, np.array([0.1, 0.0, 0.2]), 50.0, 1.0, 4.0),
        ),
        motors=(Motor(tree, Course(np.array([1.0, -2.0, 0.5]), np.array([[3.0, 0.4, -0.7]]))),),
    )


def traced(lay, applied, start, backend, near=1e5):
    task = InitialValue(start, np.zeros_like(start), 0.0, np.array([0.0, 1.0]), Integration(near=near))
    return TracedForward(lay, Problem(applied, task, MOTION), task, backend)


@pytest.mark.slow
@pytest.mark.parametrize("backend", backends())
@pytest.mark.parametrize("name", ["3ups-upu-s", "a03-andrews"])
def test_slopes_are_those_of_the_arrays(name, backend):
    lay = layout(load_mechanism(name))
    columns, applied = lay.mechanism.independent_columns, everything(lay)
    y = lay.mechanism.home[columns] + 0.05 * np.cos(np.arange(len(columns)))
    programs, t = traced(lay, applied, y, backend), 0.3
    yd = np.sin(1.0 + np.arange(len(y)))
    near = y[:, None] + 1e-3 * np.arange(11)  # more than a register holds
    states = np.concatenate([near, np.repeat(yd[:, None], 11, axis=1), np.zeros((1, 11))])
    found, two, one = programs.slopes(t, states), programs.slopes(t, states[:, :2]), programs.slope(t, states[:, 0])
    at = moved(lay, near.T, states[len(y) : -1].T, applied=applied, t=t)
    right = np.concatenate([states[len(y) : -1], at.ydd.T, at.input_power[None]])
    assert np.abs(found / right - 1.0).max() < 1e-10
    assert np.abs(two / right[:, :2] - 1.0).max() < 1e-10  # of which one needs no step
    assert np.abs(one / right[:, 0] - 1.0).max() < 1e-10


@cache
def simulated(name, until, backend):
    scene = screwgauge.load_scene(name)
    task = replace(scene.start, t=np.linspace(0.0, until, 5))
    model = ScrewModel(layout(scene.mechanism), backend=backend)
    return model.solve(Problem(scene.applied, task, MOTION))


@pytest.mark.sampled(2)
@pytest.mark.slow
@pytest.mark.parametrize("backend", backends())
@pytest.mark.parametrize(
    ("name", "until"), [("a03-andrews-ivp", 0.004), ("a02-fourbar-2", 0.5), ("a05-governor", 0.02)]
)
def test_simulations_are_those_of_the_array_solver(name, until, backend):
    mine, other = simulated(name, until, backend), simulated(name, until, "array")
    assert any("program" in note for note in mine.notes)
    assert not any("program" in note for note in other.notes)
    for quantity in MOTION:
        a, b = mine.values[quantity].array, other.values[quantity].array
        assert np.abs(a - b).max() < 1e-7 * np.abs(b).max()
    assert np.abs(mine.work - other.work).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("backend", backends())
def test_next_to_a_singular_pose_no_digit_is_lost_on_the_way(backend):
    """Parallelograms are one pendulum, phi'' = kappa sin phi. A Newton step from a closed pose moves it by rounding
    times the condition, and its accelerations by that twice: 2e-3 instead of 3e-6.
    """
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay, kappa = layout(scene.mechanism), 9.81 * (1.5 + 2.0) / (1.0 + 2.0)
    distance = 1e-4 * np.linspace(1.0, 1.2, 6)
    for y in np.pi / 2.0 - distance:
        programs = traced(lay, scene.applied, np.array([y - 1e-8]), backend, near=1e9)
        found = programs.slope(0.0, np.array([y, 3.0, 0.0]))
        assert abs(found[1] - kappa * np.sin(y)) < 1e-5


@pytest.mark.parametrize("backend", backends())
def test_a_doubtful_state_is_left_to_the_array_solver(backend):
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay, y = layout(scene.mechanism), np.array([0.3])
    programs = traced(lay, scene.applied, y, backend)
    state = np.array([0.31, 1.0, 0.0])
    assert programs.slope(0.0, state) is not None
    assert programs.slope(0.0, np.array([np.pi / 2.0 - 1e-6, 1.0, 0.0])) is None  # nearly singular, and far
    assert programs.slope(0.0, np.array([np.nan, 1.0, 0.0])) is None
    assert programs.slopes(0.0, np.array([[0.31, 90.0], [1.0, 1.0], [0.0, 0.0]])) is None
    strict = traced(lay, scene.applied, y, backend, near=5.0)
    assert strict.slope(0.0, state) is None
    programs.pose[0] += 0.2  # another branch is no place to predict from
    assert programs.slope(0.0, np.array([0.3, 1.0, 0.0])) is None


@pytest.mark.parametrize("backend", backends())
def test_a_state_too_far_for_one_prediction_is_reached_by_shorter_ways(backend):
    scene = screwgauge.load_scene("a03-andrews-ivp")
    lay = layout(scene.mechanism)
    y = scene.start.start
    programs, far = traced(lay, scene.applied, y, backend), y + 1.0
    found = programs.slope(0.0, np.array([*far, 2.0, 0.0]))
    at = moved(lay, far[None], np.array([[2.0]]), applied=scene.applied, t=0.0)
    assert found[1] == pytest.approx(at.ydd[0, 0], rel=1e-9, abs=0)


def test_angles_of_joints_that_close_loops_are_followed_over_whole_turns():
    scene = screwgauge.load_scene("a02-fourbar-2").under(gravity=np.zeros(3))
    lay = layout(scene.mechanism)
    task = replace(scene.start, rates=np.array([20.0]), t=np.array([0.0, 1.0]))
    found = ScrewModel(lay).solve(Problem(scene.applied, task, MOTION))
    q = dict(zip(lay.mechanism.coordinates, found.values["joint_position"].array[-1], strict=True))
    assert q["a0"] == pytest.approx(20.0, abs=1e-6)
    for cut in lay.cuts:
        assert abs(q[cut.name]) == pytest.approx(20.0, abs=1e-5)


def test_what_has_no_program_is_said():
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay = layout(scene.mechanism)
    applied = replace(scene.applied, springs=(JointSpring(lay.cuts[0].name, 1.0),))
    with pytest.raises(NotTraceableError, match="a spring acts on an angle"):
        traced(lay, applied, np.zeros(1), "numpy")
    task = replace(scene.start, t=np.linspace(0.0, 0.02, 3))
    found = ScrewModel(lay).solve(Problem(applied, task, MOTION))
    assert any("array solver: a spring acts" in note for note in found.notes)
