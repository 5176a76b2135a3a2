"""Accelerations of single states and small batches by traced programs; what these cannot answer is for the arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite

import numpy as np

from screwgauge.engines.screw.programs import check_traceable, runner
from screwgauge.problem import InitialValue, Problem
from screwgauge.reference.branch import BEND, Branch
from screwgauge.reference.continuation import OPEN
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.pose import Layout
from screwgauge.reference.resting import home_equations
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.equations import Question
from screwgauge.reference.traced.forward import forward_programs
from screwgauge.reference.traced.scalars import Scalars
from screwgauge.reference.traced.vectors import vector
from screwgauge.solution import Stopwatch

#: Steps of Newton's method, and the square of one, without dimension, after which the next would be rounding.
MOST, SETTLED = 10, 1e-20
#: Longest way to a predicted pose [rad or lengths of the mechanism]; the array solver walks farther step by step.
FARTHEST = 1.0
#: How much closer to a singular pose than `Integration.near` the estimate of the condition may put a state.
MARGIN = 30.0
#: So many states of good condition that a program could not answer make new pivots worth while, so often.
MISSED, AGAIN = 8, 3


class TracedForward:
    """Slopes of states (y, yd, work) by programs, each pose predicted from the one before.

    Attributes:
        by_array: States that were left to the array solver.
        setup: What tracing and compiling took [s of processor time].
        said: What is to be said about the programs.
    """

    def __init__(self, lay: Layout, problem: Problem, task: InitialValue, backend: str) -> None:
        """Traces and compiles.

        Raises:
            NotTraceableError: There are no such programs.
            ClosureError: The loops cannot close at the start.
        """
        check_traceable(lay, replace(problem, wanted=frozenset()))
        near = task.integration.near
        self.lay, self.applied, self.backend = lay, problem.applied, backend
        self.near, self.by_array, self.setup = near, 0, 0.0
        self.clear = (near / MARGIN) ** 2
        branch = Branch(lay, lay.mechanism.home)
        branch.move(task.start)
        self.poses, self.missed, self.made = [branch.q.copy()], list[Array](), 0
        self._make(branch)

    def _make(self, branch: Branch) -> None:
        """Makes the programs, pivots being chosen at the poses that are known to matter."""
        clock, lay, system = Stopwatch(), self.lay, home_equations(self.lay)
        sizes = [*map(float, system.size)]
        question = Question(lay, system.fixed, sizes, system.length, vector(self.applied.g), ())
        programs = forward_programs(question, self.applied, np.array(self.poses))
        (close, said), (respond, _) = (runner(p, self.backend, Scalars) for p in (programs.close, programs.respond))
        self.said = f"{said}; " if said else ""
        self.operations = len(programs.close.code) + len(programs.respond.code)
        self.dependent, k, d = [*programs.dependent], len(lay.mechanism.independent), len(programs.dependent)
        self.columns, self.k, self.width = lay.mechanism.independent_columns, k, getattr(respond, "width", 1)
        given = np.zeros((programs.respond.inputs, self.width))
        self.q, self.y, self.yd, self.motors = np.split(given, [d, d + k, d + 2 * k])
        self.state = given[d : d + 2 * k]
        for row, motor in zip(self.motors, self.applied.motors, strict=True):
            row[:] = motor.force(0.0)
        self.changing = [(i, motor) for i, motor in enumerate(self.applied.motors) if not motor.constant]
        self.checks, self.answer = np.empty((2, self.width)), np.empty((len(programs.respond.outputs), self.width))
        self.map = self.answer[k + 3 :, 0].reshape(d, k)
        self.close = close.bind([given[: d + k]], [self.q, self.checks])
        self.respond = respond.bind([given], [self.answer])
        self.size = system.size[self.dependent][:, None]
        self.made += 1
        self.recall(branch)
        self.setup += clock.cost().cpu_s

    def recall(self, branch: Branch) -> None:
        """Predicts from the pose of a branch from now on."""
        size = branch.size
        self.y0, self.q0 = branch.y[:, None].copy(), branch.q[self.dependent][:, None]
        self.K = branch.K[self.dependent] * size[self.dependent][:, None] / size[self.columns]

    def lend(self, branch: Branch) -> None:
        """Puts a branch to the last closed pose."""
        q = branch.q.copy()
        q[self.columns], q[self.dependent] = self.y0[:, 0], self.q0[:, 0]
        branch.put(q)

    def learn(self, branch: Branch, condition: float) -> None:
        """Goes on from a pose that no program answered; if its condition is good, it may ask for other pivots."""
        self.recall(branch)
        self.by_array += 1
        if condition > self.near / MARGIN**2:
            return
        self.missed.append(branch.q.copy())
        if len(self.missed) >= MISSED and self.made <= AGAIN:
            self.poses += self.missed
            self.missed = []
            self._make(branch)

    def place(self, y: Array) -> bool:
        """Closes the loops at some independent coordinates; whether that is beyond doubt. Shape (k, m)."""
        m = y.shape[1]
        self.y[:, :m] = y
        if not self.dependent:
            return True
        way = self.K @ (y - self.y0)
        self.q[:, :m] = self.q0 + way
        off = 0.0
        for _ in range(MOST):
            self.close()
            moved, residual = self.checks[:, 0] if m == 1 else self.checks[:, :m].max(axis=1)
            off += moved**0.5
            if not moved > SETTLED:
                break
        far = float(np.abs(way / self.size).max())
        return moved <= SETTLED and residual <= OPEN**2 and off <= BEND * far + 1e-9 and far <= FARTHEST

    def pose(self, y: Array) -> Array | None:
        """Joint coordinates of the closed pose, those of cut joints left out; None where there is a doubt. (n_q,)."""
        if not self.place(y[:, None]):
            return None
        q = self.lay.mechanism.home.copy()
        q[self.columns], q[self.dependent] = y, self.q[:, 0]
        return q

    def slope(self, t: float, states: Array) -> Array | None:
        """Derivatives of states, one a column; None where one of them is doubtful. Shape (2 k + 1, n)."""
        k, out = self.k, np.empty_like(states)
        out[:k] = states[k:-1]
        for i, motor in self.changing:
            self.motors[i] = motor.force(t)
        for first in range(0, states.shape[1], self.width):
            some = states[:-1, first : first + self.width]
            m = some.shape[1]
            if not self.place(some[:k]):
                return None
            self.state[:, :m] = some
            self.respond()
            found = self.answer[: k + 3, :m]
            condition, inertia = found[-2:, 0] if m == 1 else found[-2:].max(axis=1)
            if not (condition <= self.clear and inertia <= SINGULAR):
                return None
            out[k:, first : first + m] = found[:-2]
            if self.dependent and not first:
                self.y0, self.q0, self.K = self.y[:, :1].copy(), self.q[:, :1].copy(), self.map.copy()
        return out if isfinite(out.sum()) else None

    def notes(self) -> Sequence[str]:
        how = "machine code" if self.width > 1 else "Python code"
        left = f", {self.by_array} evaluations by the array solver" if self.by_array else ""
        return (
            f"{self.said}accelerations by a program of {self.operations} operations as {how}, "
            f"made in {self.setup:.2g} s of processor time before and beside the steps{left}",
        )
