"""Lint: one-sentence warnings about legal mechanisms that probably contain mistakes.

Warnings show implausible values, such as moments of inertia in a wrong unit or angles in degrees, in the unit that was
probably meant; for implausible geometry and masses, they name the place to check. The input stays unchanged.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.errors import first_few
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, widest

#: Multiple of a body's size above which its radius of gyration is suspect, if its density is below air's [kg/m^3].
LARGER, AIR = 2.0, 1.2
#: Smallest semi-axis of the equivalent ellipsoid relative to the longest semi-axis: rods and plates have a volume.
SLENDER = 1.0 / 30.0
#: Density of osmium [kg/m^3], and smallest inertia of a body relative to an osmium ball.
OSMIUM, LEAST = 22600.0, 0.2
#: Ratio of radius of gyration to size below which a point mass is meant; smallest mass of a substantial part [kg].
POINT, HEAVY = 1e-3, 100.0
#: Length above which [m], and mass per length below which [kg/m], a body is implausible.
LONG, THIN = 20.0, 0.05
#: Unit of moments of inertia in data sheets and CAD -> kg m^2.
UNITS = {"g m^2": 1e-3, "kg cm^2": 1e-4, "kg mm^2": 1e-6, "g cm^2": 1e-7, "g mm^2": 1e-9}
#: Range of plausible ratios of radius of gyration to size.
USUAL = (0.03, 1.0)
#: Angle beyond which a joint must rotate continuously, as a limit or as an amplitude [rad].
TURNED = 4.0 * np.pi
#: Largest usual angle in degrees.
DEGREES = 720.0
#: Largest number of bodies that are reported one by one, and of bodies that a message names.
SHOWN = 3
#: How to write an angle in degrees.
WRITTEN = "degrees are written as '30*deg'"
#: Rounding error of a zero; angle [rad] and distance [mechanism lengths] below which nonzero values are likely errors.
#: A right angle written as 1.5708 has an error of 4e-6.
ROUNDING, ANGLE, DISTANCE = 1e-8, 0.01, 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A body with mass.

    Attributes:
        inertia: Inertia tensor about the centre of mass [kg m^2]. Shape (3, 3).
        size: Extent of the body's joints and centre of mass; for a body with one joint, extent of all joints and
            centres of mass [m].
        span: Extent of the body's own joints and centre of mass [m].
    """

    name: str
    mass: float
    inertia: Array
    size: float
    span: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Suspicion:
    """A suspicious entry of a description.

    Attributes:
        point: Position in the body frame [m]. Shape (3,).
    """

    body: str
    point: Array
    sentence: str


class _End(NamedTuple):
    """An end of a joint: the frame of the joint on a body, which is its parent (side 0) or child (side 1)."""

    joint: Joint
    frame: Frame
    side: int

    @property
    def axis(self) -> Array:
        """Axis of the joint that is fixed in the body. Shape (3,)."""
        return np.asarray(self.frame.R @ self.joint.axes[-self.side])

    @property
    def turns(self) -> bool:
        """True if the body rotates about the axis; the normal of a planar joint is a fixed line only in the child."""
        return self.joint.angles > 0 and (self.side == 1 or self.joint.slides < 2)


def _ends(mechanism: Mechanism) -> dict[str, list[_End]]:
    """Return the joint ends of each body, except those of F joints."""
    ends: dict[str, list[_End]] = {body.name: [] for body in mechanism.bodies}
    for joint in mechanism.joints:
        for side, (body, frame) in enumerate(joint.sides):
            if body in ends and joint.constrains:
                ends[body].append(_End(joint, frame, side))
    return ends


def _spread(mechanism: Mechanism, places: Iterable[tuple[str, Array]]) -> float:
    """Return the largest distance between body points at the home pose [m]."""
    at, index = pose(layout(mechanism), mechanism.home[None]), mechanism.body_index
    return widest([at.p[0, index[body]] + at.R[0, index[body]] @ point for body, point in places])


def implausible(mechanism: Mechanism) -> tuple[str, ...]:
    """Warn about implausible bodies and joints."""
    return (
        *of_bodies([*solids(mechanism)]),
        *(
            text
            for joint, i in hinges(mechanism)
            for text in too_far(joint.coordinates[i], joint.home[i], joint.limits[i])
        ),
    )


def of_bodies(bodies: Sequence[Solid]) -> tuple[str, ...]:
    """Warn about bodies that are too wide, too dense, or too long for their mass."""
    return (*all_too_wide(bodies), *too_dense(bodies), *too_long(bodies))


def too_dense(bodies: Iterable[Solid]) -> tuple[str, ...]:
    """Warn about bodies with less inertia than a ball of the densest metal; point masses are exempt."""
    return _shorten({one.name: text for one in bodies if (text := _too_dense(one))}, "too dense")


