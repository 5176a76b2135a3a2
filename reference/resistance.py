"""Resistance of joint coordinates: rotor inertia, damping and dry friction.

Rotors follow the armature model, which has inertia only along the coordinate. The model omits the remaining effects of
a geared rotor: gyroscopic moments, and the rotor's coupling with the acceleration of the body that carries it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.rotations import Array

if TYPE_CHECKING:
    from screwgauge.reference.mechanism import Joint, Mechanism

#: Names of the resistance parameters.
RESISTS = ("rotor", "damping", "friction")
#: Inertia; dissipative resistances; and the dissipative resistance whose direction is undefined at rest.
ROTORS, LOSSES, DRY = RESISTS[:1], RESISTS[1:], RESISTS[2:]
#: Rate, far above rounding, below which a coordinate is at rest and dry friction lacks a direction [rad/s or m/s].
REST = 1e-9


class Resistance(NamedTuple):
    """Resistance of one joint coordinate.

    Attributes:
        column: Column of the coordinate among those of all joints.
        what: Kind of resistance (`RESISTS`): ``rotor qdd``, ``damping qd`` or ``friction sign(qd)`` is subtracted from
            the force along the coordinate. At rest, dry friction is taken as zero (physically, any value up to its
            maximum).
        unit: Unit of the resisting force.
    """

    column: int
    coordinate: str
    what: str
    amount: float
    unit: str

    @property
    def name(self) -> str:
        """Name of the coordinate, followed by the kind of resistance."""
        return f"{self.coordinate}.{self.what}"


@lru_cache(maxsize=256)
def resistances(joints: tuple[Joint, ...], kinds: tuple[str, ...] = RESISTS) -> tuple[Resistance, ...]:
    """List the nonzero resistances of the given kinds, coordinate by coordinate."""
    each = ((joint, i) for joint in joints for i in range(len(joint.coordinates)))
    return tuple(
        Resistance(column, joint.coordinates[i], what, amount, "N m" if joint.freedoms[i][0] else "N")
        for column, (joint, i) in enumerate(each)
        for what in kinds
        if (amount := plain(getattr(joint, what)[i])) or not isinstance(amount, float)
    )


def plain(amount: Any) -> Any:
    """Convert a float of any precision to a Python float; return other scalars, such as trace nodes, unchanged."""
    return float(amount) if isinstance(amount, float | np.floating) else amount


def rotors_of(joints: tuple[Joint, ...]) -> dict[str, float]:
    """Return the nonzero rotor inertias by coordinate."""
    return {one.coordinate: one.amount for one in resistances(joints, ROTORS)}


def without_resistance(mechanism: Mechanism, what: str) -> Mechanism:
    """Remove rotors, damping or dry friction from a mechanism; return it unchanged if it lacks them."""
    if not resistances(mechanism.joints, (what,)):
        return mechanism
    joints = tuple(replace(joint, **{what: 0.0 * getattr(joint, what)}) for joint in mechanism.joints)
    return replace(mechanism, joints=joints)


def amounts(what: str, given: Array, n: int, where: str) -> Array:
    """Return the amounts for n coordinates, which are zero by default. Shape (n,).

    Raises:
        DescriptionError: An amount is negative or not finite, or the number of amounts is not n.
    """
    each = given if len(given) else np.zeros(n)
    if len(each) != n or not (np.isfinite(each) & (each >= 0.0)).all():
        raise DescriptionError(f"{what} is {each.tolist()}", where, f"use {n} finite numbers, zero or more")
    return each
