"""Follow the closed poses of a motion from the home pose, for engines whose unknowns are all joint coordinates.

Poses are predicted along the tangent and closed with Newton's method. Steps are halved until two neighbouring poses
verifiably lie on the same branch. No code is shared with the continuation of `screw` and of tree engines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.error_estimate import SolvedPart, Trust, examine_part
from screwgauge.engines.kit.answers import at_samples
from screwgauge.problem import GivenMotion, Rows
from screwgauge.quantities import description_names, length
from screwgauge.reference.applied import Applied
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.linear import invert, norms
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock

Gaps = Callable[[Array], tuple[Array, Array]]
"""Joint coordinates (n, n_q) -> residuals of loop closures and couplings, (n, m), and derivatives, (n, m, n_q)."""

Solve = Callable[[Array, GivenMotion, Applied], tuple[dict[str, Array], dict[str, Array]]]
"""Joint coordinates (n, n_q), motion and applied forces -> quantities (n, m), and condition numbers (n,) for those
quantities that require the solution of further equations at the closed poses.
"""

# Angles are in rad and distances in mechanism lengths wherever these constants are used.
#: Number of Newton steps; step size after which only rounding errors remain, and step size that counts as divergence.
STEPS, SMALL, FAR = 12, 1e-8, 10.0
#: Residual above which loops do not close; condition number of a singular pose.
OPEN, SINGULAR = 1e-10, 1e12
#: Fraction of a step by which a pose may miss the tangents at both ends, allowance for rounding, and longest step.
BEND, SLACK, LONGEST = 0.25, 1e-9, 0.5
#: Largest number of samples tried at a time; how often the step to a sample may be halved.
MANY, HALVINGS = 256, 17


class Branch:
    """The branch of closed poses from the home pose to the last pose reached."""

    def __init__(self, mechanism: Mechanism, gaps: Gaps, angular: Sequence[bool], points: Sequence[Point] = ()) -> None:
        """Start at the home pose.

        Args:
            gaps: Computes the residuals of loop closures and couplings, which may be redundant.
            angular: True for gaps that are angles. Shape (m,).
            points: Named points, whose velocities are components of the quantity `jacobian`.
        """
        self._gaps, self._columns, self._length = gaps, mechanism.independent_columns, length(mechanism)
        self._component_units = {name: units for name, (_, units) in description_names(mechanism, points).items()}
        self._sizes = np.where([unit == "rad" for unit in mechanism.units], 1.0, self._length)
        self._units = np.concatenate([np.where(angular, 1.0, self._length), self._sizes[self._columns]])
        self._t, self._y, self._many = np.nan, mechanism.home[self._columns], MANY
        self._q, self._K, _ = self._newton(mechanism.home[None].copy(), self._y[None])

    def follow(self, motion: GivenMotion) -> Array:
        """Follow the branch along the next samples; return all joint coordinates [rad or m]. Shape (n, n_q).

        Raises:
            ClosureError: The branch ends before a sample is reached, or meets another branch.
        """
        parts, first = list[Array](), 0
        while first < len(motion):
            rows = slice(first, first + self._many)
            parts.append(self._link(motion.t[rows], motion.y[rows]))
            if self._many == 1 and not len(parts[-1]):
                self._go(motion, float(motion.t[first]), motion.y[first])
                parts.append(self._q)
            first, self._many = first + len(parts[-1]), min(2 * len(parts[-1]), MANY) or 1
        return np.concatenate(parts)

    def system(self, q: Array, y: Array) -> tuple[Array, Array, Array]:
        """Invert the closing system at given poses; its last rows select y.

        Returns:
            Least-squares inverse, (n, n_q, m + k); condition number of the dimensionless system, (n,); residuals of
            the gaps and of y, (n, m + k).
        """
        A, missed = self._matrix(q, y)
        with np.errstate(all="ignore"):
            inverse, condition = invert(A)
        return inverse * self._sizes[:, None] / self._units, condition, missed

    def solve_part(self, motion: GivenMotion, applied: Applied, solve: Solve, clock: Clock) -> SolvedPart:
        """Solve the next samples, with error estimates.

        Estimates follow from the condition numbers of the solved systems. Ill-conditioned samples are solved again at
        poses perturbed by about the rounding error.

        Raises:
            ClosureError: See `follow`.
        """
        with clock.stage("positions"):
            q = self.follow(motion)
        values, conditions = solve(q, motion, applied)
        A, _ = self._matrix(q, motion.y)
        _, condition = invert(A)
        trust = Trust(condition, condition / norms(A), np.ones(len(q)), conditions)

        def solve_perturbed(rows: Rows, shake: Array) -> dict[str, Array]:
            return solve(q[rows] + shake * self._sizes, motion.part(rows), at_samples(applied, rows))[0]

        k = motion.y.shape[1]
        part = examine_part(values, trust, A, k, solve_perturbed, clock, self._component_units, self._length)
        return replace(part, q=q)

    def _matrix(self, q: Array, y: Array) -> tuple[Array, Array]:
        """Return the dimensionless closing system, and residuals of gaps and y."""
        with np.errstate(all="ignore"):
            gaps, G = self._gaps(q)
            A = np.concatenate([G, np.eye(q.shape[1])[self._columns] + np.zeros((len(q), 1, 1))], axis=1)
            missed = np.concatenate([gaps, q[:, self._columns] - y], axis=1)
            return A * self._sizes / self._units[:, None], missed

    def _go(self, motion: GivenMotion, t: float, y: Array, halvings: int = 0) -> None:
        """Move to a pose, halving the step if necessary, along the curve of the motion if it is known."""
        if len(self._link(np.array([t]), y[None])):
            return
        if halvings == HALVINGS:
            near = ", ".join(f"{x:.6g}" for x in self._y)
            what = f"the loops cannot close beyond y = [{near}], or the pose there is singular"
            raise ClosureError(what, f"t = {t:g} s", "shorten the motion or check the geometry")
        middle, halfway = 0.5 * (self._t + t), 0.5 * (self._y + y)
        if motion.drive is not None and np.isfinite(middle):
            halfway = motion.drive(np.array([middle])).y[0]
        self._go(motion, middle, halfway, halvings + 1)
        self._go(motion, t, y, halvings + 1)

    def _link(self, t: Array, y: Array) -> Array:
        """Return the poses before the first pose whose step is long or disagrees with the tangents at its ends."""
        q, K, good = self._newton(self._q + (self._K @ (y - self._y)[..., None])[..., 0], y)
        K, way = np.concatenate([self._K, K]), np.diff(np.concatenate([self._y[None], y]), axis=0)[..., None]
        step = np.diff(np.concatenate([self._q, q]), axis=0)
        size = np.abs(step / self._sizes).max(axis=1)
        for tangent in (K[:-1], K[1:]):
            missed = np.abs((step - (tangent @ way)[..., 0]) / self._sizes).max(axis=1)
            good &= (size <= LONGEST) & (missed <= BEND * size + SLACK)
        if count := len(good) if good.all() else int(np.argmin(good)):
            self._t, self._y, self._q, self._K = t[count - 1], y[count - 1], q[count - 1 : count], K[count : count + 1]
        return q[:count]

    def _newton(self, q: Array, y: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Close poses with Newton's method until a step is small; the error left is about the square of that step.

        Returns:
            Coordinates, tangents, and True for regular closed poses. Shapes (n, n_q), (n, n_q, k), (n,).
        """
        k, K, step = y.shape[1], np.zeros((*q.shape, y.shape[1])), np.zeros_like(q)
        good, rows, size = np.zeros(len(q), dtype=bool), np.arange(len(q)), np.full(len(q), np.inf)
        for _ in range(STEPS):
            q[rows] -= step
            inverse, condition, missed = self.system(q[rows], y[rows])
            K[rows] = inverse[..., inverse.shape[2] - k :]
            good[rows] = (condition < SINGULAR) & (np.abs(missed / self._units).max(axis=1) <= OPEN)
            step = (inverse @ missed[..., None])[..., 0]
            before, size = size, np.abs(step / self._sizes).max(axis=1)
            more = (before > SMALL) & (size < FAR)
            rows, size, step = rows[more], size[more], step[more]
            if not len(rows):
                break
        return q, K, good
