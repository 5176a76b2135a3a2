"""The same machine said otherwise: at other coordinates, in another place, by other names, with joints held."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import reduce

import numpy as np

from screwgauge.models.kinematics import moved
from screwgauge.models.matter import Matter, combined, displaced, of_body
from screwgauge.models.readings.reading import BodyReading, ClosureReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array


def placed(reading: Reading, T: Array) -> Reading:
    """A reading seen from another world.

    Args:
        T: Of its world in the other. Shape (4, 4).
    """

    def end(body: str, frame: Array) -> Array:
        return T @ frame if body not in reading.bodies else frame

    return replace(
        reading,
        joints={name: moved(joint, T) for name, joint in reading.joints.items()},
        bodies={name: replace(body, pose=T @ body.pose) for name, body in reading.bodies.items()},
        fixed={name: T @ frame for name, frame in reading.fixed.items()},
        closures={
            name: replace(c, first_frame=end(c.first, c.first_frame), second_frame=end(c.second, c.second_frame))
            for name, c in reading.closures.items()
        },
        gravity=None if reading.gravity is None else T[:3, :3] @ reading.gravity,
    )


def ordered(reading: Reading, joints: Collection[str]) -> Reading:
    """A reading with its joints, and so all vectors of velocities, in a given order."""
    return replace(reading, joints={name: reading.joints[name] for name in joints})


def held(reading: Reading, joints: Collection[str]) -> Reading:
    """A reading with joints that do not move from home: bodies that they alone move are one with what carries them."""
    bodies: dict[str, BodyReading] = {}
    into: dict[str, tuple[str, Array]] = {}  # body that is part of another one -> that, its frame there
    fixed = dict(reading.fixed)
    for name, body in reading.bodies.items():
        near, _ = into.get(body.near, (body.near, np.eye(4)))
        moving = tuple(joint for joint in body.joints if joint not in joints)
        if moving:
            bodies[name] = replace(body, near=near, joints=moving)
        elif near in bodies:
            into[name] = near, np.linalg.inv(bodies[near].pose) @ body.pose
            bodies[near] = joined(bodies[near], name, body)
        else:
            into[name] = GROUND, body.pose
            fixed |= {name: body.pose, **{link: body.pose @ T for link, T in body.fixed.items()}}
    gone = set(joints)
    return replace(
        reading,
        bodies=bodies,
        joints={name: joint for name, joint in reading.joints.items() if name not in gone},
        fixed=fixed,
        closures={name: _moved_to(closure, into) for name, closure in reading.closures.items()},
        couplings={name: c for name, c in reading.couplings.items() if not {c.joint, c.of} & gone},
        actuators={name: driven for name, driven in reading.actuators.items() if driven[0] not in gone},
    )


def _moved_to(closure: ClosureReading, into: Mapping[str, tuple[str, Array]]) -> ClosureReading:
    first, T1 = into.get(closure.first, (closure.first, np.eye(4)))
    second, T2 = into.get(closure.second, (closure.second, np.eye(4)))
    return replace(
        closure,
        first=first,
        first_frame=T1 @ closure.first_frame,
        second=second,
        second_frame=T2 @ closure.second_frame,
    )


def _shown(part: BodyReading) -> bool:
    """Whether a part has mass that its file gives it; the share of a body that was cut is the body's own."""
    return bool(part.mass or part.inertia.any()) and not part.copy_of


def _own(part: BodyReading) -> Matter:
    """That of the link that a body is called after."""
    return reduce(lambda left, other: combined(left, other, -1.0), part.parts.values(), of_body(part))


def joined(body: BodyReading, name: str, part: BodyReading) -> BodyReading:
    """A body with another one fixed to it as both are at home."""
    T = np.linalg.inv(body.pose) @ part.pose
    both = combined(of_body(body), displaced(of_body(part), T))
    weight = body.mass * body.gravcomp + part.mass * part.gravcomp
    parts = {link: displaced(matter, T) for link, matter in part.parts.items()}
    links = {name: T, **{link: T @ frame for link, frame in part.fixed.items()}}
    return replace(
        body,
        mass=both.mass,
        com=both.com,
        inertia=both.inertia,
        gravcomp=weight / both.mass if both.mass else 0.0,
        fixed={**body.fixed, **links},
        parts={**body.parts, **({name: displaced(_own(part), T)} if _shown(part) else {}), **parts},
    )
