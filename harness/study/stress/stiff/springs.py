"""Springs and dampers across the prismatic joints of a mechanism."""

from __future__ import annotations

import numpy as np

from screwgauge.reference.applied import JointSpring
from screwgauge.reference.forward import inertia_matrix
from screwgauge.reference.kinematics import velocities
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import layout, pose

#: Share of critical damping at home: overdamped, so that eigenvalues are real; the fastest is 1e5 1/s at 1e10 N/m.
DAMPING = 1.2


def leg_springs(mechanism: Mechanism, stiffness: float) -> tuple[JointSpring, ...]:
    """A spring and damper across every actuated joint, relaxed at home.

    Args:
        stiffness: [N/m].
    """
    lay, home = layout(mechanism), mechanism.home[None]
    rate = velocities(lay, pose(lay, home), np.zeros((1, len(mechanism.independent))))
    B = rate.K[0][mechanism.actuated_columns]
    fastest = np.linalg.eigvals(np.linalg.solve(inertia_matrix(lay, rate)[0], B.T @ B)).real.max()
    damping = 2.0 * DAMPING * float(np.sqrt(stiffness / fastest))
    return tuple(
        JointSpring(mechanism.coordinates[i], stiffness, float(home[0, i]), damping) for i in mechanism.actuated_columns
    )
