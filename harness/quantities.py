"""The quantities in which engines are compared: their names and meanings, and the natural scale of each unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from screwgauge.reference import graph
from screwgauge.reference.equations import kinematics
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.errors import check_choice
from screwgauge.reference.mechanism import KINDS, Joint, Mechanism, driven_coordinates
from screwgauge.reference.points import Point
from screwgauge.reference.resistance import resistances

G0 = 9.81  # [m/s^2], used only as a scale
MAX_DIGITS = 17.0


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity computed by engines.

    Attributes:
        of: Items with one component each: ``joint`` coordinates, axes of each ``body``, coordinates of the ``tree``,
            ``independent`` coordinates, a ``pair`` of independent coordinates, ``actuator``, ``reaction`` components,
            ``axis`` of a joint coordinate, each ``resistance`` along a joint coordinate, ``rate`` of a body or point
            per actuator, ``observable``.
        needs: Prerequisite of its computation: ``q``, ``v``, ``a`` (positions, rates, accelerations) or ``f`` (forces).
        tolerance: Scaled error up to which two engines agree.
        ruled: True if a rule for redundant actuators determines its values.
        body: Kind of body motion in world axes, one of `BODY_UNITS`.
        named: True if it is computed only when requested by name.
    """

    name: str
    meaning: str
    of: str
    needs: str
    tolerance: float
    ruled: bool = False
    body: str = ""
    named: bool = False


#: Unit of each motion of a body: angular velocity and acceleration, velocity and acceleration of the centre of mass.
BODY_UNITS = {"w": "rad/s", "b": "rad/s^2", "v": "m/s", "a": "m/s^2"}
#: Prerequisite of a joint quantity -> suffix of the coordinate's unit.
RATE = {"q": "", "v": "/s", "a": "/s^2"}
# 1e-11: rounding (2.2e-16) times the condition of the closure and force systems (up to 1e3 away from singular poses)
# leaves about 12.5 digits; a wrong term leaves none. 1e-12 for recursions, which solve no system.
SOLVED, RECURSIVE = 1e-11, 1e-12


@dataclass(frozen=True, slots=True)
class NumberType:
    """Floating-point type in which a method computes, and the differences that its rounding may explain.

    Attributes:
        eps: Distance from 1 to the next larger number.
        limit: Scaled error up to which rounding explains a difference: half of the digits, so that neither rounding nor
            a modelling error of interest can be mistaken for the other.
        zero: Fraction of its terms below which a sum is zero within rounding.
        sure: Scaled error allowed where rounding may exceed `limit`.
    """

    name: str
    eps: float
    limit: float
    zero: float
    sure: float


#: The tolerances of the quantities apply to float64. The eps of float32 times the usual condition number
#: is close to half of its digits, so that float32's tolerances follow from an estimate for each quantity, see
#: `screwgauge.engines.rounding`.
FLOAT64 = NumberType("float64", float(np.finfo(np.float64).eps), limit=1e-8, zero=SOLVED, sure=0.0)
_HALF = float(np.finfo(np.float32).eps) ** 0.5
FLOAT32 = NumberType("float32", float(np.finfo(np.float32).eps), limit=_HALF, zero=_HALF, sure=_HALF)
NUMBER_TYPES = {kind.name: kind for kind in (FLOAT64, FLOAT32)}
#: Separates the name of an engine from a number type: ``mjwarp@float32``.
AS = "@"


def number_type(method: str) -> NumberType:
    """Return the number type in the name of a method; float64 if the name contains none."""
    return NUMBER_TYPES.get(method.partition(AS)[2], FLOAT64)


