"""Inverse dynamics of a closed mechanism using an engine's open tree: positions, velocities, accelerations, forces.

The engine supplies values (poses, Jacobians, accelerations, inverse dynamics, transmitted wrenches). All tree engines
share this module's linear algebra, which closes loops and projects forces.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from screwgauge.engines.chunks import assemble
from screwgauge.engines.error_estimate import ACCELERATED, SolvedPart, Trust, examine_part, worst_of
from screwgauge.engines.kit.acting import resistance
from screwgauge.engines.kit.poses import counted_turns
from screwgauge.engines.kit.projection import idle_accelerations
from screwgauge.engines.kit.rates import per_actuator
from screwgauge.engines.tree.applied_forces import applied_wrenches
from screwgauge.engines.tree.closed_forces import closed_forces
from screwgauge.engines.tree.closed_tree import Charts, ClosedTree
from screwgauge.engines.tree.protocol import BodyPoses
from screwgauge.problem import GivenMotion, Problem, Progress, Rows
from screwgauge.quantities import Names, component_names, stages
from screwgauge.reference import linear
from screwgauge.reference.closed.continuation import Continuation
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.resistance import resistances
from screwgauge.reference.rotations import Array, cross
from screwgauge.solution import SOFTNESS, Clock, Error, Solution


def solve_motion(closed: ClosedTree, problem: Problem, motion: GivenMotion, progress: Progress) -> Solution:
    """Solve inverse dynamics for a prescribed motion, using the engine's open-tree model."""
    work, tree = _Work(closed, problem, motion), closed.tree
    size = closed.length, float(tree.masses.sum())
    labels = (tree.engine, tree.version, f"{closed.file.cut} cut, rule {problem.rule}")
    solution = assemble(labels, len(motion), work.part, work.names, work.clock, progress, size)
    errors = {name: _soften(error, work.softness.get(name, 0.0)) for name, error in solution.errors.items()}
    return replace(solution, errors=errors)


def _soften(error: Error, softness: float) -> Error:
    """Raise an error estimate to at least the effect of soft constraints [N or N m]."""
    if not softness:
        return error
    absolute = {unit: max(size, softness) for unit, size in error.absolute.items()}
    return replace(error, absolute=absolute, source=SOFTNESS)


#: Quantities that need the accelerations of all bodies.
_MOVED = frozenset(
    {"joint_acceleration", "body_angular_acceleration", "com_acceleration", "tree_force_soft", "resistance"}
)


