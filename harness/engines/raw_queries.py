"""Raw queries to a library about any model, in terms of its reading, without problem and closure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from screwgauge.models.formats import adjoint
from screwgauge.models.readings.reading import FREEDOMS
from screwgauge.reference.rotations import Array, quaternion_rotation


@dataclass(frozen=True, slots=True, eq=False)
class JointStates:
    """Samples of one joint's motion in terms of the reading.

    Attributes:
        kind: An entry of `reading.FREEDOMS`.
        frame: Frame carried by a ball or free joint, in the world at home. Shape (4, 4).
        q: Of a hinge or slide as the file counts; of a ball or free joint of its frame, in that frame at home:
            of a free one the position, then the quaternion (w, x, y, z). Shape (n, 1, 4 or 7).
        qd, qdd: See `reading.FREEDOMS`. Shape (n, n_freedom).
    """

    kind: str
    frame: Array
    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The library's answers along the reading's velocities.

    Attributes:
        covers: Forces in `tau` besides inertia and gravity: ``armature``, ``damping``, ``stiffness``, ``medium``.
        tau: Inverse dynamics. Shape (n, n_freedom).
        mass_matrix: Shape (n, n_freedom, n_freedom).
        bias: At zero accelerations. Shape (n, n_freedom).
        gravity: Shape (n, n_freedom).
        velocity: Angular velocity of each body and velocity of its origin, world axes. Shape (n, n_body, 6).
        acceleration: Their derivatives. Shape (n, n_body, 6).
    """

    covers: frozenset[str]
    tau: Array
    mass_matrix: Array
    bias: Array
    gravity: Array
    velocity: Array
    acceleration: Array


#: Asks a library: file, bodies that are wanted, joints in their order, whether the base of a URDF floats, and whether
#: the file is taken whole or without what no reading holds.
Ask = Callable[[Path, tuple[str, ...], Mapping[str, JointStates], bool, bool], Answers]


def carried(states: JointStates, frame: Array) -> tuple[Array, Array]:
    """Convert the reading's motion to that of a frame of the library.

    Args:
        frame: Frame of the library's joint in the world at home. Shape (4, 4).

    Returns:
        Pose in that frame at home, (n, 4, 4), and the map of velocities of the reading to those of that frame, along
        its axes, (3 or 6, 3 or 6).
    """
    C = np.linalg.inv(frame) @ states.frame
    if states.kind == "ball":
        C[:3, 3] = 0.0
    X = np.broadcast_to(np.eye(4), (len(states.q), 4, 4)).copy()
    X[:, :3, :3] = quaternion_rotation(states.q[:, -4:])
    X[:, : states.q.shape[1] - 4, 3] = states.q[:, :-4]
    n = FREEDOMS[states.kind]
    return C @ X @ np.linalg.inv(C), adjoint(C)[:n, :n]
