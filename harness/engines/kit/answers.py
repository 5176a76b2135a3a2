"""Compute the quantities of a closed motion, name their components, and assemble a solution part by part."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from screwgauge.engines.chunks import assemble
from screwgauge.engines.error_estimate import SolvedPart
from screwgauge.engines.kit.acting import resistance
from screwgauge.engines.kit.closing import ClosedMotion
from screwgauge.engines.kit.poses import com_accelerations
from screwgauge.problem import GivenMotion, Problem, Progress, Rows, quiet
from screwgauge.quantities import description_names, length
from screwgauge.reference.applied import Applied
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Solution

#: Number of samples processed at a time.
PART = 256


@contextmanager
def temporary(owner: Any, **values: Any) -> Iterator[None]:
    """Set attributes of an object, such as a library's settings, within the context."""
    before = {name: getattr(owner, name) for name in values}
    try:
        for name, value in values.items():
            setattr(owner, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(owner, name, value)


def motion_values(wanted: Collection[str], closed: ClosedMotion, A: Array | None = None) -> dict[str, Array]:
    """Return the requested velocities or, if accelerations A of the bodies are given, the requested accelerations."""
    n, V = len(closed.x), closed.V
    known: dict[str, Callable[[], Array]] = {
        "joint_velocity": lambda: closed.qd,
        "body_angular_velocity": lambda: V[:, 1:, :3].reshape(n, -1),
    }
    if A is not None:
        qdd = closed.joints.accelerations(V, A)
        known = {
            "joint_acceleration": lambda: qdd,
            "body_angular_acceleration": lambda: A[:, 1:, :3].reshape(n, -1),
            "com_acceleration": lambda: com_accelerations(closed.mechanism, closed.at.R, V, A).reshape(n, -1),
            "resistance": lambda: resistance(closed.mechanism.joints, closed.qd, qdd),
        }
    return {name: value() for name, value in known.items() if name in wanted}


def force_values(closed: ClosedMotion, qdd: Array, Q: Array, f: Array, along: Array) -> dict[str, Array]:
    """Return the force quantities except reactions.

    Args:
        Q, f: Generalised forces, and actuator forces. Shapes (n, k), (n, n_actuator).
        along: Forces of motors, springs, dampers and friction along joints, see `along_joints`. Shape (n, n_q).
    """
    moments = along - closed.mechanism.rotors * qdd
    moments[:, closed.mechanism.actuated_columns] += f
    return {"generalized_force": Q, "actuator_force": f, "axis_moment": moments}


def inertia_values(closed: ClosedMotion, M: Array) -> dict[str, Array]:
    """Return the quantity ``mass_matrix``, see `inertia`."""
    whole = inertia(closed, M)
    return {"mass_matrix": whole[(..., *np.triu_indices(whole.shape[1]))]}


def inertia(closed: ClosedMotion, M: Array) -> Array:
    """Project an engine's mass matrix, which excludes rotors, onto the independent coordinates, and add the rotors.

    Shape (n, n_x, n_x) -> (n, k, k).
    """
    K, turned = closed.K, closed.J @ closed.K
    return np.asarray(K.swapaxes(1, 2) @ M @ K + (turned * closed.mechanism.rotors[:, None]).swapaxes(1, 2) @ turned)


def answer(
    labels: tuple[str, str, str],
    mechanism: Mechanism,
    problem: Problem,
    solve_part: Callable[[GivenMotion, Applied], SolvedPart],
    progress: Progress = quiet,
    clock: Clock | None = None,
) -> Solution:
    """Solve a given motion part by part; return the requested values with names and units.

    Args:
        labels: Name and version of the engine, and a description of its method and settings.
        solve_part: Solves one part of the motion, given its applied forces; called for all parts in order. Quantities
            that are not requested are dropped.
        clock: Measures the engine's stages.
    """

    def part(rows: slice) -> SolvedPart:
        solved = solve_part(*_part(problem, rows))
        return replace(solved, values={name: x for name, x in solved.values.items() if name in problem.wanted})

    n, size, clock = len(problem.task), (length(mechanism), mechanism.mass), clock or Clock()
    return assemble(labels, n, part, lambda: description_names(mechanism, problem.points), clock, progress, size, PART)


def _part(problem: Problem, rows: slice) -> tuple[GivenMotion, Applied]:
    """Select samples of a given motion and its applied forces.

    Raises:
        TypeError: The task is not a given motion.
    """
    task = problem.task
    if not isinstance(task, GivenMotion):
        raise TypeError(f"expected a given motion, got {type(task).__name__}")
    motion = task.part(rows)
    return motion, at_samples(problem.applied, rows).at(motion.t)


def at_samples(applied: Applied, rows: slice | Rows) -> Applied:
    """Select samples of the applied forces."""

    def some(vectors: Array) -> Array:
        return vectors[rows] if vectors.ndim == 2 else vectors

    loads = tuple(replace(load, force=some(load.force), torque=some(load.torque)) for load in applied.loads)
    return replace(applied, loads=loads)
