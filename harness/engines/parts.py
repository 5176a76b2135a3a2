"""Puts the parts of a trajectory, computed one after the other, together into a `Solution`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter_ns

import numpy as np

from screwgauge.engines.estimate import Part, estimates
from screwgauge.problem import Motion, Progress
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.mechanism import KINDS, Joint
from screwgauge.solution import Solution, Timing, Values

PART = 1024  # samples worked on at a time: keeps memory constant and arrays in the cache

Names = Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]
"""Quantity -> names and units of its components."""

_FORCE = {"rad": "N m", "m": "N"}


def stages(quantities: frozenset[str]) -> str:
    """How far the computation has to go: ``q``, ``v``, ``a`` or ``f``."""
    return max((QUANTITIES[name].needs for name in quantities), key="qvaf".index, default="q")


def component_names(
    joints: Sequence[Joint],
    bodies: Sequence[str],
    independent: Mapping[str, str],
    tree: Sequence[str],
    actuators: Sequence[str],
    reactions: tuple[tuple[str, ...], tuple[str, ...]],
) -> Names:
    """Names and units of every quantity.

    Args:
        joints: All joints, in the order of the description.
        bodies: Moving bodies.
        independent: Label -> coordinate.
        tree: Coordinates of the spanning tree.
        actuators: Names of the actuators, in the order of the actuated joints.
        reactions: Names and units of the reaction components.
    """
    unit = {c: "rad" if turn else "m" for j in joints for c, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}
    q = tuple(unit)
    xyz = tuple(f"{body}.{axis}" for body in bodies for axis in "xyz")

    def same(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return xyz, (text,) * len(xyz)

    tree_units = tuple(_FORCE[unit[name]] for name in tree)
    driven = [joint.coordinates[0] for joint in joints if joint.actuated]
    return {
        "joint_position": (q, tuple(unit.values())),
        "joint_velocity": (q, tuple(f"{u}/s" for u in unit.values())),
        "joint_acceleration": (q, tuple(f"{u}/s^2" for u in unit.values())),
        "body_angular_velocity": same("rad/s"),
        "body_angular_acceleration": same("rad/s^2"),
        "com_acceleration": same("m/s^2"),
        "tree_force": (tuple(tree), tree_units),
        "tree_force_soft": (tuple(tree), tree_units),
        "generalized_force": (tuple(independent), tuple(_FORCE[unit[name]] for name in independent.values())),
        "actuator_force": (tuple(actuators), tuple(_FORCE[unit[name]] for name in driven)),
        "reaction": reactions,
    }


@dataclass(slots=True)
class Clock:
    """Adds up the time of each stage over the parts of a trajectory."""

    spent: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = perf_counter_ns()
        yield
        self.spent[name] = self.spent.get(name, 0.0) + (perf_counter_ns() - start) * 1e-9

    def timings(self, engine: str, setting: str, n: int) -> tuple[Timing, ...]:
        return tuple(
            Timing(engine, setting, stage, n, seconds, seconds, "whole trajectory, once")
            for stage, seconds in self.spent.items()
        )


def assemble(
    engine: str,
    version: str,
    setting: str,
    motion: Motion,
    solve_part: Callable[[slice], Part],
    names: Callable[[], Names],
    clock: Clock,
    progress: Progress,
    *,
    length: float,
) -> Solution:
    """Solves a trajectory part by part.

    Args:
        solve_part: Takes the rows of a part.
        length: Length of the mechanism [m].
        names: Called afterwards: components of each quantity.
    """
    parts: list[Part] = []
    for first in range(0, len(motion), PART):
        parts.append(solve_part(slice(first, first + PART)))
        progress(min(1.0, (first + PART) / len(motion)))
    table = names()
    values = {key: Values(*table[key], np.concatenate([part.values[key] for part in parts])) for key in parts[0].values}
    return Solution(
        engine=engine,
        version=version,
        values=values,
        condition=np.concatenate([part.trust.condition for part in parts]),
        timings=clock.timings(engine, setting, len(motion)),
        estimate=estimates(parts, values, length),
        conditions={name: np.concatenate([part.trust.of(name) for part in parts]) for name in values},
    )
