"""Simulate with the fixed-step integrator of an engine that formulates constraints in its own coordinates."""

from __future__ import annotations

from math import ceil
from typing import Protocol

import numpy as np

from screwgauge.engines.chunks import JointMotion
from screwgauge.engines.kit.closing import Closing
from screwgauge.engines.kit.constrained import Constrained
from screwgauge.engines.kit.poses import follow_joints
from screwgauge.problem import GivenMotion, InitialValue, Problem, Progress, quiet
from screwgauge.reference.applied import JointSpring
from screwgauge.reference.errors import ModelFileError, ScrewgaugeError
from screwgauge.reference.resistance import resistances
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Stopwatch, empty

#: Fraction of a step by which rounding may lengthen an interval.
ROUNDED = 1e-9


class Stepped(Constrained, Protocol):
    """An engine with its own integrator."""

    def begin(self, x: Array, xd: Array) -> None:
        """Set the initial state: x and its rates, both of shape (n_x,)."""

    def walk(self, t: float, h: float, n: int) -> tuple[Array, Array]:
        """Take n steps of size h from time t; return x and its rates as arrays that later steps do not modify.

        Raises:
            ScrewgaugeError: The integration cannot continue.
        """


def solve_stepwise(
    labels: tuple[str, str, str], engine: Stepped, problem: Problem, dt: float, progress: Progress = quiet
) -> Solution:
    """Integrate from a closed initial pose, with steps that end at all requested times.

    Args:
        labels: Name and version of the engine, and a description of its method and settings.
        dt: Largest step [s].

    Raises:
        ModelFileError: The problem has couplings or forces along joints, which the engine does not support.
        ClosureError: The loops do not close in the initial pose, or no output time was reached.
    """
    task, mechanism, stopped, steps = problem.task, engine.mechanism, "", 0
    if not isinstance(task, InitialValue):
        raise TypeError(f"expected an initial value, got {type(task).__name__}")
    check_bodies_alone(problem, engine)
    closing = Closing(mechanism, engine.place, engine.home, engine.units, engine.gap_units)
    still = GivenMotion(np.array([task.since]), task.start[None], task.rates[None], 0.0 * task.rates[None])
    start, grid = closing.follow(still), task.grid
    engine.begin(start.x[0], start.xd[0])
    path, watch = [(start.x[0], start.xd[0])], Stopwatch()
    for t, after in zip(grid[:-1].tolist(), grid[1:].tolist(), strict=True):
        n = max(1, ceil((after - t) / dt * (1.0 - ROUNDED)))
        try:
            path.append(engine.walk(t, (after - t) / n, n))
        except ScrewgaugeError as error:
            stopped = f"at t = {t:g} s: {error.what}"
            break
        steps += n
        progress((after - grid[0]) / (grid[-1] - grid[0]))
    cost, (x, xd) = watch.cost(steps), (np.array(each) for each in zip(*path, strict=True))
    read = _read_joints(engine, problem, x, xd, start.q[0])
    return read.solution(labels, mechanism.joints, task, empty(len(x)), cost, stopped)


def check_bodies_alone(problem: Problem, engine: Constrained) -> None:
    """Reject couplings and forces along joints, which the engine's integrator does not support.

    Raises:
        ModelFileError: The problem has couplings or forces along joints.
    """
    mechanism, applied = engine.mechanism, problem.applied
    found = {
        "a coupling": any(not one.fixing for one in mechanism.couplings),
        "a fixed joint": any(joint.fixed for joint in mechanism.joints),
        "a rotor, damping or friction": bool(resistances(mechanism.joints)),
        "a motor": bool(applied.motors),
        "a time-varying load": any(load.courses for load in applied.loads),
        "a spring along a joint": any(isinstance(one, JointSpring) for one in applied.springs),
    }
    for what, there in found.items():
        if there:
            raise ModelFileError(
                f"has {what}, which the engine's integrator does not support", mechanism.name, "choose another engine"
            )


def _read_joints(engine: Constrained, problem: Problem, x: Array, xd: Array, before: Array) -> JointMotion:
    """Read joint coordinates from states, and compute their accelerations from the engine's equations."""
    at, n = engine.place(x), x.shape[1]
    unknown = np.full((len(x), len(before)), np.nan)
    joints = follow_joints(engine.mechanism, at.R, at.p, unknown, before)
    (bias, rest), (M, acting) = engine.bias(x, xd), engine.dynamics(x, xd, problem.applied)
    m = at.G.shape[1]
    system = np.zeros((len(x), n + m, n + m))
    system[:, :n, :n], system[:, n:, :n], system[:, :n, n:] = M, at.G, at.G.swapaxes(1, 2)
    right = np.concatenate([acting, -bias], axis=1)
    xdd = np.array([np.linalg.lstsq(A, b, rcond=1e-12)[0][:n] for A, b in zip(system, right, strict=True)])
    V, A = (np.asarray((at.T @ rates[:, None, :, None])[..., 0]) for rates in (xd, xdd))
    return JointMotion(joints.q, joints.rates(V), joints.accelerations(V, A + rest), np.ones(len(x)))
