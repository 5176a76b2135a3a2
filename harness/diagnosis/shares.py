"""Torques of A with some of B's values, along motions that A's loops allow; and comparison of joint orders."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.diagnosis.facts.fact import STANDARD, Fact, known_gravity
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.properties import PASSIVE, apply_changes, sequence
from screwgauge.models.check import expected_reading
from screwgauge.models.importing.model import Imported
from screwgauge.models.kinematics import draw, near_home, tree_of
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.models.readings.source import by_name, in_file, prepare
from screwgauge.reference.errors import ScrewgaugeError, first_few
from screwgauge.reference.linear import null_space
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import DEPENDENT, close_loops, gaps_and_rows
from screwgauge.witness.dynamics import inverse_dynamics
from screwgauge.witness.tree import TreeStates

#: Number of random states; it exceeds the ten inertial parameters of a body.
STATES = 24
#: Largest rounding error of scaled torques: the reference dynamics contribute 1e-14, MuJoCo's tensors 5e-14.
UNSEEN = 1e-11
#: Largest difference between scaled torques of equal readings: loops are closed to about 1e-11.
SAME = 1e-9


def with_gravity(reading: Reading) -> Reading:
    """Return a reading with standard gravity if its file does not specify gravity."""
    return replace(reading, gravity=known_gravity(reading.gravity))


def freedom_left(reading: Reading, seed: int = 0) -> int:
    """Count the degrees of freedom at closed poses near the home pose; return -1 if no pose closes the loops."""
    tree = tree_of(reading)
    if not (reading.closures or reading.couplings):
        return reading.freedom
    states, _ = close_loops(tree, near_home(tree, 3, _units(reading), seed))
    ranks = [int(np.linalg.matrix_rank(rows, tol=1e-7)) for rows in gaps_and_rows(tree, states)[1]]
    return reading.freedom - min(ranks) if ranks else -1


def _slides(reading: Reading) -> NDArray[np.bool_]:
    """Return flags that are True for velocities of slides. Shape (n_freedom,)."""
    kinds = [joint.kind for joint in reading.joints.values() for _ in range(FREEDOMS[joint.kind])]
    return np.array([kind == "slide" for kind in kinds], dtype=bool)


def _units(reading: Reading) -> Array:
    """Return the value by which each velocity is scaled. Shape (n_freedom,)."""
    return np.where(_slides(reading), _reach(reading), 1.0)


def _reach(reading: Reading) -> float:
    """Compute the largest distance of a body's centre of mass from the machine's centre of mass, in any frame [m]."""
    bodies = [body for body in reading.bodies.values() if body.mass > 0.0]
    if not bodies:
        return 1.0
    centres = np.array([body.centre for body in bodies])
    middle = np.average(centres, axis=0, weights=[body.mass for body in bodies])
    return float(np.linalg.norm(centres - middle, axis=1).max()) or 1.0


def components(reading: Reading) -> list[tuple[str, str]]:
    """Return the name and unit of the force conjugate to each velocity."""
    ends = {"hinge": ("",), "slide": ("",), "ball": (".x", ".y", ".z"), "free": (".wx", ".wy", ".wz", ".x", ".y", ".z")}
    return [
        (name + end, "N" if joint.kind == "slide" or (joint.kind == "free" and k > 2) else "N m")
        for name, joint in reading.joints.items()
        for k, end in enumerate(ends[joint.kind])
    ]


@dataclass(frozen=True, slots=True)
class Largest:
    """The largest difference in torque: scaled, and unscaled with component and unit."""

    scaled: float
    value: float
    component: str
    unit: str


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques of a machine before and after changes, for motions that its loops allow.

    Attributes:
        reading: The machine, with gravity.
        seed: Seed of the random states.
    """

    reading: Reading
    seed: int = 0

    @cached_property
    def states(self) -> TreeStates:
        """Random states; for loops, closed states near the home pose with admissible velocities and accelerations."""
        tree = tree_of(self.reading)
        if not (self.reading.closures or self.reading.couplings):
            return draw(self.reading, STATES, self.seed)
        return close_loops(tree, near_home(tree, STATES, _units(self.reading), self.seed))[0]

    @cached_property
    def bases(self) -> list[Array] | None:
        """Basis of admissible motions at each state, scaled by `_units`, (n_freedom, m); None for an open tree."""
        if not (self.reading.closures or self.reading.couplings):
            return None
        units = _units(self.reading)
        return [null_space(rows * units, DEPENDENT) for rows in gaps_and_rows(tree_of(self.reading), self.states)[1]]

    @cached_property
    def own(self) -> Array:
        """Torques of the unchanged machine. Shape (n, n_freedom)."""
        return inverse_dynamics(tree_of(self.reading), self.states)

    @cached_property
    def scale(self) -> Array:
        """Largest torque with the same unit, for each component. Shape (n_freedom,)."""
        slides, most = _slides(self.reading), np.abs(self.own).max(axis=0, initial=0.0)
        scale = np.ones(len(most))
        for which in (slides, ~slides):
            scale[which] = most[which].max(initial=0.0) or 1.0
        return scale

    def effect(self, facts: Iterable[Fact]) -> Array | None:
        """Compute the change in torques due to facts; None if this is impossible. Shape (n, n_freedom)."""
        try:
            tau = inverse_dynamics(tree_of(self.apply(facts)), self.states)
        except (ScrewgaugeError, LookupError, ValueError):  # a different change removes the part
            return None
        return tau - self.own if tau.shape == self.own.shape and np.all(np.isfinite(tau)) else None

    def apply(self, facts: Iterable[Fact]) -> Reading:
        """Return the machine with B's values; a transformation of the whole machine is applied last.

        Raises:
            ScrewgaugeError: A change refers to a part that a different change removes.
        """
        facts = list(facts)
        reading = apply_changes(self.reading, sequence(facts))
        for whole in (fact.b for fact in facts if isinstance(fact.b, Whole)):
            reading = whole.apply(reading)
        return reading

    @property
    def names(self) -> list[str]:
        """Names of the components."""
        return [name for name, _ in components(self.reading)]

    def project(self, effect: Array) -> Array:
        """Project an effect onto admissible motions, and divide it by the largest torque in its unit. Shape (k,)."""
        if self.bases is None:
            return np.asarray(effect / self.scale).ravel()
        units = _units(self.reading)
        most = float((units * self.scale).max(initial=0.0)) or 1.0
        parts = [N.T @ (units * row) / most for N, row in zip(self.bases, effect, strict=True)]
        return np.concatenate([np.zeros(0), *parts])

    def largest(self, effect: Array) -> Largest:
        """Return the component where an effect is largest."""
        if not effect.size:
            return Largest(0.0, 0.0, "", "")
        off = np.abs(effect).max(axis=0)
        k = int((off / self.scale).argmax())
        name, unit = components(self.reading)[k]
        return Largest(float(off[k] / self.scale[k]), float(off[k]), name, unit)


