"""The quantities that engines are compared in: names, meaning, and the natural scale of each unit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from screwgauge.reference import graph
from screwgauge.reference.equations import kinematics
from screwgauge.reference.errors import check_choice
from screwgauge.reference.mechanism import Mechanism

G0 = 9.81  # [m/s^2], only a scale
MAX_DIGITS = 17.0


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity that engines compute.

    Attributes:
        needs: What has to be known before: ``q``, ``v``, ``a`` (positions, rates, accelerations) or ``f`` (forces).
        tolerance: Scaled error up to which two engines agree.
        ruled: Whether a rule fixes what redundant actuation leaves open.
    """

    name: str
    meaning: str
    needs: str
    tolerance: float
    ruled: bool = False


# 1e-11: rounding (2.2e-16) times the condition of the closure and force systems (up to 1e3 away from singular
# poses) leaves about 12.5 digits; a wrong term leaves none. 1e-12 where nothing is solved: recursions only.
SOLVED, RECURSIVE = 1e-11, 1e-12

QUANTITIES = {
    quantity.name: quantity
    for quantity in (
        Quantity("joint_position", "all joint coordinates", "q", SOLVED),
        Quantity("joint_velocity", "their rates", "v", SOLVED),
        Quantity("joint_acceleration", "their second derivatives", "a", SOLVED),
        Quantity("body_angular_velocity", "angular velocity of each body, world axes", "v", SOLVED),
        Quantity("body_angular_acceleration", "angular acceleration of each body, world axes", "a", SOLVED),
        Quantity("com_acceleration", "acceleration of each centre of mass, world axes", "a", SOLVED),
        Quantity("tree_force", "joint forces of the open tree: RNEA against mj_inverse", "a", RECURSIVE),
        Quantity("tree_force_soft", "the same with MuJoCo's equality constraints on", "a", RECURSIVE),
        Quantity("generalized_force", "what the actuators must deliver for each coordinate", "f", SOLVED),
        Quantity("actuator_force", "force of each actuator", "f", SOLVED, ruled=True),
        Quantity("reaction", "every constraint force and moment, predecessor on successor", "f", SOLVED, ruled=True),
        Quantity("observable", "what a forward scene follows", "q", SOLVED),
    )
}
#: What engines compute when the motion is given, and when it is integrated.
GIVEN = tuple(name for name in QUANTITIES if name != "observable")
SIMULATED = ("joint_position", "joint_velocity", "joint_acceleration", "observable")
#: Unit of a coordinate -> unit of a force along it.
FORCE = {"rad": "N m", "m": "N"}
#: Share of its natural scale, or of its largest summand, below which no magnitude is a measure.
FLOOR = 1e-6
#: Error of a motion over the tolerance of its steps. The smooth established problems show up to 160 (a01-pendulum at
#: 1e-6), stiff ones less; singular poses multiply errors further, so scenes that pass them say tolerances of their own.
GROWTH = 1e3


def digits(scaled: float) -> float:
    """Digits of agreement of a scaled error: 17 at most, 0 at least, NaN where there is no number."""
    if not np.isfinite(scaled):
        return float("nan")
    return float(np.clip(-np.log10(scaled), 0.0, MAX_DIGITS)) + 0.0 if scaled > 0.0 else MAX_DIGITS


def integrated_tolerance(rtol: float, atol: float) -> float:
    """Scaled error up to which two integrated motions agree."""
    return max(SOLVED, GROWTH * max(rtol, atol))


def check_quantities(
    names: Iterable[str], where: str = "", known: Iterable[str] = tuple(QUANTITIES)
) -> tuple[str, ...]:
    """The names in the order of the table.

    Args:
        known: Those that there are to choose from.

    Raises:
        ScrewgaugeError: There is none, or one of them is not among the known.
    """
    wanted = check_choice("quantity", names, known, where)
    return tuple(name for name in QUANTITIES if name in wanted)


def length(mechanism: Mechanism) -> float:
    """Largest distance [m] between joint points and centres of mass at the home pose, 1 if there is none."""
    return kinematics.length(graph.layout(mechanism))


def arm(unit: str, length: float) -> float:
    """What turns an angle into this unit of length, or a force into this unit of moment, else 1."""
    return length if unit in ("m", "m/s", "m/s^2", "N m") else 1.0


def natural_scales(mechanism: Mechanism) -> dict[str, float]:
    """S0 by unit, of a mechanism."""
    return scales_of(length(mechanism), mechanism.mass)


def scales_of(L: float, M: float) -> dict[str, float]:
    """S0 by unit: 1 rad, L, sqrt(g/L), sqrt(g L), g/L, g, M g, M g L, of a length [m] and a mass [kg]."""
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
    }
