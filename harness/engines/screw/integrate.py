"""Time integration in the independent coordinates, with scipy's methods and the accelerations of `equations.forward`.

Traced programs of the same equations evaluate most states, and the array solver evaluates the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853, OdeSolver

from screwgauge.engines.methods import MOST, SIZES, DryFriction, check_method, keep_passed
from screwgauge.engines.screw.forward import TracedForward
from screwgauge.problem import InitialValue, Progress, quiet
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.assembly_mode import BranchPose
from screwgauge.reference.closed.loops import read
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.equations.joint_types import SURE
from screwgauge.reference.errors import ClosureError, DescriptionError, ScrewgaugeError, SingularPoseError
from screwgauge.reference.graph import Layout
from screwgauge.reference.mobility import near_singularity
from screwgauge.reference.rotations import Array, follow
from screwgauge.solution import Cost, Stopwatch

#: Relative step of finite differences: the square root of the rounding error.
DIFFERENCE = 2.0**-26


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Result of an integration, at the requested times that were reached.

    Attributes:
        t: Times [s]. Shape (n,).
        rates: Closed poses and rates at these times.
        energy: Kinetic energy plus energy stored in gravity and springs [J]. Shape (n,).
        work: Work of actuators, motors, loads and dampers since the start [J]. Shape (n,).
        cost: Cost of the steps, excluding the output at the requested times.
        stepped_over: Number of steps retried with a different size because of a nearly singular pose.
        stopped: Why the motion ended early; empty if it reached the end.
    """

    t: Array
    rates: ClosedMotion
    energy: Array
    work: Array
    cost: Cost
    stepped_over: int
    stopped: str


class _Near(Exception):
    """Raised for a pose too close to a singular pose."""

    def __init__(self, lay: Layout, q: Array, condition: float) -> None:
        super().__init__(condition)
        self.lay, self.q, self.condition = lay, q, condition

    def __str__(self) -> str:
        """Build the message only on demand, because most such poses are stepped over."""
        mechanism = self.lay.mechanism
        where = mechanism.pose_text(self.q[mechanism.independent_columns])
        why = near_singularity(self.lay, self.q[None])
        return f"the pose {where} is nearly singular (condition {self.condition:.1e}): {why}"


class _Run:
    """Integration in progress; its states are (y, yd, work).

    Attributes:
        passed: Time, joint coordinates of the closed pose, and yd, for all requested states and for the ends of steps.
        wanted, work: Indices of the requested states in `passed`, and the work up to these states [J].
        taken, stepped_over: Number of steps taken, and number of retries with a different step size.
    """

    def __init__(
        self,
        lay: Layout,
        applied: Applied,
        times: Array,
        near: float,
        traced: TracedForward | None = None,
    ) -> None:
        self.lay, self.applied, self.times, self.near, self.traced = lay, applied, times, near, traced
        self.branch = BranchPose(lay, lay.mechanism.home)
        self.evaluations = self.taken = self.stepped_over = 0
        self.passed: list[tuple[float, Array, Array]] = []
        self.wanted: list[int] = []
        self.work: list[float] = []
        self.clock = Stopwatch()
        self.friction = DryFriction(lay.mechanism.joints, self.joint_rates, self.slope)

    def joint_rates(self, state: Array, names: Sequence[str]) -> Array:
        """Return the rates of named coordinates in a state. Shape (m,)."""
        columns = self.lay.mechanism.columns(names)
        return np.asarray(self.rates(0.0, state[None], None).joint_velocity[0, columns])

    def rates(self, t: float, states: Array, q: Array | None) -> ClosedMotion:
        """Return closed poses and rates of states (n, 2 k + 1); without `q`, the poses are found on the branch."""
        k = states.shape[1] // 2
        if q is not None:
            closed = read(self.lay, q[None])
        else:
            if self.traced is not None:
                self.traced.lend(self.branch)
            closed = self.branch.joints(states[:, :k])
        return motion_at(self.lay, closed, states[:, k:-1], applied=self.applied, t=t)

    def slope(self, t: float, state: Array) -> Array:
        """Return the derivative of a state. Shape (2 k + 1,)."""
        self.evaluations += 1
        slope = None if self.traced is None else self.traced.slope(t, state)
        return self._by_arrays(t, state[:, None])[:, 0] if slope is None else slope

    def _by_arrays(self, t: float, states: Array) -> Array:
        """Return derivatives of states, one per column, using the array solver on the branch. Shape (2 k + 1, n)."""
        k, alone = len(states) // 2, states.shape[1] == 1
        q = self.traced.close(states[:k, 0]) if self.traced is not None and alone else None
        at = self.rates(t, states.T, q)
        ydd, worst = at.ydd, int(np.argmax(at.condition))
        if at.condition[worst] > self.near:
            raise _Near(self.lay, at.q[worst], float(at.condition[worst]))
        if self.traced is not None:
            with self.clock.pause():  # the call may rebuild the programs
                self.traced.learn(at.q[0], at.joint_map[0], float(at.condition[0]) if q is not None else np.inf)
        return np.concatenate([states[k:-1], ydd.T, at.input_power[None]])

    def jacobian(self, t: float, state: Array) -> Array:
        """Differentiate `slope` by finite differences; the column of the work is zero. Shape (2 k + 1, 2 k + 1)."""
        m = len(state) - 1
        size = DIFFERENCE * np.maximum(np.abs(state[:m]), 1.0)
        around = np.column_stack([state, state[:, None] + np.vstack([np.diag(size), np.zeros(m)])])
        self.evaluations += 1
        traced = None if self.traced is None else self.traced.slopes(t, around)
        slopes = self._by_arrays(t, around) if traced is None else traced
        return np.column_stack([(slopes[:, 1:] - slopes[:, :1]) / size, np.zeros(m + 1)])

    def keep(self, t: float, state: Array) -> None:
        """Store a requested state."""
        self.reach(t, state)
        self.wanted.append(len(self.passed) - 1)
        self.work.append(float(state[-1]))

    def reach(self, t: float, state: Array) -> None:
        """Move to a state and remember its closed pose."""
        k = len(state) // 2
        q = None if self.traced is None else self.traced.close(state[:k])
        if q is None:
            if self.traced is not None:
                self.traced.lend(self.branch)
            self.branch.move(state[:k])
            q = self.branch.q.copy()
        self.passed.append((t, q, state[k:-1]))

    def steps(self, method: type[OdeSolver], state: Array, options: dict[str, Any], progress: Progress) -> str:
        """Step through all times; return why the integration stopped. Storing the motion is not timed."""
        times, tries = self.times, 0
        size: float | None = None
        try:
            solver = method(self.slope, times[0], state, times[-1], **options)
        except (_Near, ScrewgaugeError) as error:
            return f"the initial state is invalid: {error}"
        safe = solver.t, solver.y
        while len(self.work) < len(times):
            try:
                if size is not None:
                    solver, size = method(self.slope, *safe, times[-1], **{**options, "first_step": size}), None
                message = solver.step()
                with self.clock.pause():  # dense output may evaluate further states
                    between = solver.dense_output() if times[len(self.work)] <= solver.t else None
            except (_Near, ClosureError, SingularPoseError) as error:
                if tries == len(SIZES) or self.stepped_over == MOST:
                    return f"t = {safe[0]:.6g} s: no step size works; {error}"
                size = min((solver.step_size or solver.h_abs) * SIZES[tries], times[-1] - safe[0])
                tries, self.stepped_over = tries + 1, self.stepped_over + 1
                continue
            if solver.status == "failed":
                return f"t = {solver.t:.6g} s: {message}"
            before, safe = safe, (solver.t, solver.y)
            self.taken, tries = self.taken + 1, 0
            progress(float((solver.t - times[0]) / (times[-1] - times[0])))
            try:
                with self.clock.pause():
                    if self.friction.names and (held := self.friction.holds(before, safe, solver.dense_output())):
                        return f"t = {before[0]:.6g} s: {held}"
                    if between is not None:
                        keep_passed(solver, between, times, self.work, self.keep)
                    self.reach(*safe)
            except (_Near, ScrewgaugeError) as error:
                return f"t = {solver.t:.6g} s: {error}"
        return ""


