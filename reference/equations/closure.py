"""Closing system: constraints of cut joints, couplings and given coordinates, and the resulting motion.

``M qd = [0; 0; yd]`` for the coordinates of the tree replaces the chains of eqs. (15), (25), (26): a cut joint
constrains its bodies with the wrenches of eq. (8), so its own coordinates are not unknowns. The transpose of M yields
the force balance, ``M^T [constraint forces; coupling forces; Q] = tau``. `dynamics` computes forces; the package
`closed` closes the loops along a motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce
from operator import add
from typing import Any

import numpy as np

from screwgauge.reference.equations.cut_joint import CutJoint
from screwgauge.reference.equations.joint_types import (
    closure_residual,
    components,
)
from screwgauge.reference.equations.kinematics import (
    Coordinates,
    TreePose,
    length,
    tree_pose,
    twists,
)
from screwgauge.reference.equations.ops import Block, Ops
from screwgauge.reference.equations.recursion import MOVING, BodyAccelerations, body_accelerations
from screwgauge.reference.equations.screws import (
    Array,
    cross,
    join,
    powers,
    times,
    velocity_at,
)
from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import Mechanism


class Loops:
    """The loops of a layout, independent of the pose.

    Attributes:
        fixed: Columns of coordinates that never move in the home assembly mode.
        columns: Columns of the tree in the order of the unknowns; fixed columns come last.
        moving: Number of moving columns.
        names: Label and unit of each constraint wrench of the cut joints, one per row.
        ends: Boundaries of rows: cut joint j has the rows ``ends[j]:ends[j + 1]``.
        given: Rows of the given coordinates.
        unit, size: Scales of rows and of unknowns: 1 for angles, the length of the mechanism for distances.
    """

    def __init__(self, lay: Layout, fixed: Sequence[int] = ()) -> None:
        self.lay, self.fixed, mechanism = lay, [*fixed], lay.mechanism
        self.columns = [c for c in lay.tree_columns if c not in self.fixed] + self.fixed
        self.moving, self.length = len(self.columns) - len(self.fixed), length(lay)
        self.place = {c: i for i, c in enumerate(self.columns)}
        self.sizes = np.where(lay.turns, 1.0, self.length).astype(lay.path.dtype)
        self.size = self.sizes[self.columns]
        self.cuts, self.couplings = lay.cuts, mechanism.coupling_rows
        self.y_columns = mechanism.independent_columns
        counts = [len(components(joint)) for joint in self.cuts]
        self.names = [pair for joint in self.cuts for pair in components(joint)]
        self.ends = np.cumsum([0, *counts]).tolist()
        first = self.ends[-1] + len(self.couplings)
        self.given = slice(first, first + len(self.y_columns))
        lengths = [self.length if unit == "N" else 1.0 for _, unit in self.names]
        chosen = [*self.couplings.columns, *self.y_columns]
        self.unit = np.concatenate([np.array(lengths, dtype=self.sizes.dtype), self.sizes[chosen]])
        tree = np.array(self.columns, dtype=int)
        self.around = [(tree[signs != 0.0], signs[signs != 0.0]) for signs in -lay.loop[:, tree]]
        self.owner = {c: (j, i) for j, joint in enumerate(self.cuts) for i, c in enumerate(lay.columns[joint.name])}

    def folds(self, q: Array) -> list[Array]:
        """Choose between the two angle triples of each cut joint, see `cut_coordinates`. Shape (..., n_q) -> (...)."""
        middle = [self.lay.columns[joint.name][1] if joint.angles == 3 else None for joint in self.cuts]
        return [np.where(np.cos(0.0 if c is None else q[..., c]) < 0.0, -1.0, 1.0) for c in middle]


class Closed:
    """The closing system at a pose, and the motion that it allows."""

    def __init__(self, loops: Loops, at: Coordinates, folds: Sequence[Any], ops: Ops) -> None:
        """Prepare the system; `folds` selects the angle triple of each cut joint, see `cut_coordinates`."""
        self.loops, self.at, self.q, self.ops = loops, at, at.q, ops
        self.pose: TreePose = tree_pose(loops.lay, at)
        index = loops.lay.mechanism.body_index
        self.cuts = [
            CutJoint(self.pose.joint(joint), index[joint.parent], index[joint.child], fold, ops)
            for joint, fold in zip(loops.cuts, folds, strict=True)
        ]

    def rates_around(self, j: int, W: Array) -> tuple[list[int], Array]:
        """Return the columns of cut joint j's loop, and the power of wrenches W per unit rate of each. (..., m, c)."""
        columns, signs = self.loops.around[j]
        return [self.loops.place[c] for c in columns], powers(W, self.pose.S[..., columns, :]) * signs

    def reading(self, column: int) -> tuple[list[int], Array]:
        """Return tree columns that determine a coordinate's rate, and its rate per unit rate of each, (..., 1, c)."""
        if column in self.loops.place:
            return [self.loops.place[column]], np.ones((1, 1), dtype=self.loops.lay.path.dtype)
        j, i = self.loops.owner[column]
        return self.rates_around(j, self.cuts[j].D[..., i : i + 1, :])

    @cached_property
    def blocks(self) -> list[Block]:
        """Blocks of M: eq. (15) of each loop in reciprocal products (eq. 8), slopes of couplings, selection of y."""
        loops, one = self.loops, np.ones((1, 1), dtype=self.loops.lay.path.dtype)
        blocks: list[Block] = [
            (slice(loops.ends[j], loops.ends[j + 1]), *self.rates_around(j, cut.W)) for j, cut in enumerate(self.cuts)
        ]
        for row, (i, terms) in enumerate(loops.couplings.derivatives(self.q, 1), loops.ends[-1]):
            blocks.append((slice(row, row + 1), [loops.place[i]], one))
            for of, slope in terms:
                if of is not None:
                    blocks.append((slice(row, row + 1), [loops.place[of]], -np.asarray(slope)[..., None, None]))
        for row, column in enumerate(loops.y_columns, loops.given.start):
            blocks.append((slice(row, row + 1), *self.reading(column)))
        return blocks

    @cached_property
    def system(self) -> Any:
        """M as a solvable system, which replaces eq. (25), see `ops.System`."""
        loops = self.loops
        return self.ops.system(self.blocks, loops.unit, loops.size, loops.moving, self.q.shape[:-1])

    def residual(self, y: Array) -> Array:
        """Return the residuals of cut joints, couplings and given coordinates. Shape (..., m) [m or rad]."""
        rows = [closure_residual(cut.at) for cut in self.cuts]
        for i, terms in self.loops.couplings.derivatives(self.q, 0):
            gap = reduce(lambda rest, term: rest - term[1], terms, self.q[..., i])
            rows.append(np.asarray(gap)[..., None])
        rows += [np.asarray(self._gap(column, y[..., k]))[..., None] for k, column in enumerate(self.loops.y_columns)]
        return join(*rows)

    def _gap(self, column: int, y: Any) -> Any:
        """Return the difference between a coordinate and its given value."""
        if column in self.loops.place:
            return self.q[..., column] - y
        j, i = self.loops.owner[column]
        value, cosine = self.cuts[j].values[i]
        if cosine is None:
            return value - y
        sine_y, cosine_y = self.ops.sin(y), self.ops.cos(y)
        return self.ops.atan2(value * cosine_y - cosine * sine_y, cosine * cosine_y + value * sine_y)

    def newton_step(self, y: Array) -> Array:
        """Return the step of all coordinates in Newton's method, which replaces eq. (27). Shape (..., n_q)."""
        return self.spread(self.system.solve(-self.residual(y)))

    def spread(self, x: Array) -> Array:
        """Scatter the moving unknowns among all coordinates. Shape (..., moving) -> (..., n_q)."""
        full = np.zeros(x.shape[:-1] + self.q.shape[-1:], dtype=x.dtype)
        full[..., self.loops.columns[: self.loops.moving]] = x
        return full

    def solve(self, given: Array, above: Array | None = None) -> Array:
        """Solve for tree coordinates; the right-hand side stacks `above` (or zeros) and `given`. Shape (..., n_q)."""
        n = self.loops.given.start
        top = np.zeros((*given.shape[:-1], n), dtype=given.dtype) if above is None else above
        return self.spread(self.system.solve(join(top, given)))

    @cached_property
    def K(self) -> Array:
        """Velocity map of the tree coordinates, one row ``dq/dy_k`` for each y_k, eq. (26). Shape (..., k, n_q)."""
        eye = np.eye(len(self.loops.y_columns), dtype=self.loops.lay.path.dtype)
        return np.stack([self.solve(np.broadcast_to(row, self.q.shape[:-1] + row.shape)) for row in eye], axis=-2)

    def velocities(self, yd: Array) -> Array:
        """Return the rates of the tree coordinates, eq. (26). Shape (..., n_q)."""
        return times(self.K.swapaxes(-1, -2), yd)

    def joint_rates(self, w: Array, V: Array) -> Array:
        """Return the rates of all joints. Shape (..., n_q).

        Args:
            w: Rates of the tree coordinates. Shape (..., n_q).
            V: Twists of the bodies. Shape (..., b, 6).
        """
        return self._with_cuts(w, lambda cut: cut.rates(V))

    def _with_cuts(self, tree: Array, of_cut: Any) -> Array:
        """Assemble the values of all coordinates from `tree` and, for cut joints, from `of_cut`."""
        joined = tree + 0.0
        for cut in self.cuts:
            joined[..., self.loops.lay.columns[cut.at.joint.name]] = of_cut(cut)
        return joined


