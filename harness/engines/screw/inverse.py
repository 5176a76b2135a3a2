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
from screwgauge.quantities import GIVEN, QUANTITIES
from screwgauge.reference import dynamics, linear
from screwgauge.reference.closed.resting import home_equations
from screwgauge.reference.equations import dynamics as equations
from screwgauge.reference.equations.closure import Loops
from screwgauge.reference.equations.dynamics import Dynamics
from screwgauge.reference.equations.kinematics import coordinates
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.equations.reactions import reaction_names
from screwgauge.reference.equations.rounding import chart_condition, extent, gain
from screwgauge.reference.equations.screws import force, power
from screwgauge.reference.kinematics import accelerations, positions, velocities
from screwgauge.reference.layout import Layout
from screwgauge.reference.precision import wide_force_matrix
from screwgauge.reference.rotations import Array
from screwgauge.solution import Clock, Solution, Stopwatch, Values

_STAGES = {"q": "positions", "v": "velocities", "a": "accelerations", "f": "forces"}
_JOINTS = frozenset({"joint_position", "joint_velocity", "joint_acceleration"})
_TREE = frozenset({"tree_force", "tree_force_soft"})


def solve_motion(lay: Layout, problem: Problem, motion: GivenMotion, progress: Progress) -> Solution:
    """Positions, velocities, accelerations and forces of a given motion."""
    work, labels = Work(problem, motion, lay), ("screw", __version__, f"rule {problem.rule}")
    size = {"length": work.system.length, "mass": lay.mechanism.mass}
    solution = assemble(labels, len(motion), work.part, work.names, work.clock, progress, **size)
    return replace(solution, assembly=np.concatenate(work.assembly))


def _stage(name: str) -> str:
    """The stage of the work in which a quantity is computed."""
    return "tree forces" if name in _TREE else _STAGES[QUANTITIES[name].needs]


