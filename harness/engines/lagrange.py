"""The engine `lagrange`: Lagrange's equations of all joint coordinates, a second opinion that shares no formulation.

They are made of positions of bodies alone. Time derivatives are taken by forward mode. One reverse sweep of the virtual
work of inertia, weight, loads and multipliers gives the equations of the coordinates, and those of six virtual
displacements at each joint of the tree, which are what that joint transmits. There are no twists, recursions, or charts
of joints that close loops.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from importlib.metadata import version
from typing import Any

import numpy as np

import screwgauge.plugins as kit

#: Operations that a trace records at the most; those of a program are a tenth.
MOST = 1_000_000
#: A rate below this is rest, where dry friction counts as none [rad/s or m/s].
REST = 1e-9

Pose = tuple[Any, Any]
"""R and p of a frame in the world, of numbers of a trace and floats. Shapes (3, 3), (3,)."""
Samples = tuple[kit.Array, kit.GivenMotion, kit.Applied]
"""Joint coordinates of closed poses, shape (n, n_q), and motion and what acts there."""
Answers = dict[str, kit.Array]
"""Quantity -> numbers at each sample."""


def outward(mechanism: kit.Mechanism) -> tuple[list[tuple[kit.Joint, bool]], list[kit.Joint]]:
    """Joints of an open tree in order, each with whether its parent is the inner body, and the joints left over.

    No body has fewer joints between itself and ground in another tree.
    """
    tree, rest, known = list[tuple[kit.Joint, bool]](), [*mechanism.joints], [kit.GROUND]
    for body in known:
        for joint in [*rest]:
            if body in joint.bodies and not {*joint.bodies} <= {*known}:
                tree.append((joint, joint.parent == body))
                known.append(joint.child if joint.parent == body else joint.parent)
                rest.remove(joint)
    return tree, rest


def skew(v: Any) -> Any:
    """The matrix that multiplies as the cross product with a vector does. Shape (3, 3)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]], dtype=object)


def axial(M: Any) -> list[Any]:
    """Vector of the skew part of a matrix. (..., 3, 3) -> three numbers."""
    return [0.5 * (M[..., i, j] - M[..., j, i]) for i, j in ((2, 1), (0, 2), (1, 0))]


def at(pose: Pose, p: Any) -> Any:
    """Place in the world of a point of a body. Shape (3,)."""
    return pose[1] + pose[0] @ p


