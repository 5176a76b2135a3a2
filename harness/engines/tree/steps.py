"""Fixed steps through the wanted times, whatever makes the step."""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol

import numpy as np

from screwgauge.engines.tree.closure import make_loops
from screwgauge.engines.tree.forces import BodyAt, Forces, tree_forces
from screwgauge.engines.tree.protocol import Tree
from screwgauge.engines.tree.reading import Path, read_path
from screwgauge.engines.tree.start import Stopwatch, start_state
from screwgauge.engines.tree.stepper import Stepper
from screwgauge.models.loops import LoopsFile
from screwgauge.problem import ForwardProblem
from screwgauge.reference.errors import SingularPoseError
from screwgauge.reference.rotations import Array
from screwgauge.solution import ForwardSolution

#: Angles of cut joints are followed at least this often [s].
OFTEN = 0.01


class Walker(Protocol):
    """What makes the steps."""

    @property
    def tree(self) -> Tree:
        """The open tree of its model."""
        ...

    def begin(self, t: float, q: Array, v: Array) -> None:
        """Goes to the start."""
        ...

    def walk(self, t: float, h: float, n: int) -> None:
        """Makes n steps of size h from time t on.

        Raises:
            SingularPoseError: It cannot go on.
        """
        ...

    def state(self) -> tuple[Array, Array]:
        """Coordinates and rates now, arrays that stay as they are. Shape (n_v,) each."""
        ...

    def accelerations(self, t: float) -> Array:
        """Accelerations now, an array that stays as it is. Shape (n_v,)."""
        ...

    def look(self, q: Array, v: Array) -> BodyAt:
        """Poses of bodies at a state, on another copy of the engine's data."""
        ...


def walk_through(problem: ForwardProblem, file: LoopsFile, walker: Walker, stepper: Stepper) -> ForwardSolution:
    """Steps from the closed start through all wanted times.

    Returns:
        States as the stepper leaves them: open loops stay open. Work by the trapezoidal rule over the steps, not known
        where the steps are better than that rule.
    """
    tree = walker.tree
    loops, times = make_loops(tree, file), problem.times
    forces = tree_forces(problem, tree, loops)
    # every step is looked at where something does work that is not stored
    known = forces.stores_only or stepper.integrator != "RK4"
    often = 0.0 if known and not forces.stores_only else OFTEN
    q, v = start_state(problem, tree, file)
    path, clock, steps, stopped = Path(), Stopwatch(), 0, ""
    walker.begin(float(times[0]), q, v)
    with clock.aside():
        path.add(float(times[0]), q, v, walker.accelerations(float(times[0])))
    for begin, end in pairwise(times):
        n = max(1, int(np.ceil((end - begin) / stepper.dt - 1e-9)))
        h, block = float(end - begin) / n, max(1, int(often / stepper.dt))
        done = 0
        try:
            while done < n:
                count = min(block, n - done)
                walker.walk(float(begin) + done * h, h, count)
                done, steps = done + count, steps + count
                problem.progress(float(begin + done * h - times[0]) / float(times[-1] - times[0]))
                q, v = walker.state()
                if not (np.isfinite(q).all() and np.isfinite(v).all()):
                    raise SingularPoseError("the state is no longer finite", tree.engine, "take smaller steps")
                if done < n:
                    path.add(float(begin) + done * h, q, v)
            with clock.aside():
                path.add(float(end), q, v, walker.accelerations(float(end)))
        except SingularPoseError as error:
            stopped = f"t = {begin + done * h:.6g} s: {error}"
            break
    seconds, cpu = clock.read()
    found = read_path(tree, loops, file, path, problem.start)
    return ForwardSolution(
        engine=tree.engine,
        version=tree.version,
        setting=stepper.setting,
        q=found.q,
        v=found.v,
        a=found.a,
        work=_work(walker, forces, path) if known else np.full(len(found.q), np.nan),
        condition=found.condition,
        steps=steps,
        evaluations=steps * (4 if stepper.integrator == "RK4" else 1),
        seconds=seconds,
        stopped=stopped,
        cpu=cpu,
    )


def _work(walker: Walker, forces: Forces, path: Path) -> Array:
    """Work put in up to each wanted state [J], from the power at all states of the path."""
    if forces.stores_only:
        return np.zeros(len(path.wanted))
    tau = np.zeros(len(walker.tree.coordinates))
    power = np.array(
        [forces.act(t, q, v, walker.look(q, v), tau) for t, q, v in zip(path.t, path.q, path.v, strict=True)]
    )
    added = 0.5 * np.diff(path.t) * (power[1:] + power[:-1])
    return np.concatenate([[0.0], np.cumsum(added)])[path.wanted]