class Motion(Closed):
    """Velocities and accelerations at a closed pose, computed on first access.

    Attributes:
        yd: Rates of the independent coordinates. Shape (..., k).
        near: Column of a cut joint's angle -> value that selects the nearest equivalent angle; other angles are within
            half a turn.
    """

    def __init__(
        self, loops: Loops, at: Coordinates, yd: Array, ydd: Array | None, folds: Sequence[Any], ops: Ops
    ) -> None:
        """Prepare the motion; `ydd`, shape (..., k), is None if forces determine it."""
        super().__init__(loops, at, folds, ops)
        self.yd, self._ydd, self.near = yd, ydd, dict[int, Any]()

    @property
    def mechanism(self) -> Mechanism:
        return self.loops.lay.mechanism

    @property
    def ydd(self) -> Array:
        """Second derivatives of the independent coordinates. Shape (..., k)."""
        if self._ydd is None:
            raise TypeError("accelerations are missing")
        return self._ydd

    @cached_property
    def w(self) -> Array:
        """Rates of the tree's coordinates, eq. (26). Shape (..., n_q)."""
        return self.velocities(self.yd)

    @cached_property
    def V(self) -> Array:
        """Twists of the bodies, eq. (15). Shape (..., b, 6)."""
        return twists(self.pose, self.w)

    @cached_property
    def partial(self) -> list[Array]:
        """Twists of the bodies per unit rate of each independent coordinate. Shape (..., b, 6) each."""
        return [twists(self.pose, self.K[..., j, :]) for j in range(self.K.shape[-2])]

    @cached_property
    def joint_map(self) -> Array:
        """Velocity map of all joint coordinates. Shape (..., n_q, k)."""
        rates = np.moveaxis(self.K, -2, 0)
        return np.stack([self.joint_rates(w, V) for w, V in zip(rates, self.partial, strict=True)], axis=-1)

    @cached_property
    def bias(self) -> BodyAccelerations:
        """Body accelerations at zero second derivatives of y, ``w^T S_L w`` of eqs. (42)-(44), (48)."""
        return body_accelerations(self.pose, self.w, 0.0 * self.w)

    def accelerations(self, ydd: Array) -> Array:
        """Return the second derivatives of the tree coordinates, given those of y, eq. (48). Shape (..., n_q)."""
        above, given, w = list[Array](), ydd + 0.0, self.w
        for cut in self.cuts:
            above.append(-cut.bias(self.V, self.bias))
        for _, terms in self.loops.couplings.derivatives(self.q, 2):
            bent = [curvature * w[..., j] * w[..., j] for j, curvature in terms if j is not None]
            above.append(np.asarray(reduce(add, bent) if bent else 0.0 * w[..., 0])[..., None])
        for k, column in enumerate(self.loops.y_columns):
            if column in self.loops.owner:
                j, i = self.loops.owner[column]
                given[..., k] = given[..., k] - self.cuts[j].accelerations(self.V, self.bias)[..., i]
        return self.solve(given, join(*above) if above else None)

    @cached_property
    def beta(self) -> Array:
        """Second derivatives of the tree coordinates, eq. (48). Shape (..., n_q)."""
        return self.accelerations(self.ydd)

    @cached_property
    def moved(self) -> BodyAccelerations:
        """Accelerations of the bodies, eq. (44)."""
        return body_accelerations(self.pose, self.w, self.beta)

    @property
    def body_angular_acceleration(self) -> Array:
        """Angular accelerations of the moving bodies in world axes. Shape (..., b - 1, 3)."""
        return self.pose.to_world(self.moved.bodies.turning.b, MOVING)

    @property
    def A(self) -> Array:
        """Acceleration screws of the bodies at O in the form of eq. (44). Shape (..., b, 6)."""
        (V, p), b = (x[..., MOVING, :] for x in (self.V, self.pose.p)), self.body_angular_acceleration
        a = self.pose.to_world(self.moved.bodies.a, MOVING)
        A = 0.0 * self.V
        A[..., MOVING, :] = join(b, a - cross(b, p) - cross(V[..., :3], velocity_at(V, p)))
        return A

    @property
    def com(self) -> Array:
        """Positions of the centres of mass. Shape (..., b - 1, 3)."""
        return self.pose.com

    @cached_property
    def com_acceleration(self) -> Array:
        """Accelerations of the centres of mass, eq. (50). Shape (..., b - 1, 3)."""
        return self.pose.to_world(self.moved.of_com, MOVING)

    @cached_property
    def joint_position(self) -> Array:
        """Coordinates of all joints, see `near`. Shape (..., n_q)."""
        return self._with_cuts(self.q, self._cut_position)

    def _cut_position(self, cut: CutJoint) -> Array:
        near = {column: self.near.get(column, 0.0) for column in self.loops.lay.columns[cut.at.joint.name]}
        q = [x + self._gap(column, x) for column, x in near.items()]
        return np.stack(np.broadcast_arrays(*q), axis=-1)

    @cached_property
    def joint_velocity(self) -> Array:
        """Rates of all joints. Shape (..., n_q)."""
        return self.joint_rates(self.w, self.V)

    @cached_property
    def joint_acceleration(self) -> Array:
        """Second derivatives of the coordinates of all joints. Shape (..., n_q)."""
        return self.accelerations_of_joints(self.beta, self.moved)

    def accelerations_of_joints(self, beta: Array, moved: BodyAccelerations) -> Array:
        """Return all second derivatives, given those of the tree and the body accelerations. Shape (..., n_q)."""
        return self._with_cuts(beta, lambda cut: cut.accelerations(self.V, moved))

    @cached_property
    def screws(self) -> Array:
        """Unit screws of all joints. Shape (..., n_q, 6)."""
        S = self.pose.S + 0.0
        for cut in self.cuts:
            S[..., self.loops.lay.columns[cut.at.joint.name], :] = cut.S
        return S

    def joint_coordinate(self, coordinate: str) -> Any:
        """Return a joint coordinate by name. Shape (...)."""
        c = self.mechanism.coordinates.index(coordinate)
        return (self.joint_position if c in self.loops.owner else self.q)[..., c]

    def joint_rate(self, coordinate: str) -> Any:
        """Return the rate of a joint coordinate by name. Shape (...)."""
        c = self.mechanism.coordinates.index(coordinate)
        return (self.joint_velocity if c in self.loops.owner else self.w)[..., c]
