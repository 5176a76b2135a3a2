"""Joint coordinates of many samples, predicted from closed poses every few samples, which are followed in sequence."""

from __future__ import annotations

import numpy as np

from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.between import knots, predicted
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.kinematics import positions, velocities
from screwgauge.reference.pose import Layout
from screwgauge.reference.rotations import Array

#: From one closed pose to the next: at most so many samples, and so far in y [rad or lengths of the mechanism].
EVERY, STEP = 64, 0.08


class Predictor:
    """Follows a motion, part after part."""

    def __init__(self, lay: Layout) -> None:
        self.lay, self.system = lay, home_equations(lay)
        self.branch = self.system.follower()

    def predict(self, motion: GivenMotion) -> Array:
        """Joint coordinates, see `predicted`. Shape (n, n_q)."""
        size = self.system.size[self.lay.mechanism.independent_columns]
        rows = knots(motion.y / size, EVERY, STEP)
        some = motion.part(rows)
        at = positions(self.lay, some.y, some.t, (some.yd, some.ydd), path=self.branch)
        if len(rows) == len(motion):
            return at.q
        K = velocities(self.lay, at, some.yd).K
        return predicted(motion.y, rows, at.q, np.where(np.isfinite(K), K, 0.0))
