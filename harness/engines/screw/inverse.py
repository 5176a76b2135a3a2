"""Solves given motions for the engine `screw`, part by part, with the solver of `screwgauge.reference`."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from screwgauge import __version__
from screwgauge.engines.chunks import assemble
from screwgauge.engines.error_estimate import SolvedPart, Trust, amplification, examine_part
from screwgauge.engines.screw.programs import undriven_columns
from screwgauge.models.layout import open_tree
from screwgauge.problem import GivenMotion, Problem, Progress, Rows
from screwgauge.quantities import ACTUATED, OF_MOTION, QUANTITIES, Names, component_names, stages
from screwgauge.reference import linear
from screwgauge.reference.closed.assembly_mode import AssemblyMode
from screwgauge.reference.closed.continuation import Poses
from screwgauge.reference.closed.loops import read
from screwgauge.reference.closed_motion import ClosedMotion
from screwgauge.reference.equations import dynamics as equations
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.forward import Forward
from screwgauge.reference.equations.joint_types import reaction_names
from screwgauge.reference.equations.recursion import at_origin
from screwgauge.reference.equations.rounding import gain, idle_rounding, stretch
from screwgauge.reference.equations.screws import force, power, times
from screwgauge.reference.graph import Layout
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Solution

_STAGES = {"q": "positions", "v": "velocities", "a": "accelerations", "f": "forces"}
_TREE = frozenset({"tree_force", "tree_force_soft"})


def solve_motion(lay: Layout, problem: Problem, motion: GivenMotion, progress: Progress) -> Solution:
    """Solve a given motion for positions, velocities, accelerations and forces."""
    work, labels = Work(lay, problem), ("screw", __version__, f"rule {problem.rule}")

    def part(rows: slice) -> SolvedPart:
        some = motion.part(rows)
        return work.part(some, work.close(some, work.predict(some)))

    size = work.loops.length, lay.mechanism.mass
    return assemble(labels, len(motion), part, work.names, work.clock, progress, size)


def _stage(name: str) -> str:
    """Return the name of the stage in which a quantity is computed."""
    return "tree forces" if name in _TREE else _STAGES[QUANTITIES[name].needs]


class Work:
    """Array solver for given motions, with the data common to all parts of a motion.

    Attributes:
        mode: Assembly mode, used to predict and close poses.
        clock: Measures the time spent in each stage.
    """

    def __init__(self, lay: Layout, problem: Problem, clock: Clock | None = None) -> None:
        self.problem, self.lay, self.clock, self.mode = problem, lay, clock or Clock(), AssemblyMode(lay)
        self.loops = self.mode.system
        self.path, self.tree = open_tree(lay)
        self.depth = stages(problem.wanted)
        self.idle, self.resting = undriven_columns(lay, problem)

    def predict(self, motion: GivenMotion) -> Poses:
        """Predict the poses of the next samples."""
        with self.clock.stage("positions"):
            return self.mode.predict(motion.y, motion.t, (motion.yd, motion.ydd), motion.drive)

    def close(self, motion: GivenMotion, poses: Poses) -> Array:
        """Close predicted poses; return their joint coordinates. Shape (n, n_q)."""
        with self.clock.stage("positions"):
            return self.mode.close(poses)

    def with_loads(self, loads: Array | None) -> Work:
        """Return a copy that uses the given force and torque of each load at each sample. Shape (6 n_load, n)."""
        if loads is None:
            return self
        each = np.split(loads.T, len(loads) // 3, axis=1)
        some = tuple(
            replace(load, force=force, torque=torque, courses=())
            for load, force, torque in zip(self.problem.applied.loads, each[::2], each[1::2], strict=True)
        )
        other = copy(self)
        other.problem = replace(self.problem, applied=replace(self.problem.applied, loads=some))
        return other

    def part(self, motion: GivenMotion, closed: Array) -> SolvedPart:
        """Compute all requested quantities at closed poses, given by coordinates `closed`, shape (n, n_q)."""
        values, trust, A = self.evaluate(closed, motion)

        def solve_perturbed(doubtful: Rows, shake: Array) -> dict[str, Array]:
            return self.perturbed_values(closed[doubtful], motion.part(doubtful), shake)

        units = {name: units for name, (_, units) in self.names().items()}
        part = examine_part(values, trust, A, motion.y.shape[1], solve_perturbed, self.clock, units, self.loops.length)
        return replace(part, q=closed)

    def perturbed_values(self, closed: Array, motion: GivenMotion, shake: Array) -> dict[str, Array]:
        """Return values at poses perturbed by `shake` in dimensionless unknowns. Shapes (n, n_q), (n, n_unknown)."""
        q, moving = closed.copy(), self.loops.unknown
        q[:, moving] += shake * self.loops.sizes[moving]
        return self.evaluate(read(self.lay, q), motion)[0]

    def evaluate(self, q: Array, motion: GivenMotion) -> tuple[dict[str, Array], Trust, Array]:
        """Compute the requested quantities at closed poses, with their error data and the closing system."""
        loops, problem = self.loops, self.problem
        with self.clock.stage("velocities"):
            at = ClosedMotion(loops, q, motion.yd, motion.ydd, problem.applied, motion.t)
            at.axial, at.points = problem.rule == "spherical_axial", problem.points
            at.idle, at.resting = self.idle, self.resting
        out, conditions = dict[str, Array](), dict[str, Array]()
        moving = loops.unknown
        speed: Array | float = 0.0
        rush: Array | float = 0.0
        load: Array | float = 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.depth in "vaf":
                speed = np.abs(at.w / loops.sizes)[:, moving].max(axis=1)
            if self.depth in "af":
                with self.clock.stage("accelerations"):
                    rush = np.maximum(speed**2, np.abs(at.beta / loops.sizes)[:, moving].max(axis=1))
            for name in (one for one in OF_MOTION if one in problem.wanted):
                with self.clock.stage(_stage(name)):
                    out[name] = self._value(at, name)
            if self.depth == "f" or problem.wanted & _TREE:
                load = self._load(at)
            self._force_conditions(at, conditions)
        with self.clock.stage("condition"):
            worst = at.charts.max(axis=1, initial=1.0)
            norm = np.sqrt(gain(at))
            norm = np.where(np.isfinite(at.system.condition), norm, at.system.condition)
            trust = Trust(at.system.condition, norm, worst, conditions, speed, rush, load, stretch=stretch(self.lay))
            trust = self._with_idle(at, trust) if at.idle and self.depth in "af" else trust
        return out, trust, at.system.A[..., : loops.moving]

    def _value(self, at: Forward, name: str) -> Array:
        if name in _TREE:
            return np.ascontiguousarray(at.open_tree_force(self.path)[:, self.tree])
        if name == "mass_matrix":
            return np.array(at.inertia_matrix[(..., *np.triu_indices(at.yd.shape[-1]))])
        return np.array(equations.QUANTITIES[name](at))

    def _load(self, at: Dynamics) -> Array:
        """Return the largest force along a coordinate, assuming that no terms cancel [N]. Shape (n,)."""
        weight = self.lay.mechanism.masses[:, None] * self.problem.applied.g
        need = at.required if self.problem.wanted <= _TREE else at.required - at.applied_wrenches
        sizes = np.abs(at_origin(at.pose, need)[:, 1:]) + np.abs(force(np.broadcast_to(weight, at.com.shape), at.com))
        along = power(np.abs(self.path).T @ sizes, np.abs(at.screws))
        return np.asarray((along * self.loops.sizes)[:, self.tree].max(axis=1) / self.loops.length)

    def _force_conditions(self, at: Dynamics, conditions: dict[str, Array]) -> None:
        """Add the condition numbers of the force systems."""
        wanted, mechanism, sizes = self.problem.wanted, self.lay.mechanism, self.loops.sizes
        if not wanted & ACTUATED:
            return
        driven = at.B * sizes[mechanism.independent_columns] / sizes[mechanism.actuated_columns, None]
        driven = driven[..., at.driven]
        # rounding of rates scales with the fastest coordinates, however slow the actuators are
        slow = np.clip(np.linalg.norm(driven, axis=(1, 2)), 1e-12, 1.0)
        conditions["jacobian"] = conditions["actuator_force"] = linear.condition(driven) / slow
        if at.line is not None:
            conditions["actuator_force"] = np.maximum(at.drive.condition, at.system.whole_condition)
        conditions["axis_moment"] = conditions["actuator_force"]
        if "reaction" in wanted:
            conditions["reaction"] = np.maximum(at.system.whole_condition, conditions["actuator_force"])

    def _with_idle(self, at: Forward, trust: Trust) -> Trust:
        """Extend the error data for idle coordinates, in whose accelerations large terms may cancel."""
        mechanism, sizes, idle, L = self.lay.mechanism, self.loops.sizes, [*at.idle], self.loops.length
        errors = idle_rounding(at) * sizes[mechanism.independent_columns][idle]
        v, w = (np.linalg.norm(part[:, idle], axis=-1) for part in at.partial_motion)
        moved, turned = ((part * errors[..., None]).sum(1) for part in (v, w))
        joints = times(np.nan_to_num(np.abs(at.joint_map[..., idle] / sizes[:, None])), errors)
        pushed = np.maximum(mechanism.masses * moved, np.trace(mechanism.inertias, axis1=1, axis2=2) * turned / L)
        rounded = {
            "joint_acceleration": joints.max(1),
            "body_angular_acceleration": turned.max(1),
            "com_acceleration": moved.max(1) / L,
        }
        rushes = {name: np.maximum(trust.rush, one / amplification(name, trust)) for name, one in rounded.items()}
        forces = {name for name in self.problem.wanted if QUANTITIES[name].needs == "f" or name in _TREE}
        load = np.maximum(trust.load, pushed.max(1) / np.maximum(trust.stretch * trust.gain**3, 1.0))
        return replace(trust, rushes=rushes, load=load if forces else trust.load)

    def names(self) -> Names:
        mechanism = self.lay.mechanism
        bodies, tree = [body.name for body in mechanism.bodies], [mechanism.coordinates[i] for i in self.tree]
        reactions, actuators = reaction_names(mechanism.joints, mechanism.couplings), mechanism.actuator_names
        named = mechanism.joints, bodies, mechanism.independent, tree, actuators, reactions
        return component_names(*named, points=self.problem.points)
