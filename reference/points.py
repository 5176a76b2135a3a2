"""Data of named body points whose velocities are requested."""

from __future__ import annotations

from dataclasses import dataclass

from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """A point of a body.

    Attributes:
        name: Names its components; no body has it.
        body: The body.
        place: In the frame of the body [m]. Shape (3,).
    """

    name: str
    body: str
    place: Array
