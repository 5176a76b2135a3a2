"""Springs, dampers, motors and loads on an engine's open tree, computed from the engine's body poses and rates.

For the samples of a given motion, `applied_wrenches` converts these forces to wrenches on bodies; for a single state of
a simulation, `TreeForces` converts them to forces along the coordinates of the tree. Both use `forces_at_joints` and
`wrenches_on_bodies`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from screwgauge.engines.kit.acting import forces_at_joints, wrenches_on_bodies
from screwgauge.engines.tree.closed_tree import ClosedTree
from screwgauge.engines.tree.cut_joints import read_chart
from screwgauge.engines.tree.protocol import BodyAt, BodyPoses, OpenTree
from screwgauge.reference.applied import Applied, JointSpring, PointSpring
from screwgauge.reference.equations.joint_types import SURE, dual_wrenches
from screwgauge.reference.equations.kinematics import coordinates, joint_screws, joint_values
from screwgauge.reference.equations.ops import NUMPY
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.resistance import LOSSES, Resistance, resistances
from screwgauge.reference.rotations import Array, cross


def resisting_joints(closed: ClosedTree) -> tuple[Resistance, ...]:
    """Return damping and dry friction of joints; the engine itself accounts for rotors."""
    return resistances(closed.file.joints, LOSSES)


def applied_wrenches(
    closed: ClosedTree, applied: Applied, at: BodyPoses, motion: tuple[Array, Array, Array, Array]
) -> tuple[Array, Array]:
    """Return the applied force and moment on each body, and the part that acts along joint coordinates.

    Args:
        motion: Times, shape (n,), velocities of the bodies, shape (n, n_body + 1, 6), coordinates of all joints and
            their rates in the order of the description, shape (n, n_q) each.

    Returns:
        Force and moment about each body's origin, shape (n, n_body + 1, 6); and the forces along the coordinates,
        shape (n, n_q), which the wrenches already contain.
    """
    t, V, q, v = motion
    column = {name: i for i, name in enumerate(closed.names)}
    out, tau = np.zeros((*at.p.shape[:2], 6)), np.zeros_like(q)

    def body(i: int) -> tuple[Array, Array, Array]:
        return at.R[:, i], at.p[:, i], V[:, i]

    for i, force, moment, _ in wrenches_on_bodies(applied, closed.loops.index, closed.load_point, t, body):
        out[:, i, :3] += force
        out[:, i, 3:] += moment
    losses = resisting_joints(closed)
    for name, amount, _ in forces_at_joints(applied, losses, t, lambda x: (q[:, column[x]], v[:, column[x]])):
        tau[:, column[name]] += amount
    for joint in closed.file.joints:
        columns = [column[name] for name in joint.coordinates]
        if tau[:, columns].any():
            _drive(closed, joint, at, q[:, columns], tau[:, columns], out)
    return out, tau


def _drive(closed: ClosedTree, joint: Joint, at: BodyPoses, q: Array, tau: Array, out: Array) -> None:
    """Add the wrenches on a joint's bodies due to forces along its coordinates; they do no work on other motions."""
    parent, child = closed.loops.sides(joint)
    frames = closed.joint_pose(joint, at)
    values = joint_values(joint.freedoms, range(q.shape[1]), coordinates(q, NUMPY))
    S = joint_screws(joint, frames.R_parent, frames.p_parent, values)[0]
    force, moment = np.split((tau[:, None] @ dual_wrenches(frames, S))[:, 0], 2, axis=1)  # about the world origin
    for i, sign in ((child, 1.0), (parent, -1.0)):  # a positive force moves the child along its coordinate
        out[:, i, :3] += sign * force
        out[:, i, 3:] += sign * (moment - cross(at.p[:, i], force))


Reader = Callable[[Array, BodyAt], tuple[float, Array]]
"""Reads a joint coordinate at q, and its derivative with respect to the tree's coordinates, (n_v,)."""