class _Work:
    """Data common to all parts of a motion, and the last pose of its path."""

    def __init__(self, closed: ClosedTree, problem: Problem, motion: GivenMotion) -> None:
        self.closed, self.problem, self.motion, self.clock = closed, problem, motion, Clock()
        self.depth = stages(problem.wanted)
        self.moves = closed.tree.poses(closed.home[None]).moves
        self.path = Continuation(
            self._scale, (closed.home / closed.units, closed.y_home), closed.angles, closed.y_units
        )
        # angles of cut joints at the last sample
        self.cut = {joint.name: closed.loops.begin(joint, motion.y[0]) for joint in closed.loops.cut}
        self.residual = 0.0
        self.softness = dict[str, float]()

    def part(self, rows: slice) -> SolvedPart:
        loops, motion = self.closed.loops, self.motion.part(rows)
        with self.clock.stage("positions"):
            q, A, at = self._positions(motion)
            charts = loops.charts(at)
            cut = {name: counted_turns(self.cut[name], c.q, name in self.closed.given) for name, c in charts.items()}
            self.cut = {name: angles[-1] for name, angles in cut.items()}
            charts = {name: replace(c, q=cut[name]) for name, c in charts.items()}
        run = _Pass(self, motion, q, at, charts, A)
        values, trust = run.all()

        def solve_perturbed(doubtful: Rows, shake: Array) -> dict[str, Array]:
            some, units = motion.part(doubtful), self.closed.units
            there = q[doubtful] + shake * units
            _, matrix, R, p, screws = self._scale(there / units, some.y / self.closed.y_units)
            poses = BodyPoses(R, p, screws, at.moves)
            read = {name: c.near(cut[name][doubtful]) for name, c in loops.charts(poses).items()}
            return _Pass(self, some, there, poses, read, matrix).all()[0]

        units = {name: units for name, (_, units) in self.names().items()}
        part = examine_part(values, trust, A, motion.y.shape[1], solve_perturbed, self.clock, units, self.closed.length)
        return replace(part, q=run.values["joint_position"])

    def _evaluate(self, q: Array, y: Array, at: BodyPoses) -> tuple[Array, Array]:
        """Return the residuals of closures, then residuals of y, and the derivative of all residuals."""
        closed, loops = self.closed, self.closed.loops
        charts, ends = loops.charts(at, closed.given), loops.ends(at)
        for value, (_, name, i) in zip(y.T, loops.independent, strict=True):
            if name:
                charts[name] = charts[name].with_angle(i, value)
        errors = [closed.gaps(q, at, ends)]
        for value, (column, name, i) in zip(y.T, loops.independent, strict=True):
            if column is None:  # an angle, read within a turn
                difference = np.remainder(charts[name].q[:, i] - value + np.pi, 2 * np.pi) - np.pi
            else:
                difference = q[:, column] - value
            errors.append(difference[:, None])
        return np.concatenate(errors, axis=1), closed.closing_rows(q, at, charts, ends)

    def _scale(self, z: Array, y: Array) -> tuple[Array, ...]:
        """Return dimensionless closure residuals, their derivative, and the poses."""
        closed = self.closed
        q = z * closed.units
        at = closed.tree.poses(q)
        error, rows = self._evaluate(q, y * closed.y_units, at)
        rows *= closed.units / closed.row_units[:, None]
        error /= closed.row_units
        if rounding := closed.tree.rounding:
            error[np.abs(error) <= rounding] = 0.0
        return error, rows, at.R, at.p, at.screws

    def _positions(self, motion: GivenMotion) -> tuple[Array, Array, BodyPoses]:
        rates = motion.yd, motion.ydd
        z, matrix, error, R, p, screws = self.path.follow(motion.y, motion.t, rates, motion.drive)
        self.residual = float(error.max()) * max(1.0, self.closed.length)
        return z * self.closed.units, matrix, BodyPoses(R, p, screws, self.moves)

    def names(self) -> Names:
        file, tree, actuators = self.closed.file, self.closed.tree_names, self.closed.actuators
        reactions = reaction_names(file.joints, file.couplings)
        named = file.joints, file.bodies, file.independent, tree, actuators, reactions
        return component_names(*named, points=self.problem.points)


def mask_gimbal_lock(charts: Charts, rates: dict[str, Array]) -> dict[str, Array]:
    """Replace the rates of cut joints, (n, m) each, by NaN at gimbal lock."""
    return {
        name: np.where((charts[name].condition <= linear.SINGULAR)[:, None], rate, np.nan)
        for name, rate in rates.items()
    }


