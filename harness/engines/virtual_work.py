"""Derive Lagrange's equations in all joint coordinates from body positions alone, as programs of the engine `lagrange`.

Time derivatives are taken in forward mode. One reverse sweep through the virtual work of inertia, weight, loads and
multipliers yields the equations of the coordinates and of six virtual displacements at each joint of the tree. The
latter equations give the wrench that the joint transmits. The derivation uses no twists, no recursions, and no angle
charts for the joints that close loops.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

import screwgauge.plugins as kit

Pose = tuple[Any, Any]
"""R and p of a frame in world axes; their entries are numbers of a trace or floats. Shapes (3, 3), (3,)."""


def outward_tree(mechanism: kit.Mechanism) -> tuple[list[tuple[kit.Joint, bool]], list[kit.Joint]]:
    """List the joints of an open tree outward from ground, and the remaining joints.

    A flag marks tree joints whose parent is the inner body. The tree has as few joints as possible between each body
    and ground.
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
    """Return the cross-product matrix of a vector. Shape (3, 3)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]], dtype=object)


def axial_vector(M: Any) -> list[Any]:
    """Return the axial vector of a matrix's skew-symmetric part. (..., 3, 3) -> three numbers."""
    return [0.5 * (M[..., i, j] - M[..., j, i]) for i, j in ((2, 1), (0, 2), (1, 0))]


def world_point(pose: Pose, p: Any) -> Any:
    """Return the world position of a body-fixed point. Shape (3,)."""
    return pose[1] + pose[0] @ p


