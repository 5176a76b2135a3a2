"""From given motion of an engine's open tree: closing rows, loads as joint forces, actuator forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.engines.tree.closure import Loops, make_loops
from screwgauge.engines.tree.protocol import Tree
from screwgauge.models.loops import LoopsFile
from screwgauge.reference.continuation import partial_rates
from screwgauge.reference.dynamics import min_norm
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.case import Case


@dataclass(frozen=True, eq=False)
class Given:
    """An engine's tree with the true motion of its coordinates.

    Attributes:
        q, v, a: Motion of the tree. Shape (n, n_v).
        load: The scene's loads as joint forces. Shape (n, n_v).
        driven: Columns of the actuated coordinates.
    """

    case: Case
    tree: Tree
    loops: Loops
    q: Array
    v: Array
    a: Array
    load: Array
    driven: tuple[int, ...]

    def actuator_forces(self, tau: Array) -> Array:
        """Smallest actuator forces that, with the loads, make the joint forces `tau` of the open tree.

        Args:
            tau: Inverse dynamics of the open tree under gravity. Shape (n, n_v).

        Returns:
            Shape (n, n_actuator).
        """
        A = closing_rows(self.tree, self.loops, self.q)
        K = partial_rates(A, len(self.loops.independent))
        Q = (K.swapaxes(1, 2) @ (tau - self.load)[..., None])[..., 0]
        return min_norm(K[:, list(self.driven)], Q)

    def applied(self) -> Array:
        """True actuator forces and loads as joint forces. Shape (n, n_v)."""
        tau = self.load.copy()
        tau[:, list(self.driven)] += self.case.reference.values["actuator_force"].array
        return tau


def given(case: Case, tree: Tree, file: LoopsFile) -> Given:
    """The true motion of a loaded tree."""
    loops = make_loops(tree, file)
    q, v, a = case.given(tree.coordinates)
    driven = tuple(tree.coordinates.index(joint.coordinates[0]) for joint in file.joints if joint.actuated)
    return Given(case, tree, loops, q, v, a, loads_on_joints(case, tree, loops, q), driven)


def closing_rows(tree: Tree, loops: Loops, q: Array) -> Array:
    """Closure Jacobian over the rows that select the independent coordinates. Shape (n, m + k, n_v)."""
    at = tree.poses(q)
    rows = [loops.jacobian(at)]
    charts = loops.charts(at)
    cut = {joint.name: joint for joint in loops.cut}
    for column, name, i in loops.independent:
        if column is None:
            row = charts[name].rates(loops.relative(cut[name], at.J))[:, i]
        else:
            row = np.tile(np.eye(q.shape[1])[column], (len(q), 1))
        rows.append(row[:, None])
    return np.concatenate(rows, axis=1)


def loads_on_joints(case: Case, tree: Tree, loops: Loops, q: Array) -> Array:
    """The scene's loads as joint forces of the open tree. Shape (n, n_v)."""
    at, out = tree.poses(q), np.zeros_like(q)
    for load in case.scene.loads:
        i = loops.index[load.body]
        arm = at.R[:, i] @ (tree.com[i - 1] if load.point is None else load.point)
        moment = load.torque + np.cross(arm, load.force)
        out += np.einsum("nxi,nx->ni", at.J[:, i, :3], moment) + np.einsum("nxi,x->ni", at.J[:, i, 3:], load.force)
    return out
