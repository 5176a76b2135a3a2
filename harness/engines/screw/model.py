"""The engine `screw`: the solver in `screwgauge.reference` on a description, for every kind of task."""

from __future__ import annotations

from typing import Any

import numpy as np

from screwgauge import __version__
from screwgauge.engines.parts import Simulated, joint_units
from screwgauge.engines.screw.integrate import Trajectory, integrate
from screwgauge.engines.screw.inverse import solve_motion
from screwgauge.engines.screw.variants import Variant, load_variant
from screwgauge.models.catalog import load_mechanism
from screwgauge.problem import GivenMotion, InitialValue, ModelFiles, Problem, Progress, States, quiet
from screwgauge.reference import linear
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.forward import Forces, forces_at, forward, forward_dense
from screwgauge.reference.kinematics import accelerations, velocities
from screwgauge.reference.pose import Layout, layout, pose
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Stopwatch, Values


def load(files: ModelFiles, **settings: Any) -> ScrewModel | Variant:
    """Loads a description; with settings, a variant of the solver, see `screwgauge.engines.screw.variants`."""
    lay = layout(load_mechanism(files.model))
    return load_variant(lay, **settings) if settings else ScrewModel(lay, str(files.model))


class ScrewModel:
    """A mechanism, laid out."""

    def __init__(self, lay: Layout, where: str = "") -> None:
        self.lay, self.where = lay, where or lay.mechanism.name

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Answers a problem.

        Raises:
            ScrewgaugeError: The description is not that of the problem, or a pose cannot be solved.
        """
        self._check(problem)
        if isinstance(problem.task, GivenMotion):
            return solve_motion(self.lay, problem, progress)
        if isinstance(problem.task, InitialValue):
            return self._simulate(problem, problem.task, progress)
        return self._accelerate(problem, problem.task)

    def _check(self, problem: Problem) -> None:
        mechanism, task = self.lay.mechanism, problem.task
        k = len(mechanism.independent)
        what, given = "", k
        if isinstance(task, GivenMotion):
            what, given = "motion", task.y.shape[1]
        elif isinstance(task, InitialValue):
            what, given = "start", len(task.start)
        if given != k:
            raise ModelFileError(
                f"has {k} independent coordinates, the {what} {given}",
                self.where,
                "name a description of the same mechanism",
            )
        for load in problem.applied.loads:
            if load.body not in mechanism.body_index:
                raise ModelFileError(f"has no body '{load.body}'", self.where, "keep the names of the scene")

    def _simulate(self, problem: Problem, task: InitialValue, progress: Progress) -> Solution:
        mechanism, method, clock = self.lay.mechanism, task.integration, Stopwatch()
        path = integrate(self.lay, task, lambda t: forces_at(mechanism, problem.applied, t), progress)
        cost = clock.cost(path.steps, path.evaluations)
        a, condition = self._joint_accelerations(problem, path)
        over = f", {path.stepped_over} steps resized near singular poses" if path.stepped_over else ""
        simulated = Simulated(
            q=path.rates.pose.q,
            v=path.rates.w,
            a=a,
            work=path.work,
            condition=condition,
            cost=cost,
            stopped=path.stopped,
            notes=(f"independent coordinates integrated, poses followed on one branch{over}",),
        )
        setting = f"{method.name}, rtol {method.rtol:g}, atol {method.atol:g}"
        return simulated.solution(("screw", __version__, setting), mechanism.joints, task)

    def _joint_accelerations(self, problem: Problem, path: Trajectory) -> tuple[Array, Array]:
        """Accelerations of all joint coordinates, shape (n, n_q), and the condition of the closed loops, shape (n,)."""
        condition = linear.condition(path.rates.A)
        ydd = np.full((len(path.t), path.rates.K.shape[2]), np.nan)
        for i in np.flatnonzero(condition < linear.SINGULAR):
            forces = forces_at(self.lay.mechanism, problem.applied, float(path.t[i]))
            ydd[i] = forward(self.lay, path.rates.sample(int(i)), forces).ydd[0]
        return accelerations(self.lay, path.rates, ydd)[0], condition

    def _accelerate(self, problem: Problem, task: States) -> Solution:
        """Accelerations of closed states for given forces, from the whole Newton-Euler system."""
        mechanism, applied = self.lay.mechanism, problem.applied
        if task.tau is None or task.coordinates != mechanism.coordinates:
            raise ModelFileError(
                "takes states of all joint coordinates with the forces along them", self.where, "give q, v and tau"
            )
        clock = Stopwatch()
        rate = velocities(self.lay, pose(self.lay, task.q), task.v[:, mechanism.independent_columns])
        forces = Forces(joints=task.tau, gravity=applied.g, loads=applied.loads, springs=applied.springs)
        qdd = forward_dense(self.lay, rate, forces).qdd
        cost = clock.cost()
        units = tuple(f"{unit}/s^2" for unit in joint_units(mechanism.joints).values())
        values = {"joint_acceleration": Values(mechanism.coordinates, units, qdd)}
        return Solution(
            "screw", __version__, values, linear.condition(rate.A), setting="whole Newton-Euler system", cost=cost
        )
