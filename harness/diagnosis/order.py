"""The order in which libraries index the joints of two models, and what a comparison by index costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.facts.fact import known_gravity
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.shares import STATES, components, weighed
from screwgauge.models.check import expected_reading
from screwgauge.models.importing.model import Imported
from screwgauge.models.kinematics import draw, plant
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import by_name, in_file, prepare
from screwgauge.reference.errors import first_few
from screwgauge.witness.dynamics import inverse_dynamics

#: So many joints are named in a sentence.
_NAMED = 3
#: A sentence has the permutation of so many joints; `Order.permutation` and ``diagnosis.json`` have all.
PASTED = 12


@dataclass(frozen=True, slots=True)
class Order:
    """Two orders of the same joints.

    Attributes:
        first, second: Joints in either order, by the names of the first.
        sentence: Which library has which, and what it costs.
        value: Largest difference of torques that are compared by index, in `unit`, of which `largest` is the largest.
        joints: That it is of: the one that has this index in the first order, and in the second.
        permutation: ``q_b = q_a[permutation]`` of forces and velocities, and of coordinates but for balls.
    """

    first: tuple[str, ...]
    second: tuple[str, ...]
    sentence: str
    value: float
    unit: str
    largest: float
    joints: tuple[str, str]
    permutation: tuple[int, ...] = ()


def order_of(models: tuple[Model, Model], joints: Mapping[str, str], seed: int) -> Order | None:
    """Compare the orders of the joints that two models share; None where they agree, or a model is a description.

    Args:
        joints: Joint of A -> joint of B.
    """
    if any(model.described for model in models):
        return None
    a, b = (model.reading for model in models)
    there = {other: name for name, other in joints.items()}
    first = tuple(name for name in a.joints if name in joints)
    second = tuple(there[other] for other in b.joints if other in there)
    k, own = _first_other(first, second), [joints[name] for name in second]
    phrases = (
        f"{models[0].library} indexes the joints of A as {first_few(first[k:], _NAMED)}{_from_joint(k)}",
        f"{models[1].library} those of B as {first_few(own[k:], _NAMED)}",
    )
    return _order(a, (first, second), phrases, seed)


def indexed(file: Path, imported: Imported, *, meshes: bool = False) -> tuple[str, ...]:
    """Warn where libraries order the joints of a model file differently, which its description cannot show.

    Args:
        meshes: It was imported with mass from meshes.

    Raises:
        ScrewgaugeError: The file cannot be read.
    """
    gravity = known_gravity(imported.gravity)
    source, reading = prepare(file, meshes=meshes), expected_reading(imported.mechanism, "full", gravity)
    orders = [[imported.names.get(name, name) for name in order(source)] for order in (by_name, in_file)]
    first, second = (tuple(name for name in order if name in reading.joints) for order in orders)
    k = _first_other(first, second)
    phrases = (
        f"pinocchio indexes the joints of a URDF of it as {first_few(first[k:], _NAMED)}{_from_joint(k)}",
        f"mujoco those of the file as {first_few(second[k:], _NAMED)}",
    )
    order = _order(reading, (first, second), phrases, 0)
    return () if order is None else (order.sentence,)


def _first_other(first: Sequence[str], second: Sequence[str]) -> int:
    """The first index at which two orders differ; 0 where they do not."""
    return next((k for k, pair in enumerate(zip(first, second, strict=True)) if pair[0] != pair[1]), 0)


def _from_joint(k: int) -> str:
    return f" (from joint {k + 1} on)" if k else ""


def _order(
    reading: Reading, orders: tuple[tuple[str, ...], tuple[str, ...]], phrases: tuple[str, str], seed: int
) -> Order | None:
    """Compare two orders of joints of a reading by the torques of its dynamics at the same random states.

    Args:
        phrases: Which library has which order, in words.
    """
    first, second = orders
    if first == second:
        return None
    reading = weighed(reading)
    tau = inverse_dynamics(plant(reading), draw(reading, STATES, seed))
    entries = components(reading)
    places = list(range(len(entries)))
    ours, theirs = ([i for name in order for i in places[reading.freedoms[name]]] for order in orders)
    units = [(entries[i][1], entries[j][1]) for i, j in zip(ours, theirs, strict=True)]
    off = np.abs(tau[:, ours] - tau[:, theirs]).max(axis=0)
    alike = np.array([one == other for one, other in units])  # a force and a torque cannot be subtracted
    k = int(np.where(alike, off, -1.0).argmax())
    (one, unit), (other, _) = entries[ours[k]], entries[theirs[k]]
    largest = float(max(np.abs(tau[:, i]).max() for i, (_, of) in enumerate(entries) if of == unit))
    cost = f"torques differ by {off[k]:.3g} {unit} ({one} beside {other}), the largest being {largest:.3g} {unit}"
    permutation = tuple(theirs if ours == sorted(ours) else map(ours.index, theirs))
    paste = f", or by q_b = q_a[{[*permutation]}]" if len(permutation) <= PASTED else ""
    sentence = f"Joints have another order: {phrases[0]}, {phrases[1]}"
    sentence += f"; compared by index, {cost}: compare them by name{paste}."
    return Order(first, second, sentence, float(off[k]), unit, largest, (one, other), permutation)