QUANTITIES = {
    quantity.name: quantity
    for quantity in (
        Quantity("joint_position", "all joint coordinates", "joint", "q", SOLVED),
        Quantity("joint_velocity", "rates of all joint coordinates", "joint", "v", SOLVED),
        Quantity("joint_acceleration", "second derivatives of all joint coordinates", "joint", "a", SOLVED),
        Quantity("body_angular_velocity", "angular velocity of each body, world axes", "body", "v", SOLVED, body="w"),
        Quantity(
            "body_angular_acceleration", "angular acceleration of each body, world axes", "body", "a", SOLVED, body="b"
        ),
        Quantity("com_acceleration", "acceleration of each centre of mass, world axes", "body", "a", SOLVED, body="a"),
        Quantity("tree_force", "joint forces of the open tree: RNEA against mj_inverse", "tree", "a", RECURSIVE),
        Quantity("tree_force_soft", "the same, with MuJoCo's equality constraints enabled", "tree", "a", RECURSIVE),
        Quantity(
            "generalized_force",
            "total force that the actuators must exert along each coordinate",
            "independent",
            "f",
            SOLVED,
        ),
        Quantity("actuator_force", "force of each actuator", "actuator", "f", SOLVED, ruled=True),
        Quantity(
            "reaction",
            "every constraint force and moment, predecessor on successor",
            "reaction",
            "f",
            SOLVED,
            ruled=True,
        ),
        Quantity(
            "axis_moment",
            "moment about each joint's own axes (for slides, force): actuator, springs, dampers, motors, resistance",
            "axis",
            "f",
            SOLVED,
            ruled=True,
            named=True,
        ),
        Quantity(
            "resistance",
            "parts of the force along each joint that rotor, damping and dry friction absorb",
            "resistance",
            "a",
            SOLVED,
            named=True,
        ),
        Quantity("mass_matrix", "mass matrix of the independent coordinates", "pair", "v", SOLVED, named=True),
        Quantity(
            "jacobian",
            "angular velocity of each body, velocity of its origin and of named points, per rate of each actuator; "
            "the transpose maps moments on bodies and forces at these points to actuator forces",
            "rate",
            "v",
            SOLVED,
            named=True,
        ),
        Quantity("observable", "observables of a forward scene", "observable", "q", SOLVED),
    )
}
#: Quantities of joint coordinates, and quantities of bodies; kind of body motion -> its quantities.
OF_JOINTS = tuple(name for name, quantity in QUANTITIES.items() if quantity.of == "joint")
OF_BODIES = tuple(name for name, quantity in QUANTITIES.items() if quantity.of == "body")
BODY_MOTION = {QUANTITIES[name].body: name for name in OF_BODIES}
#: Quantities available for a given motion, the default selection of these, and quantities of a simulation.
OF_MOTION = tuple(name for name in QUANTITIES if name != "observable")
GIVEN = tuple(name for name in OF_MOTION if not QUANTITIES[name].named)
SIMULATED = (*OF_JOINTS, "observable")
#: Quantities that depend on the rule for redundant actuators.
RULED = frozenset(name for name, quantity in QUANTITIES.items() if quantity.ruled)
#: Quantities that need actuators for all degrees of freedom.
ACTUATED = RULED | {"jacobian"}
#: Unit of a coordinate -> unit of a force along it.
FORCE = {"rad": "N m", "m": "N"}
#: Number of angles among two coordinates -> unit of the inertia between them.
INERTIA = ("kg", "kg m", "kg m^2")
#: Unit of a rate per rate of an actuator -> exponent of a length.
RATIOS = {"rad/rad": 0, "m/m": 0, "m/rad": 1, "rad/m": -1}
#: Fraction of its natural scale, or of its largest term, below which a magnitude cannot serve as a scale.
FLOOR = 1e-6
#: Ratio of the error of a motion to the tolerance of its steps. It is at most 160 for smooth benchmark problems
#: (a01-pendulum at 1e-6), and smaller for stiff ones. Singular poses multiply errors further, so scenes that pass
#: through them set their own tolerances.
GROWTH = 1e3


