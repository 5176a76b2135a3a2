"""Simulations and sampled states by engines that support them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge.contract.fixtures import MOTION, Loaded
from screwgauge.problem import InitialValue, Problem, States
from screwgauge.quantities import RATE
from screwgauge.reference.errors import ModelFileError
from screwgauge.report.verdict import verdict
from screwgauge.solution import Solution

LINEAR = 1e-9  # largest difference between tree forces from states and from the motion, relative to the largest force
#: Established problems, and end times of their integration [s].
SIMULATED = {"a01-pendulum": 0.2, "a03-andrews-ivp": 0.003, "cart-pole": 0.2}


def test_a_simulation_has_joint_motions_work_and_cost(subject: Loaded, fall: Problem, fall_answer: Solution) -> None:
    task, mechanism = fall.task, subject.mechanism
    assert isinstance(task, InitialValue)
    assert {*fall_answer.values} == MOTION
    n, k = len(task), len(mechanism.coordinates)
    for name, rate in zip(("joint_position", "joint_velocity", "joint_acceleration"), RATE.values(), strict=True):
        values = fall_answer.values[name]
        assert values.components == mechanism.coordinates
        assert values.units == tuple(f"{unit}{rate}" for unit in mechanism.units)
        assert values.array.shape == (n, k)
        assert np.isfinite(values.array).all()
    assert fall_answer.work is not None, "set `work`, with NaN where it is unknown"
    assert fall_answer.work.shape == fall_answer.condition.shape == (n,)
    assert (fall_answer.stopped, fall_answer.rows, fall_answer.n_solved) == ("", None, n)
    assert fall_answer.setting, "name the method and its tolerances in `setting`"
    assert fall_answer.cost is not None, "set `cost`: steps, evaluations, time"
    assert fall_answer.cost.evaluations > fall_answer.cost.steps > 0
    assert fall_answer.cost.wall_s > 0.0
    columns = mechanism.independent_columns
    assert fall_answer.values["joint_position"].array[0, columns] == pytest.approx(task.start, abs=1e-12)


def test_a_simulation_shows_its_progress(subject: Loaded, fall: Problem) -> None:
    shares: list[float] = []
    subject.ask(fall, progress=shares.append)
    assert shares == sorted(shares)
    assert all(0.0 <= share <= 1.0 for share in shares)


@pytest.mark.parametrize("name", SIMULATED)
def test_a_simulation_agrees_with_the_solver(subject: Loaded, name: str) -> None:
    subject.takes(InitialValue)
    scene = screwgauge.load_scene(name).at([0.0, 0.5 * SIMULATED[name], SIMULATED[name]])
    results = screwgauge.run(scene, dict.fromkeys(("screw", subject.engine.name)))
    assert not results.failures, results.failures[subject.engine.name].reason
    assert results.ok, verdict(results).text


def test_states_are_taken_in_the_order_of_their_names(subject: Loaded, push: Problem) -> None:
    solution, task = subject.ask(push), push.task
    assert isinstance(task, States)
    units = dict(zip(subject.mechanism.coordinates, subject.mechanism.units, strict=True))
    values = solution.values["joint_acceleration"]
    assert {*solution.values} == {"joint_acceleration"}
    assert values.components == task.coordinates
    assert values.units == tuple(f"{units[name]}/s^2" for name in task.coordinates)
    assert values.array.shape == task.q.shape
    assert solution.cost is not None
    assert solution.cost.wall_s > 0.0
    if not subject.engine.cut:
        return
    assert task.tau is not None
    turned = States(task.coordinates[::-1], task.q[:, ::-1], task.v[:, ::-1], tau=task.tau[:, ::-1])
    other = subject.ask(replace(push, task=turned)).values["joint_acceleration"]
    assert other.components == task.coordinates[::-1]
    assert np.array_equal(other.array[:, ::-1], values.array)


def test_states_with_accelerations_give_forces_of_the_tree(subject: Loaded, push: Problem) -> None:
    task, scene = push.task, subject.scene
    assert isinstance(task, States)
    if not subject.engine.cut:
        with pytest.raises(ModelFileError, match="with the forces along them"):
            subject.ask(replace(push, task=replace(task, tau=None, a=task.q)))
        return
    wanted = frozenset(("tree_force", "actuator_force"))
    subject.has(*wanted)
    motion = subject.ask(scene.problem([*MOTION, *wanted])).values
    a = motion["joint_acceleration"].pick(task.coordinates).array
    answer = subject.ask(replace(push, applied=scene.applied, task=replace(task, tau=None, a=a), wanted=wanted))
    assert {*answer.values} == wanted
    for name in wanted:
        found, expected = answer.values[name], motion[name]
        assert (found.components, found.units) == (expected.components, expected.units)
        assert np.abs(found.array - expected.array).max() < LINEAR * np.abs(expected.array).max()


def test_states_of_other_coordinates_are_refused(subject: Loaded, push: Problem) -> None:
    task = push.task
    assert isinstance(task, States)
    other = States(("x", *task.coordinates[1:]), task.q, task.v, tau=task.tau)
    with pytest.raises(ModelFileError, match="states of"):
        subject.ask(replace(push, task=other))
