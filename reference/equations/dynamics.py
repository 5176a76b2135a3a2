"""Forces of a closed mechanism in motion (section 5 of the paper): Newton-Euler, virtual power, all reactions.

Corrected against the paper: gravity as ``m (a - g)``, lever arms from the centre of mass to the point of action, the
moment of the U-joint's wrist and ``(O - P) x F_S`` are in, and the sign of the load says who exerts it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.applied import Applied
from screwgauge.reference.equations.applied_forces import Exerted, exerted
from screwgauge.reference.equations.closure import Closed, CutJoint, Loops
from screwgauge.reference.equations.joint_types import forbidden_twists
from screwgauge.reference.equations.kinematics import (
    Bracket,
    Coordinates,
    bias_screws,
    forces_along,
    transmitted,
    twists,
    zeros,
)
from screwgauge.reference.equations.ops import Ops, System, absent
from screwgauge.reference.equations.reactions import by_role, reaction_names
from screwgauge.reference.equations.screws import (
    Array,
    acceleration_at,
    couple,
    cross,
    force,
    join,
    lie_bracket,
    power,
    powers,
    scale,
    stack,
    times,
    transpose,
)
from screwgauge.reference.mechanism import Mechanism


class Motion(Closed):
    """Velocities and accelerations at a closed pose; each is worked out when it is first asked for.

    Attributes:
        yd: Rates of the independent coordinates. Shape (..., k).
        near: Column of a cut joint's angle -> what it is to be near to, among all that mean the same; else it is within
            half a turn.
        bracket: In place of the Lie bracket, to see what a part of it does.
    """

    bracket: Bracket = staticmethod(lie_bracket)

    def __init__(self, loops: Loops, at: Coordinates, yd: Array, ydd: Array, folds: Sequence[Any], ops: Ops) -> None:
        """`ydd`: second derivatives of the independent coordinates. Shape (..., k)."""
        super().__init__(loops, at, folds, ops)
        self.yd, self._ydd, self.near = yd, ydd, dict[int, Any]()

    @property
    def mechanism(self) -> Mechanism:
        return self.loops.lay.mechanism

    @property
    def ydd(self) -> Array:
        """Second derivatives of the independent coordinates. Shape (..., k)."""
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
    def joint_map(self) -> Array:
        """Velocity map of all joints. Shape (..., n_q, k)."""
        found = []
        for j in range(self.K.shape[-2]):
            V = twists(self.pose, self.K[..., j, :])
            found.append(self._with_cuts(self.K[..., j, :], lambda cut, V=V: np.moveaxis(cut.rates(V), -1, 0)))
        return np.stack(found, axis=-1)

    @cached_property
    def bias(self) -> Array:
        """Their acceleration screws without joint accelerations. Shape (..., b, 6)."""
        return bias_screws(self.pose, self.w, self.V, self.bracket)

    @cached_property
    def beta(self) -> Array:
        """Second derivatives of the tree's coordinates, eq. (48). Shape (..., n_q)."""
        return self.accelerations(self.ydd, self.w, self.V, self.bias)

    @cached_property
    def A(self) -> Array:
        """Acceleration screws of the bodies, eq. (44). Shape (..., b, 6)."""
        return self.bias + twists(self.pose, self.beta)

    @cached_property
    def com(self) -> Array:
        """Centres of mass. Shape (..., b - 1, 3)."""
        own = np.array([body.com for body in self.mechanism.bodies])
        return self.pose.p[..., 1:, :] + times(self.pose.R[..., 1:, :, :], own)

    @cached_property
    def com_acceleration(self) -> Array:
        """Their accelerations, eqs. (49)-(50). Shape (..., b - 1, 3)."""
        return acceleration_at(self.V[..., 1:, :], self.A[..., 1:, :], self.com)

    @cached_property
    def joint_position(self) -> Array:
        """Coordinates of all joints, see `near`. Shape (..., n_q)."""
        return self._with_cuts(self.q, self._cut_position)

    def _cut_position(self, cut: CutJoint) -> list[Any]:
        found, atan2 = list[Any](), self.ops.atan2
        for column, (x, cosine) in zip(self.loops.lay.columns[cut.at.joint.name], cut.values, strict=True):
            if cosine is None:
                found.append(x)
            elif column in self.near:
                angle = self.near[column]
                s, c = self.ops.sin(angle), self.ops.cos(angle)
                found.append(angle + atan2(x * c - cosine * s, cosine * c + x * s))
            else:
                found.append(atan2(x, cosine))
        return found

    @cached_property
    def joint_velocity(self) -> Array:
        """Rates of all joints. Shape (..., n_q)."""
        return self._with_cuts(self.w, lambda cut: np.moveaxis(cut.rates(self.V), -1, 0))

    @cached_property
    def joint_acceleration(self) -> Array:
        """Second derivatives of the coordinates of all joints. Shape (..., n_q)."""
        return self._with_cuts(self.beta, lambda cut: np.moveaxis(cut.accelerations(self.V, self.A), -1, 0))

    def _with_cuts(self, tree: Array, own: Any) -> Array:
        """Numbers of all coordinates from those of the tree, and of each cut joint from its own two bodies."""
        found = tree + 0.0
        for cut in self.cuts:
            for column, x in zip(self.loops.lay.columns[cut.at.joint.name], own(cut), strict=True):
                found[..., column] = x
        return found


