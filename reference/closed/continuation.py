"""Follows the home assembly mode along a motion, including the curves between samples.

If a path ends early, the error names the sample and the reason. A `Region` handles samples in any order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.closed.anchors import NEAR, Flags, Indices
from screwgauge.reference.closed.newton import (
    HALF,
    HALVES,
    OPEN,
    Curve,
    Drive,
    Motion,
    Rates,
    State,
    are_consistent,
    bent_paths,
    hermite,
    knots,
    newton,
    predict_unknowns,
    straight_path,
    velocity_map,
)
from screwgauge.reference.closed.walk import EACH, LEAP, MISS, MOST, Blocked, Walk
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.rotations import TURN, Array

#: Number of samples that become anchors if predictions are poor.
SOME = 8
#: Largest distance to a sample that is reached by following a path [rad or mechanism lengths].
LONGEST = 1e3
#: Initial and largest number of samples that are processed together.
WINDOW, WIDEST = 32, 8192
#: If at least `DENSE` samples are closely spaced, they are predicted from every `EVERY`-th sample, at most `SPREAD`
#: apart in y.
DENSE, EVERY, SPREAD = 100, 16, 0.1
#: Largest number of singular poses on the path from home to the start of a motion.
LEAPS = 8
REMEDY = "shorten the motion or check the geometry"


def no_further(y: Array) -> str:
    """Return the message that the motion cannot be continued beyond independent coordinates `y`, shape (k,)."""
    return f"the loops cannot close beyond y = {np.array2string(y, precision=6)}, or the pose there is singular"


class PathEnd(ClosureError):
    """Raised when path following fails.

    Attributes:
        z, y: Dimensionless unknowns, shape (n_z,), and independent coordinates [rad or m], shape (k,), of the last pose
            that was reached.
        t: Time of the sample that cannot be reached [s].
        singular: True if that pose is singular, False if the path is too long.
        beyond: True if the loops also close beyond that pose.
    """

    def __init__(self, z: Array, y: Array, t: float, *, singular: bool, beyond: bool) -> None:
        super().__init__(no_further(y), f"t = {t:g} s", REMEDY)
        self.z, self.y, self.t, self.singular, self.beyond = z, y, t, singular, beyond


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Predictions of n closed poses; all are dimensionless except `near`.

    Attributes:
        t: Times [s], or sample indices if samples are in any order. Shape (n,).
        y: Independent coordinates. Shape (n, k).
        z: Unknowns, predicted to first order. Shape (n, n_z).
        anchor: Number of the anchor of each sample. Shape (n,).
        visit: Row of `near` for each sample. Shape (n,).
        path: Continuation that has the anchors; None if poses have a closed form.
        near: Joint coordinates [rad or m] that select among equivalent angles of a cut joint; None if the angles depend
            on y alone. Shape (v, n_q).
        ordered: True if the samples form a sequence.
    """

    t: Array
    y: Array
    z: Array
    anchor: Indices
    visit: Indices
    path: Continuation | None = None
    near: Array | None = None
    ordered: bool = False

    def rows(self, rows: Indices) -> Poses:
        """Select the predictions of the given samples, in any order."""
        some = self.t[rows], self.y[rows], self.z[rows], self.anchor[rows], self.visit[rows]
        return Poses(*some, self.path, self.near)


