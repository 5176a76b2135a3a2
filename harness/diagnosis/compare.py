"""Two models at the same random states, quantity by quantity in the terms of A, and the order of their joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.diagnosis.causes.attribution import Torques
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import STANDARD, Common, brought, states_of_b, velocity_map, weighed
from screwgauge.diagnosis.pairing.mapping import Pairing
from screwgauge.diagnosis.properties import INERTIAL
from screwgauge.models.check import expected_reading
from screwgauge.models.importing.model import Imported
from screwgauge.models.kinematics import ReadingTree, draw, plant
from screwgauge.models.readings.reading import Reading
from screwgauge.models.readings.source import by_name, in_file, prepare
from screwgauge.reference.errors import ScrewgaugeError, first_few
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import closure_rows
from screwgauge.witness.dynamics import dynamics, inverse_dynamics
from screwgauge.witness.kinematics import TreeMotion, move
from screwgauge.witness.tree import FixedFrames, MassProperties, TreeStates

#: How many states are drawn: more than the ten inertial parameters of a body need to be distinguished.
STATES = 40
#: Velocities of a ball and of a free joint by name.
_ENDS = {"hinge": ("",), "slide": ("",), "ball": (".x", ".y", ".z"), "free": (".wx", ".wy", ".wz", ".x", ".y", ".z")}
#: Unit of an entry of the mass matrix, by how many of its two velocities are angular.
_INERTIA = ("kg", "kg m", "kg m^2")


@dataclass(frozen=True, slots=True)
class Row:
    """The largest difference of a quantity, scaled by the largest magnitude in A of the same unit.

    Attributes:
        worst: Component that has it.
        max_abs: The difference there, in `unit`.
    """

    quantity: str
    worst: str
    unit: str
    max_abs: float
    scaled: float


def components(reading: Reading) -> list[tuple[str, str]]:
    """Name and unit of the force along each velocity."""
    return [
        (name + end, "N" if joint.kind == "slide" or (joint.kind == "free" and k > 2) else "N m")
        for name, joint in reading.joints.items()
        for k, end in enumerate(_ENDS[joint.kind])
    ]


def torques(common: Common, pairing: Pairing, states: TreeStates) -> Torques:
    """Inverse dynamics of A, and of whatever B becomes, at the same states."""
    a, known = plant(common.a), list[_Moved]()

    def of(b: Reading) -> Array:
        if known and (tree := known[0].changed(b)) is not None:
            return known[0].torques(tree)
        try:
            there = brought(common.a, b, pairing)
            tree = plant(there.b)
            theirs = states_of_b(a, tree, states)
            moved = _Moved(b, there.own, tree, theirs, velocity_map(a, tree), move(tree, theirs))
        except (KeyError, ScrewgaugeError):  # a joint is gone that A has
            return np.full((len(states.q), len(a.before)), np.nan)
        known.append(moved)
        return moved.torques(tree)

    names, units = zip(*components(common.a), strict=True)
    return Torques(inverse_dynamics(a, states), of, names, units)


#: What of bodies and joints their motion is of.
_MOVING = {"bodies": ("near", "joints", "pose"), "joints": ("kind", "screw", "centre", "home")}


@dataclass(frozen=True, slots=True, eq=False)
class _Moved:
    """B in motion, which changes of mass properties and of what joints exert leave as it is.

    Attributes:
        reading: B's, as it was read; `own`: common names -> B's.
        states: Those of B; `C`: velocities of A -> those of B.
    """

    reading: Reading
    own: Mapping[str, Mapping[str, str]]
    tree: ReadingTree
    states: TreeStates
    C: Array
    motion: TreeMotion

    def torques(self, tree: ReadingTree) -> Array:
        """Torques of a tree in the same motion."""
        return inverse_dynamics(tree, self.states, replace(self.motion, tree=tree)) @ self.C

    def changed(self, b: Reading) -> ReadingTree | None:
        """The tree of a reading that differs in mass properties and passive forces alone; None of others."""
        if not self._moves_as(b):
            return None
        tree, matter = self.tree, self.tree.matter
        mass, com, inertia, weight = (np.array(x) for x in (matter.mass, matter.com, matter.inertia, tree.weight))
        for i, (name, body) in enumerate(tree.reading.bodies.items()):
            new, old = self._both(b, "bodies", name)
            if new is old:
                continue
            if any(not np.array_equal(getattr(body, entry), getattr(old, entry)) for entry in (*INERTIAL, "gravcomp")):
                return None  # it is not counted as the file has it
            mass[i], com[i], inertia[i], weight[i] = new.mass, new.com, new.inertia, 1.0 - new.gravcomp
        passive = {what: values.copy() for what, values in tree.passive.items()}
        for name, part in tree.freedoms.items():
            new, old = self._both(b, "joints", name)
            for what in passive if new is not old else ():
                passive[what][part] = getattr(new, what)
        return replace(tree, matter=MassProperties(mass, com, inertia), weight=weight, passive=passive)

    def _both(self, b: Reading, room: str, name: str) -> tuple[Any, Any]:
        """A body or joint of B after and before."""
        one = self.own[room].get(name, name)
        return getattr(b, room)[one], getattr(self.reading, room)[one]

    def _moves_as(self, b: Reading) -> bool:
        """Whether a reading is of the same parts that move alike; changes keep what they do not change."""
        for room, entries in _MOVING.items():
            new, old = getattr(b, room), getattr(self.reading, room)
            if new.keys() != old.keys():
                return False
            if any(getattr(new[name], entry) is not getattr(old[name], entry) for name in old for entry in entries):
                return False
        return b.gravity is self.reading.gravity


def table(common: Common, states: TreeStates) -> list[Row]:
    """All quantities."""
    a, b = plant(common.a), plant(common.b)
    theirs, C = states_of_b(a, b, states), velocity_map(a, b)
    first, second = move(a, states), move(b, theirs)
    one, two = dynamics(a, states, first), dynamics(b, theirs, second)
    force = components(common.a)
    inertia = [(f"{x}, {y}", _INERTIA[(u + v).count("m")]) for x, u in force for y, v in force]
    pairs = [
        ("inverse dynamics", one.tau, two.tau @ C, force),
        ("mass matrix", one.mass_matrix, C.T @ two.mass_matrix @ C, inertia),
        ("bias", one.bias, two.bias @ C, force),
        ("gravity", one.gravity, two.gravity @ C, force),
        *_bodies(common, (first, second)),
        *_closures(common, (closure_rows(a, first), closure_rows(b, second)), C),
    ]
    return [row_of(*pair, one.tau if pair[3] is force else pair[1]) for pair in pairs if pair[1].size]


def _bodies(
    common: Common, motions: tuple[TreeMotion, TreeMotion]
) -> Iterator[tuple[str, Array, Array, list[tuple[str, str]]]]:
    """Motion of the origin of A's frame in each body, as A and as B move it."""
    both = [name for name in common.a.bodies if name in common.b.bodies]
    values: list[tuple[Array, Array]] = []
    for reading, motion in zip((common.a, common.b), motions, strict=True):
        order = {name: i for i, name in enumerate(reading.bodies)}
        numbers = np.array([order[name] for name in both], dtype=int)
        back = [np.linalg.inv(reading.bodies[name].pose) @ common.a.bodies[name].pose for name in both]
        R, p = (np.array([T[:3, part] for T in back]) for part in (slice(3), 3))
        at = motion.bodies.frames(FixedFrames(numbers, R.reshape(-1, 3, 3), p.reshape(-1, 3)))
        values.append((at.velocity, at.acceleration))
    for k, (what, unit) in enumerate((("velocity", "s"), ("acceleration", "s^2"))):
        names = [(f"{name}.{axis}", f"{length}/{unit}") for name in both for length in ("rad", "m") for axis in "xyz"]
        yield f"body {what}", values[0][k], values[1][k], names


