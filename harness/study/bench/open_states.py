"""Stress tests with states that violate loop closure: answers before and after closing the loops."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from screwgauge import __version__
from screwgauge.models.generate import write_models
from screwgauge.problem import Problem, States
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.graph import Layout, layout, spanning_tree
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.solution import TRUTH, Solution, Stopwatch, Values
from screwgauge.study.bench.question import (
    ACCELERATION,
    ENGINES,
    JUDGED,
    SCENE,
    SCREW,
    Question,
    closure_residuals,
    files_of,
    findings,
    scene_in_motion,
    tree_coordinates,
)
from screwgauge.study.bench.variants import variant
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import Reference, acceleration_problem
from screwgauge.study.solving import solve
from screwgauge.witness.joints import mechanism_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates

#: Baumgarte gains: critically damped, with the time constant of MuJoCo's default solref, 0.02 s.
GAINS = (1.0 / 0.02**2, 2.0 / 0.02)
HARD, PASSES = 0.9999, 7
FORWARD, TREE_FORCE, _SOFT_FORCE = "forward_acceleration", "tree_force", "tree_force_soft"
#: Proximal settings that are exact to rounding for loops of full rank.
_EXACT = {"mu": 1e-10, "iterations": 5}
_TAKEN = "the engine assumes that the state closes the loops: its answer is for a mechanism pulled apart by the gap"
_SPRINGS = f"{_TAKEN}; springs across the gap reduce it over time, but do not correct the answer"
_STIFF = "mj_inverse returns the force of its soft constraints: the gap times stiffness times apparent mass"
_SOFT = "soft constraints: (1 - d) / d of the constraint forces is missing, even for closed states"


def closure_violation(gap: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Yield questions about joint coordinates and velocities with closure errors as left by an integration."""
    scene = scene_in_motion(load_scene(SCENE), quick)
    mechanism, names, methods = scene.mechanism, tree_coordinates(scene.mechanism), tuple(map(Method, ENGINES))
    write_models(mechanism, folder, gravity=scene.applied.g)
    exact = TRUTH if find_spec("flint") else SCREW.engine
    solutions, _ = solve(scene, (*ENGINES, exact), JUDGED)
    true, files = Reference.by_size(exact, mechanism, solutions[exact].values), files_of(scene, folder)
    given = Question(mechanism, files, scene.problem(JUDGED), methods, ("generalized_force", "actuator_force"), true)
    for name in ENGINES:
        yield replace(given, methods=(Method(name, label=name if name == SCREW.engine else f"{name} projected"),))
    # an engine that is not installed still gets rows in the table
    closed = {name: _closed_states(solutions.get(name, solutions[exact]).values, names) for name in ENGINES}
    raw, right = pull_apart(scene, names, gap), _closed_states(true.values, names)
    reduced, every = variant("screw", reduced_equations), mechanism.coordinates
    yield _accelerations(given, reduced, _closed_states(solutions["screw"].values, every))
    yield _forces(given, Method("pinocchio", label="pinocchio raw"), raw)
    for label, states, more, cause in (
        ("projected", closed["pinocchio"], {}, ""),
        ("raw", raw, {}, _TAKEN),
        ("raw Baumgarte", raw, {"gains": GAINS}, _SPRINGS),
    ):
        yield _accelerations(given, Method("pinocchio", {**_EXACT, **more}, f"pinocchio {label}"), states, cause)
    yield _forces(given, Method("mujoco", label="mujoco raw"), raw)
    for method in (Method("mujoco", label="mujoco raw"), Method("mujoco", {"solimp": HARD}, f"mujoco raw d={HARD:g}")):
        yield _soft_forces(given, scene, method, raw)
        floor, question = (_accelerations(given, method, states) for states in (right, raw))
        at_rest, error = (next(findings(one)).error for one in (floor, question))
        yield replace(question, cause=_SOFT if at_rest > 0.5 * error else _SPRINGS)
    method = Method("mujoco", {"solimp": HARD, "passes": PASSES}, "mujoco projected")
    yield _accelerations(given, method, closed["mujoco"])


