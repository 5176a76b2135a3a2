"""The engine `screw`: runs the solver of `screwgauge.reference` on a mechanism description; supports every task."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from screwgauge import __version__
from screwgauge.engines.chunks import JointMotion
from screwgauge.engines.screw.inverse import solve_motion
from screwgauge.engines.screw.traced import solve_traced
from screwgauge.models.catalog import load_mechanism
from screwgauge.problem import GivenMotion, InitialValue, ModelFiles, Problem, Progress, States, check_fits, quiet
from screwgauge.quantities import FLOAT64, NUMBER_TYPES, joint_units
from screwgauge.reference import linear
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.forward import NewtonEuler
from screwgauge.reference.errors import ModelFileError, check_choice
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.solution import Solution, Stopwatch, Values

if TYPE_CHECKING:
    from screwgauge.engines.screw.forward import TracedForward
    from screwgauge.engines.screw.integrate import Trajectory

BACKENDS = ("array", "numpy", "llvm")
#: Number of samples above which tracing saves more time than it takes, for any built-in mechanism.
LONG = 2000


def load(files: ModelFiles, backend: str | None = None, precision: str = FLOAT64.name) -> ScrewModel:
    """Load a description; see `ScrewModel` for the settings."""
    lay = layout(load_mechanism(files.model))
    check_choice("precision", [precision], NUMBER_TYPES, "settings of screw")
    backends = BACKENDS if precision == FLOAT64.name else BACKENDS[1:]
    check_choice("backend", [backend or backends[0]], backends, "settings of screw")
    return ScrewModel(lay, str(files.model), backend=backend, precision=precision)


class ScrewModel:
    """A loaded mechanism, its layout, and the settings of its solver.

    Attributes:
        backend: Solver for given motions and simulations: ``array``, or a traced program run by ``numpy`` or ``llvm``.
            In simulations, ``numpy`` runs the program in Python. The default is ``llvm`` for simulations, ``numpy`` for
            given motions of at least `LONG` samples, and ``array`` for shorter motions.
        precision: Number type of the program; float32 works only for given motions, and not with backend ``array``.
    """

    def __init__(
        self, lay: Layout, where: str = "", *, backend: str | None = None, precision: str = FLOAT64.name
    ) -> None:
        self.lay, self.where, self.backend, self.precision = lay, where or lay.mechanism.name, backend, precision

    @property
    def independent(self) -> tuple[str, ...]:
        return tuple(self.lay.mechanism.independent)

    @property
    def lacks(self) -> dict[str, str]:
        """Quantities that the engine does not compute, each with the reason."""
        return {} if self.precision == FLOAT64.name else {"mass_matrix": "programs do not compute mass matrices"}

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Solve a problem.

        Raises:
            ScrewgaugeError: The problem belongs to a different description, or a pose cannot be solved.
        """
        check_fits(problem, self.lay.mechanism, self.where)
        problem = replace(problem, wanted=problem.wanted - {*self.lacks})
        if isinstance(problem.task, GivenMotion):
            return self._move(problem, problem.task, progress)
        if isinstance(problem.task, InitialValue):
            return self._simulate(problem, problem.task, progress)
        return self._accelerate(problem, problem.task)

    def _move(self, problem: Problem, task: GivenMotion, progress: Progress) -> Solution:
        """Solve a given motion with the array solver or with a program, depending on the settings."""
        kind = NUMBER_TYPES[self.precision]
        backend = self.backend or ("numpy" if len(task) >= LONG or kind is not FLOAT64 else "array")
        if backend == "array":
            return solve_motion(self.lay, problem, task, progress)
        return solve_traced(self.lay, problem, task, progress, (backend, kind))

    def _simulate(self, problem: Problem, task: InitialValue, progress: Progress) -> Solution:
        from screwgauge.engines.screw.integrate import integrate

        method = task.integration
        traced, notes = self._trace(problem, task)
        path = integrate(self.lay, task, problem.applied, progress, traced)
        reactions = self._reactions(path) if "reaction" in problem.wanted else None
        over = f"; {path.stepped_over} steps were resized near singular poses" if path.stepped_over else ""
        notes = (
            f"the independent coordinates were integrated; poses were followed on one branch{over}",
            *notes,
            *(traced.notes() if traced else ()),
        )
        read = JointMotion(path.rates.q, path.rates.joint_velocity, *self._joint_accelerations(problem, path))
        labels = "screw", __version__, f"{method.name}, rtol {method.rtol:g}, atol {method.atol:g}"
        joints = self.lay.mechanism.joints
        solution = read.solution(labels, joints, task, path.work, path.cost, path.stopped, reactions)
        return replace(solution, notes=notes)

    def _trace(self, problem: Problem, task: InitialValue) -> tuple[TracedForward | None, tuple[str, ...]]:
        """Return a program for the accelerations, or None, and notes on why there is none."""
        from screwgauge.engines.screw.forward import TracedForward

        if self.backend == "array":
            return None, ()
        try:
            return TracedForward(self.lay, problem, task, self.backend or "llvm"), ()
        except NotTraceableError as error:
            return None, (f"accelerations were computed by the array solver: {error.what}",)

    def _joint_accelerations(self, problem: Problem, path: Trajectory) -> tuple[Array, Array]:
        """Return accelerations of all joints, (n, n_q), and the condition number of the closed loops, (n,)."""
        at, accelerations = path.rates, np.full(path.rates.q.shape, np.nan)
        if (regular := at.condition < linear.SINGULAR).any():
            applied, t = problem.applied, path.t[regular]
            accelerations[regular] = motion_at(
                self.lay, at.q[regular], at.yd[regular], None, applied, t
            ).joint_acceleration
        return accelerations, at.condition

    def _reactions(self, path: Trajectory) -> Values:
        """Return all constraint forces, from the Newton-Euler system of all bodies."""
        whole = NewtonEuler(path.rates)
        return Values(whole.names, whole.units, whole.response()[1])

    def _accelerate(self, problem: Problem, task: States) -> Solution:
        """Solve for accelerations of closed states under given forces, using the whole Newton-Euler system."""
        mechanism = self.lay.mechanism
        if task.tau is None or task.coordinates != mechanism.coordinates:
            raise ModelFileError(
                "expected states of all joint coordinates with the forces along them", self.where, "pass q, v and tau"
            )
        clock, applied = Stopwatch(), replace(problem.applied, motors=())
        yd = task.v[:, mechanism.independent_columns]
        at = motion_at(self.lay, task.q, yd, applied=applied, joints=task.tau)
        qdd = NewtonEuler(at).response()[0]
        cost = clock.cost()
        units = tuple(f"{unit}/s^2" for unit in joint_units(mechanism.joints).values())
        values = {"joint_acceleration": Values(mechanism.coordinates, units, qdd)}
        return Solution("screw", __version__, values, at.condition, setting="whole Newton-Euler system", cost=cost)