class Equations:
    """Programs of a mechanism under given loads and springs.

    Attributes:
        tree, cuts: See `outward_tree`.
        inputs: Coordinates q, their derivatives v and a, gravity g, force and torque of each load, tension of each
            spring between points, multipliers of the gaps, and virtual displacements. At each tree joint these are a
            translation and a rotation of all bodies beyond it, about the joint's child-side point.
        gaps: Residual displacements and small rotations of joints that close loops, six per joint, followed by the
            residuals of couplings.
        pose: R and p of each body if virtual displacements are zero.
        flat, second: R, row by row, and the centre of mass of each body; and their second time derivatives.
        rate: Returns the time derivatives of values that depend on q.
    """

    def __init__(self, mechanism: kit.Mechanism, applied: kit.Applied, trace: kit.Trace) -> None:
        self.mechanism, self.applied, n = mechanism, applied, len(mechanism.coordinates)
        self.springs = [spring for spring in applied.springs if isinstance(spring, kit.PointSpring)]
        self.tree, self.cuts = outward_tree(mechanism)
        sizes = {"q": n, "v": n, "a": n, "g": 3, "loads": 6 * len(applied.loads), "pulls": len(self.springs)}
        sizes |= {"multipliers": 6 * len(self.cuts) + len(mechanism.couplings), "moved": 6 * len(self.tree)}
        self.inputs = {name: [trace.input(np.ones(1)) for _ in range(size)] for name, size in sizes.items()}
        self.q, v, a = (self.inputs[name] for name in "qva")
        self.pose = self._poses([0.0] * sizes["moved"])
        coupled = mechanism.coupling_rows.derivatives(np.array(self.q), 0)
        self.gaps = [*self._gaps(self.pose), *(self.q[i] - sum(value for _, value in terms) for i, terms in coupled)]
        self.rate = partial(kit.tangents, rates=dict(zip(self.q, v, strict=True)))
        bodies = [(self.pose[body.name], body.com) for body in mechanism.bodies]
        self.flat = [x for pose, com in bodies for x in (*pose[0].flat, *world_point(pose, com))]
        self.second = kit.tangents(self.rate(self.flat), dict(zip(self.q + v, v + a, strict=True)))

    @cached_property
    def closing(self) -> kit.Function:
        """Function: q, v -> gaps and their rates. Shape (n, m)."""
        return self._function(gaps=self.gaps, rates=self.rate(self.gaps))

    def evaluate_gaps(self, q: kit.Array) -> tuple[kit.Array, kit.Array]:
        """Return gaps, (n, m), and their derivatives, (n, m, n_q), as gap rates at unit coordinate rates."""
        n, m = q.shape
        found = self.closing(n * m, q=q.repeat(m, axis=0), v=np.tile(np.eye(m), (n, 1)))
        return found["gaps"][::m], found["rates"].reshape(n, m, len(self.gaps)).swapaxes(1, 2)

    @property
    def angular(self) -> list[bool]:
        """True for each gap that is an angle."""
        coupled = [self.mechanism.units[column] == "rad" for column in self.mechanism.coupling_rows.columns]
        return [False, False, False, True, True, True] * len(self.cuts) + coupled

    @cached_property
    def motion(self) -> kit.Function:
        """Function: q, v, a -> R and centre of mass of each body, their first and second time derivatives, and origins.

        It also returns the springs' lengths and rates, and the gaps' second time derivatives at zero accelerations.
        """
        lengths = [self._length(spring, self.pose) for spring in self.springs]
        made = {"pose": self.flat, "rate": self.rate(self.flat), "second": self.second, "lengths": lengths}
        made |= {"stretches": self.rate(lengths), "bends": self.rate(self.rate(self.gaps))}
        return self._function(**made, origins=[x for body in self.mechanism.bodies for x in self.pose[body.name][1]])

    @cached_property
    def balance(self) -> kit.Function:
        """Function: q, v, a, g, loads, pulls -> forces along q that the motion still requires. Shape (n, n_q)."""
        return self._function("multipliers", "moved", needs=self._virtual_work[: len(self.q)])

    @cached_property
    def transmitted(self) -> kit.Function:
        """Function: inputs of `balance`, multipliers -> wrench of each tree joint on its outer body. (n, 6 n_tree)."""
        return self._function("moved", wrenches=self._virtual_work[len(self.q) :])

    def _function(self, *zero: str, **outputs: Sequence[Any]) -> kit.Function:
        """Build a function with some inputs set to zero."""
        numbers = dict.fromkeys([x for name in zero for x in self.inputs[name]], 0.0)
        return kit.Function(self.inputs, {name: kit.substitute(some, numbers) for name, some in outputs.items()})

    @cached_property
    def _virtual_work(self) -> list[Any]:
        """Derivatives of the virtual work with respect to coordinates and virtual displacements."""
        return kit.adjoints(self._works(), self.q + self.inputs["moved"])

    def _works(self) -> Iterator[tuple[Any, Any]]:
        """Yield positions and the forces along them: inertia minus weight, loads, spring tensions and multipliers."""
        inputs = {name: np.array(some, dtype=object) for name, some in self.inputs.items()}
        pose = self._poses(self.inputs["moved"])
        changes = np.array(self.second, dtype=object).reshape(-1, 12)
        for body, second in zip(self.mechanism.bodies, changes, strict=True):
            yield from zip(world_point(pose[body.name], body.com), body.mass * (second[9:] - inputs["g"]), strict=True)
            moments = 0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia  # integral of x x^T dm
            yield from zip(pose[body.name][0].flat, (second[:9].reshape(3, 3) @ moments).flat, strict=True)
        for load, (force, torque) in zip(self.applied.loads, inputs["loads"].reshape(-1, 2, 3), strict=True):
            if load.body == kit.GROUND:
                continue
            point, R = self.mechanism.body(load.body).com if load.point is None else load.point, self.pose[load.body][0]
            force, torque = (R @ x if load.axes == "body" else x for x in (force, torque))
            yield from zip(world_point(pose[load.body], point), -force, strict=True)
            yield from zip(pose[load.body][0].flat, (-0.5 * skew(torque) @ R).flat, strict=True)
        yield from zip((self._length(spring, pose) for spring in self.springs), inputs["pulls"], strict=True)
        yield from zip(self._gaps(pose), -inputs["multipliers"], strict=False)

    def _length(self, spring: kit.PointSpring, pose: Mapping[str, Pose]) -> Any:
        a, b = (world_point(pose[name], point) for name, point in spring.ends)
        return kit.apply("sqrt", (b - a) @ (b - a))

    def _joint_pose(self, joint: kit.Joint) -> Pose:
        """Return the pose of the joint's child frame in its parent frame."""
        R, p = np.eye(3).astype(object), np.zeros(3).astype(object)
        for column, (turns, axis) in zip(self.mechanism.columns(joint.coordinates), joint.freedoms, strict=True):
            if turns:
                s, c, along = kit.apply("sin", self.q[column]), kit.apply("cos", self.q[column]), np.outer(axis, axis)
                R = R @ (along + c * (np.eye(3) - along) + s * skew(axis))
            else:
                p = p + R @ (self.q[column] * axis)
        return R, p

    def _poses(self, moved: Sequence[Any]) -> dict[str, Pose]:
        """Return the poses of all bodies after virtual displacements."""
        pose: dict[str, Pose] = {kit.GROUND: (np.eye(3).astype(object), np.zeros(3).astype(object))}
        for (joint, out), x in zip(self.tree, np.array(moved, dtype=object).reshape(-1, 6), strict=True):
            ((near, inner), (far, outer)), (A, s) = joint.sides if out else joint.sides[::-1], self._joint_pose(joint)
            A, s = (A, s) if out else (A.T, -(A.T @ s))
            R, p = pose[near][0] @ inner.R, world_point(pose[near], inner.p)
            turn, arm = np.eye(3) + skew(x[3:]), np.zeros(3) if out else R @ s  # from the joint's child-side point
            p, R = p + R @ s - arm + x[:3] + turn @ arm, turn @ R @ A @ outer.R.T
            pose[far] = R, p - R @ outer.p
        return pose

    def _gaps(self, pose: Mapping[str, Pose]) -> Iterator[Any]:
        for joint in self.cuts:
            (before, inner), (after, outer) = joint.sides
            A, s = self._joint_pose(joint)
            yield from world_point(pose[after], outer.p) - world_point(pose[before], inner.p + inner.R @ s)
            yield from axial_vector(pose[after][0] @ outer.R @ (pose[before][0] @ inner.R @ A).T)