class Continuation(Walk):
    """Closed poses of one assembly mode along a motion."""

    def predict(self, y: Array, t: Array, rates: Rates | None = None, drive: Motion | None = None) -> Poses:
        """Predict the samples of a motion that continues from earlier samples; link each sample to its predecessor.

        Args:
            y: Independent coordinates [rad or m]. Shape (n, k).
            t: Times [s]. Shape (n,).
            rates: Derivatives of y; between two samples, the motion is the curve through their states. Without rates,
                or if they are inconsistent with y, any path to a sample is allowed. Shape (n, k) each.
            drive: Motion between these times, see `newton.Motion`.

        Raises:
            PathEnd: The motion reaches a pose where the loops cannot close, or crosses a singular pose.
        """
        y, rates = y / self.size, None if rates is None else (rates[0] / self.size, rates[1] / self.size)
        return self._pass_samples(y, t, rates, None if drive is None else self._unitless(drive))

    def _unitless(self, drive: Motion) -> Drive:
        def at(t: Array) -> State:
            motion = drive(t)
            return motion.y / self.size, motion.yd / self.size, motion.ydd / self.size

        return at

    def _pass_samples(self, y: Array, t: Array, rates: Rates | None, drive: Drive | None) -> Poses:
        """Process dimensionless samples, see `predict`."""
        self._look_for_turns(y)
        curves, moving, miss = self._curves(y, t, rates, drive)
        anchor, visit = np.empty(len(y), dtype=np.intp), np.empty(len(y), dtype=np.intp)
        i, window, begin = 0, WINDOW, len(self.visits) - 1
        while i < len(y):
            first, stop, known = i, min(i + window, len(y)), len(self.anchors)
            covering, inside, linked = self._link(curves[first:stop], miss[first:stop])
            for gap in (*(first + np.flatnonzero(~linked)).tolist(), stop):
                anchor[i:gap], visit[i:gap] = self._pass(covering[i - first : gap - first])
                i = gap
                if i == stop:
                    break
                ends = (float(t[i - 1]) if i else float(self.last[0]) if self.last else float(t[0])), float(t[i])
                self._go(Curve(curves[i], ends, drive if moving[i] else None), moving=bool(moving[i]))
                anchor[i], visit[i], self.begun = self.at, len(self.visits) - 1, True
                i += 1
                next_one = int(covering[gap - first])
                if len(self.anchors) > known or not (inside[gap - first] and self._hop(next_one)):
                    break  # these anchors are not valid for the samples that follow
            window = min(2 * window, WIDEST) if i == stop else max(window // 2, WINDOW)
        self.last = [t[-1], y[-1], *(x[-1] for x in rates or ())]
        table = self.anchors.table["z"][self.visits[begin:]]  # full turns are counted along the path
        self.path = self._unwrap(np.concatenate([self.path[-1:], table]))[1:]
        self.visits, visit = self.visits[-1:], visit - begin
        z = self.anchors.predict(y, anchor) + (self.path - table)[visit]
        return Poses(t, y, z, anchor, visit, self, ordered=True)

    def _pass(self, covering: Indices) -> tuple[Indices, Indices]:
        """Visit the anchors of linked samples; return these anchors and the index of each visit. Shape (n,)."""
        changed = np.flatnonzero(np.diff(covering, prepend=self.at))
        visit = len(self.visits) - 1 + np.searchsorted(changed, np.arange(len(covering)), side="right")
        self.visits += covering[changed].tolist()
        self.at, self.begun = int(self.visits[-1]), self.begun or len(covering) > 0
        return covering, visit

    def _hop(self, a: int) -> bool:
        """Move to an anchor on the same branch whose ball contains the current sample; return False if this fails."""
        if a != self.at and not self.anchors.on_one_branch(self.at, a):
            return False
        if a != self.at:
            self._visit(a)
        return True

    def _curves(self, y: Array, t: Array, rates: Rates | None, drive: Drive | None) -> tuple[Array, Flags, Array]:
        """Build curves to the samples, flags for curves that are the motion, and deviations of the motion at midpoints.

        Returns:
            Shapes (n, 6, k), (n,), (n, k).
        """
        before = np.concatenate([(self.last[1] if self.last else self.anchors[self.at].y)[None], y[:-1]])
        points, moving, miss = straight_path(before, y), np.zeros(len(y), dtype=bool), np.zeros_like(y)
        if rates is None:
            return points, moving, miss
        known = len(self.last) == 4
        states = [y, *rates]
        if known:
            states = [np.concatenate([old[None], new]) for old, new in zip(self.last[1:], states, strict=True)]
            t = np.concatenate([self.last[:1], t])
        h = np.diff(t)
        ends: list[State] = [(x[0][some], x[1][some], x[2][some]) for x in [states] for some in (np.s_[:-1], np.s_[1:])]
        rows = slice(0 if known else 1, None)
        moving[rows] = are_consistent(h, *ends)
        if drive is not None:  # the motion is also known between two states at rest
            moving[rows] |= (h > 0.0) & ~np.concatenate([x for end in ends for x in end[1:]], axis=1).any(axis=1)
        points[rows] = np.where(moving[rows, None, None], hermite(h, *ends), points[rows])
        if drive is not None and len(h):
            miss[rows] = np.where(moving[rows, None], drive(t[:-1] + 0.5 * h)[0] - HALF @ points[rows], 0.0)
        return points, moving, miss

    def _link(self, curves: Array, miss: Array) -> tuple[Indices, Flags, Flags]:
        """Find the anchor of each sample; flag samples inside its ball, and samples linked to their predecessor.

        A sample is linked if its anchor and its predecessor's anchor lie on one branch and the curve from the
        predecessor, or each half of that curve, lies in one ball. Shape (n, 6, k).
        """
        anchors, y = self.anchors, curves[:, -1]
        covering, inside = anchors.cover(y, int(anchors.table["sheet"][self.at]))
        before = np.concatenate([[self.at], covering[:-1]])
        within = self._lie_inside(curves, miss, before)
        other = np.flatnonzero(~within & (covering != before))
        within[other] = self._lie_inside(curves[other], miss[other], covering[other])
        other = np.flatnonzero(~within & (covering != before))
        left, right = HALVES[:, None] @ curves[other]
        within[other] = self._lie_inside(left, miss[other], before[other])
        within[other] &= self._lie_inside(right, miss[other], covering[other])
        good = inside & within
        for i in np.flatnonzero(good & (covering != before)).tolist():
            good[i] = anchors.on_one_branch(int(before[i]), int(covering[i]))
        return covering, inside, good

    def _lie_inside(self, curves: Array, miss: Array, a: Indices) -> Flags:
        """Return True for curves inside the balls of anchors. Shapes (n, 6, k), (n, k), (n,) -> (n,)."""
        inside = (self.anchors.distances(curves, a) <= 1.0).all(axis=1)
        if miss.any():
            W = self.anchors.table["W"][a]
            inside &= np.matmul(np.matmul(miss[:, None], W), miss[..., None])[:, 0, 0] <= MISS**2
        return np.asarray(inside)

    def _go(self, curve: Curve, *, moving: bool) -> None:
        """Move to the end of a curve, along the curve if it is the motion and along any path if it is not."""
        target, t = curve.points[-1], curve.t[1]
        length = float(np.abs(target - curve.points[0]).max(initial=0.0))
        if not length <= LONGEST:
            what = f"the motion jumps by {length:.3g} (rad or mechanism lengths) from one sample to the next"
            raise ClosureError(what, f"t = {t:g} s", "use a smaller step")
        start, seen, home = self.at, len(self.visits), self.anchors[0].y
        ways = [(list[int](), curve)]
        around = not moving and not (self.strict and self.begun)
        if around:
            ways += [([], Curve(points)) for points in bent_paths(curve.points[0], target)]
        if around and start:
            ways += [
                (self._ancestors(), Curve(points))
                for points in (straight_path(home, target), *bent_paths(home, target))
            ]
        ends = list[PathEnd]()
        for back, way in ways:
            self.visits[seen:], self.left = back, MOST + int(EACH * length)
            self.at = self.visits[-1]
            try:
                self._follow_curve(way)
                self._walk(target)
                return
            except Blocked as blocked:
                ends.append(self._end(way, t, singular=blocked.singular))
        if not (self.strict or self.begun) and self._straight_over(target):
            return
        self.visits[seen:], self.at = [], start
        raise ends[0]

    def _straight_over(self, target: Array) -> bool:
        """Move straight to the start of a motion, across singular poses; ignore branches that bend away there."""
        self.visits, self.at = [0], 0
        way = target - self.anchors[0].y
        for _ in range(LEAPS):
            self.left = MOST
            try:
                self._walk(target)
                return True
            except Blocked:
                if not self._leap(way, target):
                    return False
        return False

    def _end(self, curve: Curve, t: float, *, singular: bool) -> PathEnd:
        """Build the error for a curve that cannot be followed; it states whether loops close beyond the last pose."""
        anchor, (begin, end) = self.anchors[self.at], curve.t
        done = (self.piece.t[1] - begin) / (end - begin) if self.piece is not None and end > begin else 1.0
        beyond = self._predict_beyond(curve.at(min(1.0, done + LEAP)))
        return PathEnd(anchor.z, anchor.y * self.size, t, singular=singular, beyond=beyond is not None)

    def follow(self, y: Array, t: Array, rates: Rates | None = None, drive: Motion | None = None) -> tuple[Array, ...]:
        """Compute the closed poses of samples, see `predict` and `close`."""
        return self.close(self.predict(y, t, rates, drive))

    def close(self, poses: Poses) -> tuple[Array, ...]:
        """Run `newton` from predictions; samples that `newton` moves too far become anchors.

        Raises:
            PathEnd: A sample that must become an anchor cannot be reached.
        """
        start, y = poses.z, poses.y
        if poses.ordered and len(y) > DENSE and 2 * len(rows := knots(y, EVERY, SPREAD)) <= len(y):
            z, J, *_ = newton(self.evaluate, start[rows], y[rows])
            start = predict_unknowns(y, rows, z, velocity_map(J, y.shape[1]))
        solution = list(newton(self.evaluate, start, y))
        z, _, error = solution[:3]
        far = self.anchors.corrections(z - poses.z, poses.anchor)
        for i in np.flatnonzero(~((error < OPEN) & (far <= NEAR))).tolist():
            exact = self._exact_pose(i, poses)
            for array, value in zip(solution, newton(self.evaluate, exact[None], y[i : i + 1]), strict=True):
                array[i] = value[0]
        return tuple(solution)

    def refine(self, poses: Poses) -> Poses:
        """Improve predictions by turning some samples into anchors.

        Raises:
            PathEnd: A sample that must become an anchor cannot be reached.
        """
        y, anchor = poses.y, poses.anchor.copy()
        for i in np.unique(np.linspace(0, len(y) - 1, SOME).astype(int)).tolist():
            self._exact_pose(i, poses)
        for sheet in np.unique(self.anchors.table["sheet"][anchor]).tolist():
            rows = np.flatnonzero(self.anchors.table["sheet"][anchor] == sheet)
            covering, inside = self.anchors.cover(y[rows], sheet)
            anchor[rows] = np.where(inside, covering, anchor[rows])
        z = self.anchors.predict(y, anchor)
        z += TURN * np.where(self.anchors.angles, np.rint((poses.z - z) / TURN), 0.0)
        return replace(poses, z=z, anchor=anchor)

    def _exact_pose(self, i: int, poses: Poses) -> Array:
        """Return the unknowns of a sample that becomes an anchor. Shape (n_z,)."""
        try:
            return self._solve_sample(poses.y[i], int(poses.anchor[i]), poses.z[i])
        except Blocked as blocked:
            way = Curve(straight_path(self.anchors[self.at].y, poses.y[i]))
            raise self._end(way, float(poses.t[i]), singular=blocked.singular) from None
