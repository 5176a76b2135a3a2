"""Query a library directly about any model, in the joints and bodies of its `Reading`; no `Problem` is needed, and
loops are not closed."""

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
    """Samples of one joint's motion, as the reading defines it.

    Attributes:
        kind: An entry of `reading.FREEDOMS`.
        frame: World pose, at the home pose, of the frame that a ball or free joint moves. Shape (4, 4).
        q: The coordinate of a hinge or slide, as defined in the file. For a ball or free joint, the pose of `frame`
            relative to its home pose: position (free joints only), then quaternion (w, x, y, z). Shape (n, 1, 4 or 7).
        qd, qdd: See `reading.FREEDOMS`. Shape (n, n_freedom).
    """

    kind: str
    frame: Array
    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """A library's results; forces are conjugate to the reading's velocities.

    Attributes:
        covers: Forces in `tau` other than inertia and gravity: ``armature``, ``damping``, ``stiffness``, ``medium``.
        tau: Inverse dynamics. Shape (n, n_freedom).
        mass_matrix: Shape (n, n_freedom, n_freedom).
        bias: Forces at zero accelerations. Shape (n, n_freedom).
        gravity: Gravity forces. Shape (n, n_freedom).
        velocity: Angular velocity of each body and velocity of its origin, in world axes. Shape (n, n_body, 6).
        acceleration: Time derivatives of `velocity`. Shape (n, n_body, 6).
    """

    covers: frozenset[str]
    tau: Array
    mass_matrix: Array
    bias: Array
    gravity: Array
    velocity: Array
    acceleration: Array


#: Queries a library: file, requested bodies, joints in order, True if the base of a URDF floats, and True if the file
#: is used as a whole, including the forces that readings omit.
Ask = Callable[[Path, tuple[str, ...], Mapping[str, JointStates], bool, bool], Answers]


def frame_motion(states: JointStates, frame: Array) -> tuple[Array, Array]:
    """Convert the reading's motion to the motion of the library's joint frame.

    Args:
        frame: World pose of the library's joint frame at the home pose. Shape (4, 4).

    Returns:
        Pose of the library's frame relative to its home pose, (n, 4, 4), and the map from velocities of the reading to
        velocities of that frame along its axes, (3 or 6, 3 or 6).
    """
    C = np.linalg.inv(frame) @ states.frame
    if states.kind == "ball":
        C[:3, 3] = 0.0
    X = np.broadcast_to(np.eye(4), (len(states.q), 4, 4)).copy()
    X[:, :3, :3] = quaternion_rotation(states.q[:, -4:])
    X[:, : states.q.shape[1] - 4, 3] = states.q[:, :-4]
    n = FREEDOMS[states.kind]
    return C @ X @ np.linalg.inv(C), adjoint(C)[:n, :n]
