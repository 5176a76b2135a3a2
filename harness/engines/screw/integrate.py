"""Time integration on the independent coordinates: scipy's methods on accelerations of `reference.forward`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853, OdeSolver

from screwgauge.engines.methods import MOST, SIZES, check_method
from screwgauge.problem import InitialValue, Progress, quiet
from screwgauge.reference.branch import Branch
from screwgauge.reference.errors import (
    ClosureError,
    DescriptionError,
    ScrewgaugeError,
    SingularPoseError,
)
from screwgauge.reference.forward import Forces, energy, forward, power
from screwgauge.reference.kinematics import Velocities, velocities
from screwgauge.reference.pose import Layout, Pose, pose
from screwgauge.reference.rotations import Array
from screwgauge.reference.singular import near_singularity

#: Relative step of differences: the root of the rounding error.
DIFFERENCE = 2.0**-26


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """An integrated motion at the times asked for, as far as it came.

    Attributes:
        t: Times [s]. Shape (n,).
        rates: Closed poses and rates there.
        energy: Kinetic energy and that stored in gravity and springs [J]. Shape (n,).
        work: What actuators, motors, loads and dampers have put in since the start [J]. Shape (n,).
        steps, evaluations: How many steps were taken, and accelerations computed.
        stepped_over: Steps whose size was changed because they met a nearly singular pose.
        stopped: Why it ended early, empty if it did not.
    """

    t: Array
    rates: Velocities
    energy: Array
    work: Array
    steps: int
    evaluations: int
    stepped_over: int
    stopped: str


class _Near(Exception):
    """A pose too close to a singular one."""

    def __init__(self, lay: Layout, at: Pose, condition: float) -> None:
        super().__init__(condition)
        self.lay, self.at, self.condition = lay, at, condition

    def __str__(self) -> str:
        """Worked out only when it is to be read: most such poses are stepped over."""
        mechanism = self.lay.mechanism
        pose = mechanism.described(self.at.q[0, mechanism.independent_columns])
        return (
            f"the pose {pose} is nearly singular (condition {self.condition:.1e}): "
            f"{near_singularity(self.lay, self.at)}"
        )


class _Run:
    """The motion while it is integrated; the state is (y, yd, work)."""

    def __init__(self, lay: Layout, forces: Callable[[float], Forces], q: Array, near: float) -> None:
        self.lay, self.forces, self.near = lay, forces, near
        self.branch = Branch(lay, q)
        self.evaluations = 0

    def rates(self, states: Array) -> Velocities:
        """Closed poses and rates of states, shape (n, 2 k + 1)."""
        k = states.shape[1] // 2
        return velocities(self.lay, self.branch.poses(states[:, :k]), states[:, k:-1])

    def slope(self, t: float, states: Array) -> Array:
        """Derivatives of states, one a column as scipy's methods give them. Shape (2 k + 1, n)."""
        self.evaluations += 1
        k = len(states) // 2
        forces, rate = self.forces(t), self.rates(states.T)
        found = forward(self.lay, rate, forces)
        if (found.condition > self.near).any():
            worst = int(np.argmax(found.condition))
            raise _Near(self.lay, rate.pose.rows([worst]), float(found.condition[worst]))
        return np.concatenate([states[k:-1], found.ydd.T, power(self.lay, rate, forces)[None]])

    def jacobian(self, t: float, state: Array) -> Array:
        """Derivative of `slope` at one state by differences; nothing depends on the work. Shape (2 k + 1, 2 k + 1)."""
        m = len(state) - 1
        size = DIFFERENCE * np.maximum(np.abs(state[:m]), 1.0)
        around = np.column_stack([state, state[:, None] + np.vstack([np.diag(size), np.zeros(m)])])
        slopes = self.slope(t, around)
        return np.column_stack([(slopes[:, 1:] - slopes[:, :1]) / size, np.zeros(m + 1)])