def integrate(
    lay: Layout,
    task: InitialValue,
    applied: Applied,
    progress: Progress = quiet,
    traced: TracedForward | None = None,
) -> Trajectory:
    """Integrate the motion of a mechanism under given forces, starting on the branch of the home pose.

    Args:
        lay: Layout of the mechanism.
        applied: Applied forces.
        traced: Programs for the same forces; without them, the array solver evaluates all states.

    Raises:
        ScrewgaugeError: The method is unknown, shapes or times are invalid, or the start cannot be reached.
    """
    method, settings = check_method(task.integration.name), task.integration
    times, state = _check_task(lay, task)
    run = _Run(lay, applied, times, settings.near, traced)
    run.branch.move(task.start)
    begin = run.branch.q.copy()
    run.keep(float(times[0]), state)
    options: dict[str, Any] = {"rtol": settings.rtol, "atol": settings.atol}
    if method is not DOP853:
        options["jac"] = run.jacobian
    stopped = run.steps(method, state, options, progress)
    cost = run.clock.cost(run.taken, run.evaluations)
    whole = _sample_run(lay, run, begin)
    return Trajectory(
        t=times[: len(run.work)],
        rates=whole,
        energy=whole.energy,
        work=np.array(run.work),
        cost=cost,
        stepped_over=run.stepped_over,
        stopped=stopped,
    )


def _sample_run(lay: Layout, run: _Run, begin: Array) -> ClosedMotion:
    """Return closed poses and rates at the requested times.

    Args:
        begin: Joint coordinates at the start, from which angles of cut joints are followed. Shape (n_q,).
    """
    t, q, yd = (np.array(column) for column in zip(*run.passed, strict=True))
    if run.traced is not None and lay.cuts:
        q = read(lay, q)
        rate = motion_at(lay, q, yd)
        for c, joint in enumerate(lay.cuts):
            columns = [i for i in lay.columns[joint.name] if lay.turns[i]]
            sure = rate.charts[:, c] < SURE
            q[:, columns] = follow(begin[columns], q[:, columns], sure, t, rate.joint_velocity[:, columns])
    rows = np.array(run.wanted)
    return motion_at(lay, q[rows], yd[rows], applied=run.applied, t=t[rows])


def _check_task(lay: Layout, task: InitialValue) -> tuple[Array, Array]:
    """Return the times and the initial state; reject invalid values."""
    where, times, settings = lay.mechanism.name, task.grid, task.integration
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0.0).all() or not np.isfinite(times).all():
        raise DescriptionError("times must increase", where, "use at least two finite times in increasing order")
    if not (0.0 < settings.rtol < 1.0 and 0.0 < settings.atol < np.inf):
        raise DescriptionError(
            f"tolerances must be positive, and rtol below 1, not rtol = {settings.rtol:g}, atol = {settings.atol:g}",
            where,
            "use small positive numbers",
        )
    k = len(lay.mechanism.independent)
    for values in (task.start, task.rates):
        if np.shape(values) != (k,) or not np.isfinite(values).all():
            raise DescriptionError(
                f"start and rates must have shape ({k},) and be finite, got shape {np.shape(values)}",
                where,
                f"pass finite numbers for the {k} independent coordinates",
            )
    return times, np.concatenate([task.start, task.rates, [0.0]])