def _shorten(sentences: dict[str, str], what: str) -> tuple[str, ...]:
    """Return the sentences about bodies; if there are many, the first one and a list of the remaining names."""
    if len(sentences) <= SHOWN:
        return (*sentences.values(),)
    first, *rest = sentences
    return sentences[first], f"{len(rest)} more bodies are {what} in the same way: {first_few(rest, SHOWN)}"


def _too_dense(body: Solid) -> str:
    """Return a warning about a body that is too dense, or an empty string."""
    moments = np.linalg.eigvalsh(body.inertia)
    ball = float(np.cbrt(0.75 * body.mass / (np.pi * OSMIUM)))
    least = 0.6 * body.mass * ball**2  # 0 if there is almost no mass
    share = 0.5 * float(moments.sum()) / least if least else 0.0
    radius = float(np.sqrt(max(moments[-1], 0.0) / body.mass))
    if not 0.0 < share < LEAST or radius < POINT * body.size:
        return ""
    denser = share**-1.5
    heavy = body.mass > HEAVY and share * 1e5 > LEAST  # the ratio scales with mass^(-5/3)
    likely = "likely g: multiply the mass by 0.001" if heavy else "a placeholder: use the tensor of the body"
    return (
        f"{body.name}: {body.mass:.4g} kg with a radius of gyration of {1e3 * radius:.3g} mm are {denser:.2g} times as "
        f"dense as osmium, for a body about {body.size:.2g} m in size ({likely})"
    )


def too_long(bodies: Iterable[Solid]) -> tuple[str, ...]:
    """Warn about bodies tens of metres long that weigh almost nothing."""
    long = [one for one in bodies if one.span > LONG and one.mass < THIN * one.span]
    if not long:
        return ()
    names, mass = first_few([one.name for one in long], SHOWN), sum(one.mass for one in long)
    return (
        f"{names}: {mass:.4g} kg over a length of {max(one.span for one in long):.3g} m, longer than any machine; "
        "likely millimetres: multiply lengths by 0.001 and moments of inertia by 1e-6",
    )


def all_too_wide(bodies: Iterable[Solid]) -> tuple[str, ...]:
    """Warn about the bodies that `too_wide` reports; summarise them if there are many."""
    return _shorten({one.name: text for one in bodies if (text := too_wide(one))}, "lighter than air")


def _turning_bodies(mechanism: Mechanism) -> set[str]:
    """Return the bodies that rotate; the inertia of a body that only slides on the ground has no effect."""
    turning = {body.name for body in mechanism.bodies}
    for _ in mechanism.bodies:
        slides = (
            joint for joint in mechanism.joints if not joint.angles and not turning >= {joint.parent, joint.child}
        )
        turning -= {name for joint in slides for name in (joint.parent, joint.child)}
    return turning


def solids(mechanism: Mechanism) -> Iterator[Solid]:
    """Yield the bodies of a mechanism that have mass and rotate."""
    ends, heavy, turning = (
        _ends(mechanism),
        [body for body in mechanism.bodies if body.mass],
        _turning_bodies(mechanism),
    )
    places = [(name, end.frame.p) for name, its in ends.items() for end in its]
    extent = _spread(mechanism, [*places, *((body.name, body.com) for body in heavy)])
    for body in heavy:
        if body.name not in turning:
            continue
        points = [*(end.frame.p for end in ends[body.name]), body.com]
        yield Solid(body.name, body.mass, body.inertia, size_of(points, extent), widest(points))


def size_of(points: list[Array], extent: float) -> float:
    """Return the size of a body [m], given joint points and centre of mass (last), and the machine's extent [m]."""
    return (widest(points) if len(points) > 2 else 0.0) or extent


def too_wide(body: Solid) -> str:
    """Return a warning about more inertia than a body of this mass and size can have, or an empty string."""
    moments = np.linalg.eigvalsh(body.inertia)
    radius = float(np.sqrt(max(moments[-1], 0.0) / body.mass))
    half = np.sqrt(np.maximum(2.5 * (moments.sum() - 2.0 * moments) / body.mass, 0.0))
    volume = 4.0 / 3.0 * np.pi * float(np.prod(np.maximum(half, SLENDER * half.max(initial=0.0))))
    if not (body.size > 0.0 and radius > LARGER * body.size and body.mass < AIR * volume):
        return ""
    shares = {unit: radius * factor**0.5 / body.size for unit, factor in UNITS.items()}
    meant = [unit for unit, share in shares.items() if USUAL[0] <= share <= USUAL[1]]
    alike = "a placeholder, or " if np.ptp(moments) < 1e-9 * moments[-1] else ""
    likely = f"{alike}likely in {' or '.join(meant)}" if meant else "no usual unit explains it"
    return (
        f"{body.name}: a moment of inertia of {moments[-1]:.4g} kg m^2 at {body.mass:.4g} kg means a radius of "
        f"gyration of {radius:.3g} m, for a body about {body.size:.2g} m in size, and makes it lighter than air "
        f"({likely})"
    )


