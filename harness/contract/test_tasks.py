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


def test_a_simulation_has_joint_motions_work_and_cost(loaded: Loaded, fall: Problem, fallen: Solution) -> None:
    task, mechanism = fall.task, loaded.mechanism
    assert isinstance(task, InitialValue)
    assert {*fallen.values} == MOTION
    n, k = len(task), len(mechanism.coordinates)
    for name, rate in zip(("joint_position", "joint_velocity", "joint_acceleration"), RATE.values(), strict=True):
        values = fallen.values[name]
        assert values.components == mechanism.coordinates
        assert values.units == tuple(f"{unit}{rate}" for unit in mechanism.units)
        assert values.array.shape == (n, k)
        assert np.isfinite(values.array).all()
    assert fallen.work is not None, "set `work`, with NaN where it is unknown"
    assert fallen.work.shape == fallen.condition.shape == (n,)
    assert (fallen.stopped, fallen.rows, fallen.n_solved) == ("", None, n)
    assert fallen.setting, "name the method and its tolerances in `setting`"
    assert fallen.cost is not None, "set `cost`: steps, evaluations, time"
    assert fallen.cost.evaluations > fallen.cost.steps > 0
    assert fallen.cost.wall_s > 0.0
    columns = mechanism.independent_columns
    assert fallen.values["joint_position"].array[0, columns] == pytest.approx(task.start, abs=1e-12)


def test_a_simulation_shows_its_progress(loaded: Loaded, fall: Problem) -> None:
    shares: list[float] = []
    loaded.ask(fall, progress=shares.append)
    assert shares == sorted(shares)
    assert all(0.0 <= share <= 1.0 for share in shares)


@pytest.mark.parametrize("name", SIMULATED)
def test_a_simulation_agrees_with_the_solver(loaded: Loaded, name: str) -> None:
    loaded.takes(InitialValue)
    scene = screwgauge.load_scene(name).at([0.0, 0.5 * SIMULATED[name], SIMULATED[name]])
    results = screwgauge.run(scene, dict.fromkeys(("screw", loaded.engine.name)))
    assert not results.failures, results.failures[loaded.engine.name].reason
    assert results.ok, verdict(results).text


def test_states_are_taken_in_the_order_of_their_names(loaded: Loaded, pushed: Problem) -> None:
    solution, task = loaded.ask(pushed), pushed.task
    assert isinstance(task, States)
    units = dict(zip(loaded.mechanism.coordinates, loaded.mechanism.units, strict=True))
    values = solution.values["joint_acceleration"]
    assert {*solution.values} == {"joint_acceleration"}
    assert values.components == task.coordinates
    assert values.units == tuple(f"{units[name]}/s^2" for name in task.coordinates)
    assert values.array.shape == task.q.shape
    assert solution.cost is not None
    assert solution.cost.wall_s > 0.0
    if not loaded.engine.cut:
        return
    assert task.tau is not None
    turned = States(task.coordinates[::-1], task.q[:, ::-1], task.v[:, ::-1], tau=task.tau[:, ::-1])
    other = loaded.ask(replace(pushed, task=turned)).values["joint_acceleration"]
    assert other.components == task.coordinates[::-1]
    assert np.array_equal(other.array[:, ::-1], values.array)


def test_states_with_accelerations_give_forces_of_the_tree(loaded: Loaded, pushed: Problem) -> None:
    task, scene = pushed.task, loaded.scene
    assert isinstance(task, States)
    if not loaded.engine.cut:
        with pytest.raises(ModelFileError, match="with the forces along them"):
            loaded.ask(replace(pushed, task=replace(task, tau=None, a=task.q)))
        return
    wanted = frozenset(("tree_force", "actuator_force"))
    loaded.has(*wanted)
    motion = loaded.ask(scene.problem([*MOTION, *wanted])).values
    a = motion["joint_acceleration"].pick(task.coordinates).array
    answer = loaded.ask(replace(pushed, applied=scene.applied, task=replace(task, tau=None, a=a), wanted=wanted))
    assert {*answer.values} == wanted
    for name in wanted:
        found, expected = answer.values[name], motion[name]
        assert (found.components, found.units) == (expected.components, expected.units)
        assert np.abs(found.array - expected.array).max() < LINEAR * np.abs(expected.array).max()


def test_states_of_other_coordinates_are_refused(loaded: Loaded, pushed: Problem) -> None:
    task = pushed.task
    assert isinstance(task, States)
    other = States(("x", *task.coordinates[1:]), task.q, task.v, tau=task.tau)
    with pytest.raises(ModelFileError, match="states of"):
        loaded.ask(replace(pushed, task=other))
