"""Lint of a mechanism: what is legal and seldom meant, in one sentence each; nothing is changed.

Numbers that no machine has, such as moments of inertia in another unit and angles in degrees, are told with what they
would be in the unit that was probably meant; geometry and masses with the place to look at.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from screwgauge.reference.layout import layout
from screwgauge.reference.mechanism import Body, Joint, Mechanism
from screwgauge.reference.pose import length, pose
from screwgauge.reference.rotations import Array, cross, widest
from screwgauge.reference.wording import first_few

#: A body is suspected whose radius of gyration is so many times its size and which is lighter than air [kg/m^3].
LARGER, AIR = 2.0, 1.2
#: Half axes of its ellipsoid are taken for no less than this share of the longest one: rods and plates have a volume.
SLENDER = 1.0 / 30.0
#: Units in which moments of inertia are found in data sheets and CAD -> kg m^2.
UNITS = {"g m^2": 1e-3, "kg cm^2": 1e-4, "kg mm^2": 1e-6, "g cm^2": 1e-7, "g mm^2": 1e-9}
#: Radius of gyration over size of a body that can be.
USUAL = (0.03, 1.0)
#: Turns of a hinge that are more than a joint makes which does not run round: as a limit, or to and fro [rad].
TURNED = 4.0 * np.pi
#: An angle in degrees is hardly larger.
DEGREES = 720.0
#: Bodies that are told of one by one, or named.
SHOWN = 3
#: How to write an angle in degrees.
WRITTEN = "degrees are written as '30*deg'"


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A body with mass.

    Attributes:
        inertia: About the centre of mass [kg m^2]. Shape (3, 3).
        size: Between its joints and its centre of mass or, of a body with one joint, those of all bodies [m].
    """

    name: str
    mass: float
    inertia: Array
    size: float


@dataclass(frozen=True, slots=True)
class Hinge:
    """A coordinate that is an angle and that no coupling ties to others; `home` and `limits` [rad]."""

    name: str
    home: float
    limits: tuple[float, float]


def implausible(mechanism: Mechanism) -> tuple[str, ...]:
    """Sentences on bodies and joints."""
    return (*all_too_wide(solids(mechanism)), *too_far(hinges(mechanism)))


def all_too_wide(bodies: Iterable[Solid]) -> tuple[str, ...]:
    """Sentences on the bodies that `too_wide` tells of, the rest being named in one where there are many."""
    found = {one.name: text for one in bodies if (text := too_wide(one))}
    if len(found) <= SHOWN:
        return (*found.values(),)
    first, *rest = found
    return found[first], f"{len(rest)} more bodies are lighter than air in the same way: {first_few(rest, SHOWN)}"


def solids(mechanism: Mechanism) -> Iterator[Solid]:
    """Its bodies that have mass."""
    at = pose(layout(mechanism), mechanism.home[None])
    R, p = at.R, at.p
    index, places = mechanism.body_index, {body.name: list[Array]() for body in mechanism.bodies}
    for joint in mechanism.joints:
        for name, frame in joint.sides:
            if name in places and joint.constrains:
                places[name].append(frame.p)
    heavy = [body for body in mechanism.bodies if body.mass]
    cloud = [p[0, i] + R[0, i] @ point for name, i in index.items() for point in places.get(name, ())]
    extent = widest([*cloud, *(p[0, index[body.name]] + R[0, index[body.name]] @ body.com for body in heavy)])
    for body in heavy:
        yield Solid(body.name, body.mass, body.inertia, size_of([*places[body.name], body.com], extent))


def size_of(points: list[Array], extent: float) -> float:
    """Size of a body with joints and, last, its centre of mass at these points, in a machine of this extent [m]."""
    return (widest(points) if len(points) > 2 else 0.0) or extent


def too_wide(body: Solid) -> str:
    """A sentence on a body with more inertia than one of its mass and size can have; empty if it can."""
    moments = np.linalg.eigvalsh(body.inertia)
    radius = float(np.sqrt(max(moments[-1], 0.0) / body.mass))
    half = np.sqrt(np.maximum(2.5 * (moments.sum() - 2.0 * moments) / body.mass, 0.0))
    volume = 4.0 / 3.0 * np.pi * float(np.prod(np.maximum(half, SLENDER * half.max(initial=0.0))))
    if not (body.size > 0.0 and radius > LARGER * body.size and body.mass < AIR * volume):
        return ""
    shares = {unit: radius * factor**0.5 / body.size for unit, factor in UNITS.items()}
    meant = [unit for unit, share in shares.items() if USUAL[0] <= share <= USUAL[1]]
    alike = "a placeholder, or " if np.ptp(moments) < 1e-9 * moments[-1] else ""
    likely = f"{alike}likely {' or '.join(meant)} meant" if meant else "no usual unit explains it"
    return (
        f"{body.name}: a moment of inertia of {moments[-1]:.4g} kg m^2 on {body.mass:.4g} kg is a radius of gyration "
        f"of {radius:.3g} m, of a body about {body.size:.2g} m large, and makes it lighter than air ({likely})"
    )


def hinges(mechanism: Mechanism) -> Iterator[Hinge]:
    """Its angles; not those that gears and screws turn, nor those of free bodies."""
    tied = {name for one in mechanism.couplings for name in (one.coordinate, one.of)}
    for joint in mechanism.joints:
        for (turns, _), name, home, (low, high) in zip(
            joint.freedoms, joint.coordinates, joint.home, joint.limits, strict=True
        ):
            if turns and name not in tied and joint.constrains:
                yield Hinge(name, float(home), (float(low), float(high)))


