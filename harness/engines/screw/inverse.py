"""The engine `screw`: the solver in `screwgauge.reference`, on whole parts of the trajectory at once.

Or actuator forces read from the Newton-Euler system of all bodies, in place of virtual power.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwgauge import __version__
from screwgauge.engines.estimate import Part, Trust, examined
from screwgauge.engines.parts import Names, assemble, component_names, stages
from screwgauge.models.layout import open_tree
from screwgauge.problem import GivenMotion, Problem, Progress, Rows
from screwgauge.reference import dynamics, linear, screws, springs
from screwgauge.reference.along import joint_wrenches
from screwgauge.reference.closed.gain import gain
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.extent import extent
from screwgauge.reference.kinematics import Velocities, accelerations, positions, velocities
from screwgauge.reference.pose import Layout, Pose
from screwgauge.reference.precision import wide_force_matrix
from screwgauge.reference.reactions import Reactions
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Solution, Stopwatch, Values

#: Quantities for which no body's own motion is needed.
_JOINTS = frozenset({"joint_position", "joint_velocity", "joint_acceleration", "body_angular_velocity"})


def solve_motion(lay: Layout, problem: Problem, motion: GivenMotion, progress: Progress) -> Solution:
    """Positions, velocities, accelerations and forces of a given motion."""
    work, labels = Work(problem, motion, lay), ("screw", __version__, f"rule {problem.rule}")
    size = {"length": work.system.length, "mass": lay.mechanism.mass}
    solution = assemble(labels, len(motion), work.part, work.names, work.clock, progress, **size)
    return replace(solution, assembly=np.concatenate(work.assembly))


class Work:
    """What stays the same from part to part."""

    def __init__(self, problem: Problem, motion: GivenMotion, lay: Layout) -> None:
        self.problem, self.motion, self.lay, self.clock = problem, motion, lay, Clock()
        self.system = home_equations(lay)
        self.branch, self.assembly = self.system.follower(), list[Array]()
        self.path, self.tree = open_tree(lay)
        self.depth = stages(problem.wanted)
        self.reactions: Reactions | None = None

    def part(self, rows: slice) -> Part:
        motion = self.motion.part(rows)
        with self.clock.stage("positions"):
            at = positions(self.lay, motion.y, motion.t, (motion.yd, motion.ydd), path=self.branch)
        self.assembly.append(at.q)
        values, trust, A = self._beyond(at, motion)

        def again(doubtful: Rows, shake: Array) -> dict[str, Array]:
            q = at.q[doubtful]
            there = self.system.fill((q / self.system.size)[:, self.system.unknown] + shake, q)
            return self._beyond(there, motion.part(doubtful))[0]

        units = {name: units for name, (_, units) in self.names().items()}
        return examined(values, trust, A, motion.y.shape[1], again, self.clock, units, self.system.length)

    def _beyond(self, at: Pose, motion: GivenMotion) -> tuple[dict[str, Array], Trust, Array]:
        """All that is wanted from closed poses: values, what they rest on, and the closing system."""
        lay, wanted = self.lay, self.problem.wanted
        out, forces = {"joint_position": at.q}, dict[str, Array]()
        speed: Array | float = 0.0
        rush: Array | float = 0.0
        load: Array | float = 0.0
        if self.depth in "vaf":
            with self.clock.stage("velocities"):
                rate = velocities(lay, at, motion.yd)
            A, charts, system = rate.A, rate.orientation, rate.system
            out["joint_velocity"] = self._unlocked(rate.w, charts)
            out["body_angular_velocity"] = rate.V[:, 1:, :3].reshape(len(motion), -1)
            # a cut joint's own rates are no summands of anything else
            speed = np.abs(rate.w / self.system.size)[:, self.system.unknown].max(axis=1)
            if self.depth in "af":
                load = self._dynamics(rate, motion, out, forces)
                beta = np.abs(out["joint_acceleration"] / self.system.size)[:, self.system.unknown]
                rush = np.maximum(speed**2, beta.max(axis=1))
        else:
            system = self.system
            A, charts = system.matrix(at), system.readers(at)[1]
        with self.clock.stage("condition"):
            condition, amplified = gain(system, A)
            worst, stretch = charts.max(axis=1, initial=1.0), extent(lay).stretch
            trust = Trust(condition, amplified, worst, forces, speed, rush, load, stretch=stretch)
        return {name: array for name, array in out.items() if name in wanted}, trust, A

    def _unlocked(self, rates: Array, charts: Array) -> Array:
        """Rates of all joints without those of cut joints in gimbal lock, which are no numbers.

        Args:
            rates: Shape (n, n_q).
            charts: Condition number of the chart of each cut joint. Shape (n, n_cut).
        """
        locked = ~(charts <= linear.SINGULAR)
        if not locked.any():
            return rates
        out = rates.copy()
        for joint, rows in zip(self.lay.tree.cuts, locked.T, strict=True):
            out[np.ix_(rows, self.lay.columns[joint.name])] = np.nan
        return out

    def _dynamics(
        self, rate: Velocities, given: GivenMotion, out: dict[str, Array], conditions: dict[str, Array]
    ) -> Array | float:
        """Accelerations and forces; the largest force on a body [N], shape (n,), if forces are wanted, else 0."""
        lay, problem, n, ydd = self.lay, self.problem, len(given), given.ydd
        with self.clock.stage("accelerations"):
            joints, A = accelerations(lay, rate, ydd)
            out["joint_acceleration"] = self._unlocked(joints, rate.orientation)
            if problem.wanted <= _JOINTS:
                return 0.0
            motion = dynamics.body_motion(lay, rate.pose, rate.V, A)
        out["body_angular_acceleration"] = motion.beta.reshape(n, -1)
        out["com_acceleration"] = motion.a.reshape(n, -1)
        applied = problem.applied
        load: Array | float = 0.0
        if problem.wanted & {"tree_force", "tree_force_soft"}:
            with self.clock.stage("tree forces"):
                F, T = dynamics.required_wrench(lay, rate.pose, motion, applied.g, ())
                out["tree_force"] = out["tree_force_soft"] = self._tree_force(rate, motion, F, T)
                load = self._load(rate, motion, F, T)
        if self.depth != "f":
            return load
        with self.clock.stage("forces"):
            pulls, loads = springs.springs_and_motors(lay, rate, applied, given.t)
            F, T = dynamics.required_wrench(lay, rate.pose, motion, applied.g, (*applied.loads, *loads))
            if applied.springs or applied.motors:
                along = joint_wrenches(lay, rate.pose, motion.com, pulls).reshape(n, -1, 6)
                F, T = F - along[..., :3], T - along[..., 3:]
            self._forces(rate, motion, (F, T), out, conditions)
        return np.maximum(load, self._load(rate, motion, F, T))

    def _load(self, rate: Velocities, motion: dynamics.BodyMotion, F: Array, T: Array) -> Array:
        """Largest force along a coordinate, as if weights, inertia and bodies did not cancel [N]. Shape (n,)."""
        weight = self.lay.mechanism.masses[:, None] * self.problem.applied.g
        sizes = np.abs(screws.force(F, motion.com) + screws.couple(T))
        sizes += np.abs(screws.force(np.broadcast_to(weight, F.shape), motion.com))
        along = screws.reciprocal_product(np.einsum("bi,nbx->nix", np.abs(self.path), sizes), np.abs(rate.pose.S))
        return np.asarray((along * self.system.size)[:, self.tree].max(axis=1) / self.system.length)

    def _tree_force(self, rate: Velocities, motion: dynamics.BodyMotion, F: Array, T: Array) -> Array:
        """Power of the required wrenches on the unit motion of each joint of the tree."""
        wrench = screws.force(F, motion.com) + screws.couple(T)
        moved = np.einsum("bi,nbx->nix", self.path, wrench)
        return screws.reciprocal_product(moved, rate.pose.S)[:, self.tree]

    def _forces(
        self,
        rate: Velocities,
        motion: dynamics.BodyMotion,
        wrench: tuple[Array, Array],
        out: dict[str, Array],
        conditions: dict[str, Array],
    ) -> None:
        lay, problem, (F, T) = self.lay, self.problem, wrench
        Q = dynamics.generalized_force(lay, rate, motion, F, T)
        out["generalized_force"] = Q
        if not problem.wanted & {"actuator_force", "reaction"}:
            return
        B = rate.K[:, lay.mechanism.actuated_columns]
        f = dynamics.min_norm(B, Q)[0]
        size, mechanism = rate.system.size, lay.mechanism
        driven = B * size[mechanism.independent_columns] / size[mechanism.actuated_columns, None]
        # rounding of rates is that of the fastest coordinates, however slow the actuators are beside these
        slow = np.clip(np.linalg.norm(driven, axis=(1, 2)), 1e-12, 1.0)
        conditions["actuator_force"] = linear.condition(driven) / slow
        axial = problem.rule == "spherical_axial"
        if axial or "reaction" in problem.wanted:
            self.reactions = dynamics.joint_reactions(lay, rate.pose)
            c = dynamics.force_matrix(lay, rate.pose, motion.com, self.reactions)
            rule = dynamics.rule_rows(lay, rate.pose, B, self.reactions, axial=axial)
            units = self.reactions.units + lay.mechanism.actuator_units
            unknown, condition = dynamics.solve_newton_euler(c, F, T, rule, units, rate.system.length)
            conditions["reaction"] = condition
            if axial:
                conditions["actuator_force"] = condition
                f = unknown[:, len(self.reactions.names) :]
            out["reaction"] = unknown[:, : len(self.reactions.names)]
        out["actuator_force"] = f

    def names(self) -> Names:
        mechanism, found = self.lay.mechanism, self.reactions
        bodies, tree = [body.name for body in mechanism.bodies], [mechanism.coordinates[i] for i in self.tree]
        reactions = ((), ()) if found is None else (found.names, found.units)
        return component_names(
            mechanism.joints, bodies, mechanism.independent, tree, mechanism.actuator_names, reactions
        )


_FORCE = "actuator_force"


def solve_whole_system(lay: Layout, problem: Problem, task: GivenMotion, *, refined: bool) -> Solution:
    """Actuator forces of smallest norm from eqs. (57)-(58), all reactions being unknowns beside them.

    Args:
        refined: One step of iterative refinement, its residual from a wider matrix; see `wide_force_matrix`.

    Returns:
        ``actuator_force`` alone, and as estimate of its error the rounding times the condition of the system.
    """
    clock, applied, mechanism = Stopwatch(), problem.applied, lay.mechanism
    at = positions(lay, task.y, task.t, (task.yd, task.ydd))
    rate = velocities(lay, at, task.yd)
    motion = dynamics.body_motion(lay, at, rate.V, accelerations(lay, rate, task.ydd)[1])
    F, T = dynamics.required_wrench(lay, at, motion, applied.g, applied.loads)
    reactions = dynamics.joint_reactions(lay, at)
    c = dynamics.force_matrix(lay, at, motion.com, reactions)
    rule = dynamics.preload_rows(rate.K[:, mechanism.actuated_columns], c.shape[2])
    wide = wide_force_matrix(lay, task.y) if refined else None
    units = reactions.units + mechanism.actuator_units
    unknown, condition = dynamics.solve_newton_euler(c, F, T, rule, units, rate.system.length, wide=wide)
    f = np.asarray(unknown[:, len(reactions.names) :], dtype=float)
    return Solution(
        "screw",
        __version__,
        {_FORCE: Values(mechanism.actuator_names, mechanism.actuator_units, f)},
        condition,
        estimate={_FORCE: linear.EPS * condition},
        conditions={_FORCE: condition},
        setting="whole Newton-Euler system" + (", refined" if refined else ""),
        cost=clock.cost(),
    )
