"""Coordinates of cut joints, read from the two frames that an engine supplies.

A cut joint is not in the engine's tree, so its angles follow from the relative rotation of its two bodies. All tree
engines share this code; each engine computes the frames, rates and accelerations itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwgauge.engines.kit.poses import angle_condition
from screwgauge.reference.equations.joint_types import triad
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import (
    MIDDLE,
    Array,
    cross,
    nearest_angles,
    other_triple,
    sequence_angles,
    within_half_turn,
)


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Coordinates of a cut joint at n poses.

    Attributes:
        q: Angles [rad], wrapped to one turn; the second of three angles is within +-pi/2. `near` returns equivalent
            angles outside these ranges. Shape (n, m).
        R: World orientation of a parent-side frame built from the joint's first two axes at q = 0 and their cross
            product. Shape (n, 3, 3).
        last: Current direction of the joint's third axis in that frame. Shape (n, 3).
    """

    q: Array
    R: Array
    last: Array

    @property
    def condition(self) -> Array:
        """Condition number of the coordinate rates: a third of the axes' condition number; 1 at best. Shape (n,)."""
        return angle_condition(self.q)

    @property
    def duals(self) -> Array:
        """Cross products of the axes in the frame `R`: second x third, third x first, first x second. (n, 3, 3)."""
        c, s, (x, y, z) = np.cos(self.q[:, 0]), np.sin(self.q[:, 0]), self.last.T
        zero = np.zeros_like(c)
        return np.stack([c * z - s * y, s * x, -c * x, zero, z, -y, zero, -s, c], axis=1).reshape(-1, 3, 3)

    def rates(self, omega: Array) -> Array:
        """Return coordinate rates for a relative angular velocity in world axes. Shape (n, 3, ...) -> (n, m, ...)."""
        duals = self.duals
        volume = duals[:, :1, :1]
        inverse = duals[:, : self.q.shape[1]] / np.where(volume == 0.0, np.nan, volume)
        return np.asarray((inverse @ self.R.swapaxes(1, 2)) @ omega)

    def bias(self, rates: Array, omega_parent: Array, omega: Array, beta: Array) -> Array:
        """Return second derivatives of the coordinates for a relative angular acceleration in world axes.

        Args:
            rates: Coordinate rates. Shape (n, m).
            omega_parent: Angular velocity of the parent. Shape (n, 3).
            omega, beta: The child's angular velocity and acceleration minus the parent's. Shape (n, 3).

        Returns:
            Shape (n, m).
        """
        local = beta - cross(omega_parent, omega)
        if rates.shape[1] == 3:  # each axis is rotated by the preceding rates
            products = np.roll(rates, -1, axis=1) * np.roll(rates, 1, axis=1) * MIDDLE
            local = local - (self.R @ (products[:, None] @ self.duals).swapaxes(1, 2))[..., 0]
        return self.rates(local[..., None])[..., 0]

    def near(self, angles: Array) -> Chart:
        """Return a chart of the same rotations with the equivalent angles nearest to the given angles.

        Args:
            angles: Shape (n, m).
        """
        return replace(self, q=nearest_angles(self.q, angles)[0])

    def with_angle(self, i: int, angle: Array) -> Chart:
        """Return a chart of the same rotations that uses the triple with angle `i` nearest to `angle`, shape (n,)."""
        if self.q.shape[1] < 3:
            return self
        two = other_triple(self.q)
        swapped = np.abs(within_half_turn(two[:, i] - angle)) < np.abs(within_half_turn(self.q[:, i] - angle))
        return replace(self, q=np.where(swapped[:, None], two, self.q)) if swapped.any() else self


def read_chart(joint: Joint, R_parent: Array, R_child: Array) -> Chart:
    """Read the angles of a cut R or S joint from the orientations of its bodies. Shapes (n, 3, 3)."""
    basis, hand = triad(joint)
    R = R_parent @ (joint.parent_frame.R @ basis.T)
    M = R.swapaxes(1, 2) @ (R_child @ (joint.child_frame.R @ basis.T))
    # the last angle turns about the last axis
    return Chart(sequence_angles(M, len(joint.axes), hand), R, hand * M[..., 2])