def too_far(angles: Iterable[Hinge]) -> Iterator[str]:
    """Sentences on hinges whose home or limits are several turns away from zero, as where degrees were meant."""
    for one in angles:
        far = [x for x in one.limits if TURNED < abs(x) <= DEGREES and not float(np.log10(abs(x))).is_integer()]
        if far:
            yield f"{one.name}: {in_degrees('a limit', max(far, key=lambda x: (abs(x), x)))}"
        if 2.0 * np.pi < abs(one.home) <= DEGREES:
            yield f"{one.name}: {in_degrees('a home', one.home)}"


def in_degrees(what: str, angle: float) -> str:
    """An angle [rad] with what it is if degrees were meant."""
    turns, less = abs(angle) / (2.0 * np.pi), np.radians(angle)
    return f"{what} of {angle:.4g} rad is {turns:.3g} turns; likely degrees were meant, {less:.3g} rad"


#: What is exactly zero but for rounding; below the other ones, an angle [rad] or a distance [lengths of the mechanism]
#: is hardly meant. A right angle written as 1.5708 is 4e-6 off.
ROUNDING, ANGLE, DISTANCE = 1e-8, 0.01, 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Suspicion:
    """Something to look at.

    Attributes:
        point: Where, in the frame of the body [m]. Shape (3,).
    """

    body: str
    point: Array
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
    joint: str
    turns: bool
    e: Array
    p: Array


def suspicious(mechanism: Mechanism) -> tuple[Suspicion, ...]:
    """All that is found, body by body."""
    lay = layout(mechanism)
    unit, at, index = length(lay), pose(lay, mechanism.home[None]), mechanism.body_index
    joints = [joint for joint in mechanism.joints if joint.constrains]
    cloud = [at.p[0, index[j.parent]] + at.R[0, index[j.parent]] @ j.parent_frame.p for j in joints]
    extent = widest(cloud)
    found = list[Suspicion]()
    wide = {solid.name: text for solid in solids(mechanism) if (text := too_wide(solid))}
    for body in mechanism.bodies:
        if body.name in wide:
            found.append(Suspicion(body.name, body.com, wide[body.name]))
        its = [(joint, frame.p) for joint in joints for name, frame in joint.sides if name == body.name]
        found += _masses(body, its, unit, extent)
        axes = _axes(mechanism, body.name)
        for a, b in combinations(axes, 2):
            if text := _between(a, b, unit, few=len(its) == 2):
                found.append(Suspicion(body.name, a.p, text))
    return tuple(found)


def _axes(mechanism: Mechanism, body: str) -> list[_Axis]:
    """Axes that are fixed in a body: the outer ones of its joints."""
    found = []
    for joint in mechanism.joints:
        if joint.angles == 3:
            continue
        for side, (name, frame) in enumerate(joint.sides):
            if name == body:
                # the parent of a planar joint has a normal to it, the child also the point in which it turns
                line = joint.angles > 0 and (side == 1 or joint.slides < 2)
                found.append(_Axis(joint.name, line, frame.R @ joint.axes[-side], frame.p))
    return found


def _masses(body: Body, its: list[tuple[Joint, Array]], unit: float, extent: float) -> Iterator[Suspicion]:
    """What is odd about a body with these joints at these points; `extent`: of all joints [m]."""
    name, points = body.name, [point for _, point in its]
    if body.mass == 0.0:
        yield Suspicion(name, body.com, f"{name} has no mass of its own")
        return
    spread = widest(points)
    away = min((_distance(body.com, a, b) for a in points for b in points), default=0.0)
    measure = (spread, "its joints are") if spread > DISTANCE * unit else (extent, "all joints are")
    if len(points) > 1 and away > max(2.0 * measure[0], 0.05 * unit) and measure[0] > 0.0:
        text = (
            f"the centre of mass of {name} is {away:.3g} m away from its joints; {measure[1]} {measure[0]:.3g} m apart"
        )
        yield Suspicion(name, body.com, text)
    if len(points) > 1 and max(spread, away) < ROUNDING * unit and not any(joint.slides for joint, _ in its):
        yield Suspicion(name, body.com, f"{name} has no length: joints and centre of mass are at one point")
    moments = np.linalg.eigvalsh(body.inertia)
    if moments[0] > 0.0 and np.ptp(moments) < 1e-9 * moments[-1]:
        text = f"{name} has {moments[0]:.3g} kg m^2 about every axis, as a ball or a placeholder has it"
        yield Suspicion(name, body.com, text)


def _distance(p: Array, a: Array, b: Array) -> float:
    """From a point to a segment."""
    along = b - a
    share = np.clip((p - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(p - a - share * along))


def _between(a: _Axis, b: _Axis, unit: float, *, few: bool) -> str:
    """What is odd about two axes of a body, `few` if they are all of its axes; empty if nothing is."""
    normal = cross(a.e, b.e)
    sine, cosine = float(np.linalg.norm(normal)), abs(float(a.e @ b.e))
    pair = f"the axes of {a.joint} and {b.joint}"
    for off, what in ((sine, "parallel"), (cosine, "at right angles")):
        if ROUNDING < off < ANGLE:
            return f"{pair} are {what} but for {off:.2g} rad"
    if not (a.turns and b.turns):
        return ""
    if sine <= ROUNDING:
        apart = float(np.linalg.norm(cross(b.p - a.p, a.e))) / unit
        return f"{a.joint} and {b.joint} turn about the same axis" if few and apart < ROUNDING else ""
    apart = abs(float((b.p - a.p) @ normal)) / sine
    return f"{pair} miss each other by {apart:.2g} m" if ROUNDING < apart / unit < DISTANCE else ""
