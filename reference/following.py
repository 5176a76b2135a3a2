"""Motions that are followed from home without leaving their branch.

An assembly of a mechanism is one branch of the solutions of its closing equations. A step along the branch is taken
only where their derivative J changes little, ``|J_a^+ J - 1| <= CHANGE`` in a norm of one's choice: as long as that
stays below one, no other solution of the same y lies between (Deuflhard, Newton Methods for Nonlinear Problems, 2011,
sections 3.1 and 5.1). Towards a singular pose steps shrink in proportion to the distance: none leads over it.
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
#: A change dJ is small in any of these norms, ``|s^-p U^T dJ V s^(p-1)|``: p = 1 is that of ``J^-1 dJ``; p = 0, that of
#: ``dJ J^-1``, takes tens of steps past the lock of a leg at 1e-6 rad where p = 1/2 takes more than 500.
NORMS = (0.0, 0.5, 1.0)
MARGIN = 0.6  # of the step that would change as much; on the way to a singular pose it is half of that
STEP = 0.5  # the longest step in y, however little changes
FARTHEST = 1.0  # no coordinate is predicted or corrected farther: whole turns mean another position of the joint
SHORT = 64 * linear.EPS  # a way in y of which rounding leaves nothing
MOST = 400  # steps of a short way; next to a singular pose, along it, there would be millions
FIRST, SLOW = 40, 0.1  # after so many steps, this share of what an even pace would have made has to be done
BLUR = 1e-6  # how far a way leads in y where rounding hides what the derivative does: branches meet there
BLOCK = 1024  # samples corrected at a time
REMEDY = "shorten the motion or check the geometry"
LONGEST = 1e3  # what is further away is not reached by following a path


class PathEnd(ClosureError):
    """A motion that cannot be followed any further.

    Attributes:
        z, y: The last pose reached: unknowns, shape (n_q,), and independent coordinates, shape (k,). No dimension.
        t: Time of the sample that cannot be reached [s].
        singular: Whether that pose is singular; otherwise the way is too long, or too near to a singular pose.
        beyond: Whether the loops close beyond it, too.
    """

    def __init__(self, at: Anchor, size: Array | float, t: float, *, singular: bool, beyond: bool) -> None:
        y = np.array2string(at.y * size, precision=6)
        super().__init__(
            f"the loops cannot close beyond y = {y}, or the pose there is singular", f"t = {t:g} s", REMEDY
        )
        self.z, self.y, self.t, self.singular, self.beyond = at.z, at.y, t, singular, beyond


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """A closed pose from which others are predicted.

    Attributes:
        z, y: Unknowns and independent coordinates, without dimension. Shapes (n_q,), (k,).
        matrix: Derivative of the closure residuals. Shape (m, n_q).
        error: Largest closure residual.
        K: Velocity map dz/dy. Shape (n_q, k).
        U, s, V: Its singular value decomposition ``U diag(s) V^T``. Shapes (m, n_q), (n_q,), (n_q, n_q).
        weights: Squares of what entries of ``U^T dJ V`` are divided by in each norm, `NORMS`. Shape (n_q^2, 3).
        slack: What rounding moves a solution by.
        singular: Whether rounding leaves nothing of the distance to a singular pose.
        blurred: Whether rounding changed the derivative more than steps may.
        all: All joint coordinates, where the unknowns are some of them. Shape (n_all,).
    """

    z: Array
    y: Array
    matrix: Array
    error: float
    K: Array
    U: Array
    s: Array
    V: Array
    weights: Array
    slack: float
    singular: bool
    blurred: bool
    all: Array

    @classmethod
    def at(cls, z: Array, y: Array, matrix: Array, error: float, joints: Array, *, blurred: bool = False) -> Anchor:
        """Shapes as above."""
        U, s, Vt = np.linalg.svd(matrix, full_matrices=False)
        s = np.maximum(s, 1e-100)  # whose powers are numbers
        K = (Vt.T / s) @ U[-len(y) :].T
        weights = [np.outer(s ** (-2.0 * left), s ** (2.0 * left - 2.0)).ravel() for left in NORMS]
        slack, singular = 64 * linear.EPS / float(s[-1]), bool(s[-1] < SHORT * s[0])
        return cls(z, y, matrix, error, K, U, s, Vt.T, np.array(weights).T, slack, singular, blurred, joints)

    def change(self, matrix: Array) -> Array:
        """How much other derivatives differ from this one. Shape (n, m, n_q) -> (n,)."""
        turned = self.U.T @ matrix @ self.V - np.diag(self.s)
        return np.asarray(np.sqrt((turned.reshape(len(matrix), len(self.weights)) ** 2 @ self.weights).min(axis=1)))


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

    def follow(self, y: Array, t: Array, rates: tuple[Array, Array] | None = None, *, strict: bool = False) -> Followed:
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
            near_by = np.abs(some - anchor.y).max(axis=1, initial=0.0) <= self.reach
            some = some[: 0 if anchor.blurred else _leading(near_by)]
            found = self._correct(some) if len(some) else None
            if found is None or not len(found[0]):
                motion = [] if rates is None else self._motion(y, t, rates, i)
                self._reach(y[i], float(t[i]), motion, strict=strict)
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
        at = self.anchor
        way = (y - at.y) @ at.K.T
        start = at.z + np.clip(way, -FARTHEST, FARTHEST)
        residual, matrix = self.evaluate(start, y)
        before = at.change(matrix)
        m = _leading(arriving | (before <= CHANGE) & (np.abs(way).max(axis=1) < FARTHEST))
        z, matrix, error = newton(self.evaluate, start[:m], y[:m], begun=(residual[:m], matrix[:m]))
        after, moved = at.change(matrix), np.abs(z - start[:m]).max(axis=1)
        clear = after <= CHANGE
        right = (arriving | clear | (moved <= at.slack)) & (error < OPEN) & (moved < FARTHEST)
        count = min(_leading(right & np.isfinite(matrix).all(axis=(1, 2))), _leading(clear) + 1)
        before[:m] = np.maximum(before[:m], after)
        self._learn(np.abs(y - at.y).max(axis=1), before, count)
        if count:
            i = count - 1
            joints = self.read(z[i], at.all)
            self.anchor = Anchor.at(z[i], y[i], matrix[i], float(error[i]), joints, blurred=not clear[i])
        return z[:count], matrix[:count], error[:count]

    def _learn(self, far: Array, change: Array, count: int) -> None:
        """How far the next step may lead, after `count` of those tried were taken: what changes grows as the step."""
        i = int(np.argmax(far[:count])) if count else 0
        growth = np.nan_to_num(MARGIN * CHANGE / np.maximum(change[i], 1e-3), nan=0.1)
        reach = float(far[i] * np.clip(growth, 0.1, 3.0 if count else 0.5))
        self.reach = min(STEP, max(reach, self.reach) if count == len(far) else reach)

    def _motion(self, y: Array, t: Array, rates: tuple[Array, Array], i: int) -> list[Way]:
        """The way of the motion itself from the sample before number i: by values and derivatives, of degree five."""
        after = (t[i], y[i], rates[0][i], rates[1][i])
        before = (t[i - 1], y[i - 1], rates[0][i - 1], rates[1][i - 1]) if i else self.last
        return [quintic(before, after)] if len(before) == 4 and after[0] > before[0] else []

    def _reach(self, target: Array, t: float, motion: list[Way], *, strict: bool) -> None:
        """Goes to a sample that is not within reach, straight on if that is possible; it is the new anchor.

        Raises:
            PathEnd: There is no way.
        """
        origin = self.anchor
        length = float(np.abs(target - origin.y).max(initial=0.0))
        if not length <= LONGEST:
            what = f"the motion jumps by {length:.3g} (rad, or lengths of the mechanism) from one sample to the next"
            raise ClosureError(what, f"t = {t:g} s", "give samples closer to each other")
        straight, *around = _ways(origin.y, target)
        ends = list[PathEnd]()
        for way in (straight, *motion, *([] if strict and self.begun else around)):
            self.anchor = origin
            if (end := self._along(way, target, t)) is None:
                return
            ends.append(end)
            self.reach = STEP
        if origin is not self.home and not (strict and all(end.singular for end in ends)):
            for way in _ways(self.home.y, target):
                self.anchor, self.reach = self.home, STEP
                if self._along(way, target, t) is None:
                    return
        self.anchor = origin
        raise ends[0]

    def _along(self, way: Way, target: Array, t: float) -> PathEnd | None:
        """Goes along a way in steps that stay on the branch; why it ends early, if it does."""
        done, step, singular, edge = 0.0, 1.0, False, None
        for i in range(MOST + int(20.0 * np.abs(target - self.anchor.y).max(initial=0.0) / STEP)):
            if i > FIRST and done < SLOW * i / MOST:
                break
            step = min(step, 1.0 - done)
            while True:
                goal = way(done + step) if done + step < 1.0 else target
                far, short = np.abs(goal - self.anchor.y).max(initial=0.0), SHORT * max(1.0, np.abs(goal).max())
                if far <= max(self.reach, short):
                    break
                step *= min(0.9, 0.9 * self.reach / far)
            arriving = bool(far <= short)
            edge = self.anchor.y if edge is None and self.anchor.blurred else edge
            hidden = edge is not None and bool(np.abs(goal - edge).max() > BLUR)
            singular = self.anchor.singular and not arriving
            if hidden or singular:
                break
            if len(self._correct(goal[None], arriving=arriving)[0]):
                done, step = done + step, 2.0 * step
                if done >= 1.0:
                    return None
            elif singular := bool(self.reach <= short):
                break
        at = self.anchor
        beyond = way(min(1.0, done + 1e-3))[None]
        start = at.z + (beyond - at.y) @ np.linalg.pinv(at.matrix, rcond=BLUR)[:, -len(at.y) :].T
        z, _, error = newton(self.evaluate, start, beyond)
        closes = bool(error[0] < OPEN and np.abs(z - start).max() < FARTHEST)
        return PathEnd(at, self.size, t, singular=singular, beyond=closes)


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
