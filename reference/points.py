"""Data class of named body points whose velocities are requested."""

from __future__ import annotations

from dataclasses import dataclass

from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """A point of a body.

    Attributes:
        name: Prefix of the point's components; it differs from all body names.
        body: Name of the body.
        place: Position in the body frame [m]. Shape (3,).
    """

    name: str
    body: str
    place: Array
