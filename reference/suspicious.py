"""Geometry and masses that are legal and yet seldom meant: each with the place to look at and a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from screwgauge.reference.layout import layout
from screwgauge.reference.mechanism import Body, Joint, Mechanism
from screwgauge.reference.plausible import solids, too_wide
from screwgauge.reference.pose import length, pose
from screwgauge.reference.rotations import Array, cross, widest

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