class Equations:
    """Programs of a mechanism under certain loads and springs.

    Attributes:
        tree, cuts: See `outward`.
        inputs: Coordinates q, their derivatives v and a, gravity g, force and torque of each load, pull of each spring
            between points, multipliers of the gaps, and the virtual displacements: shift and turn at each joint of the
            tree, of all that hangs on it, about the joint's point of the child.
        gaps: Shifts and small turns by which joints that close loops are open, six a joint, and after them what
            couplings leave over.
        pose: R and p of each body without virtual displacements.
        flat, second: R row by row and centre of mass of each body, and their second time derivatives.
        rate: Time derivatives of numbers that depend on q, where q changes at constant rates.
    """

    def __init__(self, mechanism: kit.Mechanism, applied: kit.Applied, trace: kit.Trace) -> None:
        self.mechanism, self.applied, n = mechanism, applied, len(mechanism.coordinates)
        self.springs = [spring for spring in applied.springs if isinstance(spring, kit.PointSpring)]
        self.tree, self.cuts = outward(mechanism)
        sizes = {"q": n, "v": n, "a": n, "g": 3, "loads": 6 * len(applied.loads), "pulls": len(self.springs)}
        sizes |= {"multipliers": 6 * len(self.cuts) + len(mechanism.couplings), "moved": 6 * len(self.tree)}
        self.inputs = {name: [trace.input(np.ones(1)) for _ in range(size)] for name, size in sizes.items()}
        self.q, v, a = (self.inputs[name] for name in "qva")
        self.pose = self._poses([0.0] * sizes["moved"])
        coupled = mechanism.coupling_rows.derivatives(np.array(self.q), 0)
        self.gaps = [*self._gaps(self.pose), *(self.q[i] - sum(value for _, value in terms) for i, terms in coupled)]
        self.rate = partial(kit.tangents, rates=dict(zip(self.q, v, strict=True)))
        bodies = [(self.pose[body.name], body.com) for body in mechanism.bodies]
        self.flat = [x for pose, com in bodies for x in (*pose[0].flat, *at(pose, com))]
        self.second = kit.tangents(self.rate(self.flat), dict(zip(self.q + v, v + a, strict=True)))

    @cached_property
    def closing(self) -> kit.Function:
        """q, v -> gaps and their rates. Shape (n, m)."""
        return self._function(gaps=self.gaps, rates=self.rate(self.gaps))

    def closed(self, q: kit.Array) -> tuple[kit.Array, kit.Array]:
        """Gaps, (n, m), and their derivatives, (n, m, n_q): rates for a unit rate of each coordinate, side by side."""
        n, m = q.shape
        found = self.closing(n * m, q=q.repeat(m, axis=0), v=np.tile(np.eye(m), (n, 1)))
        return found["gaps"][::m], found["rates"].reshape(n, m, len(self.gaps)).swapaxes(1, 2)

    @property
    def angular(self) -> list[bool]:
        """Whether each gap is an angle."""
        coupled = [self.mechanism.units[column] == "rad" for column in self.mechanism.coupling_rows.columns]
        return [False, False, False, True, True, True] * len(self.cuts) + coupled

    @cached_property
    def motion(self) -> kit.Function:
        """q, v, a -> of each body R and centre of mass with two time derivatives, and its origin.

        Also lengths of springs with their rates, and the second time derivative of gaps without accelerations.
        """
        lengths = [self._length(spring, self.pose) for spring in self.springs]
        made = {"pose": self.flat, "rate": self.rate(self.flat), "second": self.second, "lengths": lengths}
        made |= {"stretches": self.rate(lengths), "bends": self.rate(self.rate(self.gaps))}
        return self._function(**made, origins=[x for body in self.mechanism.bodies for x in self.pose[body.name][1]])

    @cached_property
    def balance(self) -> kit.Function:
        """q, v, a, g, loads, pulls -> forces along q that the motion needs besides. Shape (n, n_q)."""
        return self._function("multipliers", "moved", needs=self._virtual_work[: len(self.q)])

    @cached_property
    def transmitted(self) -> kit.Function:
        """The same and multipliers -> force and moment of each joint of the tree on its outer body. (n, 6 n_tree)."""
        return self._function("moved", wrenches=self._virtual_work[len(self.q) :])

    def _function(self, *zero: str, **outputs: Sequence[Any]) -> kit.Function:
        """A function in which some inputs are zero."""
        numbers = dict.fromkeys([x for name in zero for x in self.inputs[name]], 0.0)
        return kit.Function(self.inputs, {name: kit.substitute(some, numbers) for name, some in outputs.items()})

    @cached_property
    def _virtual_work(self) -> list[Any]:
        """Derivatives of the virtual work by coordinates and virtual displacements."""
        return kit.adjoints(self._works(), self.q + self.inputs["moved"])

    def _works(self) -> Iterator[tuple[Any, Any]]:
        """Pairs of a number and a force along it: inertia less weight, loads, pulls of springs and multipliers."""
        inputs = {name: np.array(some, dtype=object) for name, some in self.inputs.items()}
        pose = self._poses(self.inputs["moved"])
        changes = np.array(self.second, dtype=object).reshape(-1, 12)
        for body, second in zip(self.mechanism.bodies, changes, strict=True):
            yield from zip(at(pose[body.name], body.com), body.mass * (second[9:] - inputs["g"]), strict=True)
            moments = 0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia  # integral of x x^T dm
            yield from zip(pose[body.name][0].flat, (second[:9].reshape(3, 3) @ moments).flat, strict=True)
        for load, (force, torque) in zip(self.applied.loads, inputs["loads"].reshape(-1, 2, 3), strict=True):
            if load.body == kit.GROUND:
                continue
            point, R = self.mechanism.body(load.body).com if load.point is None else load.point, self.pose[load.body][0]
            force, torque = (R @ x if load.axes == "body" else x for x in (force, torque))
            yield from zip(at(pose[load.body], point), -force, strict=True)
            yield from zip(pose[load.body][0].flat, (-0.5 * skew(torque) @ R).flat, strict=True)
        yield from zip((self._length(spring, pose) for spring in self.springs), inputs["pulls"], strict=True)
        yield from zip(self._gaps(pose), -inputs["multipliers"], strict=False)

    def _length(self, spring: kit.PointSpring, pose: Mapping[str, Pose]) -> Any:
        a, b = (at(pose[name], point) for name, point in spring.ends)
        return kit.apply("sqrt", (b - a) @ (b - a))

    def _across(self, joint: kit.Joint) -> Pose:
        """Pose of the joint's frame on the child in that on the parent."""
        R, p = np.eye(3).astype(object), np.zeros(3).astype(object)
        for column, (turns, axis) in zip(self.mechanism.columns(joint.coordinates), joint.freedoms, strict=True):
            if turns:
                s, c, along = kit.apply("sin", self.q[column]), kit.apply("cos", self.q[column]), np.outer(axis, axis)
                R = R @ (along + c * (np.eye(3) - along) + s * skew(axis))
            else:
                p = p + R @ (self.q[column] * axis)
        return R, p

    def _poses(self, moved: Sequence[Any]) -> dict[str, Pose]:
        """Poses of all bodies after the virtual displacements."""
        pose: dict[str, Pose] = {kit.GROUND: (np.eye(3).astype(object), np.zeros(3).astype(object))}
        for (joint, out), x in zip(self.tree, np.array(moved, dtype=object).reshape(-1, 6), strict=True):
            ((near, inner), (far, outer)), (A, s) = joint.sides if out else joint.sides[::-1], self._across(joint)
            A, s = (A, s) if out else (A.T, -(A.T @ s))
            R, p = pose[near][0] @ inner.R, at(pose[near], inner.p)
            turn, arm = np.eye(3) + skew(x[3:]), np.zeros(3) if out else R @ s  # from the joint's point of the child
            p, R = p + R @ s - arm + x[:3] + turn @ arm, turn @ R @ A @ outer.R.T
            pose[far] = R, p - R @ outer.p
        return pose

    def _gaps(self, pose: Mapping[str, Pose]) -> Iterator[Any]:
        for joint in self.cuts:
            (before, inner), (after, outer) = joint.sides
            A, s = self._across(joint)
            yield from at(pose[after], outer.p) - at(pose[before], inner.p + inner.R @ s)
            yield from axial(pose[after][0] @ outer.R @ (pose[before][0] @ inner.R @ A).T)


