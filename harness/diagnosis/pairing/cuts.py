"""One loop cut in two ways: one model has all of its joints and a copy of a body, welded to that; the other has points.

What a copy weighs is a share of the body. It is given back, and the joints that lead to it become points, as there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.differences.change import axis
from screwgauge.diagnosis.mechanics.lines import CLOSE, size
from screwgauge.diagnosis.mechanics.reshape import joined
from screwgauge.models.readings.assemble import matrix
from screwgauge.models.readings.reading import BodyReading, ClosureReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, skew


@dataclass(frozen=True, slots=True)
class Copy:
    """A body that is part of another one, behind joints that the other model has not.

    Attributes:
        name: Of the body; `weld` of the closure that holds it.
        points: Names of the closures that the other model has there.
        half: Half of how far two of them are apart; 0 of one [m].
    """

    name: str
    weld: str
    points: tuple[str, ...]
    half: float


def copies(reading: Reading, other: Reading, alone: Iterable[str], bodies: Mapping[str, str]) -> Iterator[Copy]:
    """Those that another reading has not.

    Args:
        alone: Joints without a partner.
        bodies: Name -> that in the other.
    """
    bound = {joint for joint, _ in reading.actuators.values()}
    bound |= {joint for coupling in reading.couplings.values() for joint in (coupling.joint, coupling.of)}
    free = {*alone} - bound
    for name, body in reading.bodies.items():
        held = [key for key, c in reading.closures.items() if name in (c.first, c.second)]
        if not {*body.joints} <= free or any(each.near == name for each in reading.bodies.values()) or len(held) != 1:
            continue
        weld = reading.closures[held[0]]
        ends = {bodies.get(each, each) for each in (body.near, *({weld.first, weld.second} - {name}))}
        points = [(n, c) for n, c in other.closures.items() if c.kind == "point" and {c.first, c.second} == ends]
        if weld.kind == "weld" and points and len(points) == len(_pivots(reading, body, 1.0)):
            one = points[0][1].first
            ends_there = [c.first_frame if c.first == one else c.second_frame for _, c in points]
            half = 0.5 * float(np.linalg.norm((ends_there[0] - ends_there[-1])[:3, 3]))
            yield Copy(name, held[0], tuple(n for n, _ in points), half)


def united(reading: Reading, parts: Iterable[Copy]) -> Reading:
    """A reading without copies: each is part of its body again, and points close the loop."""
    for part in parts:
        if part.name not in reading.bodies or part.weld not in reading.closures:
            continue  # another library reads it otherwise
        body, weld = reading.bodies[part.name], reading.closures[part.weld]
        whole, here, there = weld.first, weld.first_frame, weld.second_frame
        if whole == part.name:
            whole, here, there = weld.second, there, here
        T, bodies = here @ np.linalg.inv(there), {n: b for n, b in reading.bodies.items() if n != part.name}
        if whole in bodies:
            bodies[whole] = joined(bodies[whole], part.name, replace(body, pose=bodies[whole].pose @ T))
        near = np.linalg.inv(reading.bodies[body.near].pose if body.near in bodies else np.eye(4))
        own, closures = np.linalg.inv(body.pose), {n: c for n, c in reading.closures.items() if n != part.weld}
        for point, pivot in zip(part.points, _pivots(reading, body, part.half), strict=True):
            while point in closures:
                point += "'"
            at, soft = matrix(pivot, np.eye(3)), weld.softness[:7]
            closures[point] = ClosureReading("point", body.near, near @ at, whole, T @ own @ at, soft)
        reading = replace(
            reading,
            bodies=bodies,
            joints={name: joint for name, joint in reading.joints.items() if name not in body.joints},
            closures=closures,
            fixed=reading.fixed if whole != GROUND else {**reading.fixed, part.name: T},
        )
    return reading


def _pivots(reading: Reading, body: BodyReading, half: float) -> list[Array]:
    """Points that no joint before a body moves, in the world at home: two of a hinge, one of three or of a ball."""
    joints = [reading.joints[name] for name in body.joints]
    kinds = {joint.kind for joint in joints}
    if kinds == {"ball"} and len(joints) == 1:
        return [joints[0].centre]
    if kinds != {"hinge"}:
        return []
    if len(joints) == 1:
        return [joints[0].centre + side * half * axis(joints[0]) for side in (1.0, -1.0)]
    rows = np.vstack([skew(axis(joint)) for joint in joints])
    offs = np.concatenate([np.cross(axis(joint), joint.centre) for joint in joints])
    point = np.linalg.lstsq(rows, offs, rcond=None)[0]
    axes = np.stack([axis(joint) for joint in joints])
    meet = np.abs(rows @ point - offs).max() < CLOSE * size(reading)
    return [point] if meet and len(joints) == 3 and np.linalg.matrix_rank(axes, tol=CLOSE) == 3 else []
