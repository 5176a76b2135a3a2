"""The engine `lagrange` solves Lagrange's equations in all joint coordinates, a second, independent formulation.

The equations are derived only from the positions of bodies, see `virtual_work`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from importlib.metadata import version

import numpy as np

import screwgauge.plugins as kit
from screwgauge.engines.virtual_work import Equations, axial_vector

#: Largest number of operations that a trace records; a program has about a tenth of this number.
MOST = 1_000_000
#: A rate below this counts as rest, where dry friction is taken as zero [rad/s or m/s].
REST = 1e-9

Samples = tuple[kit.Array, kit.GivenMotion, kit.Applied]
"""Joint coordinates of closed poses, shape (n, n_q), the given motion, and the applied forces."""
Answers = dict[str, kit.Array]
"""Quantity -> values at each sample."""


def load(files: kit.ModelFiles) -> Lagrange:
    """Load a description."""
    return Lagrange(kit.load_mechanism(files.model), str(files.model))


class Lagrange:
    """A loaded description."""

    def __init__(self, mechanism: kit.Mechanism, where: str) -> None:
        self.mechanism, self.where, self.independent = mechanism, where, tuple(mechanism.independent)

    def solve(self, problem: kit.Problem, progress: kit.Progress = kit.quiet) -> kit.Solution:
        """Solve a given motion.

        Raises:
            ScrewgaugeError: The problem does not match the description, or its motion cannot be followed.
        """
        kit.check_fits(problem, self.mechanism, self.where)
        if not isinstance(problem.task, kit.GivenMotion):
            raise kit.ModelFileError("this engine supports only given motions", "lagrange", "choose another engine")
        clock = kit.Clock()
        with clock.stage("equations"):
            equations = Equations(self.mechanism, problem.applied, kit.Trace(MOST))
            branch = kit.Branch(self.mechanism, equations.evaluate_gaps, equations.angular, problem.points)

        def solve(q: kit.Array, motion: kit.GivenMotion, applied: kit.Applied) -> tuple[Answers, Answers]:
            at, values = SolvedMotion(equations, branch, (q, motion, applied), problem.rule), Answers()
            at.points = problem.points
            for name in (name for name in QUANTITIES if name in problem.wanted):
                with clock.stage(name):
                    values[name] = QUANTITIES[name](at)
            return values, at.conditions

        def solve_part(motion: kit.GivenMotion, applied: kit.Applied) -> kit.SolvedPart:
            return branch.solve_part(motion, applied, solve, clock)

        labels = "lagrange", version("screwgauge"), f"rule {problem.rule}"
        return kit.answer(labels, self.mechanism, problem, solve_part, progress, clock)


def times(A: kit.Array, x: kit.Array) -> kit.Array:
    """Multiply stacked matrices by vectors."""
    return np.asarray(np.matmul(A, x[..., None])[..., 0])


class SolvedMotion:
    """Quantities at some samples of a motion, computed when first requested.

    Attributes:
        q, v, a: All joint coordinates and their derivatives. Shape (n, n_q).
        back: Derivative of the coordinates with respect to the gaps. Shape (n, n_q, m).
        K: Derivative of the coordinates with respect to the independent coordinates. Shape (n, n_q, k).
        conditions: Quantity -> condition number of the equations that were solved for it. Shape (n,).
    """

    def __init__(self, equations: Equations, branch: kit.Branch, samples: Samples, rule: str) -> None:
        self.equations, self.mechanism, self.rule = equations, equations.mechanism, rule
        (self.q, self.motion, self.applied), self.conditions = samples, Answers()
        self.n, (inverse, _, _) = len(self.q), branch.system(self.q, self.motion.y)
        self.back, self.K = np.split(inverse, [len(self.equations.gaps)], axis=2)
        self.v = times(self.K, self.motion.yd)

    @cached_property
    def a(self) -> kit.Array:
        bends = self.equations.motion(self.n, q=self.q, v=self.v)["bends"]
        return times(self.K, self.ydd) - times(self.back, bends)

    @cached_property
    def ydd(self) -> kit.Array:
        """Second derivatives of the independent coordinates, from forces for undriven coordinates. Shape (n, k)."""
        ydd, idle = self.motion.ydd, [*self.motion.idle]
        if idle:
            given = ydd * ~np.isin(np.arange(ydd.shape[1]), idle)
            still, M = copy(self), self.inertia[..., idle]  # no quantity that needs accelerations is known yet
            still.motion, B = replace(self.motion, ydd=given, idle=()), self.K[:, self.mechanism.actuated_columns]
            x, condition = kit.idle_accelerations(B, M, still.generalized_force, idle)
            ydd = given + x @ np.eye(ydd.shape[1])[idle]
            self.conditions |= dict.fromkeys(kit.ACCELERATED, condition)
        return ydd

    @cached_property
    def moved(self) -> Mapping[str, kit.Array]:
        """Body motions, see `Equations.motion`."""
        return self.equations.motion(self.n, q=self.q, v=self.v, a=self.a)

    def matrices(self, name: str) -> kit.Array:
        """Return the bodies' orientations or their time derivatives, ground first. Shape (n, n_body + 1, 3, 3)."""
        ground = np.eye(3) * (name == "pose") + np.zeros((self.n, 1, 1, 1))
        return np.concatenate([ground, self.moved[name].reshape(self.n, -1, 12)[..., :9].reshape(self.n, -1, 3, 3)], 1)

    def spin(self, name: str) -> kit.Array:
        """Convert derivatives of orientations to angular velocities or accelerations of bodies. Shape (n, 3 n_body)."""
        products = self.matrices(name)[:, 1:] @ self.matrices("pose")[:, 1:].swapaxes(2, 3)
        return np.stack(axial_vector(products), axis=-1).reshape(self.n, -1)

    @cached_property
    def state(self) -> dict[str, kit.Array]:
        """Inputs of the equations: motion and forces on bodies."""
        each = [*zip(self.equations.springs, self.moved["lengths"].T, self.moved["stretches"].T, strict=True)]
        if met := [spring for spring, length, _ in each if not length.all()]:
            raise met[0].no_direction()
        pulls = [spring.pull(length, rate) for spring, length, rate in each]
        loads = [np.broadcast_to(x, (self.n, 3)) for load in self.applied.loads for x in (load.force, load.torque)]
        acting = {"g": self.applied.g, "pulls": np.reshape(pulls, (-1, self.n)).T}
        acting["loads"] = np.reshape(loads, (-1, self.n, 3)).swapaxes(0, 1).reshape(self.n, -1)
        return {"q": self.q, "v": self.v, "a": self.a, **acting}

    @cached_property
    def along(self) -> kit.Array:
        """Forces along joint coordinates, including the inertial forces of rotors but no actuator forces. (n, n_q)."""
        out, at = np.zeros_like(self.q), self.mechanism.coordinates.index
        for spring, c in ((x, at(x.coordinate)) for x in self.applied.springs if isinstance(x, kit.JointSpring)):
            out[:, c] -= spring.pull(self.q[:, c], self.v[:, c])
        for motor in self.applied.motors:
            out[:, at(motor.coordinate)] += motor.force(self.motion.t)
        for one, force in zip(self.mechanism.resistances, self.resistance.T, strict=True):
            out[:, one.column] -= force
        return out

    @cached_property
    def resistance(self) -> kit.Array:
        """Force of each rotor, damper and dry friction along its coordinate. Shape (n, n_resistance)."""
        sign = np.where(np.abs(self.v) > REST, np.sign(self.v), 0.0)
        by = {"rotor": self.a, "damping": self.v, "friction": sign}
        each = [one.amount * by[one.what][:, one.column] for one in self.mechanism.resistances]
        return np.asarray(np.reshape(each, (-1, self.n)).T)

    @cached_property
    def needs(self) -> kit.Array:
        """Forces, along all coordinates, that actuators and loops must supply. Shape (n, n_q)."""
        return self.equations.balance(self.n, **self.state)["needs"] - self.along

    @cached_property
    def generalized_force(self) -> kit.Array:
        return times(self.K.swapaxes(1, 2), self.needs)

    @cached_property
    def actuator_force(self) -> kit.Array:
        """Actuator forces that have minimum norm, or that keep a joint's force along its line."""
        given = [i for i in range(self.K.shape[2]) if i not in self.motion.idle]
        A = self.K[:, self.mechanism.actuated_columns][..., given].swapaxes(1, 2)
        b = self.generalized_force[:, given]
        if self.rule == "spherical_axial" and self.mechanism.axial:
            name, direction = self.mechanism.axial
            joint = next(i for i, one in enumerate(self.mechanism.joints) if one.name == name)
            child = self.mechanism.body_index[self.mechanism.joints[joint].child]
            across = np.linalg.svd(direction[None])[2][1:] @ self.matrices("pose")[:, child].swapaxes(1, 2)
            none, units = np.zeros(A.shape[2]), np.eye(A.shape[2])
            idle = self.wrenches(self.needs, none, **self.state)[:, joint, :3]
            each = [self.wrenches(0.0 * self.needs, unit, q=self.q)[:, joint, :3] for unit in units]
            A = np.concatenate([A, np.stack([times(across, x) for x in each], axis=2)], axis=1)
            b = np.concatenate([b, -times(across, idle)], axis=1)
        if A.size:
            found = dict.fromkeys(("actuator_force", "axis_moment", "reaction"), np.linalg.cond(A))
            self.conditions = kit.worst_of(self.conditions, found)
        return times(np.asarray(np.linalg.pinv(A, rcond=1e-13), dtype=float), b)

    def extend(self, f: kit.Array) -> kit.Array:
        """Extend actuator forces to all coordinates, with zeros elsewhere. Shape (..., n_act) -> (n, n_q)."""
        out = np.zeros_like(self.q)
        out[:, self.mechanism.actuated_columns] = f
        return out

    def multipliers(self, needs: kit.Array, f: kit.Array) -> kit.Array:
        """Return minimum-norm multipliers of the gaps, which supply the remaining forces. Shape (n, m)."""
        return times(self.back.swapaxes(1, 2), needs - self.extend(f))

    def wrenches(self, needs: kit.Array, f: kit.Array, **state: kit.Array) -> kit.Array:
        """Return each joint's force on its child, and its moment about the child-side point. (n, n_joint, 6)."""
        forces, equations = self.multipliers(needs, f), self.equations
        found = equations.transmitted(self.n, **state, multipliers=forces)["wrenches"].reshape(self.n, -1, 6)
        each = {joint.name: found[:, i] * (1 if out else -1) for i, (joint, out) in enumerate(equations.tree)}
        each |= {joint.name: forces[:, 6 * i : 6 * i + 6] for i, joint in enumerate(equations.cuts)}
        return np.stack([each[joint.name] for joint in self.mechanism.joints], axis=1)

    @property
    def reaction(self) -> kit.Array:
        p = np.concatenate([np.zeros((self.n, 1, 3)), self.moved["origins"].reshape(self.n, -1, 3)], axis=1)
        wrenches = self.wrenches(self.needs, self.actuator_force, **self.state)
        couplings = self.multipliers(self.needs, self.actuator_force)[:, 6 * len(self.equations.cuts) :]
        return kit.reactions(self.mechanism, self.matrices("pose"), p, wrenches, couplings)

    points: Sequence[kit.Point] = ()

    @property
    def jacobian(self) -> kit.Array:
        """The quantity `jacobian`, computed from derivatives of poses with respect to each independent coordinate."""
        twists, R = np.zeros((self.n, len(self.mechanism.body_index), 6, self.K.shape[2])), self.matrices("pose")
        com = np.array([body.com for body in self.mechanism.bodies])
        for j, v in enumerate(np.moveaxis(self.K, 2, 0)):
            rate = self.equations.motion(self.n, q=self.q, v=v)["rate"].reshape(self.n, -1, 12)
            turned = rate[..., :9].reshape(self.n, -1, 3, 3)
            twists[:, 1:, :3, j] = np.stack(axial_vector(turned @ R[:, 1:].swapaxes(2, 3)), axis=-1)
            twists[:, 1:, 3:, j] = rate[..., 9:] - times(turned, com)
        B, index = self.K[:, self.mechanism.actuated_columns], self.mechanism.body_index
        found, self.conditions["jacobian"] = kit.per_actuator(twists, R, self.points, index, B, idle=self.motion.idle)
        return found

    @cached_property
    def inertia(self) -> kit.Array:
        """Mass matrix in the independent coordinates. Shape (n, k, k)."""
        columns, rotors = np.moveaxis(self.K, 2, 0), self.mechanism.rotors
        each = [self.equations.balance(self.n, q=self.q, a=a)["needs"] + rotors * a for a in columns]
        return np.asarray(self.K.swapaxes(1, 2) @ np.stack(each, axis=2))


QUANTITIES: Mapping[str, Callable[[SolvedMotion], kit.Array]] = {
    "joint_position": lambda at: at.q,
    "joint_velocity": lambda at: at.v,
    "joint_acceleration": lambda at: at.a,
    "body_angular_velocity": lambda at: at.spin("rate"),
    "body_angular_acceleration": lambda at: at.spin("second"),
    "com_acceleration": lambda at: at.moved["second"].reshape(at.n, -1, 12)[..., 9:].reshape(at.n, -1),
    "generalized_force": lambda at: at.generalized_force,
    "actuator_force": lambda at: at.actuator_force,
    "reaction": lambda at: at.reaction,
    "axis_moment": lambda at: at.along + at.extend(at.actuator_force),
    "resistance": lambda at: at.resistance,
    "mass_matrix": lambda at: at.inertia[(..., *np.triu_indices(at.K.shape[2]))],
    "jacobian": lambda at: at.jacobian,
}
