"""A reading displaced: its joints in another place, and its home at other coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from screwgauge.models.kinematics.tree import displacements, home, plant
from screwgauge.models.readings.assemble import matrix
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading
from screwgauge.reference.rotations import Array, cross


def moved(joint: JointReading, T: Array) -> JointReading:
    """A joint displaced in the world.

    Args:
        T: Displacement. Shape (4, 4).
    """
    R, p = T[:3, :3], T[:3, 3]
    axis = R @ joint.screw[:3]
    return replace(joint, screw=np.append(axis, R @ joint.screw[3:] + cross(p, axis)), centre=R @ joint.centre + p)


def rehomed(
    reading: Reading, q: Mapping[str, float] | Mapping[str, Array]
) -> tuple[Reading, dict[str, Array], dict[str, Array]]:
    """A reading with its home at other coordinates.

    Args:
        q: Joint -> its coordinates, see `tree.COORDINATES`; the others stay.

    Returns:
        The reading, and how what is before each joint, and each body, is displaced. Shape (4, 4) each.
    """
    if not q:
        still = np.eye(4)
        return reading, dict.fromkeys(reading.joints, still), dict.fromkeys(reading.bodies, still)
    tree, there = plant(reading), home(reading).q
    for name, value in q.items():
        there[0, tree.places[name]] = value
    before, behind = (
        {name: matrix(p[0, i], R[0, i]) for i, name in enumerate(reading.joints)} for R, p in displacements(tree, there)
    )
    joints = {name: moved(joint, behind[name]) for name, joint in reading.joints.items()}
    counted = {name: float(there[0, tree.places[name]][0]) for name in q if FREEDOMS[joints[name].kind] == 1}
    joints |= {name: replace(joints[name], home=value) for name, value in counted.items()}
    carried = {name: behind[body.joints[-1]] for name, body in reading.bodies.items()}
    bodies = {name: replace(body, pose=carried[name] @ body.pose) for name, body in reading.bodies.items()}
    return replace(reading, joints=joints, bodies=bodies), before, carried
