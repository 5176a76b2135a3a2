"""The assembly mode of home: closed poses of a mechanism, for a motion or for coordinates in any order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwgauge.reference.closed.anchors import Flags, Indices
from screwgauge.reference.closed.continuation import Continuation, Followed, Predicted
from screwgauge.reference.closed.loops import LoopEquations, follow_cut_joints, home_equations, read
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
        """The same for some of the samples."""
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
        """Where motions have led to."""
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
        """The same for samples in any order; see `Region.reach`. Shape (n, k)."""
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
        found = None if self.strict else closed_form(self.lay, y, NUMPY, self.system.fixed)
        return None if found is None else Guess(self.system, y, None, lambda: read(self.lay, found.q, near=False))

    def _visited(self, z: Array) -> Array:
        """All joint coordinates of the anchors along a way, which goes on from the last one. Shape (v, n_q)."""
        found = self._followed(z, self.near)
        self.near = found[-1]
        return found

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
        """Their joint coordinates. Shape (n, n_q)."""
        return self.system.coordinates(self.follow(guess).z, guess.q)

    def motion(self, y: Array, t: Array, rates: Rates | None = None, drive: Drive | None = None) -> Array:
        """Joint coordinates of the samples of a motion, see `predict`. Shape (n, n_q)."""
        return self.close(self.predict(y, t, rates, drive))
