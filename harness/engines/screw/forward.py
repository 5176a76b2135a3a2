"""Accelerations of single states and small batches by traced programs; what these cannot answer is for the arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.integrate import DOP853

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
from screwgauge.reference.traced.stages import Buffers, Limits, Stages
from screwgauge.reference.traced.vectors import vector
from screwgauge.solution import Stopwatch

#: Steps of Newton's method, and the square of one, without dimension, after which the next would be rounding.
MOST, SETTLED = 10, 1e-20
#: Longest way to a predicted pose [rad or lengths of the mechanism]; the array solver walks farther step by step.
FARTHEST = 1.0
#: How much closer to a singular pose than `Integration.near` the estimate of the condition may put a state.
MARGIN = 4.0
#: So many states of good condition that a program could not answer make new pivots worth while, so often.
MISSED, AGAIN = 8, 3


class TracedForward:
    """Slopes of states (y, yd, work) by programs, each pose predicted from the one before.

    Attributes:
        stages: The same for all stages of a step, where there is machine code.
        by_array: Evaluations that were left to the array solver.
        setup: What tracing and compiling took [s of processor time].
    """

    def __init__(self, lay: Layout, problem: Problem, task: InitialValue, backend: str) -> None:
        """Traces and compiles.

        Raises:
            NotTraceableError: There are no such programs.
            ClosureError: The loops cannot close at the start.
        """
        check_traceable(lay, replace(problem, wanted=frozenset()))
        near = task.integration.near
        self.lay, self.applied, self.backend, self.near = lay, problem.applied, backend, near
        self.limits = Limits(MOST, SETTLED, OPEN**2, BEND, 1e-9, FARTHEST, (near / MARGIN) ** 2, SINGULAR)
        self.by_array, self.made, self.setup, self.missed = 0, 0, 0.0, list[Array]()
        branch = Branch(lay, lay.mechanism.home)
        branch.move(task.start)
        self.poses = [branch.q.copy()]
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
        self.dependent, d = [*programs.dependent], len(programs.dependent)
        self.columns, k = lay.mechanism.independent_columns, len(lay.mechanism.independent)
        self.width, s = getattr(respond, "width", 1), len(DOP853.C) + 1
        A = np.zeros((s, s))
        A[:-1, :-1], A[-1, :-1] = DOP853.A, DOP853.B
        self.at = at = Buffers(
            given=np.zeros((programs.respond.inputs, self.width)),
            checks=np.zeros((2, self.width)),
            answer=np.zeros((len(programs.respond.outputs), self.width)),
            y=np.zeros(k),
            q=np.zeros(d),
            K=np.zeros((d, k)),
            size=system.size[self.dependent],
            state=np.zeros(2 * k + 1),
            A=A,
            c=np.append(DOP853.C, 1.0),
            slopes=np.zeros((s, 2 * k + 1)),
        )
        self.close = close.bind([at.given[: d + k]], [at.given[:d], at.checks])
        self.respond = respond.bind([at.given], [at.answer])
        self.stages = None if isinstance(respond, Scalars) else Stages(close, respond, at, self.limits)
        self.made += 1
        self.recall(branch)
        self.setup += clock.cost().cpu_s

    def recall(self, branch: Branch) -> None:
        """Predicts from the pose of a branch from now on."""
        at = self.at
        at.y[:], at.q[:] = branch.y, branch.q[self.dependent]
        at.K[:] = branch.K[self.dependent] * at.size[:, None] / branch.size[self.columns]

    def lend(self, branch: Branch) -> None:
        """Puts a branch to the pose that is predicted from."""
        q = branch.q.copy()
        q[self.columns], q[self.dependent] = self.at.y, self.at.q
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
        at, limits, m = self.at, self.limits, y.shape[1]
        d, k = at.K.shape
        at.given[d : d + k, :m] = y
        if not d:
            return True
        way = at.K @ (y - at.y[:, None])
        at.given[:d, :m] = at.q[:, None] + way
        off = 0.0
        for _ in range(limits.most):
            self.close()
            moved, residual = at.checks[:, 0] if m == 1 else at.checks[:, :m].max(axis=1)
            off += moved**0.5
            if not moved > limits.settled:
                break
        far = float(np.linalg.norm(way / at.size[:, None], axis=0).max())
        settled = moved <= limits.settled and residual <= limits.residual
        return bool(settled and off <= limits.bend * far + limits.slack and far <= limits.farthest)

    def pose(self, y: Array) -> Array | None:
        """Joint coordinates of the closed pose, those of cut joints left out; None where there is a doubt. (n_q,)."""
        if not self.place(y[:, None]):
            return None
        q = self.lay.mechanism.home.copy()
        q[self.columns], q[self.dependent] = y, self.at.given[: len(self.at.q), 0]
        return q

    def one(self, t: float, state: Array) -> Array | None:
        """Derivative of a state, None where it is doubtful. Shape (2 k + 1,)."""
        if self.stages is None:
            found = self.slope(t, state[:, None])
            return None if found is None else found[:, 0]
        self.at.state[:] = state
        return self.at.slopes[0].copy() if self.stages.run(t, 0.0, 0, 0) else None

    def step(self, t: float, state: Array, slope: Array, h: float) -> Array | None:
        """Slopes at all stages of a step of DOP853, None where one is doubtful. Shape (s, 2 k + 1)."""
        at = self.at
        at.state[:], at.slopes[0] = state, slope
        if self.stages is None or not self.stages.run(t, h, 1, len(at.slopes) - 1):
            return None
        return at.slopes

    def slope(self, t: float, states: Array) -> Array | None:
        """Derivatives of states, one a column; None where one of them is doubtful. Shape (2 k + 1, n)."""
        at, (d, k), out = self.at, self.at.K.shape, np.empty_like(states)
        out[:k] = states[k:-1]
        at.given[-1] = t
        for first in range(0, states.shape[1], self.width):
            some = states[:-1, first : first + self.width]
            m = some.shape[1]
            if not self.place(some[:k]):
                return None
            at.given[d:-1, :m] = some
            self.respond()
            found = at.answer[: k + 3, :m]
            condition, inertia = found[-2:, 0] if m == 1 else found[-2:].max(axis=1)
            if not (condition <= self.limits.condition and inertia <= self.limits.inertia):
                return None
            out[k:, first : first + m] = found[:-2]
            if d and not first:
                at.y[:], at.q[:], at.K[:] = at.given[d : d + k, 0], at.given[:d, 0], at.answer[k + 3 :, 0].reshape(d, k)
        return out

    def notes(self) -> tuple[str, ...]:
        how = "machine code" if self.stages else "Python code"
        left = f"; {self.by_array} evaluations by the array solver" if self.by_array else ""
        return (
            f"{self.said}accelerations by a program of {self.operations} operations as {how}, "
            f"made in {self.setup:.2g} s of processor time that does not count as integration{left}",
        )
