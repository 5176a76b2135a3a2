"""Accelerations of single states and small batches by traced programs; what these cannot answer is for the arrays."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.integrate import DOP853

from screwgauge.engines.methods import StagedDOP853
from screwgauge.engines.screw.programs import check_traceable, runner
from screwgauge.problem import InitialValue, Problem
from screwgauge.reference.closed.branch import BEND, Branch
from screwgauge.reference.closed.continuation import OPEN, ROUNDING
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.equations.closure import Loops
from screwgauge.reference.layout import Layout
from screwgauge.reference.linear import SINGULAR
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.forward import forward_programs
from screwgauge.reference.traced.native import Native
from screwgauge.reference.traced.scalars import Scalars
from screwgauge.reference.traced.stages import Buffers, Limits
from screwgauge.reference.traced.steps import GROW, LAST, SIZE, STEPS, TAKEN, TRIED, UNTIL, Stages, T
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.solution import Stopwatch

#: Steps of Newton's method, and the square of one, without dimension, after which the next would be rounding.
MOST, SETTLED = 10, 1e-20
#: Longest way to a predicted pose, on average of all coordinates [rad or lengths of the mechanism]; what lies farther
#: is reached in steps.
FARTHEST = 1.0
#: Shortest step on a long way, as a share of it.
SHORTEST = 2.0**-6
#: How much closer to a singular pose than `Integration.near` the estimate of the condition may put a state.
MARGIN = 1.5
#: So many states of good condition that a program could not answer make new pivots worth while, so often.
MISSED, AGAIN = 8, 3


class TracedForward:
    """Slopes of states (y, yd, work) by programs, each pose predicted from the one before.

    Attributes:
        stages: The same for whole steps, where there is machine code.
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
        self.by_array, self.made, self.setup, self.missed = 0, 0, 0.0, list[Array]()
        branch = Branch(lay, lay.mechanism.home)
        branch.move(task.start)
        self.poses = [branch.q.copy()]
        self._make()
        self.recall(branch.q, branch.K * branch.size[:, None] / branch.size[self.columns])

    def _make(self) -> None:
        """Makes the programs, pivots being chosen at the poses that are known to matter."""
        clock, lay, system = Stopwatch(), self.lay, home_equations(self.lay)
        programs = forward_programs(Loops(lay, system.fixed), self.applied, np.array(self.poses))
        (close, said), (respond, _) = (runner(p, self.backend, Scalars) for p in (programs.close, programs.respond))
        self.said = f"{said}; " if said else ""
        self.operations = len(programs.close.code) + len(programs.respond.code)
        self.dependent, d = [*programs.dependent], len(programs.dependent)
        self.columns, k = lay.mechanism.independent_columns, len(lay.mechanism.independent)
        self.width, s = getattr(respond, "width", 1), len(DOP853.C) + 1
        farthest, condition = FARTHEST * d**0.5, (self.near / MARGIN) ** 2
        self.limits = Limits(MOST, SETTLED, ROUNDING**2, OPEN**2, BEND, 1e-9, farthest, condition, SINGULAR)
        A, m, pose = np.zeros((s, s)), 2 * k + 1, np.zeros(k + d + d * k)
        A[:-1, :-1], A[-1, :-1] = DOP853.A, DOP853.B
        self.at = at = Buffers(
            given=np.zeros((programs.respond.inputs, self.width)),
            step=np.zeros((d + 2, self.width)),
            answer=np.zeros((len(programs.respond.outputs), self.width)),
            y=pose[:k],
            q=pose[k : k + d],
            K=pose[k + d :].reshape(d, k),
            size=system.size[self.dependent],
            state=np.zeros(m),
            pose=pose,
            start=np.zeros_like(pose),
            A=A,
            c=np.append(DOP853.C, 1.0),
            E=np.array([DOP853.E3, DOP853.E5]),
            slopes=np.zeros((s, m)),
            new=np.zeros(m),
            control=np.zeros(UNTIL + 1),
            log=np.zeros((STEPS, 1 + m + d)),
        )
        self.close = close.bind([at.given[: d + k]], [at.step])
        self.respond = respond.bind([at.given], [at.answer])
        self.stages: Stages | None = None
        if isinstance(close, Native) and isinstance(respond, Native):
            self.stages = Stages(close, respond, at, self.limits)
        self.made += 1
        self.setup += clock.cost().cpu_s

    def recall(self, q: Array, K: Array) -> None:
        """Predicts from a closed pose with its velocity map from now on. Shapes (n_q,), (n_q, k)."""
        self.at.y[:], self.at.q[:], self.at.K[:] = q[self.columns], q[self.dependent], K[self.dependent]

    def lend(self, branch: Branch) -> None:
        """Puts a branch to the pose that is predicted from."""
        q = branch.q.copy()
        q[self.columns], q[self.dependent] = self.at.y, self.at.q
        branch.put(q)

    def learn(self, q: Array, K: Array, condition: float) -> None:
        """Goes on from a pose that no program answered; if it closed it and its condition is good, it may ask for
        other pivots. `condition`: infinite where it did not."""
        self.by_array += 1
        if condition < self.near / MARGIN**2:
            self.missed.append(q)
        if len(self.missed) >= MISSED and self.made <= AGAIN:
            self.poses, self.missed = [*self.poses, *self.missed], []
            with suppress(NotTraceableError):  # no pivots keep their size at all these poses
                self._make()
        self.recall(q, K)

    def place(self, y: Array) -> bool:
        """Closes the loops at some independent coordinates; whether that is beyond doubt. Shape (k, m)."""
        at, limits, m = self.at, self.limits, y.shape[1]
        d, k = at.K.shape
        at.given[d : d + k, :m] = y
        if not d:
            return True
        way = at.K @ (y - at.y[:, None])
        at.given[:d, :m] = at.q[:, None] + way
        off, there = 0.0, False
        for _ in range(limits.most):
            self.close()
            moved, residual = at.step[d:, 0] if m == 1 else at.step[d:, :m].max(axis=1)
            if there := bool(residual <= limits.rounding):
                break
            at.given[:d, :m] += at.step[:d, :m]
            off += moved**0.5
            if there := bool(moved <= limits.settled):
                break
        far = float(np.linalg.norm(way / at.size[:, None], axis=0).max())
        near = off <= limits.bend * far + limits.slack and far <= limits.farthest
        return bool(there and near and residual <= limits.residual)

    def reach(self, y: Array) -> bool:
        """The same over a way that is too long for one prediction, in steps towards the first. Shape (k, m)."""
        if self.place(y):
            return True
        done, step, start = 0.0, 0.5, self.at.y.copy()
        while step >= SHORTEST:
            if self.place((start + (done + step) * (y[:, 0] - start))[:, None]):
                self.respond()
                self._go_on()
                if self.place(y):
                    return True
                done, step = done + step, min(2.0 * step, 0.5 * (1.0 - done - step))
            else:
                step *= 0.5
        return False

    def _go_on(self) -> None:
        """Predicts from the first of the states that were answered."""
        at, (d, k) = self.at, self.at.K.shape
        at.y[:], at.q[:], at.K[:] = at.given[d : d + k, 0], at.given[:d, 0], at.answer[k + 3 :, 0].reshape(d, k)

    def pose(self, y: Array) -> Array | None:
        """Joint coordinates of the closed pose, those of cut joints left out; None where there is a doubt. (n_q,)."""
        if not self.reach(y[:, None]):
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

    def walk(self, solver: StagedDOP853, until: float) -> bool:
        """Steps of DOP853 until one leads past a time [s] or is doubtful, see `Buffers.log`; whether there were any."""
        at, control = self.at, self.at.control
        at.state[:], at.slopes[0], at.start[:] = solver.y, solver.f, at.pose
        control[:] = solver.t, solver.h_abs, 0.0, 0.0, 0.0, GROW, solver.rtol, solver.atol, solver.t_bound, until
        past = bool(self.stages and self.stages.walk())
        solver.h_abs = control[SIZE]
        if not control[TAKEN]:
            return False
        solver.t, solver.h_previous, solver.y_old, solver.K[:] = control[T], control[LAST], at.state.copy(), at.slopes
        solver.y, solver.f = (at.new.copy(), at.slopes[-1].copy()) if past else (at.state.copy(), at.slopes[0].copy())
        return True

    def steps(self) -> tuple[int, list[tuple[float, Array, Array]]]:
        """Evaluations that the last steps took, and time, joint coordinates and yd after each."""
        at, rows, k = self.at, self.at.log[: int(self.at.control[TAKEN])], len(self.at.y)
        q = np.tile(self.lay.mechanism.home, (len(rows), 1))
        q[:, self.columns], q[:, self.dependent] = rows[:, 1 : 1 + k], rows[:, 2 + 2 * k :]
        after = [*zip(rows[:, 0].tolist(), q, rows[:, 1 + k : 1 + 2 * k].copy(), strict=True)]
        return int(at.control[TRIED]) * (len(at.slopes) - 1), after

    def slope(self, t: float, states: Array) -> Array | None:
        """Derivatives of states, one a column; None where one of them is doubtful. Shape (2 k + 1, n)."""
        at, (d, k), out = self.at, self.at.K.shape, np.empty_like(states)
        out[:k] = states[k:-1]
        at.given[-1] = t
        for first in range(0, states.shape[1], self.width):
            some = states[:-1, first : first + self.width]
            m = some.shape[1]
            if not (self.place if first else self.reach)(some[:k]):
                return None
            at.given[d:-1, :m] = some
            self.respond()
            found = at.answer[: k + 3, :m]
            condition, inertia = found[-2:, 0] if m == 1 else found[-2:].max(axis=1)
            if not (condition <= self.limits.condition and inertia <= self.limits.inertia):
                return None
            out[k:, first : first + m] = found[:-2]
            if not first:
                self._go_on()
        return out

    def notes(self) -> tuple[str, ...]:
        how = "machine code" if self.stages else "Python code"
        left = f"; {self.by_array} evaluations by the array solver" if self.by_array else ""
        return (
            f"{self.said}accelerations by a program of {self.operations} operations as {how}, "
            f"made in {self.setup:.2g} s of processor time that does not count as integration{left}",
        )