def without_forces(reading: Reading) -> Reading:
    """Remove passive forces from a reading and set standard gravity."""
    joints, bodies = reading.joints.items(), reading.bodies.items()
    nothing: dict[str, Any] = dict.fromkeys(PASSIVE, 0.0)
    return replace(
        reading,
        joints={name: replace(joint, **nothing) for name, joint in joints},
        bodies={name: replace(body, gravcomp=0.0) for name, body in bodies},
        gravity=STANDARD,
    )


def have_values(facts: Sequence[Fact]) -> bool:
    """Return True if changes of values reproduce all facts except names."""
    real = [fact for fact in facts if fact.what != "name"]
    return bool(real) and all(fact.changes or isinstance(fact.b, Whole) for fact in real)


#: Number of joints that a sentence names.
_NAMED = 3
#: Longest permutation that a sentence contains; `Order.permutation` and ``diagnosis.json`` always contain it.
PASTED = 12


@dataclass(frozen=True, slots=True)
class Order:
    """Two different orders of the same joints.

    Attributes:
        first, second: Joints in each order; both use the names of the first model.
        sentence: Sentence that names the libraries, their orders and the error of a comparison by index.
        value: Largest difference between torques that are compared by index, in `unit`; `largest`: largest torque.
        joints: The joints at the index of that difference in the first and in the second order.
        permutation: ``q_b = q_a[permutation]`` for forces and velocities, and for coordinates if no joint is a ball.
    """

    first: tuple[str, ...]
    second: tuple[str, ...]
    sentence: str
    value: float
    unit: str
    largest: float
    joints: tuple[str, str]
    permutation: tuple[int, ...] = ()


