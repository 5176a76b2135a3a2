"""A loaded model of an open-tree engine, which solves every kind of task.

For the task `States`, forces or accelerations are computed without first closing the loops.
"""

from __future__ import annotations

import numpy as np

from screwgauge.engines.kit.acting import resistance_force
from screwgauge.engines.kit.projection import min_norm
from screwgauge.engines.tree.applied_forces import TreeForces, applied_wrenches, resisting_joints
from screwgauge.engines.tree.closed_tree import ClosedTree
from screwgauge.engines.tree.inverse import solve_motion
from screwgauge.engines.tree.protocol import TreeDynamics
from screwgauge.models.files.loops import LoopsFile, read_loops
from screwgauge.problem import GivenMotion, InitialValue, ModelFiles, Problem, Progress, States, quiet
from screwgauge.quantities import FORCE, joint_units
from screwgauge.reference import linear
from screwgauge.reference.applied import Applied, JointSpring
from screwgauge.reference.closed.newton import velocity_map
from screwgauge.reference.errors import DescriptionError, ModelFileError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.solution import Error, Solution, Values, empty


def loops_file(files: ModelFiles) -> LoopsFile:
    """Read the loops file of a model.

    Raises:
        ModelFileError: The loops file is missing or cannot be read.
    """
    if files.loops is None:
        raise ModelFileError("has no loops file", str(files.model), "place NAME.loops.toml next to it")
    return read_loops(files.loops)


class TreeModel:
    """A loaded model of an open-tree engine.

    Attributes:
        dynamics: Dynamics of the engine; None if the engine solves only given motions.
    """

    def __init__(self, closed: ClosedTree, dynamics: TreeDynamics | None = None) -> None:
        self.closed, self.dynamics = closed, dynamics

    @property
    def independent(self) -> tuple[str, ...]:
        return tuple(self.closed.file.independent)

    def solve(self, problem: Problem, progress: Progress = quiet) -> Solution:
        """Solve a problem.

        Raises:
            ScrewgaugeError: The problem does not match the model, or cannot be solved.
        """
        closed, dynamics, task = self.closed, self.dynamics, problem.task
        self._check(problem)
        closed.tree.set_gravity(problem.applied.gravity)
        if isinstance(task, GivenMotion):
            return solve_motion(closed, problem, task, progress)
        if dynamics is None:
            raise ModelFileError("this engine supports only given motions", self._where, "choose another engine")
        if isinstance(task, InitialValue) or task.tau is not None:
            self._check_mass()
        if not isinstance(task, InitialValue):
            return solve_states(closed, dynamics, problem, task)
        from screwgauge.engines.tree.projected_stepper import ProjectedStepper
        from screwgauge.engines.tree.simulation import simulate, step_through

        if dynamics.dt is None:
            return simulate(closed, dynamics.mover(), problem, task, progress)
        stepper = dynamics.stepper(closed, problem, task)
        if stepper is None:
            forces = TreeForces(closed, problem.applied, task.start)
            stepper = ProjectedStepper(dynamics.mover(), forces, dynamics.integrator, dynamics.dt)
        return step_through(closed, stepper, problem, task, dynamics.dt, progress)

    @property
    def _where(self) -> str:
        return f"model of {self.closed.tree.engine}"

    def _check(self, problem: Problem) -> None:
        """Reject a problem that belongs to a different mechanism."""
        loops, task = self.closed.loops, problem.task
        for load in problem.applied.loads:
            if load.body not in loops.index and load.body != GROUND:
                raise ModelFileError(f"has no body '{load.body}'", self._where, "keep the names of the loops file")
        k = len(loops.independent)
        if isinstance(task, GivenMotion) and task.y.shape[1] != k:
            raise ModelFileError(
                f"has {k} independent coordinates, but the motion has {task.y.shape[1]}",
                self._where,
                "use a model of the same mechanism",
            )

    def _check_mass(self) -> None:
        """Reject a tree with massless branches, whose mass matrix is singular."""
        tree, heavy = self.closed.tree, {GROUND}
        above = dict(zip(tree.bodies, tree.parents, strict=True))
        for body, mass in zip(tree.bodies, tree.masses, strict=True):
            while mass and body not in heavy:
                heavy.add(body)
                body = above[body]
        if light := [body for body in tree.bodies if body not in heavy]:
            what = f"body '{light[0]}' and its subtree in the open tree have no mass, which {tree.engine} requires"
            raise ModelFileError(what, self._where, "use screw, or add mass")


