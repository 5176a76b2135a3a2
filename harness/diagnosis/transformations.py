"""Readings made of a reading: seen from another world, in another order, with joints moved, held or left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from screwgauge.models.kinematics import moved
from screwgauge.models.matter import Matter, combined, displaced, remainder
from screwgauge.models.readings.reading import BodyReading, ClosureReading, JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross


def outwards(reading: Reading, joint: str) -> tuple[list[str], list[str]]:
    """Bodies that a joint carries, and the joints that it carries, itself first."""
    bodies: list[str] = []
    joints: list[str] = []
    for name, body in reading.bodies.items():
        if body.near in bodies:
            joints += body.joints
        elif joint in body.joints:
            joints += body.joints[body.joints.index(joint) :]
        else:
            continue
        bodies.append(name)
    return bodies, joints


def axis(joint: JointReading) -> Array:
    """Direction of a hinge or slide. Shape (3,)."""
    return joint.direction


def turned(joint: JointReading, direction: Array, centre: Array) -> JointReading:
    """A hinge or slide on another axis. Shape (3,) both."""
    parts = {"slide": (np.zeros(3), direction), "hinge": (direction, cross(centre, direction))}
    return replace(joint, screw=np.concatenate(parts.get(joint.kind, (joint.screw,))), centre=centre)


def carried(reading: Reading, joint: str, T: Array) -> Reading:
    bodies, joints = outwards(reading, joint)
    return replace(
        reading,
        bodies={**reading.bodies, **{n: replace(reading.bodies[n], pose=T @ reading.bodies[n].pose) for n in bodies}},
        joints={**reading.joints, **{n: moved(reading.joints[n], T) for n in joints}},
    )


def counted_back(reading: Reading, name: str) -> Reading:
    """A joint that counts the other way, and so do the couplings with it."""
    joint = reading.joints[name]
    low, high = joint.limits
    new = replace(joint, screw=-joint.screw, home=-joint.home, limits=(-high, -low), rest=-joint.rest)
    couplings = {}
    for key, coupling in reading.couplings.items():
        polynomial = -coupling.polynomial if coupling.joint == name else coupling.polynomial
        if coupling.of == name:
            polynomial = polynomial * (-1.0) ** np.arange(len(polynomial))
        couplings[key] = replace(coupling, polynomial=polynomial)
    return replace(reading, joints={**reading.joints, name: new}, couplings=couplings)


def without(reading: Reading, joint: str) -> Reading:
    """A reading without a joint and what it carries. Joints before it, of the same body, go with it."""
    bodies, joints = outwards(reading, joint)
    return _lacking(reading, bodies, {*joints, *(name for body in bodies for name in reading.bodies[body].joints)})


def spliced(reading: Reading, joint: str) -> Reading:
    """A reading without the body that a joint moves; what hangs on that hangs, where it is, on its parent."""
    name = reading.moved_by(joint)
    gone = reading.bodies[name]
    bodies = {n: replace(b, near=gone.near) if b.near == name else b for n, b in reading.bodies.items()}
    return _lacking(replace(reading, bodies=bodies), [name], {*gone.joints})


def _lacking(reading: Reading, bodies: Collection[str], joints: Collection[str]) -> Reading:
    """A reading without some bodies and joints, and without what is of them."""

    def stays(body: str) -> bool:
        return body not in bodies

    return replace(
        reading,
        bodies={name: body for name, body in reading.bodies.items() if stays(name)},
        joints={name: joint for name, joint in reading.joints.items() if name not in joints},
        closures={n: c for n, c in reading.closures.items() if stays(c.first) and stays(c.second)},
        couplings={n: c for n, c in reading.couplings.items() if not {c.joint, c.of} & {*joints}},
        actuators={n: driven for n, driven in reading.actuators.items() if driven.joint not in joints},
    )


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
    closures = {name: _moved_to(closure, into) for name, closure in reading.closures.items()}
    return _lacking(replace(reading, bodies=bodies, fixed=fixed, closures=closures), (), joints)


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
    """Mass properties of the link that a body is named after."""
    return remainder(part, part.parts.values())


def joined(body: BodyReading, name: str, part: BodyReading) -> BodyReading:
    """A body with another one fixed to it as both are at home."""
    T = np.linalg.inv(body.pose) @ part.pose
    both = combined(body, displaced(part, T))
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