def compare_orders(models: tuple[Model, Model], joints: Mapping[str, str], seed: int) -> Order | None:
    """Compare the order of the joints that two models share; None if it is the same or a model is a description.

    Args:
        joints: Joint of A -> joint of B.
    """
    if any(model.described for model in models):
        return None
    a, b = (model.reading for model in models)
    there = {other: name for name, other in joints.items()}
    first = tuple(name for name in a.joints if name in joints)
    second = tuple(there[other] for other in b.joints if other in there)
    phrases = f"{models[0].library} indexes the joints of A", f"and {models[1].library} the joints of B"
    return _order(a, (first, second), [joints[name] for name in second], phrases, seed)


def warn_of_order(file: Path, imported: Imported, *, meshes: bool = False) -> tuple[str, ...]:
    """Warn if libraries order the joints of a model file differently, because its description cannot show this.

    Args:
        meshes: True if the file was imported with mass from meshes.

    Raises:
        ScrewgaugeError: The file cannot be read.
    """
    gravity = known_gravity(imported.gravity)
    source, reading = prepare(file, meshes=meshes), expected_reading(imported.mechanism, "full", gravity)
    orders = [[imported.names.get(name, name) for name in order(source)] for order in (by_name, in_file)]
    first, second = (tuple(name for name in order if name in reading.joints) for order in orders)
    phrases = "pinocchio indexes the joints of a URDF of this model", "and mujoco the joints of the file"
    order = _order(reading, (first, second), second, phrases, 0)
    return () if order is None else (order.sentence,)


def _order(
    reading: Reading,
    orders: tuple[tuple[str, ...], tuple[str, ...]],
    names: Sequence[str],
    phrases: tuple[str, str],
    seed: int,
) -> Order | None:
    """Compare two orders of a reading's joints by the torques at the same random states.

    Args:
        names: Joints in the second order, as they are named in the second model.
        phrases: Library and joints of each order, as clauses of one sentence.
    """
    first, second = orders
    if first == second:
        return None
    reading = with_gravity(reading)
    tau = inverse_dynamics(tree_of(reading), draw(reading, STATES, seed))
    entries = components(reading)
    places = list(range(len(entries)))
    ours, theirs = ([i for name in order for i in places[reading.freedoms[name]]] for order in orders)
    units = [(entries[i][1], entries[j][1]) for i, j in zip(ours, theirs, strict=True)]
    off = np.abs(tau[:, ours] - tau[:, theirs]).max(axis=0)
    alike = np.array([one == other for one, other in units])  # a force and a torque cannot be subtracted
    k = int(np.where(alike, off, -1.0).argmax())
    (one, unit), (other, _) = entries[ours[k]], entries[theirs[k]]
    largest = float(max(np.abs(tau[:, i]).max() for i, (_, of) in enumerate(entries) if of == unit))
    cost = f"torques differ by {off[k]:.3g} {unit} ({one} against {other}; the largest torque is {largest:.3g} {unit})"
    permutation = tuple(theirs if ours == sorted(ours) else map(ours.index, theirs))
    paste = f", or by q_b = q_a[{[*permutation]}]" if len(permutation) <= PASTED else ""
    start = next(i for i, pair in enumerate(zip(first, second, strict=True)) if pair[0] != pair[1])
    told = [
        f"{whose} as {first_few(each[start:], _NAMED)}" for whose, each in zip(phrases, (first, names), strict=True)
    ]
    told[0] += f" (from joint {start + 1} on)" * bool(start)
    sentence = f"The joint orders differ: {', '.join(told)}"
    sentence += f"; compared by index, {cost}: compare by name{paste}."
    return Order(first, second, sentence, float(off[k]), unit, largest, (one, other), permutation)
