"""Readings made of a reading: seen from another world, in another order, with joints moved, held or left out."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from screwgauge.models.kinematics import moved
from screwgauge.models.readings.reading import JointReading, Reading
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


def seated(reading: Reading, joint: str, T: Array) -> Reading:
    """A reading with all that a joint carries displaced on it, the joint left where it is. T: shape (4, 4)."""
    moved_ = carried(reading, joint, T)
    return replace(moved_, joints={**moved_.joints, joint: reading.joints[joint]})


def counted_back(reading: Reading, name: str) -> Reading:
    """A joint that counts the other way, and so do the couplings with it."""
    joint = reading.joints[name]
    low, high = joint.limits
    new = replace(joint, screw=-joint.screw, home=-joint.home, limits=(-high, -low), rest=-joint.rest)
    couplings = {}
    for key, coupling in reading.couplings.items():
        function = coupling.function.counted({}, {name: -1.0})
        couplings[key] = replace(coupling, function=function.times(-1.0) if coupling.joint == name else function)
    return replace(reading, joints={**reading.joints, name: new}, couplings=couplings)


def counted_from(reading: Reading, name: str, home: float) -> Reading:
    """A joint whose coordinate at home is another one, and with it its limits, its rest and the couplings with it."""
    joint = reading.joints[name]
    step = home - joint.home
    low, high = joint.limits
    new = replace(joint, home=home, limits=(low + step, high + step), rest=joint.rest + step)
    couplings = {}
    for key, coupling in reading.couplings.items():
        function = coupling.function.counted({name: -step}, {})
        couplings[key] = replace(coupling, function=function.plus(step) if coupling.joint == name else function)
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
        couplings={n: c for n, c in reading.couplings.items() if not {*c.named} & {*joints}},
        actuators={n: driven for n, driven in reading.actuators.items() if driven.joint not in joints},
    )
