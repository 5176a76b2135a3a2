"""Loop equations in the coordinates of the spanning tree, made dimensionless for Newton's method.

`home_equations` fixes the coordinates that are constant in the home assembly mode; `read` computes the coordinates
of cut joints at closed poses. The equations themselves are in `equations.closure`.
"""

from __future__ import annotations

from functools import cached_property
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.closed.continuation import Continuation
from screwgauge.reference.closed.newton import OPEN, newton, velocity_map
from screwgauge.reference.closed.walk import Walk
from screwgauge.reference.equations.closure import Closed, Loops
from screwgauge.reference.equations.joint_types import read_coordinates
from screwgauge.reference.equations.kinematics import coordinates, tree_pose
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.equations.rounding import chart_conditions
from screwgauge.reference.errors import ClosureError
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array, follow


def read(lay: Layout, guess: Array, *, near: bool = True) -> Array:
    """Read the coordinates of the cut joints from the body poses of the tree.

    Args:
        guess: Joint coordinates. Shape (n, n_q).
        near: Choose the coordinates of cut joints that are nearest to the guess, see `read_coordinates`.
    """
    q = guess.copy()
    if lay.cuts:
        at = tree_pose(lay, coordinates(guess, NUMPY))
        for joint in lay.cuts:
            columns = lay.columns[joint.name]
            q[:, columns] = read_coordinates(at.joint(joint), guess[:, columns] if near else None)
    return q


def follow_cut_joints(lay: Layout, q: Array, near: Array) -> Array:
    """Compute joint coordinates along a path such that the coordinates of cut joints change least between poses.

    Args:
        q: Joint coordinates, of which only tree coordinates are used. Shape (v, n_q).
        near: Joint coordinates of the pose that precedes the path. Shape (n_q,).
    """
    q = read(lay, q, near=False)
    for joint in lay.cuts:
        turning = [c for c in lay.columns[joint.name] if lay.turns[c]]
        q[:, turning] = follow(near[turning], q[:, turning], np.ones(len(q), dtype=bool))
    return q


W = TypeVar("W", bound=Walk)


class LoopEquations(Loops):
    """The loop equations of a layout, evaluated with arrays."""

    @cached_property
    def unknown(self) -> list[int]:
        """Columns of the tree coordinates that are free to move."""
        return self.columns[: self.moving]

    @cached_property
    def row_names(self) -> list[str]:
        """Names of the cut-joint rows, taken from their constraint wrenches."""
        counts = zip(self.cuts, np.diff(self.ends).tolist(), strict=True)
        owners = [joint.name for joint, count in counts for _ in range(count)]
        return [f"{owner}.{label}" for owner, (label, _) in zip(owners, self.names, strict=True)]

    def closing_system(self, q: Array) -> Closed:
        """Evaluate the closing system at joint coordinates. Shape (n, n_q)."""
        return Closed(self, coordinates(q, NUMPY), self.folds(q), NUMPY)

    def matrix(self, q: Array) -> Array:
        """Return the derivative of dimensionless residuals (loops, couplings, selected coordinates) with respect to the
        dimensionless unknowns. Shape (n, n_q) -> (n, m + k, n_unknown).
        """
        return np.asarray(self.closing_system(q).system.A[..., : self.moving])

    def constraints(self, q: Array) -> Array:
        """Return only the rows of `matrix` for loops and couplings. Shape (n, n_q) -> (n, m, n_unknown)."""
        return self.matrix(q)[:, : self.given.start]

    def chart_conditions(self, q: Array) -> Array:
        """Return the condition number of the angles of each cut joint. Shape (n, n_q) -> (n, n_cut)."""
        return chart_conditions(self.closing_system(q))

    def evaluate(self, z: Array, y: Array) -> tuple[Array, ...]:
        """Evaluate dimensionless residuals of loops and couplings, and their Jacobian, as `newton` requires.

        If coordinates are fixed, also return the Jacobian that includes their columns, which come last.

        Args:
            z: Unknowns divided by their `sizes`. Shape (n, n_unknown).
            y: Independent coordinates divided by their sizes. Shape (n, k).
        """
        columns = self.y_columns
        given = y * self.sizes[columns]
        q = np.tile(self.lay.mechanism.home, (len(z), 1))
        q[:, columns] = given  # for a cut joint: angle nearest to the requested value
        q[:, self.unknown] = z * self.sizes[self.unknown]
        at = self.closing_system(q)
        full = np.asarray(at.system.A)
        equations = at.residual(given) / self.unit, full[..., : self.moving]
        return (*equations, full) if self.fixed else equations

    def unknowns(self, q: Array) -> Array:
        """Convert joint coordinates to dimensionless unknowns. Shape (..., n_q) -> (..., n_unknown)."""
        return np.asarray(q[..., self.unknown] / self.sizes[self.unknown])

    def tree(self, z: Array, guess: Array) -> Array:
        """Convert unknowns to joint coordinates; cut joints keep the guessed coordinates."""
        q = guess.copy()
        q[:, self.fixed] = self.lay.mechanism.home[self.fixed]
        q[:, self.unknown] = z * self.sizes[self.unknown]
        return q

    def coordinates(self, z: Array, guess: Array) -> Array:
        """Convert unknowns to all joint coordinates. Shape (n, n_q).

        Args:
            z: Dimensionless unknowns. Shape (n, n_unknown).
            guess: Joint coordinates; those of cut joints select among equivalent angles. Shape (n, n_q).
        """
        return read(self.lay, self.tree(z, guess))

    def correct(self, q: Array, y: Array) -> tuple[Array, Array] | None:
        """Find the closed pose near a prediction, and dq/dy [rad and m]; return None if the loops do not close.

        The coordinates of cut joints are chosen near the prediction.
        """
        unit = self.sizes[self.y_columns]
        z, matrix, error = newton(self.evaluate, self.unknowns(q[None]), (y / unit)[None])[:3]
        if not error[0] < OPEN:
            return None
        K = np.zeros((len(q), len(y)))  # cut coordinates are not predicted because they diverge near gimbal lock
        K[self.unknown] = self.sizes[self.unknown, None] * velocity_map(matrix, len(y))[0] / unit
        return self.coordinates(z, q[None])[0], K

    def walk(self, kind: type[W], *, strict: bool = False) -> W:
        """Start a `Continuation` or a `Region` at the home pose."""
        home, turns, given = self.lay.mechanism.home, self.lay.turns, self.y_columns
        start, angles = (self.unknowns(home), home[given]), (turns[self.unknown], turns[given])
        return kind(self.evaluate, start, angles, self.sizes[given], resting=bool(self.fixed), strict=strict)


