"""Closed poses on one assembly mode: of a motion, of samples in any order, or step by step along a branch.

`AssemblyMode` starts at the home pose and follows motions (`Continuation`) or reaches samples in any order
(`Region`); `Branch` goes on from the last closed pose, wherever it was; `positions` is the short form for one
motion.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwgauge.reference.closed.anchors import Flags, Indices
from screwgauge.reference.closed.continuation import REMEDY, Continuation, Followed, Predicted, no_further
from screwgauge.reference.closed.loops import LoopEquations, follow_cut_joints, home_equations, loop_equations, read
from screwgauge.reference.closed.newton import OPEN, Drive, newton
from screwgauge.reference.closed.region import Region
from screwgauge.reference.equations.closed_form import closed_form
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import TURN, Array

Rates = tuple[Array, Array]
"""First and second derivatives of the independent coordinates. Shape (n, k) each."""


@dataclass(frozen=True, eq=False)
class Guess:
    """Initial guesses of n closed poses.

    Attributes:
        y: Independent coordinates [rad or m]. Shape (n, k).
        prediction: Unknowns without dimension and what they rest on; None where there is a closed form.
        near: Gives joint coordinates [rad or m] that say which of equal angles of a cut joint is meant; where there is
            a closed form, those of it. Shape (n, n_q).
        source: Whose prediction it is.
    """

    system: LoopEquations
    y: Array
    prediction: Predicted | None
    near: Callable[[], Array]
    source: Continuation | None = None

    def rows(self, rows: Indices) -> Guess:
        """Guesses of some of the samples."""
        prediction = None if self.prediction is None else self.prediction.rows(rows)
        return replace(self, y=self.y[rows], prediction=prediction, near=lambda: self.near()[rows])

    @cached_property
    def q(self) -> Array:
        """Joint coordinates [rad or m]. Shape (n, n_q)."""
        near, system = self.near(), self.system
        if self.prediction is None:
            return near
        near[:, system.lay.mechanism.independent_columns] = self.y  # with the whole turns that are given
        return system.tree(self.prediction.z, near)

    def columns(self, columns: Sequence[int]) -> Array:
        """Some coordinates of the tree [rad or m]. Shape (len(columns), n)."""
        if self.prediction is None:
            return np.ascontiguousarray(self.q[:, [*columns]].T)
        places = [self.system.unknown.index(c) for c in columns]
        return np.ascontiguousarray(self.prediction.z[:, places].T) * self.system.size[[*columns], None]


class AssemblyMode:
    """Closed poses on the assembly mode of the home pose.

    Attributes:
        system: The loop equations, coordinates that are constant on this mode being fixed.
    """

    def __init__(self, lay: Layout, *, strict: bool = False) -> None:
        """`strict`: whether a way from sample to sample is that of the motion or straight, and poses are followed even
        where there is a closed form: by default other ways will do for samples that are no motion."""
        self.lay, self.system, self.columns = lay, home_equations(lay), lay.mechanism.independent_columns
        self.unit, self.strict = self.system.size[self.columns], strict
        self.near = lay.mechanism.home
        """Joint coordinates of the last anchor that was visited. Shape (n_q,)."""

    @cached_property
    def continuation(self) -> Continuation:
        """Continuation that holds where motions have led to."""
        return self.system.continuation(strict=self.strict)

    @cached_property
    def region(self) -> Region:
        """Where samples in any order have been reached: no motion adds to it, as they are to depend on y alone."""
        return self.system.region()

    def predict(self, y: Array, t: Array, rates: Rates | None = None, drive: Drive | None = None) -> Guess:
        """Guesses for the samples of a motion that goes on from those before.

        Args:
            y: Independent coordinates [rad or m]. Shape (n, k).
            t: Times [s]. Shape (n,).
            rates: Their derivatives, see `Continuation.predict`.
            drive: The motion between these times, without dimension.

        Raises:
            ClosureError: A loop cannot close, or there is no way but over a singular pose.
        """
        if (guess := self.in_closed_form(y)) is not None:
            return guess
        scaled = None if rates is None else (rates[0] / self.unit, rates[1] / self.unit)
        prediction = self.continuation.predict(y / self.unit, t, scaled, drive)
        near = self._visited(prediction.visited)
        return Guess(self.system, y, prediction, lambda: near[prediction.visit], self.continuation)

    def reach(self, y: Array) -> tuple[Guess, Flags, Flags]:
        """Guesses for samples in any order; see `Region.reach`. Shape (n, k)."""
        if (guess := self.in_closed_form(y)) is not None:
            none = np.zeros(len(y), dtype=bool)
            return guess, none, none
        prediction, lost, twice = self.region.reach(y / self.unit)
        return Guess(self.system, y, prediction, lambda: self._turned(y), self.region), lost, twice

    def _turned(self, y: Array) -> Array:
        """Home, its angles turned as far as they turn with y. Shape (n, k) -> (n, n_q)."""
        home = self.lay.mechanism.home
        near = np.tile(home, (len(y), 1))
        for i, path in self.region.loops.items():
            winding = np.rint((self._followed(path, home)[-1] - home) / TURN) * self.lay.turns
            near += (y[:, i, None] - home[self.columns[i]]) * winding
        return near

    def restart(self) -> None:
        """Begins the next motion at home."""
        self.near = self.lay.mechanism.home
        if "continuation" in vars(self):  # a motion has begun
            self.continuation.restart()

    def in_closed_form(self, y: Array) -> Guess | None:
        """Joint coordinates that need not be followed: of an open tree, and of legs in closed form on this mode."""
        if len(self.system.unknown) == len(self.columns) and not self.lay.cuts:
            q = np.tile(self.lay.mechanism.home, (len(y), 1))
            q[:, self.columns] = y
            return Guess(self.system, y, None, lambda: q)
        coordinates = None if self.strict else closed_form(self.lay, y, NUMPY, self.system.fixed)
        return (
            None
            if coordinates is None
            else Guess(self.system, y, None, lambda: read(self.lay, coordinates.q, near=False))
        )

    def _visited(self, z: Array) -> Array:
        """All joint coordinates of the anchors along a way, which goes on from the last one. Shape (v, n_q)."""
        q = self._followed(z, self.near)
        self.near = q[-1]
        return q

    def _followed(self, z: Array, near: Array) -> Array:
        q = self.system.tree(z, np.tile(near, (len(z), 1)))
        return follow_cut_joints(self.lay, q, near)

    def refine(self, guess: Guess) -> Guess:
        """Better guesses in the place of bad ones, see `Continuation.refine`."""
        if guess.prediction is None or guess.source is None:
            return guess
        return replace(guess, prediction=guess.source.refine(guess.y / self.unit, guess.prediction))

    def follow(self, guess: Guess) -> Followed:
        """The closed poses next to guesses, without dimension.

        Raises:
            ClosureError: A loop stays open.
        """
        y = guess.y / self.unit
        if guess.prediction is not None and guess.source is not None:
            return guess.source.close(y, guess.prediction)
        system, where = self.system, self.lay.mechanism.name
        z, J, error, *more = newton(system.evaluate, (guess.q / system.size)[:, system.unknown], y)
        if not (error < OPEN).all():
            raise ClosureError("the closed form leaves loops open", where, "check the geometry")
        return Followed(z, J, error, tuple(more))

    def close(self, guess: Guess) -> Array:
        """Joint coordinates of the closed poses. Shape (n, n_q)."""
        return self.system.coordinates(self.follow(guess).z, guess.q)

    def motion(self, y: Array, t: Array, rates: Rates | None = None, drive: Drive | None = None) -> Array:
        """Joint coordinates of the samples of a motion, see `predict`. Shape (n, n_q)."""
        return self.close(self.predict(y, t, rates, drive))


STEP, SMALLEST = 0.1, 1e-5  # of the independent coordinates [rad or lengths of the mechanism]
#: Largest distance of the closed pose from its prediction, over the way predicted. Another branch lies farther.
BEND = 0.3
#: Steps that a short way may take; where more are needed, the way ends at a pose that it cannot pass.
MOST = 40


class Branch:
    """Remembers the last closed pose; the next one is predicted from it by the velocity map dq/dy.

    A step may pass over a singular pose: the prediction goes straight on, where the branch that turns off there
    does not.
    """

    def __init__(self, lay: Layout, q: Array) -> None:
        """Starts at joint coordinates `q`, shape (n_q,), that close the loops nearly."""
        self.lay = lay
        self.columns = lay.mechanism.independent_columns
        self.system = home_equations(lay)
        if np.abs(q - lay.mechanism.home)[list(self.system.fixed)].max(initial=0.0) > OPEN:
            self.system = loop_equations(lay)  # another branch than that of the home pose
        self.size = self.system.size
        self.is_tree = not lay.cuts and len(self.columns) == len(q)
        self.q, self.y = q.copy(), q[self.columns]
        self.K = np.zeros((len(q), len(self.columns)))  # without dimension
        if not self.is_tree and not self._try(q, self.y):
            where = f"start of {lay.mechanism.name}"
            raise ClosureError("the loops do not close there", where, "correct the coordinates")

    def _try(self, predicted: Array, goal: Array, bend: float = np.inf) -> bool:
        """Newton's method from a prediction; keeps the pose if it closes and is where it should be."""
        corrected = self.system.correct(predicted / self.size, goal / self.size[self.columns])
        if corrected is None:
            return False
        q, K = corrected
        if np.abs(q - predicted / self.size)[self.system.unknown].max() > bend:
            return False
        self.q, self.y, self.K = q * self.size, goal.copy(), K
        return True

    def put(self, q: Array) -> None:
        """Puts the pose where joint coordinates `q`, shape (n_q,), close the loops already."""
        if self.is_tree or not self._try(q, q[self.columns]):
            self.q, self.y = q, q[self.columns]

    def move(self, y: Array) -> None:
        """Moves the pose to independent coordinates `y`, shape (k,), in steps of at most `STEP`.

        Raises:
            ClosureError: The loops cannot close on the way.
        """
        if self.is_tree:
            self.q[self.columns] = self.y = y.copy()
            return
        largest, unit = STEP, self.size[self.columns]
        for _ in range(MOST + int(4.0 * float(np.abs((y - self.y) / unit).max()) / STEP)):
            way = (y - self.y) / unit
            length = float(np.abs(way).max())
            if length == 0.0:
                return
            way = way * min(1.0, largest / length)
            step = self.K @ way
            goal = y if largest >= length else self.y + way * unit
            if self._try(self.q + step * self.size, goal, BEND * float(np.abs(step[self.system.unknown]).max()) + 1e-9):
                continue
            largest = 0.5 * min(largest, length)
            if largest < SMALLEST:
                break
        raise ClosureError(no_further(self.y), self.lay.mechanism.name, REMEDY)

    def joints(self, y: Array) -> Array:
        """Joint coordinates of closed poses for some independent coordinates in order. Shape (n, k) -> (n, n_q)."""
        q = np.empty((len(y), len(self.q)))
        if self.is_tree:
            q[:, self.columns] = y
            return q
        for row, goal in zip(q, y, strict=True):
            self.move(goal)
            row[:] = self.q
        return q


def positions(lay: Layout, y: Array, t: Array, rates: Rates | None = None) -> Array:
    """Joint coordinates on the assembly mode of home, see `AssemblyMode.motion`.

    Args:
        y: Independent coordinates [rad or m]. Shape (n, k).
        t: Times [s]. Shape (n,).
        rates: Derivatives, by which the motion is followed between samples. Shape (n, k) each.

    Returns:
        Of all joints [rad or m]. Shape (n, n_q).

    Raises:
        ClosureError: A loop cannot close, or there is no way but over a singular pose.
    """
    return AssemblyMode(lay).motion(y, t, rates)


def closed_form_positions(lay: Layout, y: Array, fixed: Collection[int] | None = None) -> Array | None:
    """Joint coordinates in closed form, if there is one, see `equations.closed_form`. Shape (n, k) -> (n, n_q)."""
    coordinates = closed_form(lay, y, NUMPY, fixed)
    return None if coordinates is None else read(lay, coordinates.q, near=False)