def load(files: kit.ModelFiles) -> Lagrange:
    """Loads a description."""
    return Lagrange(kit.load_mechanism(files.model), str(files.model))


class Lagrange:
    """A description."""

    def __init__(self, mechanism: kit.Mechanism, where: str) -> None:
        self.mechanism, self.where, self.independent = mechanism, where, tuple(mechanism.independent)

    def solve(self, problem: kit.Problem, progress: kit.Progress = kit.quiet) -> kit.Solution:
        """Answers a given motion.

        Raises:
            ScrewgaugeError: The problem is not that of the description, or its motion cannot be followed.
        """
        kit.check_fits(problem, self.mechanism, self.where)
        if not isinstance(problem.task, kit.GivenMotion):
            raise kit.ModelFileError("takes given motions only", "lagrange", "name another engine")
        clock = kit.Clock()
        with clock.stage("equations"):
            equations = Equations(self.mechanism, problem.applied, kit.Trace(MOST))
            branch = kit.Branch(self.mechanism, equations.closed, equations.angular)

        def solve(q: kit.Array, motion: kit.GivenMotion, applied: kit.Applied) -> tuple[Answers, Answers]:
            at, values = Motion(equations, branch, (q, motion, applied), problem.rule), Answers()
            for name in (name for name in QUANTITIES if name in problem.wanted):
                with clock.stage(name):
                    values[name] = QUANTITIES[name](at)
            return values, at.conditions

        def solve_part(motion: kit.GivenMotion, applied: kit.Applied) -> kit.Answered:
            return branch.answered(motion, applied, solve, clock)

        labels = "lagrange", version("screwgauge"), f"rule {problem.rule}"
        return kit.answer(labels, self.mechanism, problem, solve_part, progress, clock)


def times(A: kit.Array, x: kit.Array) -> kit.Array:
    """Products of stacked matrices and vectors."""
    return np.asarray(np.matmul(A, x[..., None])[..., 0])


