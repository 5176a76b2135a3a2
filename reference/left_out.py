"""Forces in a model file that descriptions and scenes cannot express: rotors, resistance, gravcomp, drag.

They are kept as data so that a run can measure their effect; engines do not apply them. MuJoCo's formulas define them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.expressions import number, rotation_matrix, vector
from screwgauge.reference.mechanism import GROUND, Frame
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_name, read_list, read_text, read_vector, require

Powers = tuple[float, ...]
"""Coefficients c0, c1, ... of the force ``x (c0 + c1 s + c2 s^2 + ...)``: s is x for a spring and |x| for a damper."""


def spring_law(powers: Powers, x: Array) -> Array:
    """Return the force of a spring, with the shape of `x`."""
    return _law(powers, x, x)


def damper_law(powers: Powers, rate: Array) -> Array:
    """Return the force of a damper, with the shape of `rate`; its magnitude is equal in both directions."""
    return _law(powers, rate, np.abs(rate))


def _law(powers: Powers, x: Array, s: Array) -> Array:
    return np.asarray(sum((c * x * s**k for k, c in enumerate(powers)), np.zeros_like(x)))


@dataclass(frozen=True, slots=True, eq=False)
class StrokeResistance:
    """Inertia and passive forces along the stroke of a hinge, slide, tendon or actuator.

    The stroke is a weighted sum of joint coordinates, or the length of a polygonal path through points of bodies.

    Attributes:
        of: Owner, as noun and name, e.g. ``joint m1``.
        along: Coordinate -> stroke per unit of the coordinate; empty for a path.
        path: Pairs (body or ground, point in its frame [m], shape (3,)) in order; empty if `along` defines the stroke.
        armature: Inertia along the stroke [kg m^2 or kg].
        damping: Coefficients of the force as a function of the rate [N m s/rad or N s/m, ...].
        friction: Dry friction [N m or N].
        stiffness: Coefficients of the force as a function of the distance from the range `rest` [N m/rad or N/m, ...].
        rest: Range in which the spring force is zero [rad or m].
    """

    of: str
    along: Mapping[str, float] = field(default_factory=dict)
    path: tuple[tuple[str, Array], ...] = ()
    armature: float = 0.0
    damping: Powers = ()
    friction: float = 0.0
    stiffness: Powers = ()
    rest: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class TurnResistance:
    """Inertia and passive forces of an S or F joint, isotropic about its three axes.

    Attributes:
        joint: Name of the joint.
    """

    of: str
    joint: str
    armature: float = 0.0
    damping: Powers = ()
    friction: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class BorneWeight:
    """Weight that neither joints nor actuators carry (MuJoCo's gravcomp).

    Attributes:
        body: Body on which the compensating force acts.
        mass: Mass whose weight is compensated [kg].
        point: Point of application in the body's frame [m]. Shape (3,).
    """

    of: str
    body: str
    mass: float
    point: Array


@dataclass(frozen=True, slots=True, eq=False)
class Drag:
    """Drag of a medium on the box that has the mass and inertia of a body, or of a part of a body.

    Attributes:
        body: Body on which the drag acts.
        density, viscosity: Density and viscosity of the medium [kg/m^3, Pa s].
        wind: Velocity of the medium in world axes [m/s]. Shape (3,).
        box: Edge lengths [m]. Shape (3,).
        frame: Centre and axes of the box in the body's frame.
    """

    of: str
    body: str
    density: float
    viscosity: float
    wind: Array
    box: Array
    frame: Frame = field(default_factory=Frame)


LeftOut = StrokeResistance | TurnResistance | BorneWeight | Drag

_LAWS = {"armature", "damping", "friction"}


def read_left_out(
    data: dict[str, Any], where: str, coordinates: Collection[str], joints: Collection[str], bodies: Collection[str]
) -> tuple[LeftOut, ...]:
    """Read an optional ``[[left_out]]`` list of a description.

    Args:
        coordinates, joints, bodies: Names of coordinates, S and F joints, and bodies that entries may use.

    Raises:
        DescriptionError: An entry is invalid.
    """
    known = {"along": coordinates, "joint": joints, "body": bodies}
    return tuple(_entry(item, f"{where}, left_out", known) for item in read_list(data, "left_out", where))


def _entry(table: Any, where: str, known: Mapping[str, Collection[str]]) -> LeftOut:
    kind = next((kind for kind in _READERS if isinstance(table, dict) and kind <= table.keys()), None)
    if kind is None:
        keys = ", ".join(" with ".join(sorted(one)) for one in _READERS)
        raise DescriptionError("an entry must name what it acts on", where, f"add one of: {keys}")
    further, read = _READERS[kind]
    check_keys(table, {"of", *kind, *further}, where)
    return read(table, f"{where}, {read_text(table, 'of', where)}", known)


def _resistance(table: dict[str, Any], where: str, known: Mapping[str, Collection[str]]) -> StrokeResistance:
    shares = table.get("along", {})
    check_keys(shares, known["along"], f"{where}, along")
    along = {name: number(share, f"{where}, along.{name}") for name, share in shares.items()}
    points, bodies = read_list(table, "path", where), {GROUND, *known["body"]}
    for point in points:
        check_keys(point, {"body", "point"}, f"{where}, path")
    path = (
        (check_name("body", read_text(one, "body", where), bodies, f"{where}, path"), read_vector(one, "point", where))
        for one in points
    )
    rest = table.get("rest", 0.0)
    low, high = vector(rest, f"{where}, rest", 2) if isinstance(rest, list) else [number(rest, f"{where}, rest")] * 2
    spring = _powers(table, "stiffness", where)
    return StrokeResistance(
        along=along, path=tuple(path), stiffness=spring, rest=(float(low), float(high)), **_laws(table, where)
    )


def _turn_resistance(table: dict[str, Any], where: str, known: Mapping[str, Collection[str]]) -> TurnResistance:
    joint = check_name("S or F joint", read_text(table, "joint", where), known["joint"], f"{where}, joint")
    return TurnResistance(joint=joint, **_laws(table, where))


def _laws(table: dict[str, Any], where: str) -> dict[str, Any]:
    single = {name: number(table.get(name, 0.0), f"{where}, {name}") for name in ("armature", "friction")}
    return {"of": table["of"], **single, "damping": _powers(table, "damping", where)}


def _powers(table: dict[str, Any], key: str, where: str) -> Powers:
    """Read the coefficients of a force law, given as one number or a list."""
    value = table.get(key, [])
    some = value if isinstance(value, list) else [value]
    return tuple(float(x) for x in vector(some, f"{where}, {key}", len(some))) if some else ()


def _weight(table: dict[str, Any], where: str, known: Mapping[str, Collection[str]]) -> BorneWeight:
    body = check_name("body", read_text(table, "body", where), known["body"], f"{where}, body")
    mass, point = number(table["mass"], f"{where}, mass"), vector(table.get("point", [0, 0, 0]), f"{where}, point")
    return BorneWeight(table["of"], body, mass, point)


def _drag(table: dict[str, Any], where: str, known: Mapping[str, Collection[str]]) -> Drag:
    return Drag(
        of=table["of"],
        body=check_name("body", read_text(table, "body", where), known["body"], f"{where}, body"),
        density=number(table.get("density", 0.0), f"{where}, density"),
        viscosity=number(table.get("viscosity", 0.0), f"{where}, viscosity"),
        wind=vector(table.get("wind", [0, 0, 0]), f"{where}, wind"),
        box=vector(require(table, "box", where), f"{where}, box"),
        frame=Frame(
            vector(table.get("point", [0, 0, 0]), f"{where}, point"),
            rotation_matrix(table.get("rotation", []), f"{where}, rotation"),
        ),
    )


_Reader = Callable[[dict[str, Any], str, Mapping[str, Collection[str]]], LeftOut]
#: Keys that identify the kind of an entry -> remaining keys and reader of the entry.
_READERS: dict[frozenset[str], tuple[set[str], _Reader]] = {
    frozenset({"along"}): ({*_LAWS, "stiffness", "rest"}, _resistance),
    frozenset({"path"}): ({*_LAWS, "stiffness", "rest"}, _resistance),
    frozenset({"joint"}): (_LAWS, _turn_resistance),
    frozenset({"body", "box"}): ({"density", "viscosity", "wind", "point", "rotation"}, _drag),
    frozenset({"body", "mass"}): ({"point"}, _weight),
}


def entries(one: LeftOut) -> dict[str, Any]:
    """Return the fields of an entry of ``[[left_out]]`` that are not zero."""
    match one:
        case StrokeResistance():
            path = tuple({"body": body, "point": point} for body, point in one.path)
            stroke = {"path": path} if path else {"along": dict(one.along)}
            rest = {"rest": np.array(one.rest)} if any(one.rest) else {}
            spring = {"stiffness": np.array(one.stiffness), **rest} if one.stiffness else {}
            return {"of": one.of, **stroke, **_resistance_entries(one), **spring}
        case TurnResistance():
            return {"of": one.of, "joint": one.joint, **_resistance_entries(one)}
        case BorneWeight():
            return {"of": one.of, "body": one.body, "mass": one.mass, "point": one.point}
    medium = {"density": one.density, "viscosity": one.viscosity, "wind": one.wind}
    placed = {"point": one.frame.p, "rotation": {"matrix": one.frame.R}}
    return {"of": one.of, "body": one.body, "box": one.box, **medium, **placed}


def _resistance_entries(one: StrokeResistance | TurnResistance) -> dict[str, Any]:
    numbers: Iterable[tuple[str, Any]] = (
        ("armature", one.armature),
        ("damping", np.array(one.damping) if one.damping else None),
        ("friction", one.friction),
    )
    return {name: value for name, value in numbers if value is not None and np.any(value)}
