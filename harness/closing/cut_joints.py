"""Coordinates of joints that were cut to open a loop, read from the two frames that an engine gives.

A cut joint is in no engine's tree, so its angles come from the relative rotation of its two sides. This reading is
shared by all tree engines; the frames, their rates and accelerations are each engine's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import Array, rotation, triad_angles


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Coordinates of a cut joint at n poses.

    Attributes:
        q: Angles [rad]. Shape (n, m).
        R: Orientation of its parent side in the world. Shape (n, 3, 3).
        inverse: Maps a relative angular velocity, in the parent side's axes, to rates. Shape (n, m, 3).
        axes: Current directions of its axes in the parent side's axes. Shape (n, m, 3).
        condition: How much the reading of its rates loses, 1 at best. Shape (n,).
    """

    q: Array
    R: Array
    inverse: Array
    axes: Array
    condition: Array

    def rates(self, omega: Array) -> Array:
        """Coordinate rates for a relative angular velocity in world axes. Shape (n, 3, ...) -> (n, m, ...)."""
        return np.asarray(self.inverse @ (self.R.swapaxes(1, 2) @ omega))

    def bias(self, rates: Array, omega_parent: Array, omega: Array, beta: Array) -> Array:
        """Second derivatives for a relative angular acceleration in world axes.

        Args:
            rates: Coordinate rates. Shape (n, m).
            omega_parent: Angular velocity of the parent. Shape (n, 3).
            omega, beta: Angular velocity and acceleration of the child less those of the parent. Shape (n, 3).

        Returns:
            Shape (n, m).
        """
        own = np.zeros_like(omega)  # each axis is carried around by the rates before it
        for i in range(self.q.shape[1]):
            for j in range(i + 1, self.q.shape[1]):
                own += np.cross(self.axes[:, i], self.axes[:, j]) * (rates[:, i] * rates[:, j])[:, None]
        local = (self.R.swapaxes(1, 2) @ (beta - np.cross(omega_parent, omega))[..., None])[..., 0] - own
        return np.asarray((self.inverse @ local[..., None])[..., 0])


def read_chart(joint: Joint, R_parent: Array, R_child: Array) -> Chart:
    """Angles of a cut joint from the orientations of its bodies. Shapes (n, 3, 3).

    Raises:
        ModelFileError: The joint slides.
    """
    if joint.kind not in "RUS":
        raise ModelFileError(
            f"a {joint.kind} joint cannot be read when it is cut",
            f"joint '{joint.name}'",
            "cut another joint",
        )
    axes = _triad(joint.axes)
    R = R_parent @ joint.parent_frame.R
    angles = triad_angles(R.swapaxes(1, 2) @ (R_child @ joint.child_frame.R), axes)
    turned = np.empty((len(R), 3, 3))
    M = np.tile(np.eye(3), (len(R), 1, 1))
    for i in range(3):
        turned[:, i] = M @ axes[i]
        M = M @ rotation(axes[i], angles[:, i])
    m = len(joint.axes)
    inverse = np.asarray(linear.inverse(turned.swapaxes(1, 2))[:, :m], dtype=np.float64)
    condition = np.ones(len(R)) if m < 3 else linear.condition(turned) / 3.0
    return Chart(angles[:, :m], R, inverse, turned[:, :m], condition)


def nearest_turn(angles: Array, near: Array) -> Array:
    """The same angles, whole turns added so that they come near to others. Shapes (n, m)."""
    return np.asarray(angles + 2.0 * np.pi * np.round((near - angles) / (2.0 * np.pi)))


def _triad(axes: Array) -> Array:
    """Completes one or two orthogonal axes to three."""
    if len(axes) == 3:
        return axes
    if len(axes) == 2:
        return np.vstack([axes, np.cross(axes[0], axes[1])])
    second = np.linalg.svd(axes)[2][1]
    return np.vstack([axes, second, np.cross(axes[0], second)])
