"""Motions that are followed from home without leaving their branch.

An assembly of a mechanism is one branch of the solutions of its closing equations. A step along the branch is taken
only where their derivative J changes little, ``|J_a^+ J - 1| <= CHANGE`` in a norm of one's choice: as long as that
stays below one, no other solution of the same y lies between (Deuflhard, Newton Methods for Nonlinear Problems, 2011,
sections 3.1 and 5.1). Towards a singular pose steps shrink in proportion to the distance: none leads over it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference import linear
from screwgauge.reference.closed.anchor import SHORT, Anchor, PathEnd
from screwgauge.reference.closed.between import Spacing, predicted
from screwgauge.reference.closed.continuation import OPEN, Evaluation, newton
from screwgauge.reference.closed.ways import Way, quintic, rest, straight_and_bent
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import Array

#: How much the derivative may change in a step; below one no other solution lies between.
CHANGE = 0.5
MARGIN = 0.6  # of the step that would change as much; on the way to a singular pose it is half of that
STEP = 0.5  # the longest step in y, however little changes
FARTHEST = 1.0  # no coordinate is predicted or corrected farther: whole turns mean another position of the joint
MOST = 400  # steps of a short way; next to a singular pose, along it, there would be millions
FIRST, SLOW = 40, 0.1  # after so many steps, this share of what an even pace would have made has to be done
BLUR = 1e-6  # how far a way leads in y where rounding hides what the derivative does: branches meet there
#: Passing a singular pose where the least singular value is a smaller share of the largest cannot be told from
#: passing through it, nor from turning off it into the branch that crosses there: rounding moves a solution as far.
FAINT = 1e-9
NEARER = 1e-3  # share of the least singular value where a way begins, below which it leads towards a singular pose
BLOCK = 2048  # samples corrected at a time
FEW = 8  # steps of Newton's method that predicted samples are worth
LEAP = 1e-3  # share of a way by which it is looked whether the loops close beyond its end
LONGEST = 1e3  # what is further away is not reached by following a path


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Closed poses of n samples.

    Attributes:
        z: Unknowns. Shape (n, n_q).
        matrix: Derivative of the closure residuals. Shape (n, m, n_q).
        error: Largest closure residual of each. Shape (n,).
        near: All joint coordinates of the pose that each was reached from. Shape (n, n_all).
        more: What else was evaluated there. Shape (n, ...) each.
    """

    z: Array
    matrix: Array
    error: Array
    near: Array
    more: tuple[Array, ...]


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
        found, matrix, error, *self.beside = newton(evaluate, z[None], y[None])
        if not error[0] < OPEN:
            remedy = "correct the placements or the home coordinates"
            raise ClosureError("the loops do not close there", "home pose", remedy)
        self.home = self.anchor = Anchor.at(found[0], y, matrix[0], float(error[0]), read(found[0], None))
        self.begun, self.last, self.spacing = False, tuple[Array, ...](), Spacing()

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
        pieces, i, tried = list[tuple[Array, ...]](), 0, 0
        while i < len(y):
            some = y[i : i + BLOCK]
            found, count = self._between(some) if i >= tried else (None, 0)
            tried = max(tried, i + count)
            if (found := found or self._onward(some)) is None:
                motion = [] if rates is None else self._motion(y, t, rates, i)
                self._reach(y[i], float(t[i]), motion, strict=strict)
                at = self.anchor
                found = at.z[None], at.matrix[None], np.array([at.error]), at.all[None], *self.beside
            pieces.append(found)
            self.begun, i = True, i + len(found[0])
        self.last = (t[-1], y[-1], *(array[-1] for array in rates or ()))
        z, matrix, error, near, *more = (x[0] if len(x) == 1 else np.concatenate(x) for x in zip(*pieces, strict=True))
        return Followed(z, matrix, error, near, tuple(more))

    def _onward(self, y: Array) -> tuple[Array, ...] | None:
        """Of samples those that are within reach and on the branch, if the first of them is.

        Returns:
            The fields of `Followed`, one after the other.
        """
        anchor, count = self.anchor, self._near(y)
        if anchor.blurred or not count:
            return None
        z, matrix, error, *more = self._correct(y[:count])
        return (z, matrix, error, anchor.all[None].repeat(len(z), axis=0), *more) if len(z) else None

    def _near(self, y: Array) -> int:
        """How many samples are within reach before the first that is not."""
        return _leading(np.abs(y - self.anchor.y).max(axis=1, initial=0.0) <= self.reach)

    def _correct(self, y: Array, *, arriving: bool = False) -> tuple[Array, ...]:
        """Of samples within reach those on the branch, up to the first that is not; the last of them is the new anchor.

        Looked at is the derivative at the prediction, then at the solution. Next to a singular pose, where rounding
        alone changes it, the first counts: no solution is nearer to its prediction.

        Args:
            arriving: Whether rounding leaves nothing of the way there, as to a singular pose.

        Returns:
            Unknowns, derivative, residual of these samples, and what else `evaluate` gives.
        """
        at = self.anchor
        way = (y - at.y) @ at.K.T
        start = at.z + np.clip(way, -FARTHEST, FARTHEST)
        begun = self.evaluate(start, y)
        before = at.change(begun[1])
        m = _leading(arriving | (before <= CHANGE) & (np.abs(way).max(axis=1) < FARTHEST))
        z, matrix, error, *more = found = newton(self.evaluate, start[:m], y[:m], begun=[x[:m] for x in begun])
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
            self.beside = [array[i:count] for array in more]
        return tuple(array[:count] for array in found)

    def _between(self, y: Array) -> tuple[tuple[Array, ...] | None, int]:
        """As `_onward`, where samples lie so near to some of them that they can be predicted from these.

        Looked at is how much the derivative changes from the nearest of those to the solution. If anything stands in
        the way, nothing is done.

        Returns:
            The same, if it was possible, and how many samples were looked at.
        """
        anchor, reach, every, knots, m = self.anchor, self.reach, self.spacing.every, list[tuple[Array, ...]](), 0
        if (rows := self.spacing.rows(y, self._near(y))) is None:
            return None, 0
        while m < len(rows) and (found := self._onward(y[rows[m:]])):
            knots.append(found[:4])
            m += len(found[0])
        rows, y = rows[:m], y[: rows[m - 1] + 1 if m else 0]
        if m > 1 and not self.anchor.blurred:
            z, matrix, _, joints = map(np.concatenate, zip(*knots, strict=True))
            inverse = linear.inverted(matrix)[0]
            start = predicted(y, rows, z, inverse[:, :, -y.shape[1] :])
            z, matrix, error, *more = newton(self.evaluate, start, y, most=FEW)  # no more for a bad one
            self.spacing.learn(every, float((z != start).any(axis=1).mean()))
            near = np.searchsorted(0.5 * (rows[1:] + rows[:-1]), np.arange(len(y)))
            change = linear.departure(matrix, inverse, near)
            if (change <= CHANGE).all() and (error < OPEN).all() and np.abs(z - start).max() < FARTHEST:
                return (z, matrix, error, joints[near], *more), len(y)
        self.anchor, self.reach = anchor, reach
        return None, len(y)

    def _learn(self, far: Array, change: Array, count: int) -> None:
        """How far the next step may lead, after `count` of those tried were taken: what changes grows as the step."""
        moved = bool(far[:count].any())
        if count == len(far) and not moved:
            return
        i = int(np.argmax(far[:count])) if moved else count
        growth = MARGIN * CHANGE / max(float(change[i]), 1e-3) if np.isfinite(change[i]) else 0.1
        reach = float(far[i] * np.clip(growth, 0.1, 3.0 if moved else 0.5))
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
        straight, *around = straight_and_bent(origin.y, target)
        ends = list[PathEnd]()
        for way in (straight, *motion, *([] if strict and self.begun else around)):
            self.anchor = origin
            if (end := self._along(way, target, t)) is None:
                return
            ends.append(end)
            self.reach = STEP
        if origin is not self.home and not (strict and all(end.singular for end in ends)):
            for way in straight_and_bent(self.home.y, target):
                self.anchor, self.reach = self.home, STEP
                if self._along(way, target, t) is None:
                    return
        end, done = ends[0], 0.0
        while not (strict or self.begun) and end.landing and end.landing[1] < 1.0:  # goes straight on over it
            self.anchor, self.reach = end.landing[0], STEP
            done += end.landing[1] * (1.0 - done)
            if (further := self._along(rest(straight, done), target, t)) is None:
                return
            end = further
        self.anchor = origin
        raise ends[0]

    def _along(self, way: Way, target: Array, t: float) -> PathEnd | None:
        """Goes along a way in steps that stay on the branch; why it ends early, if it does."""
        done, step, singular, edge = 0.0, 1.0, False, None
        first = low = self.anchor.s[-1]
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
            faint = self.anchor.s[-1] < min(FAINT * self.anchor.s[0], NEARER * first)
            passing = faint and bool(np.abs(target - self.anchor.y).max() > MOST * max(self.reach, short))
            singular = (self.anchor.singular or passing) and not arriving
            if hidden or singular:
                break
            if len(self._correct(goal[None], arriving=arriving)[0]):
                done, step, least = done + step, 2.0 * step, self.anchor.s[-1]
                low = min(low, least)
                if singular := bool(low < FAINT * self.anchor.s[0] and 4.0 * low < min(first, least)):
                    break
                if done >= 1.0:
                    return None
            elif singular := bool(self.reach <= short):
                break
        return self._end(way, done, t, singular=singular)

    def _end(self, way: Way, done: float, t: float, *, singular: bool) -> PathEnd:
        """That the way ends here, after a share of it, and where straight on leads."""
        at, beyond = self.anchor, min(1.0, done + LEAP)
        y = way(beyond)
        start = at.z + np.linalg.pinv(at.matrix, rcond=BLUR)[:, -len(y) :] @ (y - at.y)
        z, matrix, error = newton(self.evaluate, start[None], y[None])[:3]
        landing = None
        if error[0] < OPEN and np.abs(z - start).max() < FARTHEST:
            landing = Anchor.at(z[0], y, matrix[0], float(error[0]), self.read(z[0], at.all)), beyond
        return PathEnd(at, self.size, t, singular, landing)


def _leading(flags: NDArray[np.bool_]) -> int:
    """How many are true before the first that is not."""
    return len(flags) if flags.all() else int(np.argmin(flags))