class Motion:
    """All quantities of some samples that follow those before.

    Attributes:
        q, v, a: All joint coordinates and their derivatives. Shape (n, n_q).
        back: Coordinates per gap. Shape (n, n_q, m).
        K: Coordinates per independent one. Shape (n, n_q, k).
        conditions: Condition numbers of the equations of forces, once these are solved. Shape (n,).
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
        """Second derivatives of the independent coordinates; those that no actuator drives follow. Shape (n, k)."""
        ydd, idle = self.motion.ydd, [*self.motion.idle]
        if idle:
            given = ydd * ~np.isin(np.arange(ydd.shape[1]), idle)
            still, M = copy(self), self.inertia[..., idle]  # nothing that needs accelerations is known yet
            still.motion, B = replace(self.motion, ydd=given, idle=()), self.K[:, self.mechanism.actuated_columns]
            x, condition = kit.idle_accelerations(B, M, still.generalized_force, idle)
            ydd = given + x @ np.eye(ydd.shape[1])[idle]
            self.conditions |= dict.fromkeys(kit.ACCELERATED, condition)
        return ydd

    @cached_property
    def moved(self) -> Mapping[str, kit.Array]:
        """See `Equations.motion`."""
        return self.equations.motion(self.n, q=self.q, v=self.v, a=self.a)

    def matrices(self, name: str) -> kit.Array:
        """Orientations of bodies or their time derivatives, ground first. Shape (n, n_body + 1, 3, 3)."""
        ground = np.eye(3) * (name == "pose") + np.zeros((self.n, 1, 1, 1))
        return np.concatenate([ground, self.moved[name].reshape(self.n, -1, 12)[..., :9].reshape(self.n, -1, 3, 3)], 1)

    def spin(self, name: str) -> kit.Array:
        """Angular velocities or accelerations of bodies, from derivatives of orientations. Shape (n, 3 n_body)."""
        products = self.matrices(name)[:, 1:] @ self.matrices("pose")[:, 1:].swapaxes(2, 3)
        return np.stack(axial(products), axis=-1).reshape(self.n, -1)

    @cached_property
    def state(self) -> dict[str, kit.Array]:
        """Inputs of the equations: the motion, and what acts on bodies."""
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
        """What acts along joint coordinates besides actuators, less what rotors take. Shape (n, n_q)."""
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
        """What rotors, dampers and dry friction take along their coordinates, one by one. Shape (n, n_resistance)."""
        sign = np.where(np.abs(self.v) > REST, np.sign(self.v), 0.0)
        by = {"rotor": self.a, "damping": self.v, "friction": sign}
        each = [one.amount * by[one.what][:, one.column] for one in self.mechanism.resistances]
        return np.asarray(np.reshape(each, (-1, self.n)).T)

    @cached_property
    def needs(self) -> kit.Array:
        """Forces along coordinates that actuators and loops make up. Shape (n, n_q)."""
        return self.equations.balance(self.n, **self.state)["needs"] - self.along

    @cached_property
    def generalized_force(self) -> kit.Array:
        return times(self.K.swapaxes(1, 2), self.needs)

    @cached_property
    def actuator_force(self) -> kit.Array:
        """Of the smallest norm, or by the rule of a joint's line."""
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

    def driven(self, f: kit.Array) -> kit.Array:
        """Actuator forces along all coordinates. Shape (..., n_act) -> (n, n_q)."""
        out = np.zeros_like(self.q)
        out[:, self.mechanism.actuated_columns] = f
        return out

    def multipliers(self, needs: kit.Array, f: kit.Array) -> kit.Array:
        """Forces along the gaps that make up what actuators leave over, of the smallest norm. Shape (n, m)."""
        return times(self.back.swapaxes(1, 2), needs - self.driven(f))

    def wrenches(self, needs: kit.Array, f: kit.Array, **state: kit.Array) -> kit.Array:
        """Force and moment of each joint on its child, about its point on the child. Shape (n, n_joint, 6)."""
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

    @cached_property
    def inertia(self) -> kit.Array:
        """Mass matrix in the independent coordinates. Shape (n, k, k)."""
        columns, rotors = np.moveaxis(self.K, 2, 0), self.mechanism.rotors
        each = [self.equations.balance(self.n, q=self.q, a=a)["needs"] + rotors * a for a in columns]
        return np.asarray(self.K.swapaxes(1, 2) @ np.stack(each, axis=2))


QUANTITIES: Mapping[str, Callable[[Motion], kit.Array]] = {
    "joint_position": lambda at: at.q,
    "joint_velocity": lambda at: at.v,
    "joint_acceleration": lambda at: at.a,
    "body_angular_velocity": lambda at: at.spin("rate"),
    "body_angular_acceleration": lambda at: at.spin("second"),
    "com_acceleration": lambda at: at.moved["second"].reshape(at.n, -1, 12)[..., 9:].reshape(at.n, -1),
    "generalized_force": lambda at: at.generalized_force,
    "actuator_force": lambda at: at.actuator_force,
    "reaction": lambda at: at.reaction,
    "axis_moment": lambda at: at.along + at.driven(at.actuator_force),
    "resistance": lambda at: at.resistance,
    "mass_matrix": lambda at: at.inertia[(..., *np.triu_indices(at.K.shape[2]))],
}
