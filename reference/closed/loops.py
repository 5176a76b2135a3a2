"""The loop equations of a mechanism in the coordinates of its spanning tree, without dimension, as Newton's method and
the follower of an assembly mode take them. The equations themselves are `equations.closure`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.reference.closed import walk
from screwgauge.reference.closed.continuation import Continuation
from screwgauge.reference.closed.cut_coordinates import read
from screwgauge.reference.closed.newton import OPEN, newton, velocity_map
from screwgauge.reference.closed.region import Region
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.kinematics import Pose, coordinates, pose
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.equations.rounding import chart_condition
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, eq=False)
class LoopEquations:
    """The loop equations of a layout.

    Attributes:
        fixed: Columns of tree coordinates that keep their home value.
    """

    lay: Layout
    fixed: tuple[int, ...] = ()

    @cached_property
    def loops(self) -> Loops:
        return Loops(self.lay, self.fixed)

    @property
    def length(self) -> float:
        """Unit of distances [m]."""
        return self.loops.length

    @property
    def size(self) -> Array:
        """Unit of each joint coordinate: 1 for angles, the mechanism's length for distances. Shape (n_q,)."""
        return self.loops.sizes

    @cached_property
    def unknown(self) -> list[int]:
        """Columns of the tree coordinates that are not fixed."""
        return self.loops.columns[: self.loops.moving]

    @cached_property
    def names(self) -> list[str]:
        """Of the rows of cut joints, their constraint wrenches."""
        ends, cuts = self.loops.ends, self.loops.cuts
        owners = [joint.name for joint, i, j in zip(cuts, ends, ends[1:], strict=False) for _ in range(i, j)]
        return [f"{owner}.{label}" for owner, (label, _) in zip(owners, self.loops.names, strict=True)]

    def closed(self, q: Array) -> Closed:
        """The equations at some joint coordinates. Shape (n, n_q)."""
        return Closed(self.loops, coordinates(q, NUMPY), self.loops.folds(q), NUMPY)

    def matrix(self, at: Pose) -> Array:
        """Derivative by the unknowns of the residuals, those of the couplings after them, and of the selected
        coordinates, without dimension. Shape (n, m + k, n_unknown)."""
        return self.matrix_of(self.closed(at.q))

    def matrix_of(self, at: Closed) -> Array:
        """The same of closed loops that are at hand."""
        return np.asarray(at.system.A[..., : self.loops.moving])

    def chart_conditions(self, q: Array) -> Array:
        """Condition number of the angles of each cut joint. Shape (n, n_q) -> (n, n_cut)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = [chart_condition(cut) + np.zeros(len(q)) for cut in self.closed(q).cuts]
        return np.stack(found, axis=1) if found else np.zeros((len(q), 0))

    def evaluate(self, z: Array, y: Array) -> tuple[Array, ...]:
        """Residuals, those of the couplings too, and their Jacobian, without dimension: an `Evaluation` for Newton.

        Where coordinates are fixed, the Jacobian with their columns, which come last, follows.

        Args:
            z: Unknowns over their `size`. Shape (n, n_unknown).
            y: Independent coordinates over theirs. Shape (n, k).
        """
        columns = self.lay.mechanism.independent_columns
        given = y * self.size[columns]
        q = np.tile(self.lay.mechanism.home, (len(z), 1))
        q[:, columns] = given  # of a cut joint the angle nearest to what is wanted
        q[:, self.unknown] = z * self.size[self.unknown]
        at = self.closed(q)
        full = np.asarray(at.system.A)
        found = at.residual(given) / self.loops.unit, full[..., : self.loops.moving]
        return (*found, full) if self.fixed else found

    def tree(self, z: Array, guess: Array) -> Array:
        """Joint coordinates, those of cut joints being guessed."""
        q, fixed = guess.copy(), list(self.fixed)
        q[:, fixed] = self.lay.mechanism.home[fixed]
        q[:, self.unknown] = z * self.size[self.unknown]
        return q

    def fill(self, z: Array, guess: Array) -> Pose:
        """The pose of given unknowns.

        Args:
            z: Unknowns without dimension. Shape (n, n_unknown).
            guess: Joint coordinates, of which those of cut joints say which of equal angles is meant. Shape (n, n_q).
        """
        return pose(self.lay, self.coordinates(z, guess))

    def coordinates(self, z: Array, guess: Array) -> Array:
        """Of that pose all joint coordinates. Shape (n, n_q)."""
        return read(self.lay, self.tree(z, guess))

    def correct(self, q: Array, y: Array) -> tuple[Array, Array] | None:
        """The closed pose next to a prediction, and dq/dy, both without dimension; None where the loops stay open.

        Those of cut joints are read near the prediction.
        """
        z, matrix, error = newton(self.evaluate, q[None, self.unknown], y[None])[:3]
        if not error[0] < OPEN:
            return None
        K = np.zeros((len(q), len(y)))  # cut coordinates are not predicted: near gimbal lock they run away
        K[self.unknown] = velocity_map(matrix, len(y))[0]
        return self.coordinates(z, q[None] * self.size)[0] / self.size, K

    def continuation(self, *, strict: bool = False) -> Continuation:
        """Closed poses of motions from home; see `Continuation`."""
        return Continuation(self._closing(), strict=strict)

    def region(self) -> Region:
        """Closed poses in any order around home; see `Region`."""
        return Region(self._closing())

    def _closing(self) -> walk.Loops:
        mechanism, angles = self.lay.mechanism, self.lay.turns
        home, columns = mechanism.home / self.size, mechanism.independent_columns
        z, turning = home[self.unknown], angles[columns]
        return walk.Loops(
            self.evaluate, z, home[columns], angles[self.unknown], turning, self.size[columns], bool(self.fixed)
        )


def loop_equations(lay: Layout, fixed: tuple[int, ...] = ()) -> LoopEquations:
    """The loop equations with some coordinates fixed at home, made once a layout."""
    if fixed not in lay.kept:
        lay.kept[fixed] = LoopEquations(lay, fixed)
    equations: LoopEquations = lay.kept[fixed]
    return equations
