"""A motion of an engine's open tree, read in the joint coordinates of the description."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from screwgauge.engines.tree.closure import Loops
from screwgauge.engines.tree.cut_joints import SURE, Chart, Flags, follow
from screwgauge.engines.tree.protocol import BodyPoses, Tree
from screwgauge.models.loops import LoopsFile
from screwgauge.reference import linear
from screwgauge.reference.mechanism import Joint
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


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """Joint coordinates of the description at the wanted states, with rates, accelerations and condition.

    Attributes:
        q, v, a: Unwrapped. Shape (m, n_q).
        condition: Of the closing rows with the selection of the independent coordinates. Shape (m,).
    """

    q: Array
    v: Array
    a: Array
    condition: Array


def read_path(tree: Tree, loops: Loops, file: LoopsFile, path: Path, start: Array) -> Reading:
    """Reads the wanted states of a path, angles of cut joints followed along all its states.

    Args:
        start: Independent coordinates at its first state. Shape (k,).
    """
    q, v = np.array(path.q), np.array(path.v)
    rows, a = np.array(path.wanted, dtype=np.intp), np.array(path.a)
    turned = {name: x[rows] for name, x in _followed(tree, loops, np.array(path.t), (q, v), start).items()}
    parts = [
        _part(tree, loops, file, q[rows[i]], v[rows[i]], a[i], {n: x[i] for n, x in turned.items()})
        for i in _blocks(tree, len(rows))
    ]
    return Reading(*(np.concatenate([part[k] for part in parts]) for k in range(4)))


def _blocks(tree: Tree, n: int) -> list[slice]:
    size = max(1, int(_MEMORY / (48 * (len(tree.bodies) + 1) * max(1, len(tree.coordinates)))))
    return [slice(i, min(n, i + size)) for i in range(0, n, size)]


def _followed(tree: Tree, loops: Loops, t: Array, states: tuple[Array, Array], start: Array) -> dict[str, Array]:
    """Angles of cut joints at all states, each step from one state to the next predicted by the rates."""
    if not loops.cut:
        return {}
    q, v = states
    found: dict[str, list[tuple[Array, Array, Flags]]] = {joint.name: [] for joint in loops.cut}
    for block in _blocks(tree, len(t)):
        at = tree.poses(q[block])
        for joint, chart in zip(loops.cut, loops.charts(at).values(), strict=True):
            rates = _rates(joint, chart, loops, at, v[block])
            found[joint.name].append((chart.q, rates, chart.condition < SURE))
    followed = {}
    for joint in loops.cut:
        angles, rates, sure = (np.concatenate(parts) for parts in zip(*found[joint.name], strict=True))
        followed[joint.name] = follow(loops.begin(joint, start), angles, sure, t, rates)
    return followed


def _rates(joint: Joint, chart: Chart, loops: Loops, at: BodyPoses, v: Array) -> Array:
    """Rates of a cut joint's coordinates. Shape (n, m)."""
    return np.asarray((chart.rates(loops.relative(joint, at.J)) @ v[..., None])[..., 0])


def _part(
    tree: Tree, loops: Loops, file: LoopsFile, q: Array, v: Array, a: Array, turned: dict[str, Array]
) -> tuple[Array, Array, Array, Array]:
    at = tree.poses(q)
    charts = {name: chart.near(turned[name]) for name, chart in loops.charts(at).items()}
    cut_v = {joint.name: _rates(joint, charts[joint.name], loops, at, v) for joint in loops.cut}
    cut_a: dict[str, Array] = {}
    if loops.cut:
        V, A = tree.accelerations(q, v, a)
        cut_a = {
            joint.name: charts[joint.name].bias(
                cut_v[joint.name],
                V[:, loops.index[joint.parent], :3],
                loops.relative(joint, V),
                loops.relative(joint, A),
            )
            for joint in loops.cut
        }
    condition = linear.condition(_closed(loops, at, charts))
    tables = ((q, turned), (v, cut_v), (a, cut_a))
    values = [_joints(tree, file, inside, cut) for inside, cut in tables]
    return values[0], values[1], values[2], condition


def _closed(loops: Loops, at: BodyPoses, charts: dict[str, Chart]) -> Array:
    """Closing rows above one row for each independent coordinate. Shape (n, m + k, n_v)."""
    rows, joints = [loops.jacobian(at)], {joint.name: joint for joint in loops.cut}
    for column, name, i in loops.independent:
        if column is None:
            row = charts[name].rates(loops.relative(joints[name], at.J))[:, i]
        else:
            row = np.tile(np.eye(at.J.shape[3])[column], (len(at.J), 1))
        rows.append(row[:, None])
    return np.concatenate(rows, axis=1)


def _joints(tree: Tree, file: LoopsFile, inside: Array, cut: dict[str, Array]) -> Array:
    """All joint coordinates, in the order of the description. Shape (n, n_q)."""
    columns = [
        cut[joint.name][:, i] if joint.name in cut else inside[:, tree.coordinates.index(name)]
        for joint in file.joints
        for i, name in enumerate(joint.coordinates)
    ]
    return np.stack(columns, axis=1)
