"""Joint coordinates of many samples, predicted from closed poses every few samples, which are followed in sequence."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from screwgauge.engines.screw.bounds import Bounds
from screwgauge.engines.screw.programs import Runner
from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.anchor import Anchor
from screwgauge.reference.closed.between import Rows, interpolated, knots, predicted, slopes
from screwgauge.reference.closed.cut_coordinates import read
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.kinematics import positions
from screwgauge.reference.layout import Layout
from screwgauge.reference.rotations import Array, nearest_angles
from screwgauge.reference.traced.lanes import Lanes
from screwgauge.reference.traced.program import only
from screwgauge.reference.traced.scalars import Scalars
from screwgauge.reference.traced.tracing import CHECKS, Traced

#: From one closed pose to the next: at most so many samples, and so far in y [rad or lengths of the mechanism].
EVERY, STEP = 64, 0.08
#: A program closes poses where so many samples at least lie within such a way: those between two of its poses show
#: whether these are of one assembly.
DENSE = 4
#: Longest way from one part to the next, in steps of that length.
FARTHEST = 2000
#: How far the samples may lie from the motion as it is interpolated [rad or lengths of the mechanism].
EVEN = 1e-4
#: How often the program is run on one pose until its loops close.
AGAIN = 3

Close = Callable[[Array, Array, Array], tuple[Array, Array] | None]
"""Closes one pose: y, their derivatives and a guess of the dependent coordinates -> these and their derivatives, or
nothing where that is in doubt. Shapes (k,), (k,), (d,)."""
Known = tuple[int, Array, Array]
"""Number of a sample, its dependent coordinates, and their derivatives by that number."""


def single(runner: Runner, traced: Traced) -> Runner:
    """What runs a program on single samples: of its outputs where Newton's method arrives, and the checks, at least.

    Arrays would cost more than they save; machine code is quick at all of it.
    """
    if not traced.predicted or not isinstance(runner, Lanes):
        return runner
    n = len(traced.program.outputs)
    return Scalars(only(traced.program, [*range(2 * len(traced.predicted)), *range(n - len(CHECKS), n)]))


def closer(runner: Runner, traced: Traced, bounds: Bounds, k: int) -> Close:
    """What closes poses with a program on k independent coordinates."""
    d, m = len(traced.predicted), len(CHECKS)
    given, out = np.zeros((runner.program.inputs, 1)), np.empty((len(runner.program.outputs), 1))
    run = runner.bind([given], [out])

    def close(y: Array, rates: Array, guess: Array) -> tuple[Array, Array] | None:
        given[: 2 * k, 0], given[3 * k : 3 * k + d, 0] = np.concatenate([y, rates]), guess
        for _ in range(AGAIN):
            run()
            found = dict(zip(CHECKS, np.sqrt(out[-m:]), strict=True))
            if not bounds.near(found).all():
                return None
            if (found["closing"] <= bounds.arrived).all():
                return out[:d, 0].copy(), out[d : 2 * d, 0].copy()
            given[3 * k : 3 * k + d] = out[:d]
        return None

    return close


class Predictor:
    """Follows a motion, part after part: with the program where samples lie close to each other, else by array.

    Attributes:
        by_program: Whether the last prediction rests on poses that the program closed.
    """

    def __init__(self, lay: Layout, dependent: Sequence[int], close: Close, *, cuts: bool) -> None:
        """`cuts`: whether coordinates of cut joints are predicted, too."""
        self.lay, self.dependent, self.close, self.cuts = lay, [*dependent], close, cuts
        self.system = home_equations(lay)
        self.chosen, self.branch = lay.mechanism.independent_columns, self.system.follower()
        self.size, self.by_program = self.system.size[self.chosen], False
        self.behind = False  # whether the branch has not followed the parts before
        self.known: list[Known] = []  # the last poses
        self.at = self.began = lay.mechanism.home  # joint coordinates where the last part ended, and began

    def predict(self, motion: GivenMotion) -> Array:
        """Joint coordinates, see `predicted`. Shape (n, n_q)."""
        rows, way = knots(motion.y / self.size, EVERY, STEP), np.abs(np.diff(motion.y / self.size, axis=0))
        self.began, self.behind = self.at, self.behind or self.by_program
        self.by_program = len(rows) < len(motion) and way.max() <= STEP / DENSE
        q = self._followed(motion, rows) if self.by_program else None
        return self.by_array(motion) if q is None else q

    def by_array(self, motion: GivenMotion) -> Array:
        """The same by the array solver alone, from where the part began."""
        if self.behind:
            z, y = (self.began / self.system.size)[self.system.unknown], self.began[self.chosen] / self.size
            residual, matrix, *_ = self.system.evaluate(z[None], y[None])
            error = float(np.abs(residual).max(initial=0.0))
            self.branch.anchor, self.branch.begun = Anchor.at(z, y, matrix[0], error, self.began), True
        self.by_program = self.behind = False
        rows = knots(motion.y / self.size, EVERY, STEP)
        some = motion.part(rows)
        q = positions(self.lay, some.y, some.t, (some.yd, some.ydd), path=self.branch)
        self.at, self.known = q[-1], []
        if len(rows) == len(motion):
            return q
        K = motion_at(self.lay, q, some.yd).joint_map
        return predicted(motion.y, rows, q, np.where(np.isfinite(K), K, 0.0))

    def _followed(self, motion: GivenMotion, rows: Rows) -> Array | None:
        """By poses that the program closes, each from where those before lead to; nothing if one is in doubt."""
        n, k, d, slope = len(motion), len(self.chosen), self.dependent, slopes(motion.y)
        start = self.at[self.chosen]
        leap = np.abs(motion.y[0] - start - slope[0]).max() > 0.5 * np.abs(slope[0]).max()
        if leap or not self.known:  # it does not go on from the part before: straight to where it begins
            steps = int(np.ceil(np.abs((motion.y[0] - start) / self.size).max() * DENSE / STEP))
            if steps > FARTHEST:
                return None
            way, self.known = np.linspace(start, motion.y[0], steps + 1), []
            if self._closed(way, np.gradient(way, axis=0) if steps else 0.0 * way, [*range(steps + 1)]) is None:
                return None
            self.known = []
        found = self._closed(motion.y, slope, rows.tolist())
        if found is None:
            return None
        rows, z, rates = map(np.array, zip(*found[0], strict=True))
        value = interpolated(n, rows, np.hstack([motion.y[rows], z]), np.hstack([slope[rows], rates]))
        if not (np.abs(value[:, :k] - motion.y) <= EVEN * self.size).all():
            return None
        self.known = [(row - n, *numbers) for row, numbers in ((one[0], one[1:]) for one in self.known)]
        near = np.zeros((n, len(self.at)))
        near[:, d] = value[:, k:]
        if self.cuts:
            for column in self.lay.cut_columns:
                near[:, column] = np.interp(np.arange(n), rows, found[1][:, column])
        return near

    def _closed(self, y: Array, slope: Array, rows: list[int]) -> tuple[list[Known], Array] | None:
        """Poses at some samples, and at others between where they are far from each other; all joint coordinates."""
        found, ahead, before = list[Known](), rows[::-1], self.at
        guess = before[self.dependent]
        while ahead:
            row = ahead[-1]
            closed = self.close(y[row], slope[row], _ahead(self.known, row) if self.known else guess)
            if closed is not None:
                self.known = [*self.known[-1:], (ahead.pop(), *closed)]
                found.append(self.known[-1])
            elif found and row - found[-1][0] > 1:
                ahead.append((found[-1][0] + row) // 2)
            else:
                return None
        q = np.tile(before, (len(found), 1))
        q[:, self.chosen], q[:, self.dependent] = y[[row for row, *_ in found]], np.array([z for _, z, _ in found])
        self.at = self._whole(q, before)[-1].copy()
        return found, q

    def _whole(self, q: Array, before: Array) -> Array:
        """Fills in coordinates of cut joints, pose after pose next to those of the pose before. Shape (n, n_q)."""
        if not self.cuts:
            return q
        q[:] = read(self.lay, q, near=False)
        for joint in self.lay.tree.cuts:
            columns = [c for c in self.lay.columns[joint.name] if self.lay.turns[c]]
            near = before[columns]
            for row in q:
                near = row[columns] = nearest_angles(row[columns], near)[0]
        return q


def _ahead(known: Sequence[Known], row: int) -> Array:
    """What one pose or two lead to at a sample, by their derivatives."""
    at, z, rates = known[-1]
    u = row - at
    if len(known) == 1:
        return z + u * rates
    before, first, rates_before = known[0]
    h = at - before
    D = (z - first) / h
    return z + u * rates + u**2 * (rates - D) / h + u**2 * (u + h) * (rates + rates_before - 2.0 * D) / h**2