def hinges(mechanism: Mechanism) -> Iterator[tuple[Joint, int]]:
    """Yield the uncoupled angles of all joints except F joints, as joint and index of the coordinate in it."""
    tied = {name for one in mechanism.couplings for name in one.named}
    for joint in (joint for joint in mechanism.joints if joint.constrains):
        yield from (
            (joint, i) for i, (turns, _) in enumerate(joint.freedoms) if turns and joint.coordinates[i] not in tied
        )


def too_far(name: str, home: float, limits: Iterable[float]) -> Iterator[str]:
    """Warn about a home value or limit [rad] that is likely in degrees."""
    far = [x for x in limits if TURNED < abs(x) <= DEGREES and not float(np.log10(abs(x))).is_integer()]
    if far:
        yield f"{name}: {in_degrees('a limit', max(far, key=lambda x: (abs(x), x)))}"
    if 2.0 * np.pi < abs(home) <= DEGREES:
        yield f"{name}: {in_degrees('a home value', home)}"


def in_degrees(what: str, angle: float) -> str:
    """Format an angle [rad], and its value if degrees were meant."""
    turns, less = abs(angle) / (2.0 * np.pi), np.radians(angle)
    return f"{what} of {angle:.4g} rad is {turns:.3g} turns; likely degrees, {less:.3g} rad"


def suspicious(mechanism: Mechanism) -> tuple[Suspicion, ...]:
    """Return all warnings, body by body."""
    unit, suspicions = length(layout(mechanism)), list[Suspicion]()
    joints = [joint for joint in mechanism.joints if joint.constrains]
    extent = _spread(mechanism, [(joint.parent, joint.parent_frame.p) for joint in joints])
    wide, ends = {solid.name: too_wide(solid) for solid in solids(mechanism)}, _ends(mechanism)
    for body in mechanism.bodies:
        its = ends[body.name]
        sentences = [wide.get(body.name, ""), *_masses(body, its, unit, extent)]
        sentences += [_warn_of_ball(body)] if body.name in wide else []
        suspicions += [Suspicion(body.name, body.com, text) for text in sentences if text]
        for a, b in combinations([end for end in its if end.joint.angles < 3 and not end.joint.fixed], 2):
            if text := _warn_of_axes(a, b, unit, few=len(its) == 2):
                suspicions.append(Suspicion(body.name, a.frame.p, text))
    return tuple(suspicions)


def _masses(body: Body, its: list[_End], unit: float, extent: float) -> Iterator[str]:
    """Warn about mass and extent of a body with the given joint ends; `extent` is that of all joints [m]."""
    name, points = body.name, [end.frame.p for end in its]
    if body.mass == 0.0:
        yield f"{name} has no mass"
        return
    spread = widest(points)
    away = min((_distance(body.com, a, b) for a in points for b in points), default=0.0)
    size, whose = (spread, "its joints are") if spread > DISTANCE * unit else (extent, "all joints are")
    if len(points) > 1 and away > max(2.0 * size, 0.05 * unit) and size > 0.0:
        yield f"the centre of mass of {name} is {away:.3g} m away from its joints; {whose} {size:.3g} m apart"
    if len(points) > 1 and max(spread, away) < ROUNDING * unit and not any(end.joint.slides for end in its):
        yield f"{name} has no length: its joints and its centre of mass coincide"


def _warn_of_ball(body: Body) -> str:
    """Return a warning about a body with the inertia of a ball, or an empty string."""
    moments = np.linalg.eigvalsh(body.inertia)
    if not (moments[0] > 0.0 and np.ptp(moments) < 1e-9 * moments[-1]):
        return ""
    return f"{body.name} has {moments[0]:.3g} kg m^2 about every axis, like a ball or a placeholder"


def _distance(p: Array, a: Array, b: Array) -> float:
    """Return the distance from a point to a segment."""
    along = b - a
    share = np.clip((p - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(p - a - share * along))


def _warn_of_axes(a: _End, b: _End, unit: float, *, few: bool) -> str:
    """Return a warning about the axes of two joints of a body (its only joints if `few`), or an empty string."""
    normal, way, names = cross(a.axis, b.axis), b.frame.p - a.frame.p, f"{a.joint.name} and {b.joint.name}"
    sine, cosine = float(np.linalg.norm(normal)), abs(float(a.axis @ b.axis))
    for off, what in ((sine, "parallel"), (cosine, "at right angles")):
        if ROUNDING < off < ANGLE:
            return f"the axes of {names} are {what} except for {off:.2g} rad"
    if not (a.turns and b.turns):
        return ""
    if sine <= ROUNDING:
        apart = float(np.linalg.norm(cross(way, a.axis))) / unit
        return f"{names} turn about the same axis" if few and apart < ROUNDING else ""
    apart = abs(float(way @ normal)) / sine
    return f"the axes of {names} miss each other by {apart:.2g} m" if ROUNDING < apart / unit < DISTANCE else ""
