"""Links as a library keeps them merged into the bodies of a `Reading`, and again where joints get other types."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.polynomial import polynomial

from screwgauge.models.content import Content
from screwgauge.models.readings.reading import BodyReading, CouplingReading, JointReading, Matter, Reading
from screwgauge.reference.errors import ModelFileError, UnknownNameError
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

    A body is named after its first link from the ground outwards that has mass, or, without any, after the first;
    among equally far ones the alphabet decides, since each library has an order of its own.

    Args:
        links: Each after the one that carries it.

    Raises:
        ModelFileError: A body that moves has the name of the ground.
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
    """One body of links, in the frame of the one that it is named after."""
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


SPHERICAL, FIXED = "SPHERICAL", "FIXED"
#: Universal joints by type -> the axes of the joint's frame about which they turn, the ground side first.
UNIVERSAL = {f"UJOINT_{one}{two}": (one, two) for one, two in permutations("XYZ", 2)}
KNOWN = (SPHERICAL, FIXED, *UNIVERSAL)
#: What a joint has besides its axis. None of it fits the axes of another type.
_OWN = ("armature", "damping", "friction", "stiffness")


def retyped(reading: Reading, types: Mapping[str, str], where: str) -> Reading:
    """The reading with joints replaced.

    A spherical or universal joint sits where the old one did, is unlimited, and is at zero where the old one was at
    home. The hinges of a universal joint ``name`` are called ``name_Z`` and ``name_Y``, after the axes of the frame of
    the link that the old joint carries. A fixed joint is gone, and what it joined is one body. The old names remain
    names of frames.

    Args:
        types: Joint -> one of `KNOWN`.
        where: The file that says so, to blame.

    Raises:
        ScrewgaugeError: There is no such joint or type, or something else depends on the joint.
    """
    for name, kind in types.items():
        if name not in reading.joints:
            raise UnknownNameError("joint", name, reading.joints, f"{where}, joint_name")
        if kind not in KNOWN:
            raise UnknownNameError(f"type of joint '{name}',", kind, KNOWN, f"{where}, joint_type")
    frames = {name: link for name in types if (link := reading.carried(name))}
    lost = (phrase for name, kind in types.items() for phrase in _lost(reading.joints[name], name, kind))
    content = (Content("read otherwise by the library", phrase, values=()) for phrase in lost)
    reading = replace(reading, frames={**reading.frames, **frames}, content=(*reading.content, *content))
    for name, kind in types.items():
        if kind != FIXED:
            _check_free(reading, name, kind, where)
            reading = _replaced(reading, name, _turning(reading, name, kind, where))
    return _welded(reading, [name for name, kind in types.items() if kind == FIXED], where)


def _lost(joint: JointReading, name: str, kind: str) -> Iterator[str]:
    """What the file says of a joint that does not hold for its new type."""
    if kind != FIXED:
        low, high = joint.limits
        limited = ["limits"] if low < high and not math.isinf(high - low) else []
        for what in (*limited, *(what for what in _OWN if getattr(joint, what))):
            yield f"{what} of joint {name}, which is made {kind}"


def _check_free(reading: Reading, name: str, kind: str, where: str) -> None:
    if any(name in (coupling.joint, coupling.of) for coupling in reading.couplings.values()):
        what = f"joint '{name}' is coupled to another one, and cannot be made {kind}"
        raise ModelFileError(what, f"{where}, joint_type", "take out its <mimic> or its joint_type")


def _turning(reading: Reading, name: str, kind: str, where: str) -> dict[str, JointReading]:
    """A spherical joint, or the hinges of a universal one, in the place of a joint."""
    centre = reading.joints[name].centre
    if kind == SPHERICAL:
        return {name: JointReading("ball", np.zeros(6), centre)}
    carried = reading.place(name)
    if carried is None:
        raise ModelFileError(f"joint '{name}' is one of several that carry a link", where, "leave out its joint_type")
    body, T = carried
    R = (reading.bodies[body].pose @ T)[:3, :3]
    hinges = {f"{name}_{axis}": R[:, "XYZ".index(axis)] for axis in UNIVERSAL[kind]}
    if taken := {*hinges} & {*reading.joints}:
        what = f"joint '{name}' is made of hinges, and '{min(taken)}' is a joint already"
        raise ModelFileError(what, f"{where}, joint_type", "give that joint another name")
    return {hinge: JointReading("hinge", screw(True, axis, centre), centre) for hinge, axis in hinges.items()}


def _replaced(reading: Reading, name: str, by: Mapping[str, JointReading]) -> Reading:
    """The reading with other joints, none or several, in the place of one."""
    body = reading.moved_by(name)
    joints = dict[str, JointReading]()
    for each, joint in reading.joints.items():
        joints |= by if each == name else {each: joint}
    chain = tuple(one for each in reading.bodies[body].joints for one in (by if each == name else (each,)))
    bodies = {**reading.bodies, body: replace(reading.bodies[body], joints=chain)}
    return replace(reading, joints=joints, bodies=bodies)


def _welded(reading: Reading, names: list[str], where: str) -> Reading:
    """The reading without some joints, whose bodies are one."""
    if not names:
        return reading
    couplings = dict(_kept(reading, names, where))
    for name in names:
        reading = _replaced(reading, name, {})
    assembly = assemble(_links(reading), where)
    if not reading.joints:
        raise ModelFileError("fixes all joints", f"{where}, joint_type", "leave one at least")
    return replace(reading, bodies=assembly.bodies, fixed={**reading.fixed, **assembly.fixed}, couplings=couplings)


def _kept(reading: Reading, names: list[str], where: str) -> Iterator[tuple[str, CouplingReading]]:
    """Couplings; what follows a fixed joint is held."""
    for key, coupling in reading.couplings.items():
        if coupling.joint in names:
            what = f"joint '{coupling.joint}' is coupled to another one, and cannot be made {FIXED}"
            raise ModelFileError(what, f"{where}, joint_type", "take out its <mimic> or its joint_type")
        if coupling.of in names:
            held = polynomial.polyval(reading.joints[coupling.of].home, coupling.polynomial)
            coupling = replace(coupling, of="", polynomial=np.array([held]))
        yield key, coupling


def _links(reading: Reading) -> Iterator[Link]:
    """The links of all bodies, the one with the mass of each among them, to be merged again."""
    for name, body in reading.bodies.items():
        near = "" if body.near == GROUND else body.near
        joints = body.joints
        if body.first:
            yield _empty(body.first, near, joints, body.pose @ body.fixed[body.first])
            near, joints = body.first, ()
        yield Link(name, near, joints, body.mass, body.com, body.inertia, body.pose, body.gravcomp)
        for link, T in body.fixed.items():
            if link != body.first:
                yield _empty(link, name, (), body.pose @ T)


def _empty(name: str, near: str, joints: tuple[str, ...], pose: Array) -> Link:
    return Link(name, near, joints, 0.0, np.zeros(3), np.zeros((3, 3)), pose)
