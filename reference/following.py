"""Motions that are followed from home without leaving their branch.

An assembly of a mechanism is one branch of the solutions of its closing equations. A step along the branch is taken only
where their derivative J changes little, ``|J_a^+ J - 1| <= CHANGE`` in a norm of one's choice: as long as that stays
below one, no other solution of the same y lies between (Deuflhard, Newton Methods for Nonlinear Problems, 2011, sections
3.1 and 5.1). Towards a singular pose steps shrink in proportion to the distance, so that none leads over it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear
from screwgauge.reference.continuation import OPEN, Evaluation, newton
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array

#: How much the derivative may change in a step; below one no other solution lies between.
CHANGE = 0.5
STEP = 0.5  # the longest step in y, however little changes
FARTHEST = 1.0  # no coordinate is predicted or corrected farther: whole turns mean another position of the joint
SHORT = 64 * linear.EPS  # a way in y of which rounding leaves nothing
MOST = 500  # steps of a short way; next to a singular pose, along it, there would be millions
BLOCK = 1024  # samples corrected at a time
REMEDY = "shorten the motion or check the geometry"
LONGEST = 1e3  # what is further away is not reached by following a path


class PathEnd(ClosureError):
    """A motion that cannot be followed any further.

    Attributes:
        z, y: The last pose reached: unknowns, shape (n_q,), and independent coordinates, shape (k,). No dimension.
        singular: Whether that pose is singular; otherwise the way to the next sample is too long.
        beyond: Whether the loops close beyond it, too.
    """

    def __init__(self, at: Anchor, size: Array | float, where: str, *, singular: bool, beyond: bool) -> None:
        y = np.array2string(at.y * size, precision=6)
        super().__init__(f"the loops cannot close beyond y = {y}, or the pose there is singular", where, REMEDY)
        self.z, self.y, self.singular, self.beyond = at.z, at.y, singular, beyond


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """A closed pose from which others are predicted.

    Attributes:
        z, y: Unknowns and independent coordinates, without dimension. Shapes (n_q,), (k,).
        matrix: Derivative of the closure residuals. Shape (m, n_q).
        error: Largest closure residual.
        K: Velocity map dz/dy. Shape (n_q, k).
        left, right: Make the identity of the matrix, each being the root of its pseudo-inverse: in the norm in which
            change is measured, a singular direction that turns counts for less than one that gets weaker still.
            Shapes (n_q, m), (n_q, n_q).
        slack: What rounding moves a solution by.
        all: All joint coordinates, where the unknowns are some of them. Shape (n_all,).
    """

    z: Array
    y: Array
    matrix: Array
    error: float
    K: Array
    left: Array
    right: Array
    slack: float
    all: Array

    @classmethod
    def at(cls, z: Array, y: Array, matrix: Array, error: float, joints: Array) -> Anchor:
        """Shapes as above."""
        U, s, Vt = np.linalg.svd(matrix, full_matrices=False)
        s = np.maximum(s, np.finfo(float).tiny)
        K, root = (Vt.T / s) @ U[-len(y) :].T, np.sqrt(s)
        return cls(z, y, matrix, error, K, U.T / root[:, None], Vt.T / root, 64 * linear.EPS / float(s[-1]), joints)

    def change(self, matrix: Array) -> Array:
        """How much other derivatives differ from this one. Shape (n, m, n_q) -> (n,)."""
        return np.asarray(np.linalg.norm(self.left @ matrix @ self.right - np.eye(len(self.z)), axis=(1, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Closed poses of n samples.

    Attributes:
        z: Unknowns. Shape (n, n_q).
        matrix: Derivative of the closure residuals. Shape (n, m, n_q).
        error: Largest closure residual of each. Shape (n,).
        near: All joint coordinates of the pose that each was reached from. Shape (n, n_all).
    """

    z: Array
    matrix: Array
    error: Array
    near: Array


Way = Callable[[float], Array]
"""Share of a way, 0 to 1, -> independent coordinates (k,)."""


