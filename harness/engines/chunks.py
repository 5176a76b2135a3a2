"""Assembly of a `Solution` from successively computed parts of a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.engines.error_estimate import SolvedPart, error_of
from screwgauge.problem import InitialValue, Progress
from screwgauge.quantities import OF_JOINTS, RATE, Names, joint_units
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Cost, Solution, Timing, Values

PART = 2048  # samples processed at a time: keeps memory constant and arrays in the cache


def assemble(
    labels: tuple[str, str, str],
    n: int,
    solve_part: Callable[[slice], SolvedPart],
    names: Callable[[], Names],
    clock: Clock,
    progress: Progress,
    *,
    length: float,
    mass: float,
) -> Solution:
    """Solve a trajectory part by part.

    Args:
        labels: Engine, version, setting.
        n: Number of samples.
        solve_part: Solves the rows of a part.
        names: Called afterwards; returns the components of each quantity.
        length, mass: Length and mass of the mechanism [m, kg].
    """
    parts: list[SolvedPart] = []
    for first in range(0, n, PART):
        parts.append(solve_part(slice(first, first + PART)))
        progress(min(1.0, (first + PART) / n))
    table, (engine, version, setting) = names(), labels
    values = {key: Values(*table[key], np.concatenate([part.values[key] for part in parts])) for key in parts[0].values}
    return Solution(
        engine=engine,
        version=version,
        setting=setting,
        values=values,
        condition=np.concatenate([part.trust.condition for part in parts]),
        timings=clock.timings(engine, setting, n),
        errors={name: error_of(name, parts, has, length, mass) for name, has in values.items()},
    )


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """Motion in the description's joint coordinates at m states.

    Attributes:
        q, v, a: Unwrapped coordinates, rates, accelerations [rad or m, per s, per s^2]. Shape (m, n_q).
        condition: Condition number of the closed loops with the selection of the independent coordinates. Shape (m,).
    """

    q: Array
    v: Array
    a: Array
    condition: Array


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """An integrated motion that reached m of the n grid times.

    Attributes:
        work: Work of motors, loads and dampers since the start [J]; NaN if unknown. Shape (m,).
        stopped: Why the motion ended early, empty if it did not.
        reactions: Names and units of constraint forces, and their values [N or N m], shape (m, k), if requested.
    """

    read: JointMotion
    work: Array
    cost: Cost
    stopped: str = ""
    notes: tuple[str, ...] = ()
    reactions: tuple[tuple[str, ...], tuple[str, ...], Array] | None = None

    def solution(self, labels: tuple[str, str, str], joints: Sequence[Joint], task: InitialValue) -> Solution:
        """Convert to a solution at the requested times, with NaN beyond the end.

        Args:
            labels: Engine, version, setting.

        Raises:
            ClosureError: No requested time was reached.
        """
        engine, version, setting = labels
        extra, n = len(task.grid) - len(task), len(task)
        m = len(self.work) - extra
        if m < 1:
            raise ClosureError(
                f"the simulation stopped before the first sample: {self.stopped}", engine, "change the initial state"
            )

        def filled(array: Array) -> Array:
            out = np.full((n, *array.shape[1:]), np.nan)
            out[:m] = array[extra:]
            return out

        units, read = joint_units(joints), self.read
        values = {
            name: Values(tuple(units), tuple(f"{unit}{per}" for unit in units.values()), filled(array))
            for name, array, per in zip(OF_JOINTS, (read.q, read.v, read.a), RATE.values(), strict=True)
        }
        if self.reactions is not None:
            names, force_units, forces = self.reactions
            values["reaction"] = Values(names, force_units, filled(forces))
        seconds = {"integration": self.cost.wall_s, "integration, processor time": self.cost.cpu_s}
        covers = "one integration from start to end, without loading and output"
        return Solution(
            engine=engine,
            version=version,
            setting=setting,
            values=values,
            condition=filled(read.condition),
            timings=tuple(
                Timing(engine, setting, stage, m, s, s, covers) for stage, s in seconds.items() if np.isfinite(s)
            ),
            notes=self.notes,
            rows=None if m == n else np.arange(m),
            work=filled(self.work),
            stopped=self.stopped,
            cost=self.cost,
        )