class Dynamics(Motion):
    """Forces at a closed pose in motion.

    Attributes:
        applied: Gravity, loads, springs, dampers and motors.
        axial: Whether redundant actuators obey the rule of eq. (56), else that of the smallest norm.
    """

    def __init__(
        self,
        loops: Loops,
        at: Coordinates,
        yd: Array,
        ydd: Array,
        folds: Sequence[Any],
        ops: Ops,
        applied: Applied,
        *,
        t: Any = 0.0,
        axial: bool = False,
    ) -> None:
        """`t`: time [s], which motors go by. Shape (...)."""
        super().__init__(loops, at, yd, ydd, folds, ops)
        self.applied, self.t, self.axial = applied, t, axial

    # what bodies need, and what is exerted on them

    def inertia(self, V: Array, A: Array) -> Array:
        """Wrenches that bodies need for a motion and against gravity, eqs. (51)-(55). Shape (..., b, 6)."""
        R, V, A, mechanism = self.pose.R[..., 1:, :, :], V[..., 1:, :], A[..., 1:, :], self.mechanism
        J = np.array([body.inertia for body in mechanism.bodies])
        F = mechanism.masses[:, None] * (acceleration_at(V, A, self.com) - self.applied.g)
        w, beta = (times(transpose(R), X[..., :3]) for X in (V, A))  # in the axes of the body, eq. (52)
        T = times(R, times(J, beta) + cross(w, times(J, w)))
        found = zeros(F[..., 0], F.shape[-2] + 1, 6)
        found[..., 1:, :] = force(F, self.com) + couple(T)
        return found

    @cached_property
    def required(self) -> Array:
        """The same for the motion itself. Shape (..., b, 6)."""
        return self.inertia(self.V, self.A)

    @cached_property
    def exerted(self) -> Exerted:
        """What loads, springs, dampers and motors exert."""
        return exerted(self)

    def along_tree(self, along: Array) -> Array:
        """Forces along the tree that have the power of forces along all joints. Shape (..., n_q) -> (..., n)."""
        found = along[..., self.loops.columns]
        for column in self.loops.owner:
            if not absent(along[..., column]):
                places, row = self.reading(column)
                found[..., places] = found[..., places] + scale(along[..., column], row[..., 0, :])
        return found

    def demand(self, V: Array, A: Array) -> Array:
        """Forces along the tree's coordinates that actuators and constraints have to make up. Shape (..., n)."""
        need = self.inertia(V, A) - self.exerted.wrenches
        return forces_along(self.pose, need)[..., self.loops.columns] - self.along_tree(self.exerted.along)

    @cached_property
    def tau(self) -> Array:
        """The same for the motion itself. Shape (..., n)."""
        return self.demand(self.V, self.A)

    def virtual_power(self, tau: Array) -> Array:
        """What forces along the tree do along y, ``K^T tau``: good next to constraint singularities, too. (..., k)."""
        return times(self.K[..., self.loops.columns], tau)

    @cached_property
    def generalized_force(self) -> Array:
        """What actuators must deliver along each independent coordinate, unique whatever the preload. (..., k)."""
        return self.virtual_power(self.tau)

    # actuators

    @cached_property
    def B(self) -> Array:
        """Rates of the actuated coordinates per rate of each independent one. Shape (..., n_act, k)."""
        K, found = self.K[..., self.loops.columns], list[Array]()
        for column in self.mechanism.actuated_columns:
            places, row = self.reading(column)
            found.append(times(K[..., places], row[..., 0, :]))
        if not found:
            return zeros(self.q, 0, len(self.loops.y_columns))
        return np.stack(np.broadcast_arrays(*found), axis=-2)

    @cached_property
    def drive(self) -> System:
        """What solves for the actuator forces: ``B^T`` over the rule of eq. (56), or the smaller of its squares."""
        BT = transpose(self.B)
        if self.line is not None:
            return self.ops.square(stack(BT, self.line[0]))
        return self.ops.square(BT if not self.surplus else BT @ self.B if self.surplus > 0 else self.B @ BT)

    @property
    def surplus(self) -> int:
        """Actuators beyond the freedoms, of which the smallest forces are wanted; none under the rule of eq. (56)."""
        return 0 if self.line is not None else len(self.mechanism.actuators) - len(self.mechanism.independent)

    @cached_property
    def actuator_force(self) -> Array:
        """Actuator forces f with ``B^T f = Q``: of smallest norm, or by the rule of eq. (56). Shape (..., n_act).

        Too few of them come as near to Q as they can.
        """
        Q = self.generalized_force
        if self.line is not None:
            return self.drive.solve(join(Q, self.line[1]))
        if self.surplus > 0:
            return times(self.B, self.drive.solve(Q))
        return self.drive.solve(times(self.B, Q) if self.surplus else Q)

    @cached_property
    def line(self) -> tuple[Array, Array] | None:
        """Eq. (56), if it is the rule: force of a joint across its line per actuator force, and what these undo."""
        return self._across_line(*self.mechanism.axial) if self.axial and self.mechanism.axial else None

    def _across_line(self, name: str, direction: Array) -> tuple[Array, Array]:
        n, child = len(self.mechanism.actuators), self.mechanism.joint(name).child
        R = self.pose.R[..., self.mechanism.body_index[child], :, :]
        across = np.linalg.svd(direction[None])[2][1:] @ transpose(R)
        names = [component for component, _ in reaction_names(self.mechanism)]
        own = [names.index(f"{name}.f{axis}") for axis in "xyz"]
        without, *unit = (
            times(across, self.reactions(f, idle=f.any())[..., own]) for f in (np.zeros(n), *np.eye(n, dtype=float))
        )
        return np.stack(unit, axis=-1), -without

    # reactions

    @cached_property
    def reaction(self) -> Array:
        """All reaction components, eqs. (57)-(58), in the order of `reaction_names`. Shape (..., r)."""
        return self.reactions(self.actuator_force)

    def reactions(self, f: Array, *, idle: bool = False) -> Array:
        """The same for given actuator forces. Shape (..., n_act) -> (..., r). `idle`: where nothing else acts."""
        x, wrenches = self.constraint_forces(f, idle=idle)
        return self.components(wrenches, x)

    def _lead(self, f: Array) -> tuple[int, ...]:
        return np.broadcast_shapes(self.q.shape[:-1], f.shape[:-1])

    def constraint_forces(self, f: Array, *, idle: bool = False) -> tuple[Array, dict[str, Array]]:
        """Forces along the rows of M, and the wrenches of all joints, see `transmitted`.

        ``M^T x = tau`` gives those of cut joints, and what is then transmitted all others. Where constraints are
        redundant, of all answers that of smallest norm, moments over the length of the mechanism.
        """
        along = np.array(np.broadcast_to(zeros(self.q, self.q.shape[-1]), (*self._lead(f), self.q.shape[-1])))
        along[..., self.mechanism.actuated_columns] = along[..., self.mechanism.actuated_columns] + f
        tau, need = -self.along_tree(along), 0.0 * self.required
        if not idle:
            tau, need, along = tau + self.tau, self.required - self.exerted.wrenches, along + self.exerted.along
        x = self.system.solve_transposed(tau)
        if null := self._redundant:
            N = np.stack(np.broadcast_arrays(*(scaled for _, scaled in null)), axis=-2)
            own = times(N, self.components(self.transmitted(x, need, along), x) / self._arms)
            share = self.ops.square(N @ transpose(N)).solve(own)
            x = x - sum(scale(share[..., i], row) for i, (row, _) in enumerate(null))
        return x, self.transmitted(x, need, along)

    @cached_property
    def imbalance(self) -> Array:
        """What reactions and actuator forces leave along the coordinates of the tree. Shape (..., n)."""
        f = self.actuator_force
        driven = self.exerted.along + 0.0
        driven[..., self.mechanism.actuated_columns] = driven[..., self.mechanism.actuated_columns] + f
        x, wrenches = self.constraint_forces(f)
        left = driven + 0.0
        for row, (i, of, slope) in enumerate(self.loops.derivatives(self.q, 1), self.loops.ends[-1]):
            left[..., i] = left[..., i] + x[..., row]
            if of is not None:
                left[..., of] = left[..., of] - slope * x[..., row]
        for edge in self.loops.lay.tree.edges:
            for c in self.loops.lay.columns[edge.joint.name]:
                left[..., c] = left[..., c] - power(wrenches[edge.joint.name], self.pose.S[..., c, :])
        return left[..., self.loops.columns]

    @cached_property
    def _arms(self) -> Array:
        return np.array([self.loops.length if unit == "N m" else 1.0 for _, unit in reaction_names(self.mechanism)])

    @cached_property
    def _redundant(self) -> list[tuple[Array, Array]]:
        """Forces along the rows of M that balance among themselves, and their components over units of size one."""
        null = self.system.null()
        nothing, rest = 0.0 * self.required, zeros(self.q, self.q.shape[-1])
        rows = [null[..., i, :] for i in range(null.shape[-2])]
        return [(x, self.components(self.transmitted(x, nothing, rest), x) / self._arms) for x in rows]

    def transmitted(self, x: Array, need: Array, along: Array) -> dict[str, Array]:
        """Wrench of parent on child of every joint, its own drive included. Joint -> shape (..., 6).

        Args:
            x: Forces along the rows of M. Shape (..., m).
            need, along: Wrenches that bodies need, and forces along all coordinates. Shapes (..., b, 6), (..., n_q).
        """
        loops, total, found = self.loops, need + 0.0 * x[..., :1, None], dict[str, Array]()
        for j, cut in enumerate(self.cuts):
            W = times(transpose(cut.W), x[..., loops.ends[j] : loops.ends[j + 1]])
            own = loops.lay.columns[cut.at.joint.name]
            if not absent(along[..., own]):
                W = W + times(transpose(cut.D), along[..., own])
            total[..., cut.child, :] = total[..., cut.child, :] - W
            total[..., cut.parent, :] = total[..., cut.parent, :] + W
            found[cut.at.joint.name] = W
        return found | transmitted(loops.lay, total)

    def components(self, wrenches: Mapping[str, Array], x: Array) -> Array:
        """Reaction components: powers on the twists that joints forbid, and forces of couplings. Shape (..., r)."""
        found = [
            x[..., self._rows_of[joint.name]]
            if joint.name in self._rows_of
            else powers(wrenches[joint.name][..., None, :], forbidden_twists(self.pose.joint(joint)))[..., 0, :]
            for joint in by_role(self.mechanism)
        ]
        return join(*found, x[..., self.loops.ends[-1] : self.loops.given.start])

    @cached_property
    def _rows_of(self) -> dict[str, slice]:
        ends = self.loops.ends
        return {joint.name: slice(ends[j], ends[j + 1]) for j, joint in enumerate(self.loops.cuts)}

    @cached_property
    def screws(self) -> Array:
        """Unit screws of all joints. Shape (..., n_q, 6)."""
        S = self.pose.S + 0.0
        for cut in self.cuts:
            for i, column in enumerate(self.loops.lay.columns[cut.at.joint.name]):
                S[..., column, :] = cut.S[..., i, :]
        return S

    def open_tree_force(self, shares: Array) -> Array:
        """Forces along all coordinates that inertia and gravity ask of an open tree. Shape (..., n_q).

        Args:
            shares: How much of each body is carried by each coordinate, with its sign. Shape (b - 1, n_q).
        """
        return np.asarray(power(transpose(shares) @ self.required[..., 1:, :], self.screws))


QUANTITIES: Mapping[str, Any] = {
    "joint_position": lambda at: at.joint_position,
    "joint_velocity": lambda at: at.joint_velocity,
    "joint_acceleration": lambda at: at.joint_acceleration,
    "body_angular_velocity": lambda at: _flat(at.V[..., 1:, :3]),
    "body_angular_acceleration": lambda at: _flat(at.A[..., 1:, :3]),
    "com_acceleration": lambda at: _flat(at.com_acceleration),
    "generalized_force": lambda at: at.generalized_force,
    "actuator_force": lambda at: at.actuator_force,
    "reaction": lambda at: at.reaction,
}


def _flat(x: Array) -> Array:
    return x.reshape(*x.shape[:-2], -1)
