"""The loop equations of a mechanism in the coordinates of its spanning tree, without dimension.

A joint that closes a loop constrains its two bodies by the wrenches reciprocal to its freedoms (eq. 8), and only these
rows are set up: its own coordinates are no unknowns, so that in gimbal lock nothing but their own velocities is lost.
Couplings are rows below those, in coordinates of the tree, where their joints always are. Lengths are divided by the
mechanism's own length, so that thresholds mean the same for every size.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from screwgauge.reference import screws
from screwgauge.reference.closed import cut_coordinates
from screwgauge.reference.closed.continuation import OPEN, newton, velocity_map
from screwgauge.reference.closed.cut_coordinates import CutColumns
from screwgauge.reference.closed.following import Follower
from screwgauge.reference.closed.kinds import Kinds, kinds
from screwgauge.reference.couplings import CouplingRows
from screwgauge.reference.pose import Layout, Pose, length, side_frames, tree_pose, whole_pose
from screwgauge.reference.rotations import Array, cross, vee

Rates = tuple[Array, Array]
"""First and second derivatives of the independent coordinates. Shape (n, k) each."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The reciprocal wrenches of the cut joints at n poses; the order is that of `Kinds`.

    Attributes:
        direction: Unit force or unit moment. Shape (n, m, 3).
        point: Where each cut joint acts on its child [m]. Shape (n, n_cut, 3).
        turn, shift: Rotation [rad] and displacement [m] of its child side against its parent side. (n, n_cut, 3) each.
    """

    direction: Array
    point: Array
    turn: Array
    shift: Array


@dataclass(frozen=True, eq=False)
class LoopEquations:
    """The loop equations of a layout.

    Attributes:
        fixed: Columns of tree coordinates that keep their home value.
        last: Orientations of the last single pose, and its rows.
    """

    lay: Layout
    fixed: tuple[int, ...] = ()
    last: list[tuple[Array, Rows]] = field(default_factory=list)

    @cached_property
    def length(self) -> float:
        """Unit of distances [m]."""
        return length(self.lay)

    @cached_property
    def size(self) -> Array:
        """Unit of each joint coordinate: 1 for angles, the mechanism's length for distances. Shape (n_q,)."""
        return np.where(self.lay.turns, 1.0, self.length).astype(self.lay.path.dtype)

    @cached_property
    def unknown(self) -> list[int]:
        """Columns of the tree coordinates that are not fixed."""
        tree = [c for edge in self.lay.tree.edges for c in self.lay.columns[edge.joint.name]]
        return sorted(set(tree) - set(self.fixed))

    @cached_property
    def cut(self) -> CutColumns:
        return cut_coordinates.cut_columns(self.lay)

    @cached_property
    def kinds(self) -> Kinds:
        return kinds(self.lay)

    def rows(self, R: Array, p: Array) -> Rows:
        """The reciprocal wrenches at given poses of the bodies, and the closure residuals of the cut joints."""
        for orientation, rows in self.last[:]:
            if orientation is R:
                return rows
        rows = self._rows(R, p)
        self.last[:] = [(R, rows)] if len(R) == 1 else []
        return rows

    def _rows(self, R: Array, p: Array) -> Rows:
        cuts, (parents, children) = self.lay.tree.cuts, self.lay.sides
        (R_from, start), (R_to, point) = side_frames(parents, R, p), side_frames(children, R, p)
        shift = point - start
        turn = np.zeros_like(shift)
        owner, _, carried, normal, own, _ = self.kinds
        direction = np.tile(own, (len(R), 1, 1))
        for some, R_side in ((carried > 0, R_to), (carried < 0, R_from)):
            if some.any():
                side = R_side[:, np.array(owner)[some]]
                direction[:, some] = (side @ direction[:, some][..., None])[..., 0]
        by_axis = [c for c, joint in enumerate(cuts) if joint.kind in "URC"]
        if by_axis:
            first = (R_from[:, by_axis] @ np.array([cuts[c].axes[0] for c in by_axis])[..., None])[..., 0]
            last = (R_to[:, by_axis] @ np.array([cuts[c].axes[-1] for c in by_axis])[..., None])[..., 0]
            turn[:, by_axis] = cross(first, last)
            for row in np.flatnonzero(normal):  # axes of a U joint stay at right angles
                c, k = owner[row], by_axis.index(owner[row])
                across = turn[:, c].copy()
                direction[:, row] = across / np.linalg.norm(across, axis=1, keepdims=True)
                turn[:, c] = -np.sum(first[:, k] * last[:, k], axis=1, keepdims=True) * across
        for c, joint in enumerate(cuts):
            if joint.kind == "P":
                turn[:, c] = vee(R_to[:, c] @ R_from[:, c].swapaxes(1, 2))
        return Rows(direction, point, turn, shift)

    def residuals(self, rows: Rows) -> Array:
        """Closure residual along each reciprocal wrench, without dimension. Shape (n, m)."""
        owner, force, *_ = self.kinds
        residual = np.where(force[:, None], rows.shift[:, owner] / self.length, rows.turn[:, owner])
        return np.asarray(np.sum(rows.direction * residual, axis=2))

    @property
    def _couplings(self) -> CouplingRows:
        return self.lay.mechanism.coupling_rows

    def _over(self, closing: Array, couplings: Array) -> Array:
        """What the loops give, shape (n, m, ...), over what the couplings give, made without dimension."""
        size = self.size[self._couplings.columns]
        return np.concatenate([closing, couplings / (size if couplings.ndim == 2 else size[:, None])], axis=1)

    def _matrix(self, rows: Rows, at: Pose) -> Array:
        owner, force, *_ = self.kinds
        # the work of each wrench on the child's twist less the parent's
        d = np.where(force[:, None], rows.direction / self.length, 0.0)
        work = np.empty((*d.shape[:2], 6), dtype=d.dtype)
        work[..., 3:] = d
        work[..., :3] = np.where(force[:, None], cross(rows.point[:, owner], d), rows.direction)
        closing = (work @ at.S[:, self.unknown].swapaxes(1, 2)) * self._signs
        if len(self._couplings):
            closing = self._over(closing, self._couplings.matrix(at.q)[:, :, self.unknown])
        return np.concatenate([closing, self._selection(at)], axis=1) * self.size[self.unknown]

    @cached_property
    def _signs(self) -> Array:
        return np.asarray(-self.lay.loop[np.ix_(self.kinds.owner, self.unknown)])

    def matrix(self, at: Pose) -> Array:
        """Derivative by the unknowns of the residuals, those of the couplings after them, and of the selected
        coordinates, without dimension. Shape (n, m + k, n_unknown)."""
        return self._matrix(self.rows(at.R, at.p), at)

    def _selection(self, at: Pose) -> Array:
        """Rows that pick the independent coordinates. Shape (n, k, n_unknown)."""
        columns = self.lay.mechanism.independent_columns
        rows = np.zeros((len(at.q), len(columns), len(self.unknown)), dtype=at.q.dtype)
        for k, column in enumerate(columns):
            if column in self.unknown:
                rows[:, k, self.unknown.index(column)] = 1.0
            else:
                place = self.lay.cut_columns.index(column)
                rows[:, k] = self.cut_rows(at)[0][:, place][:, self.unknown]
            rows[:, k] /= self.size[column]
        return rows

    def cut_rows(self, at: Pose) -> tuple[Array, Array]:
        """Velocities of the cut coordinates per velocity of the tree, and the condition of each joint's orientation.

        Returns:
            Shapes (n, n_place, n_q) in the order of `Layout.cut_columns`, and (n, n_cut).
        """
        tree = self.lay.loop.copy()
        tree[:, self.lay.cut_columns] = 0.0
        reader, condition = self.readers(at)
        return -(reader @ at.S.swapaxes(1, 2)) * tree[self.cut.owner], condition

    def readers(self, at: Pose) -> tuple[Array, Array]:
        """What reads the velocities of the cut joints, see `cut_coordinates.readers`."""
        points = side_frames(self.lay.sides[1], at.R, at.p)[1]
        return cut_coordinates.readers(self.lay, self.cut, at.S, points)

    def evaluate(self, z: Array, y: Array) -> tuple[Array, Array]:
        """Residuals, those of the couplings too, and their derivative, without dimension: an `Evaluation` for Newton.

        Args:
            z: Unknowns over their `size`. Shape (n, n_unknown).
            y: Independent coordinates over theirs. Shape (n, k).
        """
        columns = self.lay.mechanism.independent_columns
        cut = [k for k, column in enumerate(columns) if column not in self.unknown]
        guess = np.tile(self.lay.mechanism.home, (len(z), 1))
        for k in cut:  # the angle nearest to what is wanted
            guess[:, columns[k]] = y[:, k] * self.size[columns[k]]
        q, R, p, S = self._tree(z, guess)
        rows = self.rows(R, p)
        at = whole_pose(self.lay, self._read(q, R, p), R, p, S) if cut else Pose(q, R, p, S, np.zeros((len(z), 0, 6)))
        error = at.q[:, columns] / self.size[columns] - y
        residuals = self.residuals(rows)
        if len(self._couplings):
            residuals = self._over(residuals, self._couplings.residuals(at.q))
        return np.concatenate([residuals, error], axis=1), self._matrix(rows, at)

    def _tree(self, z: Array, guess: Array) -> tuple[Array, Array, Array, Array]:
        """Joint coordinates, those of cut joints being guessed, and what `tree_pose` gives."""
        q, fixed = guess.copy(), list(self.fixed)
        q[:, fixed] = self.lay.mechanism.home[fixed]
        q[:, self.unknown] = z * self.size[self.unknown]
        return q, *tree_pose(self.lay, q)

    def _read(self, q: Array, R: Array, p: Array) -> Array:
        return cut_coordinates.read(self.lay, self.cut, R, p, q)

    def fill(self, z: Array, guess: Array) -> Pose:
        """The pose of given unknowns.

        Args:
            z: Unknowns without dimension. Shape (n, n_unknown).
            guess: Joint coordinates, of which those of cut joints say which of equal angles is meant. Shape (n, n_q).
        """
        q, R, p, S = self._tree(z, guess)
        return whole_pose(self.lay, self._read(q, R, p), R, p, S)

    def coordinates(self, z: Array, guess: Array) -> Array:
        """Of that pose all joint coordinates. Shape (n, n_q)."""
        q, R, p, _ = self._tree(z, guess)
        return self._read(q, R, p)

    def correct(self, q: Array, y: Array) -> tuple[Array, Array] | None:
        """A `Corrector`: all joint coordinates without dimension, those of cut joints read near the prediction."""
        z, matrix, error = newton(self.evaluate, q[None, self.unknown], y[None])
        if not error[0] < OPEN:
            return None
        K = np.zeros((len(q), len(y)))  # cut coordinates are not predicted: near gimbal lock they run away
        K[self.unknown] = velocity_map(matrix, len(y))[0]
        return self.coordinates(z, q[None] * self.size)[0] / self.size, K

    def joints(self, z: Array, near: Array | None) -> Array:
        """All joint coordinates of one pose, those of cut joints next to others, or to home. Shape (n_q,)."""
        return np.asarray(self.coordinates(z[None], (self.lay.mechanism.home if near is None else near)[None])[0])

    def follower(self) -> Follower:
        """Follows motions from home on."""
        home, columns = self.lay.mechanism.home / self.size, self.lay.mechanism.independent_columns
        return Follower(self.evaluate, home[self.unknown], home[columns], size=self.size[columns], read=self.joints)

    def follow(self, path: Follower, y: Array, t: Array, rates: Rates | None = None, *, strict: bool = False) -> Pose:
        """The poses of a motion, see `Follower.follow`. Shapes (n, k), (n,) and (n, k) twice, in rad and m."""
        over = None if rates is None else (rates[0] / path.size, rates[1] / path.size)
        found = path.follow(y / path.size, t, over, strict=strict)
        found.near[:, self.lay.mechanism.independent_columns] = y  # with the whole turns that are given
        return self.fill(found.z, found.near)

    def bias(self, at: Pose, w: Array, V: Array, A: Array) -> Array:
        """Second derivative of the residuals, couplings' too, where the unknowns have none. Shape (n, m).

        Args:
            w: Velocities of the joint coordinates. Shape (n, n_q).
            V: Twists of the bodies at O. Shape (n, n_body + 1, 6).
            A: Their acceleration screws for joint accelerations of zero. Shape (n, n_body + 1, 6).
        """
        rows = self.rows(at.R, at.p)
        owner, force, carried, normal, *_ = self.kinds
        (i, _, _), (j, _, _) = self.lay.sides
        V_i, V_j, A_i, A_j = V[:, i], V[:, j], A[:, i], A[:, j]
        w_i, w_j = V_i[..., :3], V_j[..., :3]
        relative = screws.acceleration_at(V_j, A_j, rows.point) - screws.acceleration_at(V_i, A_i, rows.point)
        # a child's point that slides on the parent is carried along by that; zero where nothing slides
        sliding = screws.velocity_at(V_j, rows.point) - screws.velocity_at(V_i, rows.point)
        sliding[:, [joint.kind not in "PC" for joint in self.lay.tree.cuts]] = 0.0
        relative -= cross(w_i, sliding)
        carrier = np.where(carried[:, None] > 0, w_j[:, owner], w_i[:, owner])
        change = np.where(carried[:, None] != 0, cross(carrier, rows.direction), 0.0)
        for row in np.flatnonzero(normal):
            first, second = at.S[:, self.lay.columns[self.lay.tree.cuts[owner[row]].name], :3].swapaxes(0, 1)
            w_first, w_second = w_i[:, owner[row]], w_j[:, owner[row]]
            change[:, row] = cross(cross(w_first, first), second) + cross(first, cross(w_second, second))
        along = np.where(force[:, None], relative[:, owner], (A_j - A_i)[:, owner, :3])
        velocity = np.where(force[:, None], sliding[:, owner], (w_j - w_i)[:, owner])
        bias = np.sum(rows.direction * along + change * velocity, axis=2)
        bias = np.asarray(np.where(force, bias / self.length, bias))
        return self._over(bias, self._couplings.bias(at.q, w)) if len(self._couplings) else bias


def loop_equations(lay: Layout, fixed: tuple[int, ...] = ()) -> LoopEquations:
    """The loop equations with some coordinates fixed at home, made once a layout."""
    if fixed not in lay.kept:
        lay.kept[fixed] = LoopEquations(lay, fixed)
    equations: LoopEquations = lay.kept[fixed]
    return equations