class Follower:
    """Follows a motion from a closed pose on, part after part, on one branch."""

    def __init__(
        self,
        evaluate: Evaluation,
        z: Array,
        y: Array,
        *,
        size: Array | float = 1.0,
        read: Callable[[Array, Array | None], Array] = lambda z, near: z,
    ) -> None:
        """Starts at a pose that closes nearly, such as home.

        Args:
            z, y: Unknowns and independent coordinates there. Shapes (n_q,), (k,).
            size: What y is divided by, for messages. Shape (k,).
            read: (unknowns, all joint coordinates of a pose nearby or at home) -> all joint coordinates.

        Raises:
            ClosureError: The loops do not close there.
        """
        self.evaluate, self.size, self.read, self.reach = evaluate, size, read, STEP
        found, matrix, error = newton(evaluate, z[None], y[None])
        if not error[0] < OPEN:
            remedy = "correct the placements or the home coordinates"
            raise ClosureError("the loops do not close there", "home pose", remedy)
        self.home = self.anchor = Anchor.at(found[0], y, matrix[0], float(error[0]), read(found[0], None))
        self.begun, self.last = False, tuple[Array, ...]()

    def follow(
        self, y: Array, t: Array, rates: tuple[Array, Array] | None = None, *, strict: bool = False
    ) -> Followed:
        """The closed poses of some samples, which go on from those followed before.

        Args:
            y: Independent coordinates. Shape (n, k).
            t: Their times [s]. Shape (n,).
            rates: Their first and second derivatives: where the straight way from one sample to the next passes a
                singular pose, that of the motion itself is taken. Shape (n, k) each.
            strict: Whether no third way may be taken, round what is singular on both.

        Raises:
            PathEnd: The motion leads to where the loops cannot close, or over a singular pose.
        """
        n, anchor = len(y), self.anchor
        z, matrix, error = np.empty((n, len(anchor.z))), np.empty((n, *anchor.matrix.shape)), np.empty(n)
        near = np.empty((n, len(anchor.all)))
        i = 0
        while i < n:
            some, anchor = y[i : i + BLOCK], self.anchor
            some = some[: _leading(np.abs(some - anchor.y).max(axis=1, initial=0.0) <= self.reach)]
            found = self._correct(some)
            if not len(found[0]):
                motion = [] if rates is None else self._motion(y, t, rates, i)
                self._reach(y[i], f"t = {t[i]:g} s", motion, strict=strict)
                anchor = self.anchor
                found = anchor.z[None], anchor.matrix[None], np.array([anchor.error])
            rows = slice(i, i + len(found[0]))
            z[rows], matrix[rows], error[rows] = found
            near[rows] = anchor.all
            self.begun, i = True, rows.stop
        self.last = (t[-1], y[-1], *(array[-1] for array in rates or ()))
        return Followed(z, matrix, error, near)

    def _correct(self, y: Array, *, arriving: bool = False) -> tuple[Array, Array, Array]:
        """Of samples within reach those on the branch, up to the first that is not; the last of them is the new anchor.

        Looked at is the derivative at the prediction, then at the solution. Next to a singular pose, where rounding
        alone changes it, the first counts: no solution is nearer to its prediction.

        Args:
            arriving: Whether rounding leaves nothing of the way there, as to a singular pose.

        Returns:
            Unknowns, derivative and residual of these samples.
        """
        if not len(y):
            return self.anchor.z[:0], self.anchor.matrix[:0], y[:, 0]
        at = self.anchor
        way = (y - at.y) @ at.K.T
        start = at.z + np.clip(way, -FARTHEST, FARTHEST)
        residual, matrix = self.evaluate(start, y)
        before = at.change(matrix)
        m = _leading(arriving | (before <= CHANGE) & (np.abs(way).max(axis=1) < FARTHEST))
        z, matrix, error = newton(self.evaluate, start[:m], y[:m], begun=(residual[:m], matrix[:m]))
        after, moved = at.change(matrix), np.abs(z - start[:m]).max(axis=1)
        near = arriving | (after <= CHANGE) | (moved <= at.slack)
        count = _leading(near & (error < OPEN) & (moved < FARTHEST) & np.isfinite(matrix).all(axis=(1, 2)))
        before[:m] = np.maximum(before[:m], after)
        self._learn(np.abs(y - at.y).max(axis=1), before, count)
        if count:
            i = count - 1
            joints = self.read(z[i], at.all)
            self.anchor = Anchor.at(z[i], y[i], matrix[i], float(error[i]), joints)
        return z[:count], matrix[:count], error[:count]

    def _learn(self, far: Array, change: Array, count: int) -> None:
        """How far the next step may lead, after `count` of those tried were taken: what changes grows as the step."""
        i = int(np.argmax(far[:count])) if count else 0
        growth = np.nan_to_num(0.9 * CHANGE / np.maximum(change[i], 1e-3), nan=0.1)
        reach = float(far[i] * np.clip(growth, 0.1, 3.0 if count else 0.5))
        self.reach = min(STEP, max(reach, self.reach) if count == len(far) else reach)

    def _motion(self, y: Array, t: Array, rates: tuple[Array, Array], i: int) -> list[Way]:
        """The way of the motion itself from the sample before number i: by values and derivatives, of degree five."""
        after = (t[i], y[i], rates[0][i], rates[1][i])
        before = (t[i - 1], y[i - 1], rates[0][i - 1], rates[1][i - 1]) if i else self.last
        return [quintic(before, after)] if len(before) == 4 and after[0] > before[0] else []

    def _reach(self, target: Array, where: str, motion: list[Way], *, strict: bool) -> None:
        """Goes to a sample that is not within reach, straight on if that is possible; it is the new anchor.

        Raises:
            PathEnd: There is no way.
        """
        origin = self.anchor
        length = float(np.abs(target - origin.y).max(initial=0.0))
        if not length <= LONGEST:
            what = f"the motion jumps by {length:.3g} (rad, or lengths of the mechanism) from one sample to the next"
            raise ClosureError(what, where, "give samples closer to each other")
        straight, *around = _ways(origin.y, target)
        ends = list[PathEnd]()
        for way in (straight, *motion, *([] if strict and self.begun else around)):
            self.anchor = origin
            if (end := self._along(way, target, where)) is None:
                return
            ends.append(end)
            self.reach = STEP
        if not strict or not all(end.singular for end in ends):
            for way in _ways(self.home.y, target):
                self.anchor, self.reach = self.home, STEP
                if self._along(way, target, where) is None:
                    return
        self.anchor = origin
        raise ends[0]

    def _along(self, way: Way, target: Array, where: str) -> PathEnd | None:
        """Goes along a way in steps that stay on the branch; why it ends early, if it does."""
        done, step, singular = 0.0, 1.0, False
        for _ in range(MOST + int(20.0 * np.abs(target - self.anchor.y).max(initial=0.0) / STEP)):
            step = min(step, 1.0 - done)
            while True:
                goal = way(done + step) if done + step < 1.0 else target
                far, short = np.abs(goal - self.anchor.y).max(initial=0.0), SHORT * max(1.0, np.abs(goal).max())
                if far <= max(self.reach, short):
                    break
                step *= min(0.9, 0.9 * self.reach / far)
            if len(self._correct(goal[None], arriving=bool(far <= short))[0]):
                done, step = done + step, 2.0 * step
                if done >= 1.0:
                    return None
            elif singular := bool(self.reach <= short):
                break
        at = self.anchor
        beyond = way(min(1.0, done + 1e-3))[None]
        start = at.z + np.clip((beyond - at.y) @ at.K.T, -FARTHEST, FARTHEST)
        z, _, error = newton(self.evaluate, start, beyond)
        closes = bool(error[0] < OPEN and np.abs(z - start).max() < FARTHEST)
        return PathEnd(at, self.size, where, singular=singular, beyond=closes)