def loop_equations(lay: Layout, fixed: tuple[int, ...] = ()) -> LoopEquations:
    """Return the loop equations with given coordinates fixed at their home values; build them once per layout."""
    if fixed not in lay.kept:
        lay.kept[fixed] = LoopEquations(lay, fixed)
    equations: LoopEquations = lay.kept[fixed]
    return equations


#: Distance of trial poses from home [rad or mechanism lengths], and number of trial poses.
AWAY, TRIALS = 0.15, 4
#: Rate below which a coordinate may be at rest, far above rounding error; a false candidate only costs time.
STILL = 1e-7
#: Condition number above which a trial pose is useless, because rounding moves coordinates at rest.
CLEAR = 1e4

_known: WeakKeyDictionary[Mechanism, tuple[int, ...]] = WeakKeyDictionary()


def home_equations(lay: Layout) -> LoopEquations:
    """Return the loop equations with all resting coordinates fixed; find those coordinates once per mechanism."""
    if lay.mechanism not in _known:
        _known[lay.mechanism] = resting_columns(lay)
    return loop_equations(lay, _known[lay.mechanism])


def resting_columns(lay: Layout) -> tuple[int, ...]:
    """Find the tree coordinates that keep their home value on the home branch, such as c of the symmetric leg.

    Coordinates are analytic functions of y. A coordinate that has its home value and zero first derivatives at several
    poses in general position is at rest on the whole branch. As a check, the loops must still close to rounding when it
    is fixed.
    """
    free = loop_equations(lay)
    # in single precision no trial would converge
    trials = _trials(free) if lay.path.dtype == np.float64 and lay.cuts and _may_rest(free) else None
    if trials is None:
        return ()
    z, y, matrix = trials
    slack = 16 * linear.EPS * linear.condition(matrix).max()
    rests = np.abs(z - free.unknowns(lay.mechanism.home)).max(axis=0) <= slack
    rests &= np.abs(velocity_map(matrix, y.shape[1])).max(axis=(0, 2)) <= slack
    chosen = {*lay.mechanism.independent_columns, *lay.mechanism.coupling_rows.columns}
    fixed = tuple(c for c, still in zip(free.unknown, rests, strict=True) if still and c not in chosen)
    if not fixed:
        return ()
    system = loop_equations(lay, fixed)
    start = z[:, [free.unknown.index(c) for c in system.unknown]]
    error = newton(system.evaluate, start, y)[2]
    return fixed if (error <= 64 * linear.EPS).all() else ()


def _may_rest(system: LoopEquations) -> bool:
    """Return True if a dependent coordinate is at rest to first order at the home pose, which is rare."""
    A = system.matrix(system.lay.mechanism.home[None])
    still = np.abs(velocity_map(A, len(system.y_columns))[0]).max(axis=1) <= STILL
    return any(rests and c not in system.y_columns for c, rests in zip(system.unknown, still, strict=True))


def _trials(system: LoopEquations) -> tuple[Array, Array, Array] | None:
    """Return unknowns, y and matrices of closed poses in general position near home, or None if too few are found."""
    columns = system.y_columns
    unit, k = system.sizes[columns], np.arange(len(columns))
    home = system.lay.mechanism.home[columns] / unit
    closed, path = [], system.walk(Continuation, strict=True)
    for i in range(TRIALS):
        y = home + AWAY * np.cos(1.0 + 2.3 * i + 1.7 * (1 + i) * k)
        try:
            path.restart(begun=True)  # straight paths only: paths around singular poses take seconds
            z, matrix, *_ = path.follow(y[None] * unit, np.zeros(1))
        except ClosureError:
            continue
        if linear.condition(matrix)[0] < CLEAR:
            closed.append((z[0], y, matrix[0]))
    if len(closed) < TRIALS // 2:
        return None
    z, y, matrix = (np.stack(parts) for parts in zip(*closed, strict=True))
    return z, y, matrix
