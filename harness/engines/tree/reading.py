"""A motion of an engine's open tree, read in the joint coordinates of the description."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from screwgauge.engines.parts import JointMotion
from screwgauge.engines.tree.closed_tree import ClosedTree
from screwgauge.engines.tree.cut_joints import SURE, Flags, follow
from screwgauge.reference import linear
from screwgauge.reference.rotations import Array

_MEMORY = 2e7  # bytes of the Jacobians of all bodies that are held at a time


@dataclass(slots=True, eq=False)
class Path:
    """States in the order of time, those of them marked that are wanted.

    Attributes:
        t, q, v: Times [s], tree coordinates and rates, one entry a state.
        wanted: Indices of the wanted states.
        a: Tree accelerations of the wanted states, one entry each.
    """

    t: list[float] = field(default_factory=list)
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)
    wanted: list[int] = field(default_factory=list)
    a: list[Array] = field(default_factory=list)

    def add(self, t: float, q: Array, v: Array, a: Array | None = None) -> None:
        """Adds a state; one with accelerations is wanted."""
        if a is not None:
            self.wanted.append(len(self.t))
            self.a.append(a)
        self.t.append(t)
        self.q.append(q)
        self.v.append(v)

    def cut(self, t: float) -> None:
        """Forgets the states after a time."""
        n = sum(time <= t for time in self.t)
        del self.t[n:], self.q[n:], self.v[n:]
        self.wanted = [i for i in self.wanted if i < n]
        del self.a[len(self.wanted) :]


def read_path(closed: ClosedTree, path: Path, start: Array) -> JointMotion:
    """Reads the wanted states of a path, angles of cut joints followed along all its states.

    Args:
        start: Independent coordinates at its first state. Shape (k,).
    """
    q, v = np.array(path.q), np.array(path.v)
    rows, a = np.array(path.wanted, dtype=np.intp), np.array(path.a)
    turned = {name: x[rows] for name, x in _followed(closed, np.array(path.t), q, v, start).items()}
    parts = [
        _part(closed, q[rows[i]], v[rows[i]], a[i], {n: x[i] for n, x in turned.items()})
        for i in _blocks(closed, len(rows))
    ]
    return JointMotion(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("q", "v", "a", "condition"))
    )


def _blocks(closed: ClosedTree, n: int) -> list[slice]:
    tree = closed.tree
    size = max(1, int(_MEMORY / (48 * (len(tree.bodies) + 1) * max(1, len(tree.coordinates)))))
    return [slice(i, min(n, i + size)) for i in range(0, n, size)]


def _followed(closed: ClosedTree, t: Array, q: Array, v: Array, start: Array) -> dict[str, Array]:
    """Angles of cut joints at all states, each step from one state to the next predicted by the velocities."""
    loops = closed.loops
    if not loops.cut:
        return {}
    blocks: dict[str, list[tuple[Array, Array, Flags]]] = {joint.name: [] for joint in loops.cut}
    for block in _blocks(closed, len(t)):
        at = closed.tree.poses(q[block])
        charts = loops.charts(at)
        for name, rates in closed.cut_velocities(charts, at.velocities(v[block])).items():
            blocks[name].append((charts[name].q, rates, charts[name].condition < SURE))
    followed = {}
    for joint in loops.cut:
        angles, rates, sure = (np.concatenate(parts) for parts in zip(*blocks[joint.name], strict=True))
        followed[joint.name] = follow(loops.begin(joint, start), angles, sure, t, rates)
    return followed


def _part(closed: ClosedTree, q: Array, v: Array, a: Array, turned: dict[str, Array]) -> JointMotion:
    at = closed.tree.poses(q)
    charts = {name: chart.near(turned[name]) for name, chart in closed.loops.charts(at).items()}
    V, cut_a = at.velocities(v), dict[str, Array]()
    cut_v = closed.cut_velocities(charts, V)
    if charts:
        cut_a = closed.cut_accelerations(charts, cut_v, V, closed.tree.bias(at, q, v, V) + at.velocities(a))
    condition = linear.condition(closed.closing_rows(q, at, charts))
    return JointMotion(closed.joints(q, turned), closed.joints(v, cut_v), closed.joints(a, cut_a), condition)
