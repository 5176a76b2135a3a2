"""Numbers that are legal and that no machine has: moments of inertia in another unit, angles in degrees.

Each is told with its value and with what it would be in the unit that was probably meant; nothing is changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.layout import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import pose
from screwgauge.reference.rotations import Array, widest
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
