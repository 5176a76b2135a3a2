"""Joint coordinates of many samples, predicted from closed poses every few samples, which are followed in sequence."""

from __future__ import annotations

import numpy as np

from screwgauge.problem import GivenMotion, Rows
from screwgauge.reference.kinematics import positions, velocities
from screwgauge.reference.pose import Layout
from screwgauge.reference.resting import home_equations
from screwgauge.reference.rotations import Array

#: From one closed pose to the next: at most so many samples, and so far in y [rad or lengths of the mechanism].
EVERY, STEP = 64, 0.08


class Predictor:
    """Follows a motion, part after part."""

    def __init__(self, lay: Layout) -> None:
        self.lay, self.system = lay, home_equations(lay)
        self.branch = self.system.follower()

    def _knots(self, y: Array) -> Rows:
        """Samples that are followed."""
        size = self.system.size[self.lay.mechanism.independent_columns]
        way = np.abs(np.diff(y / size, axis=0)).max(axis=1, initial=0.0)
        share = np.cumsum(np.maximum(way / STEP, 1.0 / EVERY))
        new = np.flatnonzero(np.diff(np.floor(np.concatenate([[0.0], share]))))
        return np.asarray(np.unique([0, *new, len(y) - 1]))

    def predict(self, motion: GivenMotion) -> Array:
        """Joint coordinates by Hermite's interpolation over the number of the sample. Shape (n, n_q).

        What the samples differ from the interpolated motion is made up for to first order, so that samples need not
        be evenly spread; where they jump, the prediction is bad, and the program's own checks say so.
        """
        n = len(motion)
        knots = self._knots(motion.y)
        some = motion.part(knots)
        at = positions(self.lay, some.y, some.t, (some.yd, some.ydd), path=self.branch)
        if len(knots) == n:
            return at.q
        K = velocities(self.lay, at, some.yd).K
        K = np.where(np.isfinite(K), K, 0.0)
        slope = np.gradient(motion.y, axis=0)[knots]
        i = np.minimum(np.searchsorted(knots, np.arange(n), side="right") - 1, len(knots) - 2)
        width = (knots[i + 1] - knots[i])[:, None].astype(float)
        s = (np.arange(n) - knots[i])[:, None] / width

        def between(x: Array, rate: Array) -> Array:
            left, right = s * (1.0 - s) ** 2 * width, s * s * (s - 1.0) * width
            part = s * s * (3.0 - 2.0 * s)
            return np.asarray(x[i] + part * (x[i + 1] - x[i]) + left * rate[i] + right * rate[i + 1])

        away = motion.y - between(some.y, slope)
        turned = (1.0 - s) * (K[i] @ away[..., None])[..., 0] + s * (K[i + 1] @ away[..., None])[..., 0]
        return np.asarray(between(at.q, (K @ slope[..., None])[..., 0]) + turned)
