"""What the description says a model file should read as, by plain matrices, joint after joint.

It shares no kinematics with the solver. Poses follow the joints of the tree alone, as they do in a file: a loop that is
open at home shows as a gap of its closure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.models.layout import Link, Tree, lay_out
from screwgauge.models.readings.assemble import matrix, screw
from screwgauge.models.readings.loops import closure_readings
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading, couplings_of
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, rotation


def expected_reading(mechanism: Mechanism, cut: str, gravity: Sequence[float] | Array) -> Reading:
    """The reading of a model file that says exactly what the description says, limits left out."""
    tree = lay_out(mechanism, cut)
    poses = home_poses(tree)
    bodies: dict[str, BodyReading] = {}
    joints: dict[str, JointReading] = {}
    for link in tree.links:
        names, body = tuple(freedom.coordinate for freedom in link.freedoms), link.body
        copy_of = link.original if link.name != link.original else ""
        matter = body.mass, body.com, body.inertia
        bodies[link.name] = BodyReading(link.near, names, *matter, poses[link.name], copy_of=copy_of)
        joints |= _joints(link, poses)
    driven = zip(mechanism.actuator_names, mechanism.actuators, strict=True)
    return Reading(
        name=mechanism.name,
        library="screwgauge",
        bodies=bodies,
        joints=joints,
        closures=closure_readings(tree.closures),
        couplings=couplings_of(mechanism.couplings),
        actuators={name: (joint.coordinates[0], 1.0) for name, joint in driven},
        gravity=np.asarray(gravity, dtype=float),
    )


def home_poses(tree: Tree) -> dict[str, Array]:
    """World pose of the ground, of every body and of every copy at the home coordinates. Shape (4, 4) each."""
    poses = {GROUND: np.eye(4)}
    for link in tree.links:
        T = joint_transform(link.joint, link.joint.home)
        poses[link.name] = poses[link.near] @ (np.linalg.inv(T) if link.reverse else T)
    return poses


def joint_transform(joint: Joint, q: Array) -> Array:
    """``T(parent, child) = parent_frame  X(q)  child_frame^-1``. Shape (4, 4)."""
    T = _matrix(joint.parent_frame)
    for value, (turns, axis) in zip(q, joint.freedoms, strict=True):
        T = T @ _step(float(value), turns, axis)
    return T @ np.linalg.inv(_matrix(joint.child_frame))


def _matrix(frame: Frame) -> Array:
    return matrix(frame.p, frame.R)


def _step(value: float, turns: bool, axis: Array) -> Array:
    if turns:
        return matrix(np.zeros(3), rotation(axis, np.array(value)))
    return matrix(value * axis, np.eye(3))


def _joints(link: Link, poses: dict[str, Array]) -> dict[str, JointReading]:
    """A joint's freedoms, as its outer body moves against the inner one."""
    joint = link.joint
    sign = -1.0 if link.reverse else 1.0
    T, joints = poses[link.name if link.reverse else link.near] @ _matrix(joint.parent_frame), {}
    for name, value, (turns, axis) in zip(joint.coordinates, joint.home, joint.freedoms, strict=True):
        S = sign * screw(turns, T[:3, :3] @ axis, T[:3, 3])
        joints[name] = JointReading("hinge" if turns else "slide", S, T[:3, 3], float(value))
        T = T @ _step(float(value), turns, axis)
    return joints
