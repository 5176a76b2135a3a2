"""Assemble a `Solution` from parts of a trajectory that are solved one after another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

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
    size: tuple[float, float],
    at_once: int = PART,
) -> Solution:
    """Solve a trajectory part by part.

    Args:
        labels: Engine, version, setting.
        n: Number of samples.
        solve_part: Solves the samples in a slice.
        names: Called after the last part; returns the components of each quantity.
        size: Length and mass of the mechanism [m, kg].
        at_once: Number of samples per part.
    """
    parts: list[SolvedPart] = []
    for first in range(0, n, at_once):
        parts.append(solve_part(slice(first, first + at_once)))
        progress(min(1.0, (first + at_once) / n))
    table, (engine, version, setting) = names(), labels
    q, rated = [part.q for part in parts if part.q is not None], [not np.isnan(part.trust.gain).all() for part in parts]
    values = {key: Values(*table[key], np.concatenate([part.values[key] for part in parts])) for key in parts[0].values}
    return Solution(
        engine=engine,
        version=version,
        setting=setting,
        values=values,
        condition=np.concatenate([part.trust.condition for part in parts]),
        timings=clock.timings(engine, setting, n),
        errors={name: error_of(name, parts, has, *size) for name, has in values.items()} if any(rated) else {},
        assembly=np.concatenate(q) if len(q) == len(parts) else None,
    )


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """Motion at m states, in the joint coordinates of the description.

    Attributes:
        q, v, a: Unwrapped coordinates, rates, accelerations [rad or m, per s, per s^2]. Shape (m, n_q).
        condition: Condition number of the closing equations for the chosen independent coordinates. Shape (m,).
    """

    q: Array
    v: Array
    a: Array
    condition: Array

    def solution(
        self,
        labels: tuple[str, str, str],
        joints: Sequence[Joint],
        task: InitialValue,
        work: Array,
        cost: Cost,
        stopped: str = "",
        reactions: Values | None = None,
    ) -> Solution:
        """Convert to a solution at the requested times, with NaN after the last grid time that the motion reached.

        Args:
            labels: Engine, version, setting.
            work: Work of motors, loads and dampers since the start [J]; NaN if unknown. Shape (m,).
            stopped: Why the motion ended early; empty if it reached the end.
            reactions: Constraint forces, if requested.

        Raises:
            ClosureError: No requested time was reached.
        """
        engine, version, setting = labels
        extra, n = len(task.grid) - len(task), len(task)
        m = len(work) - extra
        if m < 1:
            what = f"the simulation stopped before the first sample: {stopped}"
            raise ClosureError(what, engine, "change the initial state")

        def pad(array: Array) -> Array:
            out = np.full((n, *array.shape[1:]), np.nan)
            out[:m] = array[extra:]
            return out

        units = joint_units(joints)
        values = {
            name: Values(tuple(units), tuple(f"{unit}{per}" for unit in units.values()), pad(array))
            for name, array, per in zip(OF_JOINTS, (self.q, self.v, self.a), RATE.values(), strict=True)
        }
        if reactions is not None:
            values["reaction"] = replace(reactions, array=pad(reactions.array))
        seconds = {"integration": cost.wall_s, "integration, processor time": cost.cpu_s}
        covers = "one integration from start to end, excluding loading and output"
        return Solution(
            engine=engine,
            version=version,
            setting=setting,
            values=values,
            condition=pad(self.condition),
            timings=tuple(
                Timing(engine, setting, stage, m, s, s, covers) for stage, s in seconds.items() if np.isfinite(s)
            ),
            rows=None if m == n else np.arange(m),
            work=pad(work),
            stopped=stopped,
            cost=cost,
        )
