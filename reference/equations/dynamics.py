"""Forces of a closed mechanism in motion (section 5 of the paper): Newton-Euler, virtual power, all reactions.

Corrections to the paper: gravity enters as ``m (a - g)``; lever arms run from the centre of mass to the point of
application; the moment of the U-joint's wrist and ``(O - P) x F_S`` are included; and the load has the sign of its
action on the platform.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from screwgauge.reference.applied import Applied
from screwgauge.reference.equations.applied_forces import forces_along, resisting_force, wrenches_on_bodies
from screwgauge.reference.equations.closure import Loops, Motion
from screwgauge.reference.equations.joint_types import reaction_components, reaction_names
from screwgauge.reference.equations.kinematics import Coordinates, walk, zeros
from screwgauge.reference.equations.ops import Ops, System, is_absent
from screwgauge.reference.equations.recursion import BodyAccelerations, at_origin, inward, on_child, wrench
from screwgauge.reference.equations.screws import (
    Array,
    join,
    power,
    scale,
    stack,
    times,
    transpose,
    velocity_at,
)
from screwgauge.reference.mechanism import by_role
from screwgauge.reference.points import Point
from screwgauge.reference.rotations import across_direction


class Dynamics(Motion):
    """Forces of a mechanism in motion at a closed pose.

    Attributes:
        applied: Gravity, loads, springs, dampers and motors.
        t: Time [s] at which motors and loads are evaluated. Shape (...).
        given_forces: Additional forces along all joint coordinates, if any. Shape (..., n_q).
        points: Named points whose velocities are requested.
        axial: True if redundant actuators follow the rule of eq. (56), False for the minimum-norm rule.
        idle: Indices of independent coordinates that no actuator drives; their accelerations follow from the forces.
        resting: Indices of independent coordinates that have neither an actuator nor inertia; their motion is given.
    """

    t: Any = 0.0
    idle: tuple[int, ...] = ()
    resting: tuple[int, ...] = ()
    given_forces: Array | None = None
    points: tuple[Point, ...] = ()
    axial = False

    def __init__(
        self,
        loops: Loops,
        at: Coordinates,
        yd: Array,
        ydd: Array | None,
        folds: Sequence[Any],
        ops: Ops,
        applied: Applied,
    ) -> None:
        super().__init__(loops, at, yd, ydd, folds, ops)
        self.applied = applied

    @cached_property
    def required(self) -> Array:
        """Wrenches that each body needs for its motion, see `BodyAccelerations.needs`. Shape (..., b, 6)."""
        return self.moved.needs(self.applied.g)

    @cached_property
    def applied_wrenches(self) -> Array:
        """Wrenches of loads and point springs on each body. Shape (..., b, 6)."""
        return wrenches_on_bodies(self)

    @cached_property
    def applied_along(self) -> Array:
        """Forces along all coordinates: springs, dampers, friction, motors and given forces. Shape (..., n_q)."""
        return forces_along(self)

    def along_tree(self, along: Array) -> Array:
        """Project forces along all coordinates onto the tree, preserving power. Shape (..., n_q) -> (..., n)."""
        tau = along[..., self.loops.columns]
        for column in self.loops.owner:
            if not is_absent(along[..., column]):
                places, row = self.reading(column)
                tau[..., places] = tau[..., places] + scale(along[..., column], row[..., 0, :])
        return tau

    def demand(self, need: Array, acting: Array) -> Array:
        """Return the forces along tree coordinates that actuators and constraints must supply. Shape (..., n).

        Args:
            need: Wrenches that the bodies need for their motion, see `required`. Shape (..., b, 6).
            acting: Forces along all coordinates, see `acting`. Shape (..., n_q).
        """
        along = inward(self.pose, need - self.applied_wrenches)[0]
        return along[..., self.loops.columns] - self.along_tree(acting)

    def acting(self, beta: Array, moved: BodyAccelerations) -> Array:
        """Return applied forces minus rotor inertia along all coordinates, without actuator forces. Shape (..., n_q).

        A rotor with (reflected) inertia I absorbs ``I qdd`` of the force along its coordinate.

        Args:
            beta: Second derivatives of the tree coordinates. Shape (..., n_q).
            moved: Accelerations of the bodies.
        """
        rotors = self.mechanism.rotors
        if not rotors.any():
            return self.applied_along
        return self.applied_along - rotors * self.accelerations_of_joints(beta, moved)

    @cached_property
    def along(self) -> Array:
        """Result of `acting` for this motion. Shape (..., n_q)."""
        return self.acting(self.beta, self.moved)

    @cached_property
    def tau(self) -> Array:
        """Forces along tree coordinates that actuators and constraints must supply in this motion. Shape (..., n)."""
        return self.demand(self.required, self.along)

    def virtual_power(self, tau: Array) -> Array:
        """Project forces along the tree onto y, ``K^T tau``; accurate near constraint singularities. Shape (..., k)."""
        return times(self.K[..., self.loops.columns], tau)

    @cached_property
    def generalized_force(self) -> Array:
        """Generalized actuator force along each independent coordinate; preload cancels. Shape (..., k)."""
        return self.virtual_power(self.tau)

    # actuators

    @cached_property
    def B(self) -> Array:
        """Rates of the actuated coordinates per unit rate of each independent coordinate. Shape (..., n_act, k)."""
        K, rows = self.K[..., self.loops.columns], list[Array]()
        for column in self.mechanism.actuated_columns:
            places, row = self.reading(column)
            rows.append(times(K[..., places], row[..., 0, :]))
        if not rows:
            return zeros(self.q, 0, len(self.loops.y_columns))
        return np.stack(np.broadcast_arrays(*rows), axis=-2)

    @property
    def driven(self) -> list[int]:
        """Indices of the independent coordinates that actuators drive."""
        undriven = {*self.idle, *self.resting}
        return [k for k in range(len(self.loops.y_columns)) if k not in undriven]

    @cached_property
    def _B(self) -> Array:
        """Columns of B for the driven coordinates. Shape (..., n_act, n_driven)."""
        return self.B[..., self.driven]

    @cached_property
    def per_actuator(self) -> Array:
        """Rates of the driven coordinates per unit rate of each actuator, ``B^-1``. Shape (..., n_driven, n_act).

        For redundant actuators, the matrix is ``B^+``, whose transpose gives minimum-norm forces; undriven coordinates
        are at rest.
        """
        B, BT = self._B, transpose(self._B)
        actuators, driven = B.shape[-2:]
        units = np.eye(min(actuators, driven), dtype=self.loops.lay.path.dtype)
        if not len(units):
            return zeros(self.q, driven, actuators)
        if actuators < driven:
            system = self.ops.square(B @ BT)
            return np.asarray(BT @ np.stack([system.solve(unit) for unit in units], axis=-1))
        system = self.ops.square(BT @ B if actuators > driven else BT)
        rows = [system.solve(unit) for unit in units]
        return np.stack([times(B, row) if actuators > driven else row for row in rows], axis=-2)

    @cached_property
    def jacobian(self) -> Array:
        """Twists of the bodies about their origins, and velocities of `points`, per unit rate of each actuator.

        Returns:
            Entries of the matrix, row by row. Shape (..., (6 (b - 1) + 3 n_point) n_act).
        """
        columns = list[Array]()
        if not self.mechanism.actuator_names or not self.driven:
            return zeros(self.q, 0)
        for V in (self.partial[k] for k in self.driven):
            bodies = join(V[..., 1:, :3], velocity_at(V, self.pose.p)[..., 1:, :])
            parts = [bodies.reshape(*bodies.shape[:-2], -1)]
            for one in self.points:
                body = self.mechanism.body_index[one.body]
                place = self.pose.p[..., body, :] + times(self.pose.R[..., body, :, :], one.place)
                parts.append(velocity_at(V[..., body, :], place))
            columns.append(join(*parts))
        J = np.stack(columns, axis=-1) @ self.per_actuator
        return J.reshape(*J.shape[:-2], -1)

    @cached_property
    def drive(self) -> System:
        """System matrix for the actuator forces: ``B^T`` on top of the rule of eq. (56), or B's smaller Gram matrix."""
        BT = transpose(self._B)
        if self.line is not None:
            return self.ops.square(stack(BT, self.line[0]))
        return self.ops.square(BT if not self.surplus else BT @ self._B if self.surplus > 0 else self._B @ BT)

    @property
    def surplus(self) -> int:
        """Number of actuators minus number of driven coordinates; zero under the rule of eq. (56).

        If it is positive, the norm of the actuator forces is minimised.
        """
        return 0 if self.line is not None else len(self.mechanism.actuator_names) - len(self.driven)

    @cached_property
    def actuator_force(self) -> Array:
        """Actuator forces f with ``B^T f = Q``, with minimum norm or by the rule of eq. (56). Shape (..., n_act).

        With too few actuators, f is the least-squares solution.
        """
        Q = self.generalized_force[..., self.driven]
        if self.line is not None:
            return self.drive.solve(join(Q, self.line[1]))
        if self.surplus > 0:
            return times(self._B, self.drive.solve(Q))
        return self.drive.solve(times(self._B, Q) if self.surplus else Q)

    def along_joints(self, f: Array) -> Array:
        """Scatter actuator forces among all coordinates. Shape (..., n_act) -> (..., n_q)."""
        lead, n = np.broadcast_shapes(self.q.shape[:-1], f.shape[:-1]), self.q.shape[-1]
        along = np.zeros((*lead, n), dtype=self.q.dtype)
        along[..., self.mechanism.actuated_columns] = along[..., self.mechanism.actuated_columns] + f
        return along

    @cached_property
    def axis_moment(self) -> Array:
        """Forces along all coordinates that the two bodies of each joint transmit to each other. Shape (..., n_q).

        They are the forces of actuators, springs, dampers, friction and motors, minus rotor inertia. Coupling forces
        are components of `reaction`.
        """
        return self.along_joints(self.actuator_force) + self.along

    @property
    def resistance(self) -> Array:
        """Force of each rotor, damper and dry friction along its coordinate. Shape (..., n_resistance)."""
        taken = [resisting_force(self, one) for one in self.mechanism.resistances]
        return np.stack(np.broadcast_arrays(*taken), axis=-1) if taken else zeros(self.q, 0)

    @cached_property
    def line(self) -> tuple[Array, Array] | None:
        """Transverse force of a joint (eq. 56) per unit actuator force, and minus its value at zero actuator force.

        None under the minimum-norm rule.
        """
        return self._across_line(*self.mechanism.axial) if self.axial and self.mechanism.axial else None

    def _across_line(self, name: str, direction: Array) -> tuple[Array, Array]:
        n, child = len(self.mechanism.actuator_names), self.mechanism.joint(name).child
        across = across_direction(self.pose.R[..., self.mechanism.body_index[child], :, :], direction)
        columns = [reaction_names(self.mechanism.joints, ())[0].index(f"{name}.f{axis}") for axis in "xyz"]
        without, *unit = (
            times(across, self.reactions(f, idle=f.any())[..., columns]) for f in (np.zeros(n), *np.eye(n, dtype=float))
        )
        return np.stack(unit, axis=-1), -without

    # reactions

    @cached_property
    def reaction(self) -> Array:
        """All reaction components, eqs. (57)-(58), in the order of `reaction_names`. Shape (..., r)."""
        return self.reactions(self.actuator_force)

    def reactions(self, f: Array, *, idle: bool = False) -> Array:
        """Return reactions to actuator forces; with `idle`, other forces are zero. Shape (..., n_act) -> (..., r)."""
        return self.constraint_forces(f, idle=idle)[0]

    def constraint_forces(self, f: Array, *, idle: bool = False) -> tuple[Array, Array, Array]:
        """Return reaction components, forces that joints transmit along tree coordinates, and multipliers of M's rows.

        The multipliers are the unknowns of eq. (57): ``M^T x = tau`` yields the forces at cut joints, from which all
        other forces follow. For redundant constraints, x is the minimum-norm solution, with moments divided by the
        length of the mechanism.

        Returns:
            Shapes (..., r), (..., n_q), (..., m).
        """
        along = self.along_joints(f)
        tau, need = -self.along_tree(along), 0.0 * self.required
        if not idle:
            tau, need, along = tau + self.tau, self.required - self.applied_wrenches, along + self.along
        x = self.system.solve_transposed(tau)
        if null := self._redundant:
            N = np.stack(np.broadcast_arrays(*(scaled for _, scaled in null)), axis=-2)
            preload = times(N, self.transmit(x, need, along)[0] / self._arms)
            share = self.ops.square(N @ transpose(N)).solve(preload)
            x = x - sum(scale(share[..., i], row) for i, (row, _) in enumerate(null))
        return *self.transmit(x, need, along), x

    @cached_property
    def imbalance(self) -> Array:
        """Residual of the force balance along the tree coordinates. Shape (..., n)."""
        _, transmitted, x = self.constraint_forces(self.actuator_force)
        residual = self.axis_moment - transmitted
        for row, (i, terms) in enumerate(self.loops.couplings.derivatives(self.q, 1), self.loops.ends[-1]):
            residual[..., i] = residual[..., i] + x[..., row]
            for of, slope in terms:
                if of is not None:
                    residual[..., of] = residual[..., of] - slope * x[..., row]
        return residual[..., self.loops.columns]

    @cached_property
    def _arms(self) -> Array:
        units = reaction_names(self.mechanism.joints, self.mechanism.couplings)[1]
        arms = [self.loops.length if unit == "N m" else 1.0 for unit in units]
        return np.array(arms, dtype=self.loops.sizes.dtype)

    @cached_property
    def _redundant(self) -> list[tuple[Array, Array]]:
        """Null vectors of ``M^T`` (internal forces), each with its scaled reaction components."""
        null = self.system.null()
        nothing, rest = 0.0 * self.required, zeros(self.q, self.q.shape[-1])
        rows = [null[..., i, :] for i in range(null.shape[-2])]
        return [(x, self.transmit(x, nothing, rest)[0] / self._arms) for x in rows]

    def transmit(self, x: Array, need: Array, along: Array) -> tuple[Array, Array]:
        """Return reaction components, and all forces along tree coordinates. Shapes (..., r), (..., n_q).

        The components are powers on the unit twists that joints forbid, followed by coupling forces.

        Args:
            x: Forces along the rows of M. Shape (..., m).
            need: Wrenches that joints must exert on the bodies, see `required`. Shape (..., b, 6).
            along: Forces along all coordinates. Shape (..., n_q).
        """
        loops, pose, total = self.loops, self.pose, need + 0.0 * x[..., :1, None]
        parts = dict[str, Array]()
        for j, cut in enumerate(self.cuts):
            name = cut.at.joint.name
            parts[name] = x[..., loops.ends[j] : loops.ends[j + 1]]
            for body, frame, f, m in cut.wrenches(parts[name], along[..., loops.lay.columns[name]]):
                total[..., body, :] = total[..., body, :] - wrench(pose, body, frame.p, f, m)
        tree, wrenches = inward(pose, total)
        for step, freedoms in zip(walk(pose.lay), pose.crossings, strict=True):
            name = step.edge.joint.name
            parts[name] = reaction_components(on_child(pose, step.edge, freedoms), *wrenches[name])
        components = join(*(parts[joint.name] for joint in by_role(self.mechanism.joints)))
        return join(components, x[..., loops.ends[-1] : loops.given.start]), tree

    def open_tree_force(self, shares: Array) -> Array:
        """Return forces along all coordinates of an open tree due to inertia and gravity. Shape (..., n_q).

        Args:
            shares: Fraction, with sign, of each body that each coordinate carries. Shape (b - 1, n_q).
        """
        along, elsewhere = inward(self.pose, self.required)[0], shares - self.loops.lay.path[1:]
        if elsewhere.any():
            along = along + power(transpose(elsewhere) @ at_origin(self.pose, self.required)[..., 1:, :], self.screws)
        rotors = self.mechanism.rotors
        return along + rotors * self.joint_acceleration if rotors.any() else along


QUANTITIES: Mapping[str, Any] = {
    "joint_position": lambda at: at.joint_position,
    "joint_velocity": lambda at: at.joint_velocity,
    "joint_acceleration": lambda at: at.joint_acceleration,
    "body_angular_velocity": lambda at: _flatten(at.V[..., 1:, :3]),
    "body_angular_acceleration": lambda at: _flatten(at.body_angular_acceleration),
    "com_acceleration": lambda at: _flatten(at.com_acceleration),
    "generalized_force": lambda at: at.generalized_force,
    "actuator_force": lambda at: at.actuator_force,
    "reaction": lambda at: at.reaction,
    "axis_moment": lambda at: at.axis_moment,
    "resistance": lambda at: at.resistance,
    "jacobian": lambda at: at.jacobian,
}


def _flatten(x: Array) -> Array:
    return x.reshape(*x.shape[:-2], -1)
