"""Displaces, combines and divides the mass properties of rigid bodies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Matter:
    """Mass properties of a rigid body, expressed in a given frame.

    Attributes:
        mass: Mass [kg].
        com: Centre of mass [m]. Shape (3,).
        inertia: Inertia about the centre of mass [kg m^2]. Shape (3, 3).
    """

    mass: float
    com: Array
    inertia: Array

    @property
    def possible(self) -> bool:
        """True if the mass is positive and no moment of inertia is negative."""
        return self.mass > 0.0 and float(np.linalg.eigvalsh(self.inertia).min()) >= -1e-9 * float(
            np.abs(self.inertia).max()
        )

    @property
    def solid(self) -> bool:
        """True if the body has mass or inertia."""
        return bool(self.mass or self.inertia.any())


NOTHING = Matter(0.0, np.zeros(3), np.zeros((3, 3)))


#: Shape that `uniform` supports -> names of its lengths, in the order of the argument `lengths`.
SHAPES = {
    "box": ("x", "y", "z"),
    "ellipsoid": ("x", "y", "z"),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "cone": ("radius", "length"),
}


def uniform(shape: str, lengths: Sequence[float], density: float = 1.0) -> Matter:
    """Compute the mass properties of a uniform solid with its length along z, centred at the origin.

    Args:
        shape: One of `SHAPES`.
        lengths: Sides of a box, semi-axes of an ellipsoid, or radius and length [m]; the length of a capsule is the
            length of its cylinder.
        density: Density [kg/m^3].
    """
    if shape in ("box", "ellipsoid", "sphere"):
        x, y, z = (*lengths, *lengths, *lengths)[:3]
        volume, share = (x * y * z, 12.0) if shape == "box" else (4.0 / 3.0 * math.pi * x * y * z, 5.0)
        squares = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
        return Matter(density * volume, np.zeros(3), density * volume / share * np.diag(squares))
    r, l = lengths
    m, com = density * math.pi * r * r * l, np.zeros(3)
    if shape == "cone":
        m, com = m / 3.0, np.array([0.0, 0.0, -0.25 * l])
        across, along = m * (0.15 * r * r + 0.0375 * l * l), 0.3 * m * r * r
        return Matter(m, com, np.diag([across, across, along]))
    whole = Matter(m, com, m * np.diag([(3.0 * r * r + l * l) / 12.0, (3.0 * r * r + l * l) / 12.0, 0.5 * r * r]))
    if shape == "cylinder":
        return whole
    half = 2.0 / 3.0 * math.pi * density * r**3  # hemisphere, centre of mass 3/8 of the radius from its base
    cap = half * r * r * np.diag([0.4 - 9.0 / 64.0, 0.4 - 9.0 / 64.0, 0.4])
    ends = (Matter(half, np.array([0.0, 0.0, side * (0.5 * l + 0.375 * r)]), cap) for side in (-1.0, 1.0))
    return join((whole, *ends))


def polyhedron(points: Array, triangles: Array, density: float = 1.0) -> Matter:
    """Compute the mass properties of a uniform solid within a closed surface; `NOTHING` if its volume is zero.

    Args:
        points: Vertices [m]. Shape (n, 3).
        triangles: Vertex indices; all triangles have the same orientation as seen from outside. Shape (m, 3).
        density: Density [kg/m^3].
    """
    corners = points[triangles]
    volumes = np.linalg.det(corners) / 6.0  # of tetrahedra with their fourth vertex at the origin
    volume = float(volumes.sum())
    if not abs(volume) > 1e-12 * float(np.abs(corners).max(initial=0.0)) ** 3:
        return NOTHING
    sums = corners.sum(axis=1)
    com = volumes @ sums / (4.0 * volume)
    squares = np.einsum("t,ti,tj->ij", volumes, sums, sums) + np.einsum("t,tki,tkj->ij", volumes, corners, corners)
    spread = squares / 20.0 - volume * np.outer(com, com)
    mass = density * abs(volume)
    return Matter(mass, com, mass / volume * (np.trace(spread) * np.eye(3) - spread))


def displace(matter: Matter, T: Array) -> Matter:
    """Transform mass properties to a different frame, or displace them in their own frame.

    Args:
        T: Placement of the frame of `matter` in the new frame. Shape (4, 4).
    """
    R = T[:3, :3]
    return Matter(matter.mass, R @ matter.com + T[:3, 3], R @ matter.inertia @ R.T)


def is_same(first: Matter, second: Matter) -> bool:
    """Return True if the mass properties of two bodies are equal to the last bit."""
    pairs = ((first.com, second.com), (first.inertia, second.inertia))
    return first.mass == second.mass and all(np.array_equal(a, b) for a, b in pairs)


def combine(first: Matter, second: Matter, sign: float = 1.0) -> Matter:
    """Combine two bodies; with `sign` -1, remove the second body from the first.

    If the remaining mass is zero, the first body's centre of mass is kept.
    """
    mass = first.mass + sign * second.mass
    if mass == 0.0:
        return Matter(0.0, first.com, first.inertia + sign * second.inertia)
    # moments about the centre of the first body, which keeps small quantities small
    step = sign * second.mass / mass * (second.com - first.com)
    com = first.com + step
    parts = first.mass * steiner(first.com - com) + sign * second.mass * steiner(second.com - com)
    return Matter(mass, com, first.inertia + sign * second.inertia + parts)


def remainder(whole: Matter, parts: Iterable[Matter]) -> Matter:
    """Subtract parts from a body; all are expressed in one frame."""
    return reduce(lambda left, part: combine(left, part, -1.0), parts, whole)


def join(parts: Iterable[Matter]) -> Matter:
    """Combine rigid parts into one body; all are expressed in one frame."""
    parts = [*parts]
    mass = sum(part.mass for part in parts)
    com = np.sum([part.mass * part.com for part in parts], axis=0) / (mass or 1.0)
    inertia = np.zeros((3, 3))
    for part in parts:
        inertia += part.inertia + part.mass * steiner(part.com - com)
    return Matter(float(mass), com, inertia)


def steiner(r: Array) -> Array:
    """Return the inertia about the origin of a unit mass at point r [m^2]. Shape (3,) -> (3, 3)."""
    return np.asarray((r @ r) * np.eye(3) - np.outer(r, r))


def change_part(matter: Matter, before: Matter, after: Matter) -> Matter:
    """Apply a body's change from `before` to `after` to one of its parts; all are expressed in one frame."""
    # (part - before) + after, in the ten additive parameters: (m, m c, inertia about the origin)
    old, new = _parameters(before), _parameters(after)
    mass, first, second = (x + (b - a) for x, a, b in zip(_parameters(matter), old, new, strict=True))
    if not mass > 0.0:
        return Matter(float(mass), np.zeros(3), second)
    com = first / mass
    return Matter(float(mass), com, second - mass * steiner(com))


