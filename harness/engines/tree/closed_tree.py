"""From an engine's open tree to the closed mechanism: positions, rates, accelerations, forces.

The numbers come from the engine (poses, Jacobians, accelerations, inverse dynamics, transmitted wrenches); the
linear algebra that closes the loops and projects the forces is this module's, and the same for every tree engine.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwgauge.engines.estimate import Part, Trust, examined, gain, shakes
from screwgauge.engines.parts import Clock, Names, assemble, component_names, stages
from screwgauge.engines.tree.closed_forces import SetOut, closed_forces
from screwgauge.engines.tree.closure import Loops, check_names, make_loops
from screwgauge.engines.tree.cut_joints import Chart, nearest_turn, unwrapped
from screwgauge.engines.tree.protocol import BodyPoses, Tree
from screwgauge.engines.tree.sizes import make_sizes
from screwgauge.models.loops import LoopsFile
from screwgauge.problem import Motion, OldProblem, Rows
from screwgauge.reference import linear
from screwgauge.reference.continuation import check_closed, corrector, follow, newton, partial_rates
from screwgauge.reference.mechanism import actuator_names
from screwgauge.reference.rotations import Array
from screwgauge.reference.wrenches import State
from screwgauge.solution import Solution


def solve_tree(problem: OldProblem, tree: Tree, file: LoopsFile) -> Solution:
    """Solves a problem with an engine's open tree."""
    work = _Work(problem, tree, file)
    solution = assemble(
        tree.engine,
        tree.version,
        work.setting,
        problem.motion,
        work.part,
        work.names,
        work.clock,
        problem.progress,
        length=work.sizes.length,
    )
    return replace(solution, tolerances=work.tolerances)


