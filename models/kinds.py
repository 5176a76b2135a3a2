"""Finds the letter code for a link's degrees of freedom, and the point where its hinge axes intersect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from screwgauge.models.readings.reading import FREEDOMS
from screwgauge.reference.rotations import Array

if TYPE_CHECKING:
    from screwgauge.models.machine import Element

#: Largest distance of lines that count as intersecting or parallel, and of points that count as coincident [machine
#: lengths or rad].
CLOSE, SAME = 1e-6, 1e-9


def kind_of(elements: Sequence[Element], length: float) -> tuple[str, Array | None]:
    """Return the kind of a link, see `Link.kind`, and the point where the axes of a U, S or F joint intersect."""
    kinds = [each.kind for each in elements]
    if kinds == ["ball"]:
        return "S", elements[0].centre
    if sum(FREEDOMS[kind] for kind in kinds) == FREEDOMS["free"]:
        return "F", elements[-1].centre
    letters = letters_of(elements)
    if letters in ("RRR", "RR") and (centre := _intersection(elements, length)) is not None:
        return ("S" if len(elements) == 3 else "U"), centre
    if letters == "PR" and np.linalg.norm(np.cross(elements[0].direction, elements[1].direction)) < CLOSE:
        return "C", None
    return letters, None


def letters_of(elements: Sequence[Element]) -> str:
    """Return the letters of the elements, forwards or backwards, whichever comes first alphabetically."""
    letters = "".join({"hinge": "R", "slide": "P", "ball": "S", "free": "F"}[each.kind] for each in elements)
    return min(letters, letters[::-1])


def _intersection(hinges: Sequence[Element], length: float) -> Array | None:
    """Return the intersection of hinges with independent directions; None if they do not intersect. Shape (3,)."""
    axes = np.array([each.direction for each in hinges])
    if np.linalg.matrix_rank(axes, tol=CLOSE) < len(axes):
        return None
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    centres = np.array([each.centre for each in hinges])
    point = np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, centres))
    # a given point that coincides with the intersection is exact
    exact = centres[np.linalg.norm(centres - point, axis=1) < SAME * length]
    meet = np.linalg.norm(np.einsum("nij,nj->ni", across, point - centres), axis=1).max() < CLOSE * length
    return np.asarray([*exact, point][0]) if meet else None