def _leading(flags: NDArray[np.bool_]) -> int:
    """How many are true before the first that is not."""
    return len(flags) if flags.all() else int(np.argmin(flags))


def quintic(before: Sequence[Array], after: Sequence[Array]) -> Way:
    """The polynomial of degree five between two samples: time, values, first and second derivatives."""
    (t0, y0, v0, a0), (t1, y1, v1, a1) = before, after
    h = float(t1 - t0)
    v0, v1, a0, a1 = h * v0, h * v1, h * h * a0, h * h * a1

    def way(s: float) -> Array:
        r = y1 - y0 - v0 - 0.5 * a0
        v, a = v1 - v0 - a0, a1 - a0
        c3, c4, c5 = 10 * r - 4 * v + 0.5 * a, -15 * r + 7 * v - a, 6 * r - 3 * v + 0.5 * a
        return np.asarray(y0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5)))))

    return way


def _ways(origin: Array, target: Array) -> list[Way]:
    """The straight way, and two that bend to either side of it."""
    along = target - origin
    across = np.eye(len(along))[int(np.argmin(np.abs(along)))]
    across = across - along * (across @ along) / max(float(along @ along), np.finfo(float).tiny)
    bends = 0.3 * np.linalg.norm(along) * across

    def bent(sign: float) -> Way:
        return lambda s: np.asarray(origin + s * along + sign * np.sin(np.pi * s) * bends)

    return [bent(sign) for sign in ((0.0, 1.0, -1.0) if len(along) > 1 else (0.0,))]
