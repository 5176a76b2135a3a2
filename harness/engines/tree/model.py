"""A loaded model of an engine with an open tree, to which every kind of task can be put."""

from __future__ import annotations

from screwgauge.engines.tree.closed import ClosedTree
from screwgauge.engines.tree.fixed_steps import step_through
from screwgauge.engines.tree.integrate import simulate
from screwgauge.engines.tree.inverse import solve_motion
from screwgauge.engines.tree.protocol import Dynamics
from screwgauge.engines.tree.states import solve_states
from screwgauge.models.loops import LoopsFile, read_loops
from screwgauge.problem import GivenMotion, InitialValue, ModelFiles, Problem, Progress, quiet
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import GROUND
from screwgauge.solution import Solution


def loops_file(files: ModelFiles) -> LoopsFile:
    """Reads the loops file beside a model.

    Raises:
        ModelFileError: There is none, or it cannot be read.
    """
    if files.loops is None:
        raise ModelFileError("has no loops file", str(files.model), "put NAME.loops.toml beside it")
    return read_loops(files.loops)


class TreeModel:
    """A tree that closes its own loops.

    Attributes:
        dynamics: What its engine moves it by; None if that takes given motions only.
    """

    def __init__(self, closed: ClosedTree, dynamics: Dynamics | None = None) -> None:
        self.closed, self.dynamics = closed, dynamics

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Answers a problem.

        Raises:
            ScrewgaugeError: The problem does not fit the model, or cannot be solved.
        """
        closed, dynamics, task = self.closed, self.dynamics, problem.task
        self._check(problem)
        closed.tree.under(problem.applied.gravity)
        if isinstance(task, GivenMotion):
            return solve_motion(closed, problem, progress)
        if dynamics is None:
            raise ModelFileError("takes given motions only", self._where, "name another engine")
        if not isinstance(task, InitialValue):
            return solve_states(closed, dynamics, problem, task)
        if dynamics.dt is None:
            return simulate(closed, dynamics.mover(), problem, task, progress)
        return step_through(closed, dynamics.stepper(closed, problem, task), problem, task, dynamics.dt, progress)

    @property
    def _where(self) -> str:
        return f"model of {self.closed.tree.engine}"

    def _check(self, problem: Problem) -> None:
        """Refuses what belongs to another mechanism."""
        loops, task = self.closed.loops, problem.task
        for load in problem.applied.loads:
            if load.body not in loops.index and load.body != GROUND:
                raise ModelFileError(f"has no body '{load.body}'", self._where, "keep the names of the loops file")
        k = len(loops.independent)
        if isinstance(task, GivenMotion) and task.y.shape[1] != k:
            raise ModelFileError(
                f"has {k} independent coordinates, the motion {task.y.shape[1]}",
                self._where,
                "name a model of the same mechanism",
            )