class Work:
    """What stays the same from part to part.

    Attributes:
        assembly: Joint coordinates, part by part.
    """

    def __init__(self, problem: Problem, motion: GivenMotion, lay: Layout) -> None:
        self.problem, self.motion, self.lay, self.clock = problem, motion, lay, Clock()
        self.system = home_equations(lay)
        self.loops = Loops(lay, self.system.fixed)
        self.branch, self.assembly = self.system.follower(), list[Array]()
        self.path, self.tree = open_tree(lay)
        self.depth = stages(problem.wanted)

    def part(self, rows: slice) -> Part:
        motion = self.motion.part(rows)
        with self.clock.stage("positions"):
            at = positions(self.lay, motion.y, motion.t, (motion.yd, motion.ydd), path=self.branch)
        self.assembly.append(at.q)
        values, trust, A = self._beyond(at.q, motion)

        def again(doubtful: Rows, shake: Array) -> dict[str, Array]:
            q, moving = at.q[doubtful], self.loops.columns[: self.loops.moving]
            q[:, moving] += shake * self.loops.sizes[moving]
            return self._beyond(q, motion.part(doubtful))[0]

        units = {name: units for name, (_, units) in self.names().items()}
        return examined(values, trust, A, motion.y.shape[1], again, self.clock, units, self.loops.length)

    def _beyond(self, q: Array, motion: GivenMotion) -> tuple[dict[str, Array], Trust, Array]:
        """All that is wanted at closed poses: values, what they rest on, and the closing system."""
        loops, problem = self.loops, self.problem
        with self.clock.stage("velocities"):
            pose = coordinates(q, NUMPY)
            at = Dynamics(loops, pose, motion.yd, motion.ydd, loops.folds(q), NUMPY, problem.applied)
            at.t, at.axial = motion.t, problem.rule == "spherical_axial"
            at.near = {c: q[:, c] for c in self.lay.cut_columns if self.lay.turns[c]}
            charts = np.stack([chart_condition(cut) + np.zeros(len(q)) for cut in at.cuts] or [np.ones(len(q))], axis=1)
        out, conditions = dict[str, Array](), dict[str, Array]()
        moving = loops.columns[: loops.moving]
        speed: Array | float = 0.0
        rush: Array | float = 0.0
        load: Array | float = 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.depth in "vaf":
                speed = np.abs(at.w / loops.sizes)[:, moving].max(axis=1)
            if self.depth in "af":
                with self.clock.stage("accelerations"):
                    rush = np.maximum(speed**2, np.abs(at.beta / loops.sizes)[:, moving].max(axis=1))
            for name in (one for one in GIVEN if one in problem.wanted):
                with self.clock.stage(_stage(name)):
                    out[name] = self._value(at, name, charts)
            if self.depth == "f" or problem.wanted & _TREE:
                load = self._load(at)
            self._force_conditions(at, conditions)
        with self.clock.stage("condition"):
            worst, stretch = charts.max(axis=1), extent(self.lay).stretch
            amplified = np.sqrt(gain(at))
            amplified = np.where(np.isfinite(at.system.condition), amplified, at.system.condition)
            trust = Trust(at.system.condition, amplified, worst, conditions, speed, rush, load, stretch=stretch)
        return out, trust, at.system.A[..., : loops.moving]

    def _value(self, at: Dynamics, name: str, charts: Array) -> Array:
        if name in _TREE:
            return np.ascontiguousarray(at.open_tree_force(self.path)[:, self.tree])
        found = np.array(equations.QUANTITIES[name](at))
        if name in _JOINTS:  # in gimbal lock the joint's angles are what they were followed as, its rates no numbers
            for cut, locked in zip(at.cuts, ~(charts.T <= linear.SINGULAR), strict=False):
                some = np.ix_(locked, self.lay.columns[cut.at.joint.name])
                found[some] = at.q[some] if name == "joint_position" else np.nan
        return found

    def _load(self, at: Dynamics) -> Array:
        """Largest force along a coordinate, as if weights, inertia and bodies did not cancel [N]. Shape (n,)."""
        weight = self.lay.mechanism.masses[:, None] * self.problem.applied.g
        need = at.required if self.problem.wanted <= _TREE else at.required - at.exerted.wrenches
        sizes = np.abs(need[:, 1:]) + np.abs(force(np.broadcast_to(weight, at.com.shape), at.com))
        along = power(np.abs(self.path).T @ sizes, np.abs(at.screws))
        return np.asarray((along * self.loops.sizes)[:, self.tree].max(axis=1) / self.loops.length)

    def _force_conditions(self, at: Dynamics, conditions: dict[str, Array]) -> None:
        """Condition numbers of the systems that forces are solved from."""
        wanted, mechanism, sizes = self.problem.wanted, self.lay.mechanism, self.loops.sizes
        if not wanted & {"actuator_force", "reaction"}:
            return
        driven = at.B * sizes[mechanism.independent_columns] / sizes[mechanism.actuated_columns, None]
        # rounding of rates is that of the fastest coordinates, however slow the actuators are beside these
        slow = np.clip(np.linalg.norm(driven, axis=(1, 2)), 1e-12, 1.0)
        conditions["actuator_force"] = linear.condition(driven) / slow
        if at.line is not None:
            conditions["actuator_force"] = np.maximum(at.drive.condition, at.system.whole_condition)
        if "reaction" in wanted:
            conditions["reaction"] = np.maximum(at.system.whole_condition, conditions["actuator_force"])

    def names(self) -> Names:
        mechanism = self.lay.mechanism
        bodies, tree = [body.name for body in mechanism.bodies], [mechanism.coordinates[i] for i in self.tree]
        names, units = zip(*reaction_names(mechanism), strict=True) if reaction_names(mechanism) else ((), ())
        return component_names(
            mechanism.joints, bodies, mechanism.independent, tree, mechanism.actuator_names, (names, units)
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
