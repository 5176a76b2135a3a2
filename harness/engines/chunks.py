"""Puts the parts of a trajectory, computed one after the other, together into a `Solution`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.engines.error_estimate import Part, error_of
from screwgauge.problem import GivenMotion, InitialValue, Problem, Progress
from screwgauge.quantities import BODY_UNITS, FORCE, OF_JOINTS, OF_MOTION, QUANTITIES, RATE, Quantity, pairs
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.errors import ClosureError, ModelFileError
from screwgauge.reference.mechanism import KINDS, Joint, Mechanism
from screwgauge.reference.resistance import resistances
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Cost, Solution, Timing, Values

PART = 2048  # samples worked on at a time: keeps memory constant and arrays in the cache

Names = Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]
"""Quantity -> names and units of its components."""


def stages(quantities: frozenset[str]) -> str:
    """How far the computation has to go: ``q``, ``v``, ``a`` or ``f``."""
    return max((QUANTITIES[name].needs for name in quantities), key="qvaf".index, default="q")


def joint_units(joints: Sequence[Joint]) -> dict[str, str]:
    """Unit of every joint coordinate, in the order of the description."""
    return {c: "rad" if turn else "m" for j in joints for c, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}


def check_fits(problem: Problem, mechanism: Mechanism, where: str) -> None:
    """Refuses a problem that is not that of a description.

    Raises:
        ModelFileError: It has another number of independent coordinates, or loads on other bodies.
    """
    task, k = problem.task, len(mechanism.independent)
    given = {"motion": task.y.shape[1]} if isinstance(task, GivenMotion) else {}
    if isinstance(task, InitialValue):
        given = {"start": len(task.start)}
    for what, n in given.items():
        if n != k:
            differs = f"has {k} independent coordinates, the {what} {n}"
            raise ModelFileError(differs, where, "name a description of the same mechanism")
    for load in problem.applied.loads:
        if load.body not in mechanism.body_index:
            raise ModelFileError(f"has no body '{load.body}'", where, "keep the names of the scene")


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
    unit = joint_units(joints)
    axes = tuple(f"{body}.{axis}" for body in bodies for axis in "xyz")
    driven, resist = [joint.coordinates[0] for joint in joints if joint.actuated], resistances(tuple(joints))
    along = {
        "tree": (tuple(tree), tree),
        "independent": (tuple(independent), independent.values()),
        "actuator": (tuple(actuators), driven),
        "axis": (tuple(unit), tuple(unit)),
    }
    forces = {of: (names, tuple(FORCE[unit[c]] for c in coordinates)) for of, (names, coordinates) in along.items()}

    def components(quantity: Quantity) -> tuple[tuple[str, ...], tuple[str, ...]]:
        if quantity.of == "joint":
            return tuple(unit), tuple(f"{each}{RATE[quantity.needs]}" for each in unit.values())
        if quantity.of == "body":
            return axes, (BODY_UNITS[quantity.body],) * len(axes)
        if quantity.of == "pair":
            return pairs({label: unit[c] for label, c in independent.items()})
        if quantity.of == "resistance":
            return tuple(one.name for one in resist), tuple(one.unit for one in resist)
        return reactions if quantity.of == "reaction" else forces[quantity.of]

    return {name: components(QUANTITIES[name]) for name in OF_MOTION}


def described(mechanism: Mechanism) -> Names:
    """Names and units as the description alone has them: without those of a tree, which an engine cuts."""
    bodies, reactions = [body.name for body in mechanism.bodies], reaction_names(mechanism.joints, mechanism.couplings)
    return component_names(mechanism.joints, bodies, mechanism.independent, (), mechanism.actuator_names, reactions)


def assemble(
    labels: tuple[str, str, str],
    n: int,
    solve_part: Callable[[slice], Part],
    names: Callable[[], Names],
    clock: Clock,
    progress: Progress,
    *,
    length: float,
    mass: float,
) -> Solution:
    """Solves a trajectory part by part.

    Args:
        labels: Engine, version, setting.
        n: Number of samples.
        solve_part: Takes the rows of a part.
        names: Called afterwards: components of each quantity.
        length, mass: Of the mechanism [m, kg].
    """
    parts: list[Part] = []
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
    """A motion in the joint coordinates of the description, at m states.

    Attributes:
        q, v, a: In its order, unwrapped, with rates and accelerations [rad or m, per s, per s^2]. Shape (m, n_q).
        condition: Condition number of the closed loops with the selection of the independent coordinates. Shape (m,).
    """

    q: Array
    v: Array
    a: Array
    condition: Array


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """A motion as an engine integrated it, as far as it came: m of the n times of the grid were reached.

    Attributes:
        work: What motors, loads and dampers have put in since the start [J]; NaN where it is not known. Shape (m,).
        stopped: Why it ended early, empty if it did not.
        reactions: Names and units of constraint forces, and their values [N or N m], shape (m, k), if they are wanted.
    """

    read: JointMotion
    work: Array
    cost: Cost
    stopped: str = ""
    notes: tuple[str, ...] = ()
    reactions: tuple[tuple[str, ...], tuple[str, ...], Array] | None = None

    def solution(self, labels: tuple[str, str, str], joints: Sequence[Joint], task: InitialValue) -> Solution:
        """The motion at the wanted times, NaN where it was not reached.

        Args:
            labels: Engine, version, setting.

        Raises:
            ClosureError: Not one wanted time was reached.
        """
        engine, version, setting = labels
        extra, n = len(task.grid) - len(task), len(task)
        m = len(self.work) - extra
        if m < 1:
            raise ClosureError(f"it stopped before the first sample: {self.stopped}", engine, "start elsewhere")

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
        covers = "integration from start to end, once; loading and output outside"
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
