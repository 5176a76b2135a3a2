"""A residual over time: what an equation leaves over, and against what it is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """What an equation leaves over.

    Attributes:
        components: Names of the columns.
        values: Shape (n, m).
        scale: Measure of a small residual, one number or one for each component, shape (m,).
        t: Times [s] if they are not those of the scene. Shape (n,).
    """

    name: str
    unit: str
    components: Sequence[str]
    values: Array
    scale: float | Array
    t: Array | None = None
