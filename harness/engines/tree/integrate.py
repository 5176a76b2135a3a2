"""Integration of a closed mechanism in all coordinates of an engine's open tree.

The state is (q, v, work). A pose that is singular for the independent coordinates is none here: `Method.near` is
not looked at. What the accelerations leave of drift is taken out after every step by the smallest correction onto the
closed loops.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from screwgauge.engines.screw.integrate import METHODS, MOST, SIZES
from screwgauge.engines.tree.closure import Loops, make_loops
from screwgauge.engines.tree.forces import Forces, tree_forces
from screwgauge.engines.tree.project import Closing, project
from screwgauge.engines.tree.protocol import Tree
from screwgauge.engines.tree.reading import Path, read_path
from screwgauge.engines.tree.start import Stopwatch, loops_file, start_state
from screwgauge.models.loops import LoopsFile
from screwgauge.problem import ForwardProblem
from screwgauge.reference.continuation import OPEN
from screwgauge.reference.errors import ClosureError, SingularPoseError, UnknownNameError
from screwgauge.reference.rotations import Array
from screwgauge.solution import ForwardSolution

#: The largest of so many last steps leads over a pose of unsafe accelerations: before it, steps may have shrunk.
RECENT = 10
#: Step of the differences by which implicit methods see the slope's derivative [rad, m and per s].
DIFFERENCE = 1e-8

Counts = tuple[int, int, float, float]
"""Steps, steps made anew, wall and processor time [s]."""


class Mover(Closing, Protocol):
    """An engine that gives the accelerations of its closed tree, one state at a time."""

    setting: str

    @property
    def tree(self) -> Tree:
        """The open tree of its model."""
        ...

    def body(self, index: int) -> tuple[Array, Array, Array]:
        """R, p and Jacobian of a body there, see `screwgauge.engines.tree.forces.BodyAt`."""
        ...

    def accelerate(self, tau: Array) -> Array:
        """Accelerations there for forces along the coordinates, an array that stays as it is. Shape (n_v,).

        Raises:
            SingularPoseError: They are not safe.
        """
        ...

    def notes(self) -> tuple[str, ...]:
        """What is worth saying after a motion."""
        ...


class _Run:
    """The motion while it is integrated."""

    def __init__(self, mover: Mover, forces: Forces) -> None:
        self.mover, self.forces = mover, forces
        self.n = len(mover.tree.coordinates)
        self.closed = bool(mover.tree.closures)
        self.tau = np.zeros(self.n)
        self.evaluations = 0
        self.drift = [0.0, 0.0]
        self.path = Path()

    def slope(self, t: float, state: Array) -> Array:
        """Derivative of a state, with the accelerations that it has on the closed loops. Shape (2 n_v + 1,).

        Beside the loops redundant rows contradict each other, and next to a singular pose what is off is divided by
        the distance to it: the step size would follow that noise down to nothing.
        """
        self.evaluations += 1
        n, out = self.n, np.empty_like(state)
        q, v = state[:n], state[n:-1]
        out[:n] = v
        if self.closed:
            found = project(self.mover, q, v)
            q, v = found.q, found.v
        else:
            self.mover.place(q, v)
        out[-1] = self.forces.act(t, q, v, self.mover.body, self.tau)
        out[n:-1] = self.mover.accelerate(self.tau)
        return out

    def jacobian(self, t: float, state: Array) -> Array:
        """Derivative of the slope by forward differences; what does not depend on a state is not looked at.

        scipy's own enlarges the step of a coordinate that moves nothing, such as the turn of a shaft, until it
        overflows.
        """
        n, out = self.n, np.zeros((len(state), len(state)))
        out[:n, n:-1] = np.eye(n)
        f = self.slope(t, state)
        for i in range(2 * n):
            moved = state.copy()
            moved[i] += DIFFERENCE * max(1.0, abs(moved[i]))
            out[n:, i] = (self.slope(t, moved) - f)[n:] / (moved[i] - state[i])
        return out

    def back(self, state: Array) -> Array:
        """A state brought back onto the closed loops."""
        found = project(self.mover, state[: self.n], state[self.n : -1])
        if not found.left < OPEN:
            raise ClosureError(
                f"the loops stay open by {found.left:.3g}",
                self.mover.tree.engine,
                "integrate with a smaller tolerance",
            )
        self.drift = [max(self.drift[0], found.gap), max(self.drift[1], found.rate)]
        return np.concatenate([found.q, found.v, state[-1:]])

    def keep(self, t: float, state: Array) -> float:
        """Keeps a wanted state, with its accelerations; returns its work."""
        state = self.back(state)
        q, v = state[: self.n].copy(), state[self.n : -1].copy()
        self.forces.act(t, q, v, self.mover.body, self.tau)
        self.path.add(t, q, v, self.mover.accelerate(self.tau))
        return float(state[-1])


def integrate_tree(problem: ForwardProblem, make: Callable[[LoopsFile], Mover]) -> ForwardSolution:
    """Integrates a problem with an engine's accelerations.

    Args:
        make: Loads the engine's model for a loops file.

    Raises:
        ScrewgaugeError: A model, start, method or force that cannot be, or a start of unsafe accelerations.
    """
    if problem.method.name not in METHODS:
        raise UnknownNameError("method", problem.method.name, METHODS)
    file = loops_file(problem)
    mover = make(file)
    loops = make_loops(mover.tree, file)
    q, v = start_state(problem, mover.tree, file)
    run = _Run(mover, tree_forces(problem, mover.tree, loops))
    state = np.concatenate([q, v, [0.0]])
    work = [run.keep(float(problem.times[0]), state)]
    counts, stopped = ((0, 0, 0.0, 0.0), "")
    if len(problem.times) > 1:
        counts, stopped = _steps(run, problem, state, work)
    return _solution(run, problem, (file, loops), np.array(work), counts, stopped)


def _steps(run: _Run, problem: ForwardProblem, state: Array, work: list[float]) -> tuple[Counts, str]:
    """Steps through all times. Returns counts and why it stopped."""
    times, method = problem.times, METHODS[problem.method.name]
    options: dict[str, Any] = {"rtol": problem.method.rtol, "atol": problem.method.atol}
    if problem.method.name != "DOP853":
        options["jac"] = run.jacobian
    # a multistep method remembers states that no correction reaches
    back = run.closed and problem.method.name != "BDF"
    taken = over = tries = 0
    recent: deque[float] = deque(maxlen=RECENT)
    clock = Stopwatch()
    solver, size = method(run.slope, times[0], state, times[-1], **options), None
    safe = solver.t, solver.y
    while len(work) < len(times):
        try:
            if size is not None:
                solver = method(run.slope, *safe, times[-1], first_step=size, **options)
            message = solver.step()
            if solver.status == "failed":
                break
            with clock.aside():
                between = _between(solver, times, work)
            if back and solver.status == "running":
                solver.y = run.back(solver.y)
                solver.f = run.slope(solver.t, solver.y)
            with clock.aside():
                _keep(run, solver, between, times, work)
        except SingularPoseError as error:
            if tries == len(SIZES) or over == MOST:
                message = f"no step leads on; {error}"
                break
            size = min(max(recent, default=solver.h_abs) * SIZES[tries], times[-1] - safe[0])
            tries, over = tries + 1, over + 1
            continue
        except ClosureError as error:
            message = str(error)
            break
        taken, tries, size, safe = taken + 1, 0, None, (solver.t, solver.y)
        recent.append(solver.step_size)
        run.path.add(float(solver.t), solver.y[: run.n].copy(), solver.y[run.n : -1].copy())
        problem.progress((solver.t - times[0]) / (times[-1] - times[0]))
    stopped = "" if len(work) == len(times) else f"t = {safe[0]:.6g} s: {message}"
    return (taken, over, *clock.read()), stopped


def _between(solver: OdeSolver, times: Array, work: list[float]) -> DenseOutput | None:
    """The motion within the last step, if it passed a wanted time."""
    return solver.dense_output() if times[len(work)] <= solver.t else None


def _keep(run: _Run, solver: OdeSolver, between: DenseOutput | None, times: Array, work: list[float]) -> None:
    """Keeps the motion at all wanted times that the last step passed."""
    while between is not None and len(work) < len(times) and times[len(work)] <= solver.t:
        t = float(times[len(work)])
        work.append(run.keep(t, solver.y if t == solver.t else between(t)))


def _solution(
    run: _Run,
    problem: ForwardProblem,
    model: tuple[LoopsFile, Loops],
    work: Array,
    counts: Counts,
    stopped: str,
) -> ForwardSolution:
    file, loops = model
    tree, (steps, over, seconds, cpu) = run.mover.tree, counts
    found = read_path(tree, loops, file, run.path, problem.start)
    notes = list(run.mover.notes())
    if run.closed:
        gap, rate = run.drift
        notes.append(f"largest drift off the closed loops that was removed: {gap:.1e} (m, rad), {rate:.1e} /s")
    if over:
        notes.append(f"{over} steps were made anew with another size, as they met unsafe accelerations")
    method = problem.method
    return ForwardSolution(
        engine=tree.engine,
        version=tree.version,
        setting=f"{method.name}, rtol {method.rtol:g}, atol {method.atol:g}; {run.mover.setting}",
        q=found.q,
        v=found.v,
        a=found.a,
        work=work,
        condition=found.condition,
        steps=steps,
        evaluations=run.evaluations,
        seconds=seconds,
        cpu=cpu,
        stopped=stopped,
        notes=tuple(notes),
    )
