"""Where the bodies of a reading are when its joints move.

Poses are products of exponentials (Lynch, Park: Modern Robotics, 4.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross, rotation


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """How far the joints of a reading have moved.

    Attributes:
        values: Hinge or slide -> its coordinate, as the file counts it [rad or m].
        displaced: Ball or free joint -> displacement from home of what it carries, in the world at home. Shape (4, 4).
    """

    values: Mapping[str, float]
    displaced: Mapping[str, Array]

    def displacement(self, name: str, joint: JointReading) -> Array:
        """Of what the joint carries, in the world at home. Shape (4, 4)."""
        if name in self.displaced:
            return self.displaced[name]
        return exponential(joint.screw, self.values[name] - joint.home)


def exponential(screw: Array, amount: float) -> Array:
    """Displacement by a unit screw [angular; linear at the world origin]. Shape (6,) -> (4, 4)."""
    T = np.eye(4)
    axis, moment = screw[:3], screw[3:]
    if not axis.any():
        T[:3, 3] = amount * moment
        return T
    T[:3, :3] = rotation(axis, np.array(amount))
    point = cross(axis, moment)  # of the axis, next to the origin
    T[:3, 3] = point - T[:3, :3] @ point + amount * (axis @ moment) * axis
    return T


def moved_screws(T: Array, screws: Array) -> Array:
    """Screws that are displaced. Shapes (4, 4), (n, 6) -> (n, 6)."""
    turned = screws[:, :3] @ T[:3, :3].T
    return np.concatenate([turned, screws[:, 3:] @ T[:3, :3].T + cross(T[:3, 3][None], turned)], axis=1)


def moved(joint: JointReading, T: Array) -> JointReading:
    """A joint displaced in the world.

    Args:
        T: Displacement. Shape (4, 4).
    """
    return replace(joint, screw=moved_screws(T, joint.screw[None])[0], centre=T[:3, :3] @ joint.centre + T[:3, 3])


def unit_screws(joint: JointReading) -> Array:
    """Unit screws at home, in the world; of a ball about the world's axes, of a free joint along them first.

    Shape (n, 6).
    """
    if joint.kind in ("hinge", "slide"):
        return joint.screw[None]
    turns = np.concatenate([np.eye(3), cross(joint.centre[None], np.eye(3))], axis=1)
    return turns if joint.kind == "ball" else np.concatenate([np.eye(6)[3:], turns])


def length_of(reading: Reading) -> float:
    """Largest distance between places that the reading names at home [m], 1 if there is none."""
    points = [body.pose[:3, 3] + body.pose[:3, :3] @ body.com for body in reading.bodies.values()]
    points += [body.pose[:3, 3] for body in reading.bodies.values()] + [np.zeros(3)]
    cloud = np.array([*points, *(joint.centre for joint in reading.joints.values())])
    return float(np.linalg.norm(cloud - cloud.mean(axis=0), axis=1).max()) * 2.0 or 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A reading in some state.

    Attributes:
        poses: Body, or ground -> its pose in the world. Shape (4, 4).
        screws: Unit screws of all velocities in the world, in the order of `Reading.freedoms`. Shape (n, 6).
        carries: Body, or ground -> which of them move it. Shape (n,).
        before: Joint -> displacement of what carries it. Shape (4, 4).
    """

    poses: dict[str, Array]
    screws: Array
    carries: dict[str, Array]
    before: dict[str, Array]


def place(reading: Reading, state: State) -> Placed:
    """Places all bodies and joints of a reading."""
    freedoms = reading.freedoms
    n = max((part.stop for part in freedoms.values()), default=0)
    placed = Placed({GROUND: np.eye(4)}, np.zeros((n, 6)), {GROUND: np.zeros(n)}, {})
    displaced = {GROUND: np.eye(4)}
    for name, body in reading.bodies.items():
        T, carries = displaced[body.near], placed.carries[body.near].copy()
        for joint in body.joints:
            placed.before[joint] = T
            placed.screws[freedoms[joint]] = moved_screws(T, unit_screws(reading.joints[joint]))
            carries[freedoms[joint]] = 1.0
            T = T @ state.displacement(joint, reading.joints[joint])
        displaced[name], placed.carries[name], placed.poses[name] = T, carries, T @ body.pose
    return placed


def at_home(reading: Reading) -> State:
    """The state in which nothing is displaced."""
    scalar = {name: joint.home for name, joint in reading.joints.items() if joint.kind in ("hinge", "slide")}
    return State(scalar, {name: np.eye(4) for name in reading.joints if name not in scalar})


def moved_home(reading: Reading, state: State) -> Reading:
    """The same reading with another state as its home."""
    placed = place(reading, state)
    joints = {}
    for name, joint in reading.joints.items():
        T = placed.before[name] @ state.displacement(name, joint)
        joints[name] = replace(moved(joint, T), home=state.values.get(name, 0.0))
    bodies = {name: replace(body, pose=placed.poses[name]) for name, body in reading.bodies.items()}
    return replace(reading, bodies=bodies, joints=joints)
