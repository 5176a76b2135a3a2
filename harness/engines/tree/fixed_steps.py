"""Integration at a fixed step: an engine's own integrator, or simple methods on its accelerations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from screwgauge.engines.chunks import Simulated
from screwgauge.engines.tree.applied_forces import TreeForces
from screwgauge.engines.tree.closed_states import Path, project, read_path
from screwgauge.engines.tree.closed_tree import ClosedTree
from screwgauge.engines.tree.protocol import Mover, Stepper
from screwgauge.problem import InitialValue, Problem, Progress
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Stopwatch, empty

#: Angles of cut joints are followed at least this often [s].
OFTEN = 0.01
#: From this order on the trapezoidal rule over the steps knows the work less well than the steps know the motion.
KNOWN = 4


def step_through(
    closed: ClosedTree, stepper: Stepper, problem: Problem, task: InitialValue, dt: float, progress: Progress
) -> Solution:
    """Steps from the closed start through all wanted times.

    Args:
        dt: Step [s]; it is shortened so that steps end at the wanted times.

    Returns:
        States as the stepper leaves them: open loops stay open. Work by the trapezoidal rule over the steps, not known
        where the steps are better than that rule, or where it is not wanted.
    """
    from screwgauge.engines.tree.integrate import start_state  # with scipy, which given motions do without

    times, forces = task.grid, TreeForces(closed, problem.applied, task.start)
    # every step is looked at where something does work that is not stored
    known = stepper.work and (forces.stores_only or stepper.order < KNOWN)
    often = 0.0 if known and not forces.stores_only else OFTEN
    q, v = start_state(closed, task)
    path, clock, steps, stopped = Path(), Stopwatch(), 0, ""
    closing: list[Array] = []

    def keep(t: float, q: Array, v: Array) -> None:
        with clock.aside():
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
                q, v = stepper.walk(begin + done * h, h, count)
                done, steps = done + count, steps + count
                progress(float((begin + done * h - times[0]) / (times[-1] - times[0])))
                if not (np.isfinite(q).all() and np.isfinite(v).all()):
                    raise SingularPoseError("the state is no longer finite", closed.tree.engine, "take smaller steps")
                if done < n:
                    path.add(begin + done * h, q, v)
            keep(end, q, v)
        except SingularPoseError as error:
            stopped = f"t = {begin + done * h:.6g} s: {error}"
            break
    cost = clock.cost(steps, steps * (KNOWN if stepper.order == KNOWN else 1))
    wanted = "reaction" in problem.wanted and bool(stepper.closing)
    simulated = Simulated(
        read_path(closed, path, task.start),
        _work(stepper, forces, path) if known else empty(len(path.wanted)),
        cost,
        stopped,
        stepper.notes,
        (stepper.closing, ("N",) * len(stepper.closing), np.array(closing)) if wanted else None,
    )
    labels = (closed.tree.engine, closed.tree.version, stepper.setting)
    return simulated.solution(labels, closed.file.joints, task)


def _work(stepper: Stepper, forces: TreeForces, path: Path) -> Array:
    """Work put in up to each wanted state [J], from the power at all states of the path."""
    if forces.stores_only:
        return np.zeros(len(path.wanted))
    tau, power, mover = np.zeros_like(path.q[0]), np.empty(len(path.t)), stepper.mover
    for i, (t, q, v) in enumerate(zip(path.t, path.q, path.v, strict=True)):
        mover.place(q, v)
        power[i] = forces.act(t, q, v, mover.body, tau)
    added = 0.5 * np.diff(path.t) * (power[1:] + power[:-1])
    return np.concatenate([[0.0], np.cumsum(added)])[path.wanted]


#: Methods at a fixed step.
INTEGRATORS = ("Euler", "RK4")


class ProjectedStepper:
    """Semi-implicit Euler or RK4 on an engine's accelerations, projected onto the closed loops after each step.

    See `screwgauge.engines.tree.protocol.Stepper`.
    """

    work = True
    closing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __init__(self, mover: Mover, forces: TreeForces, integrator: str, dt: float) -> None:
        """`integrator`: one of `INTEGRATORS`."""
        name = "semi-implicit Euler" if integrator == "Euler" else integrator
        self.mover, self.forces, self.setting = mover, forces, f"{name} with projection, dt {dt:g} s"
        self.order = 1 if integrator == "Euler" else 4
        self.once = self._euler if integrator == "Euler" else self._rk4
        self.q = self.v = self.tau = np.zeros(len(mover.tree.coordinates))

    def begin(self, t: float, q: Array, v: Array) -> None:
        self.q, self.v, self.tau = q, v, np.zeros_like(q)

    def walk(self, t: float, h: float, n: int) -> tuple[Array, Array]:
        for i in range(n):
            closed = project(self.mover, *self.once(t + i * h, h))
            self.q, self.v = closed.q, closed.v
        return self.q.copy(), self.v.copy()

    def accelerations(self, t: float) -> tuple[Array, Array]:
        return self._slope(t, self.q, self.v), np.zeros(0)

    def _slope(self, t: float, q: Array, v: Array) -> Array:
        """Accelerations on the closed loops: off them redundant rows contradict each other."""
        closed = project(self.mover, q, v)
        self.forces.act(t, closed.q, closed.v, self.mover.body, self.tau)
        return self.mover.accelerate(self.tau)

    def _euler(self, t: float, h: float) -> tuple[Array, Array]:
        v = self.v + h * self._slope(t, self.q, self.v)
        return self.q + h * v, v

    def _rk4(self, t: float, h: float) -> tuple[Array, Array]:
        q, v, half = self.q, self.v, 0.5 * h
        a1 = self._slope(t, q, v)
        v2 = v + half * a1
        a2 = self._slope(t + half, q + half * v, v2)
        v3 = v + half * a2
        a3 = self._slope(t + half, q + half * v2, v3)
        v4 = v + h * a3
        a4 = self._slope(t + h, q + h * v3, v4)
        return q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