def solve_states(closed: ClosedTree, dynamics: TreeDynamics, problem: Problem, task: States) -> Solution:
    """Solve for accelerations or forces in given states of the tree.

    Args:
        task: States with forces `tau` or accelerations `a`. From forces, accelerations are computed. From
            accelerations, the requested quantities are computed, which may be ``tree_force``, ``tree_force_soft`` and
            minimum-norm ``actuator_force``.

    Raises:
        ModelFileError: The coordinates differ from the tree's, or the task lacks exactly one of `a` and `tau`.
        DescriptionError: Forces are given, and the problem also has loads, motors, or springs that are not along tree
            coordinates; or a joint outside the tree has damping or friction.
    """
    tree = closed.tree
    if set(task.coordinates) != set(tree.coordinates) or (task.a is None) == (task.tau is None):
        what = "expected states of the tree coordinates with either accelerations or forces"
        raise ModelFileError(what, f"model of {tree.engine}", "pass q, v and either a or tau")
    into = [task.coordinates.index(name) for name in tree.coordinates]
    out = [tree.coordinates.index(name) for name in task.coordinates]
    q, v = task.q[:, into], task.v[:, into]
    unit = joint_units(closed.file.joints)
    force_units, nothing = tuple(FORCE[unit[name]] for name in task.coordinates), empty(len(q))
    if task.tau is not None:
        tau = task.tau[:, into] - _resistance(closed, v)
        answer = dynamics.accelerate(q, v, tau, _springs(closed, problem.applied))
        units = tuple(f"{unit[name]}/s^2" for name in task.coordinates)
        return Solution(
            tree.engine,
            tree.version,
            {"joint_acceleration": Values(task.coordinates, units, answer.a[:, out])},
            nothing if answer.condition is None else answer.condition,
            setting=dynamics.setting,
            errors={
                name: Error(np.zeros(len(q)), dict.fromkeys(units, size)) for name, size in answer.tolerances.items()
            },
            notes=answer.notes,
            cost=answer.cost,
        )
    assert task.a is not None
    a, wanted, condition = task.a[:, into], problem.wanted, nothing
    values: dict[str, Values] = {}
    if "tree_force_soft" in wanted:
        soft = tree.soft_force(q, v, a, np.zeros(3))[0]
        values["tree_force_soft"] = Values(task.coordinates, force_units, soft[:, out])
    if wanted & {"tree_force", "actuator_force"}:
        tau = tree.soft_force(q, v, a, np.zeros(3))[0] if dynamics.naive else tree.tree_force(q, v, a)
        if "tree_force" in wanted:
            values["tree_force"] = Values(task.coordinates, force_units, tau[:, out])
        if "actuator_force" in wanted:
            f, condition = _actuator_forces(closed, dynamics, problem, q, tau + _resistance(closed, v))
            units = tuple(FORCE[unit[tree.coordinates[i]]] for i in closed.driven)
            values["actuator_force"] = Values(closed.actuators, units, f)
    return Solution(tree.engine, tree.version, values, condition, setting=dynamics.setting)


def _resistance(closed: ClosedTree, v: Array) -> Array:
    """Return forces of damping and dry friction along the tree coordinates. Shape (n, n_v)."""
    total, tree = np.zeros_like(v), closed.tree
    for one in resisting_joints(closed):
        if one.coordinate not in tree.coordinates:
            what = f"states cannot include {one.what} of '{one.coordinate}', which is not a tree coordinate"
            raise DescriptionError(what, f"model of {tree.engine}", "add it to the forces along the coordinates")
        column = tree.coordinates.index(one.coordinate)
        total[:, column] += resistance_force(one, v[:, column])
    return total


def _springs(closed: ClosedTree, applied: Applied) -> list[JointSpring]:
    springs = [s for s in applied.springs if isinstance(s, JointSpring) and s.coordinate in closed.tree.coordinates]
    if len(springs) < len(applied.springs) or applied.loads or applied.motors:
        raise DescriptionError(
            "besides the given forces, states can include only gravity and springs along tree coordinates",
            f"model of {closed.tree.engine}",
            "include other forces in the forces along the coordinates",
        )
    return springs


def _actuator_forces(
    closed: ClosedTree, dynamics: TreeDynamics, problem: Problem, q: Array, tau: Array
) -> tuple[Array, Array]:
    """Return minimum-norm actuator forces that, with the loads, produce the open tree's joint forces `tau`.

    Returns:
        Actuator forces, shape (n, n_actuator), and the condition number of the closing rows, (n,).
    """
    at = closed.tree.poses(q)
    still, joints = np.zeros((*at.p.shape[:2], 6)), np.zeros((len(q), len(closed.names)))
    applied = Applied(loads=problem.applied.loads)
    loads, _ = applied_wrenches(closed, applied, at, (np.zeros(len(q)), still, joints, joints))
    need = tau - at.forces_along(loads)
    if dynamics.naive:  # forces along the actuated joints, used as actuator forces
        return need[:, closed.driven], empty(len(q))
    A = closed.closing_rows(q, at, closed.loops.charts(at))
    K = velocity_map(A, len(closed.loops.independent))
    Q = (K.swapaxes(1, 2) @ need[..., None])[..., 0]
    return min_norm(K[:, closed.driven], Q)[0], linear.condition(A)
