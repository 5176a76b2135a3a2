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
    """A tree that closes its own loops, and what its engine moves it by."""

    def __init__(self, closed: ClosedTree, dynamics: Dynamics) -> None:
        self.closed, self.dynamics = closed, dynamics

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Answers a problem.

        Raises:
            ScrewgaugeError: The problem does not fit the model, or cannot be solved.
        """
        closed, dynamics, task = self.closed, self.dynamics, problem.task
        for load in problem.applied.loads:
            if load.body not in closed.loops.index and load.body != GROUND:
                where = f"model of {closed.tree.engine}"
                raise ModelFileError(f"has no body '{load.body}'", where, "keep the names of the loops file")
        closed.tree.under(problem.applied.gravity)
        if isinstance(task, GivenMotion):
            return solve_motion(closed, problem, task, progress)
        if not isinstance(task, InitialValue):
            return solve_states(closed, dynamics, problem, task)
        if dynamics.dt is None:
            return simulate(closed, dynamics.mover(), problem, task, progress)
        return step_through(closed, dynamics.stepper(closed, problem, task), problem, task, dynamics.dt, progress)
