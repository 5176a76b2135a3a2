"""Traced forward dynamics are those of the arrays, and simulations by them those of the array solver."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import screwgauge
from support.acting import Applied, JointSpring, Load, Motor, PointSpring, forces_at, power
from support.engines import Problem
from support.mechanism import load_mechanism
from support.scene import InitialValue, Integration
from support.solve import Branch, ScrewModel, Settings, StagedDOP853, TracedForward, forward, layout, moved, velocities
from support.tolerances import LINEAR
from support.traced import NotTraceableError

MOTION = frozenset(("joint_position", "joint_velocity", "joint_acceleration"))


def backends():
    try:
        import llvmlite  # noqa: F401
    except ImportError:
        return ["numpy"]
    return ["numpy", "llvm"]


def everything(lay):
    """All kinds of forces on a mechanism."""
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
        motors=(Motor(tree, np.array([1.0, -2.0, 0.5]), np.array([[3.0, 0.4, -0.7]])),),
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
    found, two, one = programs.slope(t, states), programs.slope(t, states[:, :2]), programs.one(t, states[:, 0])
    rate = moved(lay, near.T, states[len(y) : -1].T)
    forces = forces_at(lay.mechanism, applied, t)
    right = np.concatenate([states[len(y) : -1], forward(lay, rate, forces).ydd.T, power(lay, rate, forces)[None]])
    assert np.abs(found / right - 1.0).max() < 1e-10
    assert np.abs(two / right[:, :2] - 1.0).max() < 1e-10  # of which one needs no step
    assert np.abs(one / right[:, 0] - 1.0).max() < 1e-10


@cache
def simulated(name, until, backend):
    scene = screwgauge.load_scene(name)
    task = replace(scene.start, t=np.linspace(0.0, until, 5))
    model = ScrewModel(layout(scene.mechanism), settings=Settings(backend=backend))
    return model.solve(Problem(scene.applied, task, MOTION))


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
    """Parallelograms are one pendulum, phi'' = kappa sin phi. A step of Newton's method from a pose that is closed to
    rounding moves it by rounding times the condition, and its accelerations by that twice: 2e-3 where 3e-6 is right."""
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay, kappa = layout(scene.mechanism), 9.81 * (1.5 + 2.0) / (1.0 + 2.0)
    distance = 1e-4 * np.linspace(1.0, 1.2, 6)
    for y in np.pi / 2.0 - distance:
        programs = traced(lay, scene.applied, np.array([y - 1e-8]), backend, near=1e9)
        found = programs.one(0.0, np.array([y, 3.0, 0.0]))
        assert abs(found[1] - kappa * np.sin(y)) < 1e-5


@pytest.mark.parametrize("backend", backends())
def test_a_doubtful_state_is_left_to_the_array_solver(backend):
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay, y = layout(scene.mechanism), np.array([0.3])
    programs = traced(lay, scene.applied, y, backend)
    state = np.array([0.31, 1.0, 0.0])
    assert programs.one(0.0, state) is not None
    assert programs.one(0.0, np.array([np.pi / 2.0 - 1e-6, 1.0, 0.0])) is None  # nearly singular, and far
    assert programs.one(0.0, np.array([np.nan, 1.0, 0.0])) is None
    assert programs.slope(0.0, np.array([[0.31, 9.0], [1.0, 1.0], [0.0, 0.0]])) is None
    strict = traced(lay, scene.applied, y, backend, near=5.0)
    assert strict.one(0.0, state) is None
    programs.at.q[0] += 0.2  # another branch is no place to predict from
    assert programs.one(0.0, np.array([0.3, 1.0, 0.0])) is None


@pytest.mark.parametrize(("name", "rtol"), [("a01-pendulum", 1e-4), ("a01-pendulum", 1e-9), ("a02-fourbar-2", 1e-9)])
def test_steps_by_machine_code_are_those_of_scipy(name, rtol):
    pytest.importorskip("llvmlite")
    scene = screwgauge.load_scene(name)
    integration = Integration("DOP853", rtol, rtol)
    task = replace(scene.start, t=np.linspace(0.0, scene.start.t[-1] / 3.0, 4), integration=integration)
    asked = Problem(scene.applied, task, MOTION)
    mine, other = (ScrewModel(layout(scene.mechanism), settings=Settings(backend=b)).solve(asked) for b in backends())
    assert (mine.cost.steps, mine.cost.evaluations) == (other.cost.steps, other.cost.evaluations)
    a, b = (found.values["joint_position"].array for found in (mine, other))
    assert np.abs(a - b).max() < 1e-9 * np.abs(b).max()


def test_steps_by_machine_code_end_before_a_doubtful_pose():
    pytest.importorskip("llvmlite")
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay, state = layout(scene.mechanism), np.array([0.3, 2.0, 0.0])
    programs = traced(lay, scene.applied, state[:1], "llvm", near=60.0)
    solver = StagedDOP853(programs.one, 0.0, state, 5.0, rtol=1e-9, atol=1e-9)
    assert programs.walk(solver, 5.0)
    assert 0.1 < solver.t < 1.0
    assert programs.slope(solver.t, solver.y[:, None]) is not None
    evaluations, after = programs.steps()
    assert evaluations >= 12 * len(after)
    assert after[-1][0] == solver.t
    assert np.abs(after[-1][1] - programs.pose(solver.y[:1])).max() < LINEAR
    ahead = solver.y + np.array([0.2, 0.0, 0.0])
    assert programs.slope(solver.t, ahead[:, None]) is None


@pytest.mark.parametrize("backend", backends())
def test_a_way_too_long_for_one_prediction_is_gone_in_steps(backend):
    scene = screwgauge.load_scene("a03-andrews-ivp")
    lay, y = layout(scene.mechanism), scene.start.start
    programs, state = traced(lay, scene.applied, y, backend), np.array([[y[0] + 1.5], [3.0], [0.0]])
    assert not programs.place(state[:1])
    rate = velocities(lay, Branch(lay, lay.mechanism.home).poses(state[:1].T), state[1:2].T)
    right = forward(lay, rate, forces_at(lay.mechanism, scene.applied, 0.0)).ydd[0, 0]
    assert abs(programs.slope(0.0, state)[1, 0] / right - 1.0) < 1e-9
    programs.at.q[0] += 0.2  # from another branch no step leads there
    assert programs.slope(0.0, state + 0.5) is None


def test_angles_of_joints_that_close_loops_are_followed_over_whole_turns():
    scene = screwgauge.load_scene("a02-fourbar-2").under(gravity=np.zeros(3))
    lay = layout(scene.mechanism)
    task = replace(scene.start, rates=np.array([20.0]), t=np.array([0.0, 1.0]))
    found = ScrewModel(lay).solve(Problem(scene.applied, task, MOTION))
    q = dict(zip(lay.mechanism.coordinates, found.values["joint_position"].array[-1], strict=True))
    assert q["a0"] == pytest.approx(20.0, abs=1e-6)
    for cut in lay.tree.cuts:
        assert abs(q[cut.name]) == pytest.approx(20.0, abs=1e-5)


def test_what_has_no_program_is_said():
    scene = screwgauge.load_scene("a02-fourbar-2")
    lay = layout(scene.mechanism)
    applied = replace(scene.applied, springs=(JointSpring(lay.tree.cuts[0].name, 1.0),))
    with pytest.raises(NotTraceableError, match="a spring acts on an angle of a joint that closes a loop"):
        traced(lay, applied, np.zeros(1), "numpy")
    task = replace(scene.start, t=np.linspace(0.0, 0.02, 3))
    found = ScrewModel(lay).solve(Problem(applied, task, MOTION))
    assert any(note.startswith("accelerations by the array solver: a spring acts on an angle") for note in found.notes)