def pairs(units: Mapping[str, str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of the upper triangle of a mass matrix, row by row, in the order of `np.triu_indices`.

    Args:
        units: Label of each coordinate -> rad or m. The names do not depend on the order of the labels.
    """
    both = [*combinations_with_replacement(units, 2)]
    names = tuple(",".join(sorted(pair)) for pair in both)
    return names, tuple(INERTIA[sum(units[label] == "rad" for label in pair)] for pair in both)


Names = Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]
"""Quantity -> names and units of its components."""


def stages(quantities: frozenset[str]) -> str:
    """Return the last stage of the computation that the quantities need: ``q``, ``v``, ``a`` or ``f``."""
    return max((QUANTITIES[name].needs for name in quantities), key="qvaf".index, default="q")


def joint_units(joints: Sequence[Joint]) -> dict[str, str]:
    """Return the unit of every joint coordinate, in the order of the description."""
    return {c: "rad" if turn else "m" for j in joints for c, turn in zip(j.coordinates, KINDS[j.kind], strict=True)}


def component_names(
    joints: Sequence[Joint],
    bodies: Sequence[str],
    independent: Mapping[str, str],
    tree: Sequence[str],
    actuators: Sequence[str],
    reactions: tuple[tuple[str, ...], tuple[str, ...]],
    *,
    points: Sequence[Point] = (),
) -> Names:
    """Return names and units of every quantity.

    Args:
        joints: All joints, in the order of the description.
        bodies: Moving bodies.
        independent: Label -> coordinate.
        tree: Coordinates of the spanning tree.
        actuators: Names of the actuators, in the order of the actuated joints.
        reactions: Names and units of the reaction components.
        points: Named points.
    """
    unit = joint_units(joints)
    axes = tuple(f"{body}.{axis}" for body in bodies for axis in "xyz")
    driven, resist = driven_coordinates(joints), resistances(tuple(joints))
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
        if quantity.of == "rate":
            return _ratios(bodies, points, dict(zip(actuators, (unit[c] for c in driven), strict=True)))
        return reactions if quantity.of == "reaction" else forces[quantity.of]

    return {name: components(QUANTITIES[name]) for name in OF_MOTION}


def _ratios(
    bodies: Sequence[str], points: Sequence[Point], actuators: Mapping[str, str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units of the body and point rates per actuator rate. `actuators`: name -> rad or m."""
    turns = {"w": "rad", "v": "m"}
    rates = {f"{body}.{what}{axis}": unit for body in bodies for what, unit in turns.items() for axis in "xyz"}
    rates |= {f"{point.name}.v{axis}": "m" for point in points for axis in "xyz"}
    every = {f"{rate}/{name}": f"{unit}/{per}" for rate, unit in rates.items() for name, per in actuators.items()}
    return tuple(every), tuple(every.values())


def description_names(mechanism: Mechanism, points: Sequence[Point] = ()) -> Names:
    """Return the names and units that the description alone determines, without coordinates of an engine's tree.

    Args:
        points: Named points.
    """
    bodies, reactions = [body.name for body in mechanism.bodies], reaction_names(mechanism.joints, mechanism.couplings)
    named = mechanism.joints, bodies, mechanism.independent, (), mechanism.actuator_names, reactions
    return component_names(*named, points=points)


def digits(scaled: float) -> float:
    """Return the digits of agreement for a scaled error: between 0 and 17, NaN for NaN."""
    if not np.isfinite(scaled):
        return float("nan")
    return float(np.clip(-np.log10(scaled), 0.0, MAX_DIGITS)) + 0.0 if scaled > 0.0 else MAX_DIGITS


def integrated_tolerance(rtol: float, atol: float) -> float:
    """Return the scaled error up to which two integrated motions agree."""
    return max(SOLVED, GROWTH * max(rtol, atol))


def check_quantities(
    names: Iterable[str], where: str = "", known: Iterable[str] = tuple(QUANTITIES)
) -> tuple[str, ...]:
    """Return the names in the order of the table; reject unknown names.

    Args:
        known: Names to choose from.

    Raises:
        ScrewgaugeError: The list is empty, or a name is unknown.
    """
    wanted = check_choice("quantity", names, known, where)
    return tuple(name for name in QUANTITIES if name in wanted)


def length(mechanism: Mechanism) -> float:
    """Return the largest distance [m] between joint points and centres of mass in the home pose; 1 if it is zero."""
    return kinematics.length(graph.layout(mechanism))


def arm(unit: str, length: float) -> float:
    """Return the power of `length` that converts angle to length, force to moment, or mass to inertia; otherwise 1."""
    if unit in RATIOS:
        return length ** RATIOS[unit]
    return length ** (2 if unit == "kg m^2" else unit in ("m", "m/s", "m/s^2", "N m", "kg m"))


def natural_scales(mechanism: Mechanism) -> dict[str, float]:
    """Return the natural scale S0 of each unit for a mechanism."""
    return scales_of(length(mechanism), mechanism.mass)


def scales_of(L: float, M: float) -> dict[str, float]:
    """Return S0 by unit: 1 rad, L, sqrt(g/L), sqrt(g L), g/L, g, M g, M g L, M, for a length [m] and a mass [kg]."""
    return {
        "rad": 1.0,
        "m": L,
        "rad/s": (G0 / L) ** 0.5,
        "m/s": (G0 * L) ** 0.5,
        "rad/s^2": G0 / L,
        "m/s^2": G0,
        "N": M * G0,
        "N m": M * G0 * L,
        "W": M * G0 * (G0 * L) ** 0.5,
        **{unit: M * arm(unit, L) for unit in INERTIA},
        **{unit: arm(unit, L) for unit in RATIOS},
    }