class _Pass:
    """Computes the requested quantities at closed poses, stage by stage.

    Attributes:
        values: Quantity -> shape (n, m).
        conditions: Quantity -> condition number of the equations from which it was solved. Shape (n,).
        speed, rush, load: Scales of velocity, acceleration and force, as in `Trust`. Shape (n,).
    """

    def __init__(self, work: _Work, motion: GivenMotion, q: Array, at: BodyPoses, charts: Charts, A: Array) -> None:
        """Start from closed poses.

        Args:
            q, at: Coordinates of the tree, shape (n, n_v), and its poses at q.
            charts: Coordinates of the cut joints.
            A: Dimensionless closing system. Shape (n, m + k, n_v).
        """
        self.work, self.closed, self.motion, self.q, self.at = work, work.closed, motion, q, at
        self.charts, self.A = charts, A
        self.wanted, self.units, self.clock = work.problem.wanted, work.closed.units, work.clock
        self.values = {"joint_position": self.closed.joints(q, {name: chart.q for name, chart in charts.items()})}
        applied = work.problem.applied
        self.sprung = bool(applied.springs or applied.motors or resistances(self.closed.file.joints))
        self.conditions: dict[str, Array] = {}
        self.speed: Array | float = 0.0
        self.rush: Array | float = 0.0
        self.load: Array | float = 0.0

    def all(self) -> tuple[dict[str, Array], Trust]:
        """Return the requested values and their error data."""
        depth, A = self.work.depth, self.A
        with self.clock.stage("condition"):
            self.inverse, self.condition = linear.invert_along(A)
        if depth in "vaf":
            with self.clock.stage("velocities"):
                self._velocities()
        if depth in "af":
            with self.clock.stage("accelerations"):
                self._accelerations()
            self._tree_forces()
        if depth == "f":
            with self.clock.stage("forces"):
                self._forces()
        with self.clock.stage("condition"):
            charts = [chart.condition for chart in self.charts.values()]
            worst = np.broadcast_to(np.max(charts, axis=0, initial=1.0), len(A))
            sizes = self.speed, self.rush, self.load
            trust = Trust(self.condition, self.condition / linear.norms(A), worst, self.conditions, *sizes)
        return {name: array for name, array in self.values.items() if name in self.wanted}, trust

    def _velocities(self) -> None:
        """Solve ``A v = [0; yd]`` for the velocities."""
        yd = self.motion.yd
        self.K = self.inverse[..., -yd.shape[1] :] * self.units[:, None] / self.closed.y_units
        self.v = (self.K @ yd[..., None])[..., 0]
        self.V = self.at.velocities(self.v)
        if self.sprung or self.wanted & {"joint_velocity", *_MOVED}:
            self.cut_v = self.closed.cut_velocities(self.charts, self.V)
            self.values["joint_velocity"] = self.closed.joints(self.v, mask_gimbal_lock(self.charts, self.cut_v))
        else:
            self.cut_v = self.closed.cut_velocities({name: self.charts[name] for name in self.closed.given}, self.V)
        self.values["body_angular_velocity"] = self.V[:, self.closed.bodies, :3].reshape(len(yd), -1)
        self.speed = np.abs(self.v / self.units).max(axis=1)
        if "jacobian" in self.wanted:
            moved = np.stack([self.at.velocities(column) for column in np.moveaxis(self.K, 2, 0)], axis=3)
            twists, R = moved[:, [0, *self.closed.bodies]], self.at.R[:, [0, *self.closed.bodies]]
            index = {name: i for i, name in enumerate((GROUND, *self.closed.file.bodies))}
            B, points, idle = self.K[:, self.closed.driven], self.work.problem.points, self.motion.idle
            rates = per_actuator(twists, R, points, index, B, idle=idle)
            self.values["jacobian"], self.conditions["jacobian"] = rates
        if "mass_matrix" in self.wanted:
            self.values["mass_matrix"] = self._inertia[(..., *np.triu_indices(yd.shape[1]))]

    @cached_property
    def _inertia(self) -> Array:
        """The mass matrix in the independent coordinates. Shape (n, k, k)."""
        return np.asarray(self.K.swapaxes(1, 2) @ self.closed.tree.mass_matrix(self.q) @ self.K)

    def _accelerations(self) -> None:
        """Solve ``A a = [-Jdot v; ydd - bias]`` for the accelerations, with the engine's own Jdot v."""
        closed, tree, loops = self.closed, self.closed.tree, self.closed.loops
        (n, k), idle = self.motion.ydd.shape, [*self.motion.idle]
        given = self.motion.ydd.copy()
        given[:, idle] = 0.0
        bias = tree.bias(self.at, self.q, self.v, self.V)
        still = self.q, self.v, np.zeros_like(self.v)
        right = np.concatenate([-closed.gap_accelerations(still, self.at, self.V, bias), given], axis=1)
        charts = {name: self.charts[name] for name in closed.given}
        cut_bias = closed.cut_accelerations(charts, self.cut_v, self.V, bias)
        for row, (column, name, i) in enumerate(loops.independent, right.shape[1] - k):
            if column is None:
                right[:, row] -= cut_bias[name][:, i]
        self.a = (self.inverse @ (right / self.closed.row_units)[..., None])[..., 0] * self.units
        if idle:
            self._follow(idle)
        self.rush = np.maximum(self.speed**2, np.abs(self.a / self.units).max(axis=1))
        if not self.wanted & _MOVED:
            return
        if "com_acceleration" in self.wanted:
            com = tree.com_accelerations(self.q, self.v, self.a)
            self.values["com_acceleration"] = com[:, [b - 1 for b in closed.bodies]].reshape(n, -1)
        A = bias + self.at.velocities(self.a)
        cut_a = closed.cut_accelerations(self.charts, self.cut_v, self.V, A)
        self.values["joint_acceleration"] = closed.joints(self.a, mask_gimbal_lock(self.charts, cut_a))
        self.values["body_angular_acceleration"] = A[:, closed.bodies, :3].reshape(n, -1)
        if "resistance" in self.wanted:
            rates, changes = self.values["joint_velocity"], self.values["joint_acceleration"]
            self.values["resistance"] = resistance(closed.file.joints, rates, changes)
        if "tree_force_soft" in self.wanted:
            self._measure(A)

    def _follow(self, idle: list[int]) -> None:
        """Add the accelerations of undriven coordinates, using the engine's own forces and inertia."""
        need = self.closed.tree.tree_force(self.q, self.v, self.a) - self.at.forces_along(self._acting[0])
        Q, B = (self.K.swapaxes(1, 2) @ need[..., None])[..., 0], self.K[:, self.closed.driven]
        x, condition = idle_accelerations(B, self._inertia[..., idle], Q, idle)
        self.conditions = dict.fromkeys(ACCELERATED, condition)
        self.a = self.a + (self.K[..., idle] @ x[..., None])[..., 0]

    def _measure(self, A: Array) -> None:
        """Measure the closure residuals of position, velocity and acceleration, to which soft constraints respond with
        forces.
        """
        q, at, closed, V = self.q, self.at, self.closed, self.V
        rate = closed.jacobian(q, at) @ self.v[..., None]
        second = closed.gap_accelerations((q, self.v, self.a), at, V, A)
        measured = [self.work.residual, np.abs(rate).max(initial=0.0), np.abs(second).max(initial=0.0)]
        # an engine's own evaluation of the same rows rounds differently
        sizes = [np.abs(array).max(initial=0.0) for array in (at.p, V, A)]
        self.residuals = np.array(measured) + 8 * linear.EPS * np.array(sizes)

    def _tree_forces(self) -> None:
        self.load = self._inertia_and_weight()
        tree, order, state = self.closed.tree, self.closed.order, (self.q, self.v, self.a)
        if "tree_force" in self.wanted or self.work.depth == "f":
            with self.clock.stage("tree forces"):
                self.tau = tree.tree_force(*state)
            self.values["tree_force"] = self.tau[:, order]
        if "tree_force_soft" in self.wanted:
            with self.clock.stage("soft tree forces"):
                soft, tolerance = tree.soft_force(*state, self.residuals)
                self.values["tree_force_soft"] = soft[:, order]
                known = self.work.softness.get("tree_force_soft", 0.0)
                self.work.softness["tree_force_soft"] = max(known, tolerance)

    def _inertia_and_weight(self) -> Array:
        """Return the largest inertial force plus weight along a coordinate, assuming no cancellation [N]. (n,)."""
        tree, at, L = self.closed.tree, self.at, self.closed.length
        most = np.abs(self.work.problem.applied.g) + np.expand_dims(self.rush, 1) * L
        bodies, columns = np.nonzero(at.moves[1:])  # most coordinates move few bodies
        weights = np.eye(len(self.units))[columns] * tree.masses[bodies, None] * self.units / L
        com, largest = at.points(range(1, len(tree.com) + 1), tree.com), np.empty(len(at.p))
        for rows in linear.blocks(len(com)):
            screws = at.screws[rows][:, :, columns].swapaxes(1, 2)
            J = screws[..., 3:] - cross(com[rows][:, bodies], screws[..., :3])
            largest[rows] = (np.einsum("npx,nx->np", np.abs(J, out=J), most[rows]) @ weights).max(axis=1)
        return largest

    @cached_property
    def _acting(self) -> tuple[Array, Array]:
        """Applied wrenches, see `applied_wrenches`."""
        q, motion = self.values["joint_position"], self.motion
        v = self.closed.joints(self.v, self.cut_v) if self.sprung else np.zeros_like(q)
        return applied_wrenches(self.closed, self.work.problem.applied, self.at, (motion.t, self.V, q, v))

    def _forces(self) -> None:
        motion, given = (self.q, self.v, self.a, self.tau), (self.work.problem, self.motion.idle)
        system = self.inverse, self.K
        values, conditions, largest = closed_forces(self.closed, given, self.at, system, motion, self._acting)
        self.values |= values
        self.conditions = worst_of(self.conditions, conditions)
        self.load = self.load + largest