def pull_apart(scene: Scene, names: tuple[str, ...], gap: float) -> States:
    """Return states of the engines' tree whose cut joints are open by `gap` [m] and opening at `gap` [m/s].

    The independent coordinates and their velocities stay unchanged.

    Args:
        scene: Scene with the closed states.
        names: Coordinates of the tree.
    """
    mechanism, motion = scene.mechanism, scene.motion
    lay = spanning_tree(mechanism)  # tree of the model files
    system, q = loop_equations(lay), positions(layout(mechanism), motion.y, motion.t)
    m, tree, size = 3 * len(lay.cuts), system.unknown, system.sizes
    y, yd = (array / size[mechanism.independent_columns] for array in (motion.y, motion.yd))
    apart, parting = (gap / system.length * _direction((len(q), m), phase) for phase in (0.3, 1.1))
    z, goal = system.unknowns(q), np.concatenate([apart, np.zeros_like(y)], axis=1)
    for _ in range(3):  # Newton's method
        residual, A = system.evaluate(z, y)
        z = z + linear.solve(A, (goal - residual)[..., None])[..., 0]
    q, A = system.coordinates(z, q), system.evaluate(z, y)[1]
    v, w, at_rest = np.zeros_like(q), np.zeros_like(z), np.zeros_like(q)
    witness = mechanism_tree(mechanism, lay)
    for _ in range(3):  # fixed-point iteration, because the matrix is that of closed loops
        v[:, tree] = w * size[tree]
        moving = move(witness, TreeStates(q, v, at_rest))
        rate = closure_residuals(moving)[1].reshape(len(q), m)
        right = np.concatenate([parting - rate / system.length, yd - (A[:, m:] @ w[..., None])[..., 0]], axis=1)
        w = w + linear.solve(A, right[..., None])[..., 0]
    v[:, tree] = w * size[tree]
    columns = mechanism.columns(names)
    return States(names, q[:, columns], v[:, columns])


def _direction(shape: tuple[int, ...], phase: float) -> Array:
    """Return a pattern without symmetry, whose largest component is one in every sample."""
    pattern = np.cos(phase + 1.7 * np.arange(np.prod(shape, dtype=int))).reshape(shape)
    return np.asarray(pattern / np.abs(pattern).max(axis=1, keepdims=True))


def _closed_states(values: Mapping[str, Values], names: tuple[str, ...]) -> States:
    """Return the closed states for the given coordinates."""
    return States(names, *(values[name].pick(names).array for name in ("joint_position", "joint_velocity")))


def _forces(given: Question, method: Method, states: States) -> Question:
    """Ask for actuator forces at the true accelerations, from inverse dynamics of the open tree."""
    task = replace(states, a=given.right.values[ACCELERATION].pick(states.coordinates).array)
    problem = replace(given.problem, task=task, wanted=frozenset(("actuator_force",)))
    return replace(given, problem=problem, methods=(method,), quantities=("actuator_force",), cause=_TAKEN)


def _soft_forces(given: Question, scene: Scene, method: Method, states: States) -> Question:
    """Pose the question for `mj_inverse` with constraints, which exert no force in the closed reference state."""
    needed = solve(scene, (SCREW.engine,), (TREE_FORCE,))[0][SCREW.engine]
    question, right = _forces(given, method, states), Reference.by_size(SCREW.engine, scene.mechanism, needed.values)
    problem, read = replace(question.problem, wanted=frozenset((_SOFT_FORCE,))), partial(rename, has=_SOFT_FORCE)
    return replace(question, problem=problem, right=right, quantities=(TREE_FORCE,), read=read, cause=_STIFF)


def _accelerations(given: Question, method: Method, states: States, cause: str = "") -> Question:
    """Pose the question for accelerations under the true actuator forces."""
    mechanism, names, true = given.mechanism, states.coordinates, given.right
    q = np.zeros((len(states), len(mechanism.coordinates)))
    q[:, mechanism.columns(names)] = states.q
    values, scales = {FORWARD: true.values[ACCELERATION].pick(names)}, {FORWARD: true.scales[ACCELERATION]}
    return replace(
        given,
        problem=acceleration_problem(mechanism, given.problem.applied, states, q, true.values["actuator_force"].array),
        methods=(method,),
        quantities=(FORWARD,),
        right=replace(true, values=values, scales=scales),
        read=partial(rename, has=ACCELERATION),
        cause=cause,
    )


def reduced_equations(lay: Layout, problem: Problem) -> Solution:
    """Compute accelerations of closed states from the equations of the independent coordinates."""
    clock, mechanism, task = Stopwatch(), lay.mechanism, problem.task
    if not isinstance(task, States):
        raise TypeError("the task has no states")
    at = motion_at(lay, task.q, task.v[:, mechanism.independent_columns], applied=problem.applied, joints=task.tau)
    units = tuple(f"{unit}/s^2" for unit in mechanism.units)
    values = {ACCELERATION: Values(mechanism.coordinates, units, at.joint_acceleration)}
    return Solution("screw", __version__, values, at.condition, cost=clock.cost())


def rename(question: Question, solution: Solution, *, has: str) -> Mapping[str, Values]:
    """Return a quantity of a solution under the name that this stress case uses."""
    return {question.quantities[0]: solution.values[has]}
