"""Velocities and accelerations that the closed loops admit, from those of chosen coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import constraint_rows
from screwgauge.witness.kinematics import TreeMotion


@dataclass(frozen=True, eq=False)
class AdmissibleMotion:
    """The motions that the closed loops admit at n poses, equations being without dimension.

    Attributes:
        motion: The poses.
        equations: What velocities make of the gaps, below it the selection of y. Shape (n, m + k, n_freedom).
        gap_size: What a gap of each of the first rows is measured by, 1 rad or a length. Shape (m,).
        size: Unit of each velocity: 1 rad, or the length [m]. Shape (n_freedom,).
        columns: The chosen ones.
    """

    motion: TreeMotion
    equations: Array
    gap_size: Array
    size: Array
    columns: list[int]

    def joints(self, y: Array, gaps: Array | None = None) -> Array:
        """Derivatives of all coordinates from those of the chosen ones.

        Args:
            y: Shape (n, k) or (n, k, m).
            gaps: What their `constraints.residual` would be without them; none by default. Shape (n, m).

        Returns:
            Shape (n, n_freedom) or (n, n_freedom, m).
        """
        single, m = y.ndim == 2, len(self.gap_size)
        y = y[..., None] if single else y
        right = np.zeros((len(y), self.equations.shape[1], y.shape[2]))
        right[:, m:] = y / self.size[self.columns, None]
        if gaps is not None:
            right[:, :m] = -(gaps / self.gap_size)[..., None]
        found = linear.solve(self.equations, right) * self.size[:, None]
        return np.asarray(found[..., 0] if single else found)

    @cached_property
    def partial(self) -> Array:
        """Velocities of all coordinates per velocity of y. Shape (n, n_freedom, k)."""
        return self.joints(np.tile(np.eye(len(self.columns)), (len(self.equations), 1, 1)))

    @cached_property
    def bodies(self) -> Array:
        """Velocities of the centres of mass over the angular ones, per velocity of y. Shape (n, n_body, 6, k)."""
        J = self.motion.jacobian(self.motion.tree.bodies, self.motion.com.p)[:, :, [3, 4, 5, 0, 1, 2]]
        return np.asarray(J @ self.partial[:, None])


def admissible_motion(motion: TreeMotion, q: Array, units: Sequence[str], columns: list[int]) -> AdmissibleMotion:
    """The motions admitted at poses.

    Args:
        units: rad or m, of each velocity.
        columns: Velocities by which a motion is told.
    """
    tree, length = motion.tree, motion.tree.length
    size = np.array([1.0 if unit == "rad" else length for unit in units])
    gap_size = [np.array([1.0] * 3 + [length] * 3)[-3 * (1 + (c.kind == "weld")) :] for c in tree.closures.values()]
    gaps = np.concatenate([*gap_size, [size[one.velocity] for one in tree.couplings.values()], np.zeros(0)])
    rows = constraint_rows(tree, motion, q) / gaps[:, None] * size
    chosen = np.broadcast_to(np.eye(len(size))[columns], (len(q), len(columns), len(size)))
    return AdmissibleMotion(motion, np.concatenate([rows, chosen], axis=1), gaps, size, columns)
