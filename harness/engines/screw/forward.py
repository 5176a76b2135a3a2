"""Computes accelerations of states with a traced program; the array solver handles doubtful states."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from screwgauge.engines.screw.programs import check_traceable, runner
from screwgauge.problem import InitialValue, Problem
from screwgauge.reference.closed.assembly_mode import BranchPose
from screwgauge.reference.closed.loops import home_equations
from screwgauge.reference.closed.newton import OPEN
from screwgauge.reference.graph import Layout
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.tracing import FORWARD_CHECKS, forward_program
from screwgauge.solution import Stopwatch

#: Largest number of times that the program continues from the last Newton iterate, and square of the dimensionless
#: step below which the next step would be at rounding level.
AGAIN, SETTLED = 4, 1e-20
#: Largest distance to a predicted pose, averaged over all coordinates [rad or mechanism lengths].
FARTHEST = 1.0
#: Checks of the quality of the predicted pose.
PREDICTED = [FORWARD_CHECKS.index(name) for name in ("moved", "residual", "far", "strayed")]
#: Numbers of pieces into which the straight path to a state is divided if a single prediction fails.
PIECES = (2, 4, 8)
#: A state is in doubt if its estimated condition number times this factor exceeds `Integration.near`.
MARGIN = 1.5
#: Number of well-conditioned states that the program may fail to solve before it gets new pivots, and the largest
#: number of times that it gets them.
MISSED, TIMES = 8, 3


class TracedForward:
    """Computes time derivatives of states (y, yd, work) with a program, and predicts each pose from the previous pose.

    Attributes:
        pose: Closed pose from which the next pose is predicted, see `forward_program`. Shape (d + d k + k, width).
        by_array: Number of evaluations left to the array solver.
        setup: CPU time spent on tracing and compiling [s].
    """

    def __init__(self, lay: Layout, problem: Problem, task: InitialValue, backend: str) -> None:
        """Trace and compile the program.

        Raises:
            NotTraceableError: No program covers the problem.
            ClosureError: The loops cannot be closed at the start.
        """
        check_traceable(lay, replace(problem, wanted=frozenset()))
        self.system, near = home_equations(lay), task.integration.near
        self.lay, self.applied, self.backend, self.near = lay, problem.applied, backend, near
        self.by_array, self.made, self.setup, self.missed = 0, 0, 0.0, list[Array]()
        branch = BranchPose(lay, lay.mechanism.home)
        branch.move(task.start)
        self.poses = [branch.q.copy()]
        self._make()
        self.recall(branch.q, branch.K)

    def _make(self) -> None:
        """Build the program, with pivots chosen at the poses collected so far."""
        clock, lay, loops = Stopwatch(), self.lay, self.system
        program, self.dependent = forward_program(loops, self.applied, np.array(self.poses))
        compiled, note = runner(program, self.backend)
        self.note = f"{note}; " if note else ""
        self.operations, self.columns = len(program.code), lay.mechanism.independent_columns
        k, width = len(self.columns), getattr(compiled, "width", 1)
        d = len(self.dependent)
        self.pose, self.state = np.zeros((d + d * k + k, width)), np.zeros((2 * k + 1, width))
        self.reached, self.answer = np.zeros_like(self.pose), np.zeros((k + 1, width))
        self.checks = np.zeros((len(FORWARD_CHECKS), width))
        limits = SETTLED, OPEN**2, (self.near / MARGIN) ** 2, SINGULAR, FARTHEST**2, 1.0
        #: Function that evaluates the states of all lanes; returns True if no state is in doubt.
        self.weights = 1.0 / np.array(limits)
        self.run = compiled.bind([self.pose, self.state], [self.answer, self.reached, self.checks], self.weights)
        self.made += 1
        self.setup += clock.cost().cpu_s

    def recall(self, q: Array, K: Array) -> None:
        """Predict the next poses from a closed pose and its velocity map. Shapes (n_q,), (n_q, k)."""
        self.pose[:] = np.concatenate([q[self.dependent], K[self.dependent].ravel(), q[self.columns]])[:, None]

    def _coordinates(self, q: Array) -> Array:
        """Write the coordinates of `pose` into q and return it. Shape (n_q,)."""
        q[self.columns], q[self.dependent] = self.pose[-len(self.columns) :, 0], self.pose[: len(self.dependent), 0]
        return q

    def lend(self, branch: BranchPose) -> None:
        """Move a branch to the pose from which the next pose is predicted."""
        branch.set_pose(self._coordinates(branch.q.copy()))

    def learn(self, q: Array, K: Array, condition: float) -> None:
        """Continue from a pose that the program could not solve.

        New pivots may be chosen at well-conditioned poses that the program closed; an infinite `condition` marks a
        pose that the program did not close.
        """
        self.by_array += 1
        if condition < self.near / MARGIN**2:
            self.missed.append(q)
        if len(self.missed) >= MISSED and self.made <= TIMES:
            self.poses, self.missed = [*self.poses, *self.missed], []
            with suppress(NotTraceableError):  # raised if no pivots are large enough at all these poses
                self._make()
        self.recall(q, K)

    def _evaluate(self) -> bool:
        """Run the program on all lanes, in smaller steps if needed; return True if no state is in doubt."""
        if self._settle():
            return True
        doubts = (self.checks * self.weights[:, None]).max(axis=1)
        if doubts[PREDICTED].sum() <= 1.0:  # the pose itself is in doubt
            return False
        k, start, goal = len(self.columns), self.pose.copy(), self.state.copy()
        begin, way = start[-k:], goal[:k] - start[-k:]
        for pieces in PIECES:
            ways = (begin + way * (i / pieces) for i in range(1, pieces))
            if all(self._settle_at(y) for y in ways) and self._settle_at(goal[:k]):
                return True
            self.pose[:] = start
        self.state[:] = goal
        return False

    def _settle_at(self, y: Array) -> bool:
        """Run the program on states with coordinates y, shape (k, width); return True if no state is in doubt."""
        self.state[: len(y)] = y
        return self._settle()

    def _settle(self) -> bool:
        """Run the program until Newton's method converges; return True if no state is in doubt."""
        if self.run():
            self.pose[:] = self.reached
            return True
        moved, residual, condition, inertia, far, strayed = (self.checks * self.weights[:, None]).max(axis=1)
        rest, before = condition + inertia + far + strayed <= 1.0, self.pose.copy()
        for _ in range(AGAIN):
            if not (rest and np.isfinite(moved + residual)):
                break
            self.pose[:] = self.reached  # continue from the last Newton iterate
            if self.run():
                self.pose[:] = self.reached
                return True
        self.pose[:] = before
        return False

    def close(self, y: Array) -> Array | None:
        """Return coordinates of the closed pose, with home values for cut joints; None if it is in doubt. (n_q,)."""
        k, before = len(self.columns), self.pose.copy()
        self.state[:k], self.state[k:] = y[:, None], 0.0
        fine = self._evaluate()
        q = self._coordinates(self.lay.mechanism.home.copy())
        self.pose[:] = before
        return q if fine else None

    def slope(self, t: float, state: Array) -> Array | None:
        """Return the derivative of a state; None if the state is in doubt. Shape (2 k + 1,)."""
        k = len(self.columns)
        self.state[:-1], self.state[-1] = state[:-1, None], t
        return np.concatenate([state[k:-1], self.answer[:, 0]]) if self._evaluate() else None

    def slopes(self, t: float, states: Array) -> Array | None:
        """Return the derivatives of states, one column each; None if a state is in doubt. Shape (2 k + 1, n)."""
        k, out, width = len(self.columns), np.empty_like(states), self.state.shape[1]
        out[:k], self.state[-1] = states[k:-1], t
        before, ahead = self.pose[:, :1].copy(), None
        for first in range(0, states.shape[1], width):
            some = states[:-1, first : first + width]
            m = some.shape[1]
            self.state[:-1, :m], self.state[:-1, m:], self.pose[:] = some, some[:, :1], before
            if not self._evaluate():
                self.pose[:] = before
                return None
            out[k:, first : first + m] = self.answer[:, :m]
            ahead = self.pose[:, :1].copy() if ahead is None else ahead
        self.pose[:] = ahead  # the next poses are predicted from the first
        return out

    def notes(self) -> tuple[str, ...]:
        """Describe how accelerations were computed."""
        left = f"; {self.by_array} evaluations were left to the array solver" if self.by_array else ""
        return (
            f"{self.note}accelerations were computed by a program of {self.operations} operations, "
            f"whose tracing and compiling took {self.setup:.2g} s of CPU time, not counted as integration{left}",
        )
