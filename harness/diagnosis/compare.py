"""Two models at the same random states, quantity by quantity, in the terms of A."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.causes.attribution import Torques
from screwgauge.diagnosis.pairing.common import Common, brought, states_of_b, velocity_map
from screwgauge.diagnosis.pairing.mapping import Pairing
from screwgauge.models.kinematics import plant
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import closure_rows
from screwgauge.witness.dynamics import dynamics, inverse_dynamics
from screwgauge.witness.kinematics import TreeMotion, move
from screwgauge.witness.tree import FixedFrames, TreeStates

#: How many states are drawn: more than the ten inertial parameters of a body need to be told apart.
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
    a = plant(common.a)

    def of(b: Reading) -> Array:
        try:
            tree = plant(brought(common.a, b, pairing).b)
            return inverse_dynamics(tree, states_of_b(a, tree, states)) @ velocity_map(a, tree)
        except (KeyError, ScrewgaugeError):  # a joint is gone that A has
            return np.full((len(states.q), len(a.before)), np.nan)

    names, units = zip(*components(common.a), strict=True)
    return Torques(inverse_dynamics(a, states), of, names, units)


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