def _parameters(matter: Matter) -> tuple[Array, Array, Array]:
    m, c = matter.mass, matter.com
    return np.asarray(m), m * c, matter.inertia + m * steiner(c)


def plainest(parts: Mapping[int, Matter], before: Matter, after: Matter) -> tuple[int, Matter]:
    """Return the part that has to change least to account for a change in the whole body, and the changed part.

    Args:
        parts: Index -> part, in the frame of the body; in case of a tie, the first part is chosen.

    Returns:
        Index of the part and the changed part. Physically possible parts are preferred, then parts for which the fewest
        of mass, centre of mass and inertia change.
    """
    if len(parts) == 1:
        return next(iter(parts)), after
    found = {i: change_part(part, before, after) for i, part in parts.items()}
    if _much(before, after):  # the other parts would be lost in the rounding error of a much larger part
        others = {i: [part for j, part in parts.items() if j != i] for i in parts}
        found = {i: remainder(after, others[i]) for i in parts}
    scale, size = max(after.mass, before.mass), max(_size(before), _size(after))
    steps = {i: np.array(list(steps_of(parts[i], matter, scale, size).values())) for i, matter in found.items()}
    least = max(1e-14, 1e-6 * min(float(step.max()) for step in steps.values()))

    def cost(i: int) -> tuple[bool, int, float]:
        return not found[i].possible, int((steps[i] > least).sum()), float(steps[i].sum())

    chosen = min(found, key=cost)
    kept = zip(("mass", "com", "inertia"), steps[chosen] <= 1e-14, strict=True)  # ignore rounding of the sums
    return chosen, Matter(*(getattr(parts[chosen] if same else found[chosen], name) for name, same in kept))


def spread(parts: Mapping[int, Matter], before: Matter, after: Matter) -> dict[int, Matter]:
    """Scale and shift all parts of a body together, and add the remaining inertia to the heaviest part."""
    ratio, step = after.mass / before.mass, after.com - before.com
    found = {i: Matter(ratio * part.mass, part.com + step, ratio * part.inertia) for i, part in parts.items()}
    heaviest = max(found, key=lambda i: found[i].mass)
    rest = after.inertia - ratio * before.inertia
    found[heaviest] = replace(found[heaviest], inertia=found[heaviest].inertia + rest)
    return found


def divide(parts: Mapping[int, Matter], after: Matter) -> dict[int, Matter]:
    """Divide a body among its parts in proportion to their masses; all parts get the body's centre of mass."""
    whole = sum(part.mass for part in parts.values())
    shares = {i: part.mass / whole for i, part in parts.items()}
    return {i: Matter(share * after.mass, after.com, share * after.inertia) for i, share in shares.items()}


def _much(before: Matter, after: Matter) -> bool:
    """Return True if a body's mass or inertia becomes more than ten times smaller."""
    moments = (float(np.abs(m.inertia + m.mass * steiner(m.com)).max()) for m in (before, after))
    return next(moments) > 10.0 * next(moments) or before.mass > 10.0 * after.mass


def _size(matter: Matter) -> float:
    """Estimate how far the mass extends from the origin [m]."""
    reach = np.sqrt(np.abs(matter.inertia).max() / matter.mass) if matter.mass > 0.0 else 0.0
    return float(np.abs(matter.com).max() + reach)


def steps_of(old: Matter, new: Matter, mass: float = 0.0, size: float = 0.0) -> dict[str, float]:
    """Compute the changes in mass, centre of mass and inertia, each relative to the scale of the whole body.

    Args:
        mass: Mass of the whole body, if it is larger than both masses [kg].
        size: Length of the whole body [m].
    """
    # the length of a point mass at the origin is zero; products of the lower bounds must not underflow
    m, L = max(mass, old.mass, new.mass, 1e-90), max(size, _size(old), _size(new), 1e-90)
    com = float(np.abs(new.com - old.com).max())
    return {
        "mass": abs(new.mass - old.mass) / m,
        "com": com / L,
        "inertia": float(np.abs(new.inertia - old.inertia).max()) / (m * L**2),
    }
