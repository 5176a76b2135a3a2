"""Links as a library keeps them, merged into the bodies of a `Reading`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.readings.reading import BodyReading, Matter
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, rotation


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A link (URDF) or body (MJCF), as a library keeps it.

    Attributes:
        near: The link that carries it; empty for one that hangs on the world.
        joints: Names of the joints between the two, from `near` outwards; none of one that is fixed.
        mass: [kg]; `com` [m], shape (3,); `inertia` about the centre of mass [kg m^2], shape (3, 3): in its own frame.
        pose: World pose at home. Shape (4, 4).
        gravcomp: Share of its weight that is compensated.
    """

    name: str
    near: str
    joints: tuple[str, ...]
    mass: float
    com: Array
    inertia: Array
    pose: Array
    gravcomp: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """Links merged.

    Attributes:
        bodies: See `Reading.bodies`.
        fixed: See `Reading.fixed`.
        places: Link -> body (or ground) that it is part of, and its frame in that body. Shape (4, 4).
    """

    bodies: dict[str, BodyReading]
    fixed: dict[str, Array]
    places: Mapping[str, tuple[str, Array]]


def assemble(links: Iterable[Link], where: str) -> Assembly:
    """Merges links that nothing moves against each other.

    A body is called after its first link from the ground outwards that has mass, or, without any, after the first;
    among equally far ones the alphabet decides, since each library has an order of its own.

    Args:
        links: Each after the one that carries it.

    Raises:
        ModelFileError: A body that moves is called like the ground.
    """
    groups: dict[str, list[tuple[int, Link]]] = {"": []}  # first link -> distance from it, link
    at = {"": ("", 0)}
    for link in links:
        key, far = (link.name, 0) if link.joints else (at[link.near][0], at[link.near][1] + 1)
        at[link.name] = key, far
        groups.setdefault(key, []).append((far, link))
    fixed = {link.name: link.pose for _, link in groups.pop("")}
    places = {name: (GROUND, pose) for name, pose in fixed.items()}
    bodies: dict[str, BodyReading] = {}
    for group in groups.values():
        ordered = [link for _, link in sorted(group, key=lambda entry: (entry[0], entry[1].name))]
        named = next((link for link in ordered if link.mass), ordered[0])
        if named.name == GROUND:
            raise ModelFileError(f"a body that moves is called '{GROUND}'", where, "give it another name")
        first = group[0][1]
        near = places[first.near][0] if first.near else GROUND
        body = _merged(named, ordered, near, first.joints)
        bodies[named.name] = body if named is first else replace(body, first=first.name)
        places |= {name: (named.name, T) for name, T in bodies[named.name].fixed.items()}
        places[named.name] = named.name, np.eye(4)
    return Assembly(bodies, fixed, places)


def _merged(named: Link, links: Sequence[Link], near: str, joints: tuple[str, ...]) -> BodyReading:
    """One body of links, in the frame of the one that it is called after."""
    back = np.linalg.inv(named.pose)
    frames = {link.name: back @ link.pose for link in links if link is not named}
    solid = [link for link in links if link.mass or link.inertia.any()]
    mass, com, inertia, gravcomp = named.mass, named.com, named.inertia, named.gravcomp
    if any(link is not named for link in solid):
        placed = ((link.mass, link.com, link.inertia, frames.get(link.name, np.eye(4))) for link in solid)
        mass, com, inertia = joined(placed)
        gravcomp = sum(link.mass * link.gravcomp for link in solid) / (mass or 1.0)
    parts = {link.name: _part(link, frames[link.name]) for link in solid if link is not named}
    return BodyReading(near, joints, float(mass), com, inertia, named.pose, float(gravcomp), frames, parts=parts)


def _part(link: Link, T: Array) -> Matter:
    """The matter of a link in another frame, in which its own is T. Shape (4, 4)."""
    R = T[:3, :3]
    return Matter(float(link.mass), R @ link.com + T[:3, 3], R @ link.inertia @ R.T)


def joined(parts: Iterable[tuple[float, Array, Array, Array]]) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it, shape (3, 3), of rigid parts as one (parallel axes).

    Args:
        parts: The same of each in its own frame, and that frame in the common one. Shape (4, 4).
    """
    parts = list(parts)
    mass = sum(m for m, _, _, _ in parts)
    coms = [T[:3, :3] @ c + T[:3, 3] for _, c, _, T in parts]
    com = np.sum([m * c for (m, _, _, _), c in zip(parts, coms, strict=True)], axis=0) / (mass or 1.0)
    inertia = np.zeros((3, 3))
    for (m, _, I, T), c in zip(parts, coms, strict=True):
        inertia += T[:3, :3] @ I @ T[:3, :3].T + m * steiner(c - com)
    return mass, com, inertia


def steiner(r: Array) -> Array:
    """Inertia of a unit mass at a point about the origin [m^2]. Shape (3,) -> (3, 3)."""
    return np.asarray((r @ r) * np.eye(3) - np.outer(r, r))


def matrix(p: Array, R: Array) -> Array:
    """A placement as a (4, 4) matrix."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def exponential(kind: str, direction: Array, centre: Array, q: float) -> Array:
    """Displacement by a hinge or slide in direction and through a centre, both of shape (3,). Shape (4, 4)."""
    if kind == "slide":
        return matrix(q * direction, np.eye(3))
    R = rotation(direction, np.array(q))
    return matrix(centre - R @ centre, R)


def screw(turns: bool, axis: Array, point: Array) -> Array:
    """Unit screw of a rotation or translation. Shape (6,)."""
    return np.concatenate([axis, np.cross(point, axis)] if turns else [np.zeros(3), axis])
