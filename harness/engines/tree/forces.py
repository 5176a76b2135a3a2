"""Springs, dampers, motors and loads as forces along the coordinates of an engine's open tree.

Poses and Jacobians of bodies are the engine's own; only those of bodies on which something acts are asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from screwgauge.engines.tree.closed import ClosedTree
from screwgauge.engines.tree.closure import Loops
from screwgauge.engines.tree.cut_joints import SURE, read_chart
from screwgauge.engines.tree.protocol import BodyAt, OpenTree
from screwgauge.reference.applied import Applied, JointSpring, Load, Motor, PointSpring, Spring
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import Array

Element = Callable[[float, Array, Array, BodyAt, Array], float]
"""Adds what it exerts at (t, q, v) to a force along the coordinates; returns the power put in that is not stored."""

Reader = Callable[[float, Array, BodyAt], tuple[float, Array]]
"""Reads a coordinate or length at (t, q), and its derivative by the tree's coordinates (n_v,)."""


@dataclass(frozen=True, slots=True)
class TreeForces:
    """All that acts besides gravity. `stores_only`: its springs are without dampers, and nothing else acts."""

    elements: tuple[Element, ...]
    stores_only: bool

    def act(self, t: float, q: Array, v: Array, body: BodyAt, tau: Array) -> float:
        """Writes the force along the coordinates into `tau`, shape (n_v,); returns the power put in [W]."""
        tau[:] = 0.0
        return sum(element(t, q, v, body, tau) for element in self.elements)


def tree_forces(closed: ClosedTree, applied: Applied, start: Array) -> TreeForces:
    """Binds what acts to the bodies and coordinates of a tree.

    Args:
        start: Independent coordinates at the start, from which angles of cut joints are followed. Shape (k,).

    Raises:
        UnknownNameError: There is no such body or coordinate.
    """
    tree, loops = closed.tree, closed.loops

    def reader(acting: Motor | Spring) -> Reader:
        if isinstance(acting, PointSpring):
            return _line_reader(acting, loops)
        return _reader(acting.coordinate, tree, loops, start)

    elements = [
        *(_motor(motor, reader(motor)) for motor in applied.motors),
        *(_load(load, tree, loops) for load in applied.loads),
        *(_spring(spring, reader(spring)) for spring in applied.springs),
    ]
    damped = any(spring.damping for spring in applied.springs)
    return TreeForces(tuple(elements), not (damped or applied.motors or applied.loads))


def spring_pull(spring: JointSpring, tree: OpenTree, q: Array, v: Array) -> Array:
    """Force of a spring along a coordinate of the tree, shape (n, n_v), at states of shape (n, n_v)."""
    tau, k = np.zeros_like(q), tree.coordinates.index(spring.coordinate)
    tau[:, k] = -spring.pull(q[:, k], v[:, k])
    return tau


def _body(name: str, loops: Loops) -> int:
    if name not in loops.index:
        raise UnknownNameError("body", name, loops.index, "load or spring")
    return loops.index[name]


def _reader(coordinate: str, tree: OpenTree, loops: Loops, start: Array) -> Reader:
    """Reads a joint coordinate, of the tree or of a cut joint."""
    if coordinate in tree.coordinates:
        column = tree.coordinates.index(coordinate)
        row = np.eye(len(tree.coordinates))[column]
        return lambda t, q, body: (float(q[column]), row)
    for joint in loops.cut:
        if coordinate in joint.coordinates:
            return _cut_reader(joint, joint.coordinates.index(coordinate), loops, start)
    known = [*tree.coordinates, *(name for joint in loops.cut for name in joint.coordinates)]
    raise UnknownNameError("coordinate", coordinate, known, "motor or spring")


def _cut_reader(joint: Joint, i: int, loops: Loops, start: Array) -> Reader:
    """Reads a coordinate of a cut joint.

    It goes on from where it was read last: by less than half a turn, and through a lock of its chart.
    """
    last = loops.begin(joint, start)

    def read(t: float, q: Array, body: BodyAt) -> tuple[float, Array]:
        nonlocal last
        (R_parent, _, J_parent), (R_child, _, J_child) = (body(loops.index[x]) for x in (joint.parent, joint.child))
        chart = read_chart(joint, R_parent[None], R_child[None]).near(last[None])
        if chart.condition[0] < SURE:
            last = chart.q[0]
        return float(chart.q[0, i]), chart.rates((J_child[:3] - J_parent[:3])[None])[0, i]

    return read


def _line_reader(spring: PointSpring, loops: Loops) -> Reader:
    """Reads the distance between the points of a spring."""
    first, second = _body(spring.first, loops), _body(spring.second, loops)

    def read(t: float, q: Array, body: BodyAt) -> tuple[float, Array]:
        Ra, pa, Ja = body(first)
        Rb, pb, Jb = body(second)
        arm_a, arm_b = Ra @ spring.first_point, Rb @ spring.second_point
        line = (pb + arm_b) - (pa + arm_a)
        length = float(np.sqrt(line @ line))
        if not length > 0.0:
            raise spring.no_direction(f" at t = {t:g} s")
        along = line / length
        # derivative of the length: along . (velocity of second point - velocity of first)
        return length, along @ (Jb[3:] - Ja[3:]) + _cross(arm_b, along) @ Jb[:3] - _cross(arm_a, along) @ Ja[:3]

    return read


def _motor(motor: Motor, read: Reader) -> Element:
    constant = motor.force(0.0) if motor.constant else None

    def element(t: float, q: Array, v: Array, body: BodyAt, tau: Array) -> float:
        f, row = motor.force(t) if constant is None else constant, read(t, q, body)[1]
        tau += f * row
        return f * float(row @ v)

    return element


def _spring(spring: Spring, read: Reader) -> Element:
    def element(t: float, q: Array, v: Array, body: BodyAt, tau: Array) -> float:
        value, row = read(t, q, body)
        speed = float(row @ v)
        tau -= spring.pull(value, speed) * row
        return -spring.damping * speed * speed

    return element


def _load(load: Load, tree: OpenTree, loops: Loops) -> Element:
    index = _body(load.body, loops)
    point = (tree.com[index - 1] if index else np.zeros(3)) if load.point is None else load.point

    def element(t: float, q: Array, v: Array, body: BodyAt, tau: Array) -> float:
        R, _, J = body(index)
        pull = load.force @ J[3:] + (load.torque + _cross(R @ point, load.force)) @ J[:3]
        tau += pull
        return float(pull @ v)

    return element


def _cross(a: Array, b: Array) -> Array:
    """`numpy.cross` for two vectors of three, at a tenth of its cost."""
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