class _Work:
    """What stays the same from part to part, and where the path of poses has got to."""

    def __init__(self, problem: OldProblem, tree: Tree, file: LoopsFile) -> None:
        self.problem, self.tree, self.file, self.clock = problem, tree, file, Clock()
        check_names(tree, file, [load.body for load in problem.loads])
        self.loops: Loops = make_loops(tree, file)
        self.depth = stages(problem.quantities)
        self.setting = f"{file.cut} cut, rule {problem.rule}"
        home = {name: value for j in file.joints for name, value in zip(j.coordinates, j.home, strict=True)}
        self.q = np.array([home[name] for name in tree.coordinates])
        self.y = np.array([home[name] for name in file.independent.values()])
        # angles of cut joints at the last sample
        self.cut = {joint.name: self.loops.begin(joint, problem.motion.y[0]) for joint in self.loops.cut}
        self.reaction_names: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
        self.sizes = make_sizes(tree, file, self.loops, self.q)
        self.set_out = SetOut(problem, tree, file, self.loops, self.sizes)
        self.tolerances: dict[str, float] = {}

    def part(self, rows: slice) -> Part:
        motion = self.problem.motion.part(rows)
        with self.clock.stage("positions"):
            q, A = self._positions(motion)
            at = self.tree.poses(q)
            charts = self.loops.charts(at)
            given = {joint for _, joint, _ in self.loops.independent}
            cut = {name: unwrapped(self.cut[name], c, name in given) for name, c in charts.items()}
            self.cut = {name: angles[-1] for name, angles in cut.items()}
            charts = {name: c.near(cut[name]) for name, c in charts.items()}
        values, trust = self._beyond(motion, q, at, charts, cut, A)

        def again(doubtful: Rows) -> list[dict[str, Array]]:
            own, self.clock = self.clock, Clock()
            here = motion.part(doubtful)
            found = []
            for shake in shakes(A[doubtful], motion.y.shape[1]):
                there = q[doubtful] + shake * self.sizes.q
                moved = self.tree.poses(there)
                read = {name: c.near(cut[name][doubtful]) for name, c in self.loops.charts(moved).items()}
                near = {name: c.q for name, c in read.items()}
                matrix = self._scaled(there / self.sizes.q, here.y / self.sizes.y)[1]
                found.append(self._beyond(here, there, moved, read, near, matrix)[0])
            self.clock = own
            return found

        with self.clock.stage("error estimate"):
            return examined(values, trust, again)

    def _beyond(
        self,
        motion: Motion,
        q: Array,
        at: BodyPoses,
        charts: dict[str, Chart],
        cut: dict[str, Array],
        A: Array,
    ) -> tuple[dict[str, Array], Trust]:
        """All that is wanted from closed poses, and what it rests on."""
        out, forces = {"joint_position": self._joints(q, cut)}, dict[str, Array]()
        speed = load = None
        if self.depth in "vaf":
            speed, load = self._rates(motion, q, at, charts, A, out, forces)
        with self.clock.stage("condition"):
            condition = linear.condition(A)
            worst = np.max([chart.condition for chart in charts.values()], axis=0, initial=1.0)
            trust = Trust(condition, gain(A, condition), np.broadcast_to(worst, len(q)), forces, speed, load)
        return {name: array for name, array in out.items() if name in self.problem.quantities}, trust

    def _rates(
        self,
        motion: Motion,
        q: Array,
        at: BodyPoses,
        charts: dict[str, Chart],
        A: Array,
        out: dict[str, Array],
        forces: dict[str, Array],
    ) -> tuple[Array, Array | None]:
        """Rates from ``A v = [0; yd]``, then whatever is wanted beyond them.

        Returns:
            Largest rate and, if forces are wanted, largest force [N], both without regard to the kind of joint.
        """
        sizes = self.sizes
        with self.clock.stage("velocities"):
            K = partial_rates(A, motion.y.shape[1]) * sizes.q[:, None] / sizes.y
            v = (K @ motion.yd[..., None])[..., 0]
            J = {joint.name: self.loops.relative(joint, at.J) for joint in self.loops.cut}
            cut_v = {name: (chart.rates(J[name]) @ v[..., None])[..., 0] for name, chart in charts.items()}
            out["joint_velocity"] = self._joints(v, cut_v)
            bodies = [self.loops.index[name] for name in self.file.bodies]
            out["body_angular_velocity"] = (at.J[:, bodies, :3] @ v[:, None, :, None]).reshape(len(v), -1)
        speed = np.abs(v / sizes.q).max(axis=1)
        if self.depth not in "af":
            return speed, None
        with self.clock.stage("accelerations"):
            a = self._accelerations(motion, at, charts, cut_v, A, (q, v), out)
        return speed, self._forces(motion.t, at, A, K, (q, v, a), out, forces)

    def _evaluate(self, q: Array, y: Array) -> tuple[Array, Array]:
        """Closing errors over y, and their derivative."""
        at = self.tree.poses(q)
        charts = self.loops.charts(at)
        for k, (_, name, i) in enumerate(self.loops.independent):
            if name:
                charts[name] = charts[name].agreeing(i, y[:, k])
        errors, rows = [self.loops.gaps(at)], [self.loops.jacobian(at)]
        rate_rows = {joint.name: charts[joint.name].rates(self.loops.relative(joint, at.J)) for joint in self.loops.cut}
        for k, (column, joint, i) in enumerate(self.loops.independent):
            if column is None:
                value, row = charts[joint].q[:, i], rate_rows[joint][:, i]
                difference = np.remainder(value - y[:, k] + np.pi, 2 * np.pi) - np.pi  # an angle, read within a turn
            else:
                difference, row = q[:, column] - y[:, k], np.tile(np.eye(q.shape[1])[column], (len(q), 1))
            errors.append(difference[:, None])
            rows.append(row[:, None])
        return np.concatenate(errors, axis=1), np.concatenate(rows, axis=1)

    def _scaled(self, z: Array, y: Array) -> tuple[Array, Array]:
        """The same without dimension."""
        sizes = self.sizes
        error, rows = self._evaluate(z * sizes.q, y * sizes.y)
        return error / sizes.rows, rows * sizes.q / sizes.rows[:, None]

    def _positions(self, motion: Motion) -> tuple[Array, Array]:
        sizes = self.sizes
        goal = motion.y / sizes.y
        start = follow(corrector(self._scaled), self.q / sizes.q, self.y / sizes.y, goal, motion.t, size=sizes.y)
        z, A, error = newton(self._scaled, start, goal)
        check_closed(error, motion.y, motion.t)
        turning = sizes.turning  # next to a chart lock Newton's method may turn a joint right round
        z[:, turning] = nearest_turn(z[:, turning], start[:, turning])
        q = z * sizes.q
        self.q, self.y, self.gap = q[-1], motion.y[-1], float(error.max()) * max(1.0, sizes.length)
        return q, A

    def _joints(self, tree_values: Array, cut_values: dict[str, Array]) -> Array:
        """All joint coordinates, in the order of the description."""
        columns = []
        for joint in self.file.joints:
            for i, name in enumerate(joint.coordinates):
                if joint.name in cut_values:
                    columns.append(cut_values[joint.name][:, i])
                else:
                    columns.append(tree_values[:, self.tree.coordinates.index(name)])
        return np.stack(columns, axis=1)

    def _accelerations(
        self,
        motion: Motion,
        at: BodyPoses,
        charts: dict[str, Chart],
        cut_v: dict[str, Array],
        A: Array,
        qv: tuple[Array, Array],
        out: dict[str, Array],
    ) -> Array:
        """Joint accelerations from ``A a = [-Jdot v; ydd - bias]``, with the engine's own Jdot v."""
        q, v = qv
        V, bias = self.tree.accelerations(q, v, np.zeros_like(v))
        right = np.concatenate([-self.loops.bias(at, V, bias), motion.ydd], axis=1)
        for k, (column, name, i) in enumerate(self.loops.independent):
            if column is None:
                right[:, k - motion.y.shape[1]] -= self._cut_bias(charts[name], name, cut_v[name], V, bias)[:, i]
        a = linear.solve(A, (right / self.sizes.rows)[..., None])[..., 0] * self.sizes.q
        wanted, bodies = self.problem.quantities, [self.loops.index[name] for name in self.file.bodies]
        if "com_acceleration" in wanted:
            com = self.tree.com_accelerations(q, v, a)
            out["com_acceleration"] = com[:, [b - 1 for b in bodies]].reshape(len(v), -1)
        if not wanted & {"joint_acceleration", "body_angular_acceleration", "tree_force_soft"}:
            return a
        V, acceleration = self.tree.accelerations(q, v, a)
        cut_a = {name: self._cut_bias(charts[name], name, cut_v[name], V, acceleration) for name in charts}
        out["joint_acceleration"] = self._joints(a, cut_a)
        out["body_angular_acceleration"] = acceleration[:, bodies, :3].reshape(len(v), -1)
        if "tree_force_soft" in wanted:
            self._measure(at, v, V, acceleration)
        return a

    def _measure(self, at: BodyPoses, v: Array, V: Array, acceleration: Array) -> None:
        """Largest closure residual of position, rate and acceleration, which a stiff constraint turns into force."""
        rate = self.loops.jacobian(at) @ v[..., None]
        residual = self.loops.bias(at, V, acceleration)
        measured = np.array([self.gap, np.abs(rate).max(initial=0.0), np.abs(residual).max(initial=0.0)])
        # an engine's own evaluation of the same rows rounds differently
        sizes = [np.abs(array).max(initial=0.0) for array in (at.p, V, acceleration)]
        self.residuals = measured + 8 * linear.EPS * np.array(sizes)

    def _cut_bias(self, chart: Chart, name: str, rates: Array, V: Array, A: Array) -> Array:
        joint = next(joint for joint in self.loops.cut if joint.name == name)
        omega_parent = V[:, self.loops.index[joint.parent], :3]
        return chart.bias(rates, omega_parent, self.loops.relative(joint, V), self.loops.relative(joint, A))

    def _forces(
        self,
        t: Array,
        at: BodyPoses,
        A: Array,
        K: Array,
        qva: tuple[Array, Array, Array],
        out: dict[str, Array],
        conditions: dict[str, Array],
    ) -> Array | None:
        wanted, order = self.problem.quantities, [self.tree.coordinates.index(n) for n in self._tree_names()]
        if "tree_force" in wanted or self.depth == "f":
            with self.clock.stage("tree forces"):
                tau = self.tree.tree_force(*qva)
            out["tree_force"] = tau[:, order]
        if "tree_force_soft" in wanted:
            with self.clock.stage("soft tree forces"):
                soft, tolerance = self.tree.soft_force(*qva, self.residuals)
                out["tree_force_soft"] = soft[:, order]
                known = self.tolerances.get("tree_force_soft", 0.0)
                self.tolerances["tree_force_soft"] = max(known, tolerance)
        if self.depth != "f":
            return None
        with self.clock.stage("forces"):
            V = (at.J @ qva[1][:, None, :, None])[..., 0]
            state = State(t, at.R, at.p, V, out["joint_position"], out["joint_velocity"])
            found = closed_forces(self.set_out, at, A, K, (*qva, tau), state)
        out |= found.values
        conditions |= found.conditions
        self.reaction_names = found.reactions or self.reaction_names
        return found.largest

    def _tree_names(self) -> list[str]:
        """Coordinates of the tree in the order of the description."""
        return [name for j in self.file.joints for name in j.coordinates if name in self.tree.coordinates]

    def names(self) -> Names:
        return component_names(
            self.file.joints,
            self.file.bodies,
            self.file.independent,
            self._tree_names(),
            actuator_names(self.file.joints),
            self.reaction_names,
        )
