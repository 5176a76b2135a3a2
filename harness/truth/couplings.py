"""Couplings in balls: as equations between series of joint coordinates, and as forces along two of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flint import arb, arb_mat

from screwgauge.reference.mechanism import Joint, Mechanism
from screwgauge.truth.exact import Jet, Vector, cross, dot, mul, vector


@dataclass(frozen=True, slots=True, eq=False)
class Tie:
    """A coupling ``q_i = p(q_j)``.

    Attributes:
        column, of: i and j; None where q_i is held.
        polynomial: Coefficients of p, lowest first.
    """

    column: int
    of: int | None
    polynomial: Vector

    def _value(self, x: Jet) -> Jet:
        """Series of the polynomial for that of its coordinate, by Horner."""
        value = [arb(0) for _ in x]
        for coefficient in reversed(self.polynomial):
            value = mul(value, x)
            value[0] += coefficient
        return value

    def error(self, q: Sequence[Jet]) -> Jet:
        """Series of ``q_i - p(q_j)``."""
        own = q[self.column]
        value = self._value([arb(0) for _ in own] if self.of is None else q[self.of])
        return [a - b for a, b in zip(own, value, strict=True)]

    def shares(self, q: Sequence[arb]) -> list[tuple[int, arb]]:
        """Derivative of the error: columns and what it is there, 1 and -p'."""
        if self.of is None:
            return [(self.column, arb(1))]
        return [(self.column, arb(1)), (self.of, -self._value([q[self.of], arb(1)])[1])]


def read_ties(mechanism: Mechanism, tables: Mapping[str, Any]) -> list[Tie]:
    """The couplings of a mechanism, their numbers from its tables."""
    place, ties = mechanism.coordinates.index, []
    for one in mechanism.couplings:
        polynomial = vector(tables["couplings"][one.name]["polynomial"])
        ties.append(Tie(place(one.coordinate), place(one.of) if one.of else None, polynomial))
    return ties


def along(axes: Sequence[Vector], i: int) -> Vector:
    """The vector in the span of one to three axes whose component along axis i is 1, and 0 along the others."""
    if len(axes) == 1:
        return axes[0]
    # of two, whose decimals are at right angles to rounding only, the third is at right angles to both
    beside = [*axes, cross(axes[0], axes[1])][:3]
    normal = cross(beside[(i + 1) % 3], beside[(i + 2) % 3])
    volume = dot(beside[i], normal)
    return [x / volume for x in normal]


def owner(mechanism: Mechanism, column: int) -> tuple[Joint, int]:
    """The joint of a coordinate, and which of its freedoms it is."""
    name = mechanism.coordinates[column]
    joint = next(joint for joint in mechanism.joints if name in joint.coordinates)
    return joint, joint.coordinates.index(name)


def directions(steps: Sequence[tuple[bool, Vector, arb_mat]], start: arb_mat) -> list[tuple[bool, Vector]]:
    """Directions of a joint's freedoms, each carried by those before it.

    Args:
        steps: Of each freedom whether it turns, its axis in the joint frame, and its matrix (4, 4).
        start: The joint frame on the parent, in the world. Shape (4, 4).
    """
    found = []
    for turns, axis, matrix in steps:
        rows = start.tolist()
        found.append((turns, [dot(row[:3], axis) for row in rows[:3]]))
        start = start * matrix
    return found