def integrate(
    lay: Layout,
    task: InitialValue,
    forces: Forces | Callable[[float], Forces],
    progress: Progress = quiet,
) -> Trajectory:
    """Integrates a mechanism under given forces; the start is reached from home on one branch.

    Args:
        lay: The mechanism.
        forces: What acts on it, constant or a function of time.

    Raises:
        ScrewgaugeError: Unknown method, wrong shapes or times, or a start that cannot be.
    """
    solver, settings = check_method(task.integration.name), task.integration
    times, state = _checked(lay, task)
    at_any_time = forces if callable(forces) else lambda _: forces
    near = settings.near
    run = _Run(lay, at_any_time, lay.mechanism.home, near)
    kept = _Kept([run.rates(state[None])], [0.0])
    options: dict[str, Any] = {"rtol": settings.rtol, "atol": settings.atol, "vectorized": True}
    if solver is not DOP853:
        options["jac"] = run.jacobian
    counts, stopped = _steps(run, solver, times, state, kept, options, progress)
    n, parts = len(kept.rates), kept.rates
    q, w = np.concatenate([r.pose.q for r in parts]), np.concatenate([r.w for r in parts])
    whole = velocities(lay, pose(lay, q), w[:, lay.mechanism.independent_columns])
    return Trajectory(
        t=times[:n],
        rates=whole,
        energy=energy(lay, whole, at_any_time(float(times[0]))),
        work=np.array(kept.work),
        steps=counts[0],
        evaluations=run.evaluations,
        stepped_over=counts[1],
        stopped=stopped,
    )


@dataclass(frozen=True, slots=True)
class _Kept:
    """The motion at the times wanted, as far as it came: closed poses with rates, and the work until then [J]."""

    rates: list[Velocities]
    work: list[float]

    def __len__(self) -> int:
        return len(self.work)


def _steps(
    run: _Run,
    method: type[OdeSolver],
    times: Array,
    state: Array,
    kept: _Kept,
    options: dict[str, Any],
    progress: Progress,
) -> tuple[tuple[int, int], str]:
    """Steps through all times and keeps the motion there. Returns (steps, stepped over) and why it stopped."""
    taken = stepped_over = tries = 0
    size: float | None = None
    try:
        solver = method(run.slope, times[0], state, times[-1], **options)
    except (_Near, ScrewgaugeError) as error:
        return (0, 0), f"the start cannot be: {error}"
    while len(kept) < len(times):
        try:
            if size is not None:
                solver = method(run.slope, solver.t, solver.y, times[-1], first_step=size, **options)
                size = None
            message = solver.step()
        except (_Near, ClosureError, SingularPoseError) as error:
            if tries == len(SIZES) or stepped_over == MOST:
                return (taken, stepped_over), f"t = {solver.t:.6g} s: no step leads on; {error}"
            usual = solver.step_size or solver.h_abs
            size = min(usual * SIZES[tries], times[-1] - solver.t)
            tries, stepped_over = tries + 1, stepped_over + 1
            continue
        if solver.status == "failed":
            return (taken, stepped_over), f"t = {solver.t:.6g} s: {message}"
        taken, tries = taken + 1, 0
        progress(float((solver.t - times[0]) / (times[-1] - times[0])))
        try:
            _keep(run, solver, times, kept)
        except (_Near, ScrewgaugeError) as error:
            return (taken, stepped_over), f"t = {solver.t:.6g} s: {error}"
    return (taken, stepped_over), ""


def _keep(run: _Run, solver: OdeSolver, times: Array, kept: _Kept) -> None:
    """Keeps the motion at all times that the last step passed."""
    if times[len(kept)] > solver.t:
        return
    between = solver.dense_output()
    while len(kept) < len(times) and times[len(kept)] <= solver.t:
        t = times[len(kept)]
        state = solver.y if t == solver.t else between(t)
        kept.rates.append(run.rates(state[None]))
        kept.work.append(float(state[-1]))
    run.branch.move(solver.y[: len(solver.y) // 2])


def _checked(lay: Layout, task: InitialValue) -> tuple[Array, Array]:
    """Times, and the state at the start."""
    where, times, settings = lay.mechanism.name, task.grid, task.integration
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0.0).all() or not np.isfinite(times).all():
        raise DescriptionError("times do not increase", where, "give two or more finite times in order")
    if not (0.0 < settings.rtol < 1.0 and 0.0 < settings.atol < np.inf):
        raise DescriptionError(
            f"tolerances rtol = {settings.rtol:g}, atol = {settings.atol:g}", where, "give small positive numbers"
        )
    k = len(lay.mechanism.independent)
    for values in (task.start, task.rates):
        if np.shape(values) != (k,) or not np.isfinite(values).all():
            raise DescriptionError(
                f"start or rates of shape {np.shape(values)} for {k} independent coordinates",
                where,
                f"give {k} finite numbers",
            )
    return times, np.concatenate([task.start, task.rates, [0.0]])
