"""Simulation of a closed mechanism in all coordinates of an open tree, with scipy's methods or a fixed step.

`simulate` integrates (q, v, work) with an engine's accelerations. A pose that is singular for the independent
coordinates is regular for tree coordinates, so `Integration.near` is ignored. After every step, the smallest correction
onto the closed loops removes the remaining drift. `step_through` runs an engine's own integrator, or simple methods
with the engine's accelerations.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from screwgauge.engines.methods import (
    METHODS,
    MOST,
    SIZES,
    DryFriction,
    Pace,
    State,
    check_method,
    interpolate_linearly,
    keep_passed,
)
from screwgauge.engines.tree.applied_forces import TreeForces
from screwgauge.engines.tree.closed_states import Path, project, read_path
from screwgauge.engines.tree.closed_tree import ClosedTree
from screwgauge.engines.tree.inverse import solve_motion
from screwgauge.engines.tree.protocol import Mover, Stepper
from screwgauge.problem import GivenMotion, InitialValue, Problem, Progress, quiet
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed.continuation import PathEnd
from screwgauge.reference.closed.newton import OPEN
from screwgauge.reference.errors import ClosureError, DescriptionError, ScrewgaugeError, SingularPoseError
from screwgauge.reference.rotations import Array
from screwgauge.solution import Cost, Solution, Stopwatch, Values, empty

#: Number of recent steps whose largest size is used to pass a pose with unreliable accelerations, because steps may
#: have shrunk on approach to it.
RECENT = 10
#: A step of at least this fraction of the longest step counts as a step of usual size.
USUAL = 0.1
#: Finite-difference step for the slope's derivative in implicit methods [rad, m and per s].
DIFFERENCE = 1e-8


class _TreeRun:
    """State of an integration in progress."""

    def __init__(self, mover: Mover, forces: TreeForces) -> None:
        self.mover, self.forces = mover, forces
        self.n = len(mover.tree.coordinates)
        self.closed = bool(mover.tree.closures or mover.tree.couplings)
        self.tau = np.zeros(self.n)
        self.evaluations = 0
        self.drift = [0.0, 0.0]
        self.path = Path()
        self.work: list[float] = []
        self.friction = DryFriction(forces.closed.file.joints, self.rates, self.slope)

    def rates(self, state: Array, names: Sequence[str]) -> Array:
        """Return the rates of named joint coordinates in a state. Shape (m,)."""
        q, v = state[: self.n], state[self.n : -1]
        self.mover.place(q, v)
        return np.array([self.forces.readers[name](q, self.mover.body)[1] @ v for name in names])

    def check_moving(self, before: State, after: State, between: Callable[[float], Array] | None = None) -> None:
        """Reject a step in which a joint comes to rest and sticks due to dry friction.

        Args:
            between: Returns the state at a time within the step, by default linearly interpolated.

        Raises:
            ScrewgaugeError: A joint sticks.
        """
        if held := self.friction.holds(before, after, between or interpolate_linearly(before, after)):
            raise ScrewgaugeError(held, self.mover.tree.engine, "end the motion earlier")

    def slope(self, t: float, state: Array) -> Array:
        """Return the derivative of a state, with accelerations on the closed loops. Shape (2 n_v + 1,).

        With open loops, redundant rows contradict each other, and near a singular pose errors are divided by the
        distance to that pose. The step size would shrink to zero in response to this noise.
        """
        self.evaluations += 1
        n, out = self.n, np.empty_like(state)
        q, v = state[:n], state[n:-1]
        out[:n] = v
        if self.closed:
            q, v, _ = project(self.mover, q, v)
        else:
            self.mover.place(q, v)
        out[-1] = self.forces.act(t, q, v, self.mover.body, self.tau)
        out[n:-1] = self.mover.accelerate(self.tau)
        return out

    def jacobian(self, t: float, state: Array) -> Array:
        """Return the derivative of the slope by forward differences, except for parts that are constant.

        scipy's own method keeps enlarging the difference step of a coordinate that has no effect, such as a shaft's
        angle, until the step overflows.
        """
        n, out = self.n, np.zeros((len(state), len(state)))
        out[:n, n:-1] = np.eye(n)
        f = self.slope(t, state)
        for i in range(2 * n):
            moved = state.copy()
            moved[i] += DIFFERENCE * max(1.0, abs(moved[i]))
            out[n:, i] = (self.slope(t, moved) - f)[n:] / (moved[i] - state[i])
        return out

    def project_state(self, state: Array) -> Array:
        """Project a state onto the closed loops."""
        q, v, (gap, rate, left) = project(self.mover, state[: self.n], state[self.n : -1])
        if not left < OPEN:
            raise ClosureError(
                f"the loops stay open by {left:.3g}",
                self.mover.tree.engine,
                "integrate with a smaller tolerance",
            )
        self.drift = [max(self.drift[0], gap), max(self.drift[1], rate)]
        return np.concatenate([q, v, state[-1:]])

    def forget(self, t: float) -> None:
        """Drop the states after a time [s]."""
        self.path.cut(t)
        del self.work[len(self.path.wanted) :]

    def keep(self, t: float, state: Array) -> None:
        """Store a requested state with its accelerations and work."""
        state = self.project_state(state)
        q, v = state[: self.n].copy(), state[self.n : -1].copy()
        self.forces.act(t, q, v, self.mover.body, self.tau)
        self.path.add(t, q, v, self.mover.accelerate(self.tau))
        self.work.append(float(state[-1]))


def simulate(closed: ClosedTree, mover: Mover, problem: Problem, task: InitialValue, progress: Progress) -> Solution:
    """Integrate a motion with scipy's methods, using an engine's accelerations.

    Raises:
        ScrewgaugeError: The start, method or a force is invalid, or accelerations at the start are unreliable.
    """
    method = task.integration
    check_method(method.name)
    q, v = start_state(closed, task)
    run = _TreeRun(mover, TreeForces(closed, problem.applied, task.start))
    state = np.concatenate([q, v, [0.0]])
    run.keep(float(task.grid[0]), state)
    steps = _Steps(run, task, progress)
    stopped = steps.all(state) if len(task.grid) > 1 else ""
    notes = list(mover.notes)
    if run.closed:
        residual, rate = run.drift
        notes.append(
            f"the largest drift from the loops, removed after each step, was {residual:.1e} (m, rad), {rate:.1e} /s"
        )
    if steps.over:
        notes.append(f"{steps.over} steps were repeated with a different size because accelerations were unreliable")
    read, cost = read_path(closed, run.path, task.start), replace(steps.cost, evaluations=run.evaluations)
    setting = f"{method.name}, rtol {method.rtol:g}, atol {method.atol:g}; {mover.setting}"
    labels = closed.tree.engine, closed.tree.version, setting
    solution = read.solution(labels, closed.file.joints, task, np.array(run.work), cost, stopped)
    return replace(solution, notes=tuple(notes))


class _Steps:
    """Integrates through all requested times, and retries steps that fail.

    Attributes:
        over: Number of retried steps.
        cost: Cost of the steps.
    """

    def __init__(self, run: _TreeRun, task: InitialValue, progress: Progress) -> None:
        self.run, self.times, self.progress, self.over = run, task.grid, progress, 0
        self.name, self.cost = task.integration.name, Cost(0.0, 0.0)
        self.method = METHODS[self.name]
        self.options: dict[str, Any] = {"rtol": task.integration.rtol, "atol": task.integration.atol}
        if self.name != "DOP853":
            self.options["jac"] = run.jacobian
        # a multistep method stores earlier states that a correction would not change
        self.back = run.closed and self.name != "BDF"

    def _pace(self) -> Pace:
        return Pace(self.name, min(self.options["rtol"], self.options["atol"]), float(self.times[-1]))

    def all(self, state: Array) -> str:
        """Store the motion at every requested time; return why it stopped."""
        run, times, work = self.run, self.times, self.run.work
        taken = tries = 0
        recent: deque[float] = deque(maxlen=RECENT)
        clock, message = Stopwatch(), ""
        longest, back = 0.0, 0
        far: tuple[float, Array] | None = None  # the last state reached by a step of usual size
        pace = self._pace()
        solver, size = self.method(run.slope, times[0], state, times[-1], **self.options), None
        safe = solver.t, solver.y
        while len(work) < len(times):
            try:
                if size is not None:
                    solver = self.method(run.slope, *safe, times[-1], first_step=size, **self.options)
                message = solver.step()
                if solver.status == "failed":
                    break
                if pace.endless(solver.t) and solver.step_size < USUAL * longest:
                    if far is None or back == len(SIZES) or self.over == MOST:
                        message = f"steps have shrunk to {solver.step_size:.1g} s without progress"
                        break
                    safe, size, pace = far, min(longest * SIZES[back], times[-1] - far[0]), self._pace()
                    back, self.over = back + 1, self.over + 1
                    run.forget(far[0])
                    continue
                self._keep_passed(solver, safe, clock)
            except SingularPoseError as error:
                if tries == len(SIZES) or self.over == MOST:
                    message = f"no step size works; {error}"
                    break
                size = min(max(recent, default=solver.h_abs) * SIZES[tries], times[-1] - safe[0])
                tries, self.over = tries + 1, self.over + 1
                continue
            except ScrewgaugeError as error:
                message = str(error).rstrip(".")
                break
            taken, tries, size, safe = taken + 1, 0, None, (solver.t, solver.y)
            recent.append(solver.step_size)
            longest = max(longest, solver.step_size)
            if solver.step_size >= USUAL * longest:
                back, far = back if far and solver.t <= far[0] + longest else 0, (solver.t, solver.y)
            run.path.add(float(solver.t), solver.y[: run.n].copy(), solver.y[run.n : -1].copy())
            self.progress((solver.t - times[0]) / (times[-1] - times[0]))
        self.cost = clock.cost(steps=taken)
        return "" if len(work) == len(times) else f"t = {safe[0]:.6g} s: {message}"

    def _keep_passed(self, solver: Any, before: State, clock: Stopwatch) -> None:
        """Project the state onto the loops, and store the requested states that the step has passed."""
        run, times = self.run, self.times
        with clock.pause():
            between = solver.dense_output() if run.friction.names or times[len(run.work)] <= solver.t else None
            if between is not None:
                run.check_moving(before, (solver.t, solver.y), between)
        if self.back and solver.status == "running":
            solver.y = run.project_state(solver.y)
            solver.f = run.slope(solver.t, solver.y)
        with clock.pause():
            if between is not None:
                keep_passed(solver, between, times, run.work, run.keep)


def start_state(closed: ClosedTree, task: InitialValue) -> tuple[Array, Array]:
    """Return coordinates and velocities at the start, reached from the home pose. Shape (n_v,) each.

    Raises:
        ScrewgaugeError: Shapes are wrong, the loops cannot close at the start, or the start is singular.
    """
    k = len(closed.file.independent)
    for what, values in (("start", task.start), ("rates", task.rates)):
        if np.shape(values) != (k,):
            raise DescriptionError(
                f"{what} must have shape ({k},), got {np.shape(values)}",
                closed.file.mechanism,
                f"pass numbers for the {k} independent coordinates",
            )
    y, yd = task.start[None].astype(float), task.rates[None].astype(float)
    wanted = frozenset(("joint_position", "joint_velocity"))
    motion = GivenMotion(task.grid[:1].astype(float), y, yd, np.zeros_like(y))
    singular = SingularPoseError(
        "the independent coordinates do not determine the motion there",
        f"{closed.tree.engine}, start of {closed.file.mechanism}",
        "start elsewhere or choose other coordinates",
    )
    try:
        solution = solve_motion(closed, Problem(Applied(), motion, wanted), motion, quiet)
    except PathEnd as end:
        raise (singular if end.singular else end) from None
    q, v = (solution.values[name].pick(closed.tree.coordinates).array[0] for name in sorted(wanted))
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise singular
    return q.copy(), v.copy()


#: Longest interval between states at which angles of cut joints are followed [s].
OFTEN = 0.01
#: From this order on, the trapezoidal rule gives the work less accurately than the steps give the motion.
KNOWN = 4


def step_through(
    closed: ClosedTree, stepper: Stepper, problem: Problem, task: InitialValue, dt: float, progress: Progress
) -> Solution:
    """Step from the closed start through all requested times.

    Args:
        dt: Step [s], shortened so that steps end at the requested times.

    Returns:
        The stepper's unmodified states; loops that it leaves open are not closed. The trapezoidal rule over the steps
        yields the work, which is NaN if the steps are more accurate than this rule or if work is not requested.
    """
    times, forces = task.grid, TreeForces(closed, problem.applied, task.start)
    run = _TreeRun(stepper.mover, forces)
    # every step is examined unless only springs without dampers act
    known = stepper.work and (forces.stores_only or stepper.order < KNOWN)
    often = 0.0 if known and not forces.stores_only else OFTEN
    q, v = start_state(closed, task)
    path, clock, steps, stopped = Path(), Stopwatch(), 0, ""
    closing: list[Array] = []

    def keep(t: float, q: Array, v: Array) -> None:
        with clock.pause():
            a, pulls = stepper.accelerations(t)
            path.add(t, q, v, a)
            closing.append(pulls)

    stepper.begin(float(times[0]), q, v)
    keep(float(times[0]), q, v)
    for begin, end in pairwise(times.tolist()):
        n = max(1, int(np.ceil((end - begin) / dt - 1e-9)))
        h, block = (end - begin) / n, max(1, int(often / dt))
        done = 0
        try:
            while done < n:
                count = min(block, n - done)
                t, before = begin + done * h, (q, v)
                q, v = stepper.walk(t, h, count)
                done, steps = done + count, steps + count
                if run.friction.names:
                    ends = [np.concatenate([*each, [0.0]]) for each in (before, (q, v))]
                    with clock.pause():
                        run.check_moving((t, ends[0]), (begin + done * h, ends[1]))
                progress(float((begin + done * h - times[0]) / (times[-1] - times[0])))
                if not (np.isfinite(q).all() and np.isfinite(v).all()):
                    raise SingularPoseError("the state is no longer finite", closed.tree.engine, "use smaller steps")
                if done < n:
                    path.add(begin + done * h, q, v)
            keep(end, q, v)
        except ScrewgaugeError as error:
            stopped = f"t = {begin + done * h:.6g} s: {error}".rstrip(".")
            break
    cost = clock.cost(steps, steps * (KNOWN if stepper.order == KNOWN else 1))
    work, reactions = _work(stepper, forces, path) if known else empty(len(path.wanted)), None
    if "reaction" in problem.wanted and stepper.closing:
        reactions = Values(stepper.closing, ("N",) * len(stepper.closing), np.array(closing))
    labels, read = (closed.tree.engine, closed.tree.version, stepper.setting), read_path(closed, path, task.start)
    solution = read.solution(labels, closed.file.joints, task, work, cost, stopped, reactions)
    return replace(solution, notes=stepper.notes)


def _work(stepper: Stepper, forces: TreeForces, path: Path) -> Array:
    """Return the input work up to each requested state [J], integrated from the power at all states of the path."""
    if forces.stores_only:
        return np.zeros(len(path.wanted))
    tau, power, mover = np.zeros_like(path.q[0]), np.empty(len(path.t)), stepper.mover
    for i, (t, q, v) in enumerate(zip(path.t, path.q, path.v, strict=True)):
        mover.place(q, v)
        power[i] = forces.act(t, q, v, mover.body, tau)
    added = 0.5 * np.diff(path.t) * (power[1:] + power[:-1])
    return np.concatenate([[0.0], np.cumsum(added)])[path.wanted]