class TreeForces:
    """Applied forces, except gravity, along the coordinates of a tree, computed state by state.

    Attributes:
        acts: Whether any force acts.
        stores_only: Whether only springs without dampers act.
    """

    def __init__(
        self, closed: ClosedTree, applied: Applied, start: Array, resist: Sequence[Resistance] | None = None
    ) -> None:
        """Bind applied forces to the bodies and coordinates of a tree.

        Args:
            start: Independent coordinates at the start, from which angles of cut joints are followed. Shape (k,).
            resist: Resistances, by default all of `resisting_joints`.

        Raises:
            UnknownNameError: The tree lacks a body or coordinate on which a force acts.
        """
        self.closed, self.applied, springs = closed, applied, applied.springs
        self.resist = resisting_joints(closed) if resist is None else resist
        takes = bool(applied.motors or applied.loads or self.resist)
        self.acts, self.stores_only = takes or bool(springs), not (takes or any(spring.damping for spring in springs))
        bodies = [load.body for load in applied.loads]
        bodies += [name for spring in springs if isinstance(spring, PointSpring) for name, _ in spring.ends]
        for name in bodies:
            if name not in closed.loops.index:
                raise UnknownNameError("body", name, closed.loops.index, "load or spring")
        along = [motor.coordinate for motor in applied.motors]
        along += [spring.coordinate for spring in springs if isinstance(spring, JointSpring)]
        self.readers = {
            name: _reader(closed, name, start) for name in (*along, *(one.coordinate for one in self.resist))
        }

    def act(self, t: float, q: Array, v: Array, body: BodyAt, tau: Array) -> float:
        """Write the force along the coordinates into `tau`, shape (n_v,); return the input power [W]."""
        tau[:] = 0.0
        if not self.acts:
            return 0.0
        jacobians, rows = dict[int, Array](), dict[str, Array]()

        def motion(i: int) -> tuple[Array, Array, Array]:
            R, p, jacobians[i] = body(i)
            return R, p, jacobians[i] @ v

        def read(name: str) -> tuple[float, float]:
            value, rows[name] = self.readers[name](q, body)
            return value, float(rows[name] @ v)

        loops, point = self.closed.loops, self.closed.load_point
        along = [*forces_at_joints(self.applied, self.resist, t, read)]
        wrenches = [*wrenches_on_bodies(self.applied, loops.index, point, t, motion)]
        for i, force, moment, _ in wrenches:
            tau += force @ jacobians[i][3:] + moment @ jacobians[i][:3]
        for name, amount, _ in along:
            tau += amount * rows[name]
        return float(sum([power for _, _, power in along] + [power for _, _, _, power in wrenches]))


def _reader(closed: ClosedTree, coordinate: str, start: Array) -> Reader:
    """Build a function that reads a joint coordinate, which may be in the tree or in a cut joint."""
    tree, loops = closed.tree, closed.loops
    if coordinate in tree.coordinates:
        column = tree.coordinates.index(coordinate)
        row = np.eye(len(tree.coordinates))[column]
        return lambda q, body: (float(q[column]), row)
    for joint in loops.cut:
        if coordinate in joint.coordinates:
            return _cut_reader(closed, joint, joint.coordinates.index(coordinate), start)
    known = [*tree.coordinates, *(name for joint in loops.cut for name in joint.coordinates)]
    raise UnknownNameError("coordinate", coordinate, known, "motor or spring")


def _cut_reader(closed: ClosedTree, joint: Joint, i: int, start: Array) -> Reader:
    """Build a function that reads a cut joint's coordinate.

    Each reading is the angle nearest to the previous reading, so that full turns are counted, even past gimbal lock.
    """
    last = closed.loops.begin(joint, start)
    parent, child = closed.loops.index[joint.parent], closed.loops.index[joint.child]

    def read(q: Array, body: BodyAt) -> tuple[float, Array]:
        nonlocal last
        (R_parent, _, J_parent), (R_child, _, J_child) = body(parent), body(child)
        chart = read_chart(joint, R_parent[None], R_child[None]).near(last[None])
        if chart.condition[0] < SURE:
            last = chart.q[0]
        return float(chart.q[0, i]), chart.rates((J_child[:3] - J_parent[:3])[None])[0, i]

    return read


def spring_pull(spring: JointSpring, tree: OpenTree, q: Array, v: Array) -> Array:
    """Return the forces along all coordinates due to a spring along a tree coordinate. Shape (n, n_v)."""
    tau, k = np.zeros_like(q), tree.coordinates.index(spring.coordinate)
    tau[:, k] = -spring.pull(q[:, k], v[:, k])
    return tau
