"""What a reading of a model file says and no machine has; see `screwgauge.reference.lint`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.models.readings.reading import Reading
from screwgauge.reference.lint import Hinge, Solid, all_too_wide, size_of, too_far
from screwgauge.reference.rotations import Array, widest


def implausible(reading: Reading) -> tuple[str, ...]:
    """Sentences on bodies and joints."""
    return (*all_too_wide(_solids(reading)), *too_far(_hinges(reading)))


def _solids(reading: Reading) -> Iterator[Solid]:
    centres = {name: body.pose[:3, :3] @ body.com + body.pose[:3, 3] for name, body in reading.bodies.items()}
    joints = {name: joint.centre for name, joint in reading.joints.items() if joint.kind != "free"}
    places: dict[str, list[Array]] = {name: [] for name in reading.bodies}
    for name, body in reading.bodies.items():
        at = [joints[joint] for joint in body.joints if joint in joints]
        places[name] += at[-1:]
        if body.near in places:
            places[body.near] += at[:1]
    for closure in reading.closures.values():
        for side, frame in ((closure.first, closure.first_frame), (closure.second, closure.second_frame)):
            if side in places:
                places[side].append((reading.bodies[side].pose @ frame)[:3, 3])
    heavy = {name: centres[name] for name, body in reading.bodies.items() if body.mass > 0.0}
    extent = widest([*joints.values(), *heavy.values()])
    for name, centre in heavy.items():
        body = reading.bodies[name]
        if np.isfinite(body.inertia).all():
            yield Solid(name, body.mass, body.inertia, size_of([*places[name], centre], extent))


def _hinges(reading: Reading) -> Iterator[Hinge]:
    tied = {name for one in reading.couplings.values() for name in (one.joint, one.of)}
    for name, joint in reading.joints.items():
        if joint.kind == "hinge" and name not in tied:
            yield Hinge(name, joint.home, joint.limits)
