"""Mass, centre of mass and inertia of something rigid: moved, put together, taken apart; poses in poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.models.readings.assemble import matrix
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Matter:
    """Something rigid, in some frame.

    Attributes:
        mass: [kg].
        com: Centre of mass [m]. Shape (3,).
        inertia: About it [kg m^2]. Shape (3, 3).
    """

    mass: float
    com: Array
    inertia: Array


NOTHING = Matter(0.0, np.zeros(3), np.zeros((3, 3)))


def steiner(r: Array) -> Array:
    """Inertia of a unit mass at a point about the origin [m^2]. Shape (3,) -> (3, 3)."""
    return np.asarray((r @ r) * np.eye(3) - np.outer(r, r))


def relative(near: Array, far: Array) -> Array:
    """One pose in another. Shape (4, 4)."""
    R = near[:3, :3].T
    return matrix(R @ (far[:3, 3] - near[:3, 3]), R @ far[:3, :3])


def displaced(matter: Matter, T: Array) -> Matter:
    """The same in another frame, or displaced in its own.

    Args:
        T: From the frame of `matter` to the other. Shape (4, 4).
    """
    R = T[:3, :3]
    return Matter(matter.mass, R @ matter.com + T[:3, 3], R @ matter.inertia @ R.T)


def same(first: Matter, second: Matter) -> bool:
    """Whether two are the same to the last bit."""
    pairs = ((first.com, second.com), (first.inertia, second.inertia))
    return first.mass == second.mass and all(np.array_equal(a, b) for a, b in pairs)


def combined(first: Matter, second: Matter, sign: float = 1.0) -> Matter:
    """Two as one; with `sign` -1 the first without the second.

    Where nothing but a dipole is left, its mass is zero and the centre of mass stays where the first has it.
    """
    mass = first.mass + sign * second.mass
    if mass == 0.0:
        return Matter(0.0, first.com, first.inertia + sign * second.inertia)
    # about the centre of the first: what is small stays small
    step = sign * second.mass / mass * (second.com - first.com)
    com = first.com + step
    parts = first.mass * steiner(first.com - com) + sign * second.mass * steiner(second.com - com)
    return Matter(mass, com, first.inertia + sign * second.inertia + parts)


def changed(matter: Matter, before: Matter, after: Matter) -> Matter:
    """A part of a body, changed by what the whole changes from `before` to `after`; all in one frame."""
    # (part - before) + after, in the ten parameters, in which bodies add: (m, m c, inertia about the origin)
    old, new = _parameters(before), _parameters(after)
    mass, first, second = (x + (b - a) for x, a, b in zip(_parameters(matter), old, new, strict=True))
    if not mass > 0.0:
        return Matter(float(mass), np.zeros(3), second)
    com = first / mass
    return Matter(float(mass), com, second - mass * steiner(com))


def _parameters(matter: Matter) -> tuple[Array, Array, Array]:
    m, c = matter.mass, matter.com
    return np.asarray(m), m * c, matter.inertia + m * steiner(c)