def _closures(
    common: Common, rows: tuple[dict[str, Array], dict[str, Array]], C: Array
) -> Iterator[tuple[str, Array, Array, list[tuple[str, str]]]]:
    joints = [name for name, _ in components(common.a)]
    for name, ours in rows[0].items():
        theirs = rows[1].get(name)
        if theirs is not None and theirs.shape == ours.shape:
            theirs = theirs @ C
            flipped = common.a.closures[name].first != common.b.closures[name].first
            yield f"closure {name}", ours, -theirs if flipped else theirs, [(j, "") for _ in ours[0] for j in joints]


def row_of(quantity: str, a: Array, b: Array, names: Sequence[tuple[str, str]], scale_of: Array) -> Row:
    """The largest difference of a quantity.

    Args:
        scale_of: What the difference is scaled by: of forces, which may vanish, all that is asked of motors.
    """
    a, b, scale_of = (each.reshape(len(a), -1) for each in (a, b, scale_of))
    kinds, which = np.unique([unit for _, unit in names], return_inverse=True)
    most = np.maximum(np.abs(a), np.abs(scale_of)).max(axis=0)
    scale = np.array([most[which == k].max() for k in range(len(kinds))])[which]
    apart = np.abs(b - a).max(axis=0)
    apart = np.where(np.isfinite(apart), apart, np.inf)
    scaled = np.where(scale > 0.0, apart / np.where(scale > 0.0, scale, 1.0), apart)
    i = int(scaled.argmax())
    return Row(quantity, names[i][0], names[i][1], float(apart[i]), float(scaled[i]))


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


def order_of(models: tuple[Model, Model], pairing: Pairing, seed: int) -> Order | None:
    """Orders of the joints that two models share; None where they agree, or a model is a description."""
    if any(model.library == "screwgauge" for model in models):
        return None
    a, b = (model.reading for model in models)
    there = {other: name for name, other in pairing.joints.items()}
    first = tuple(name for name in a.joints if name in pairing.joints)
    second = tuple(there[other] for other in b.joints if other in there)
    k, own = _first_other(first, second), [pairing.joints[name] for name in second]
    phrases = (
        f"{models[0].library} indexes the joints of A as {first_few(first[k:], _NAMED)}{_from_joint(k)}",
        f"{models[1].library} those of B as {first_few(own[k:], _NAMED)}",
    )
    return _order(a, (first, second), phrases, seed)


def indexed(file: Path, imported: Imported, *, meshes: bool = False) -> tuple[str, ...]:
    """A sentence where libraries order the joints of a model file differently, which its description cannot show.

    Args:
        meshes: It was imported with mass from meshes.

    Raises:
        ScrewgaugeError: The file cannot be read.
    """
    gravity = STANDARD if imported.gravity is None else imported.gravity
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
    """Two orders of joints of a reading, and the torques of its dynamics in both at the same random states.

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
