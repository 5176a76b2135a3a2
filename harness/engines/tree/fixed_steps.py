"""An engine's own integrator at a fixed step: what its users would run, beside what its accelerations allow."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from screwgauge.engines.parts import Simulated
from screwgauge.engines.tree.closed import ClosedTree
from screwgauge.engines.tree.forces import TreeForces, tree_forces
from screwgauge.engines.tree.integrate import start_state
from screwgauge.engines.tree.protocol import Stepper
from screwgauge.engines.tree.reading import Path, read_path
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
    times, forces = task.grid, tree_forces(closed, problem.applied, task.start)
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
