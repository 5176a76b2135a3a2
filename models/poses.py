"""Computes placements as (4, 4) matrices, and joint axes as screws."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.rotations import Array, cross, rotation


def matrix(p: Array, R: Array) -> Array:
    """Build a placement from a position and a rotation. Shapes (3,), (3, 3) -> (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def relative(near: Array, far: Array) -> Array:
    """Compute the pose of `far` relative to `near`. Shape (4, 4)."""
    R = near[:3, :3].T
    return matrix(R @ (far[:3, 3] - near[:3, 3]), R @ far[:3, :3])


def exponential(kind: str, direction: Array, centre: Array, q: float) -> Array:
    """Compute the displacement of a hinge or slide by `q`, given direction and centre. Shapes (3,), (3,) -> (4, 4)."""
    if kind == "slide":
        return matrix(q * direction, np.eye(3))
    R = rotation(direction, np.array(q))
    return matrix(centre - R @ centre, R)


def shortest_turn(way: Array, other: Array) -> Array:
    """Compute the smallest rotation that maps one unit vector to another; return the identity if they are opposite.

    Shapes (3,), (3,) -> (3, 3).
    """
    axis = cross(way, other)
    sine = float(np.linalg.norm(axis))
    return rotation(axis / sine, np.arctan2(sine, way @ other)) if sine > 0.0 else np.eye(3)


def shortest_step(one: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
    """Compute the displacement from one axis (direction, point) to another, without rotation about it. Shape (4, 4)."""
    R = shortest_turn(one[0], other[0])
    return matrix(other[1] - R @ one[1], R)


def screw(turns: bool, axis: Array, point: Array) -> Array:
    """Return the unit screw of a rotation or translation. Shape (6,)."""
    return np.concatenate([axis, np.cross(point, axis)] if turns else [np.zeros(3), axis])
