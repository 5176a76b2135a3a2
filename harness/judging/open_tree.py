"""Joint forces of an engine's open tree, computed again body by body."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.judging.newton_euler_residuals import required_wrenches
from screwgauge.reference.graph import Layout, spanning_tree
from screwgauge.reference.rotations import Array
from screwgauge.witness.dynamics import along
from screwgauge.witness.joints import open_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates

TREE_FORCES = ("tree_force", "tree_force_soft")


def tree_forces(answer: Answer) -> Iterator[Row]:
    """Reported forces less the work that gravity and inertia of the bodies want, one joint of the tree moving alone.

    The tree is that of the joints named. One that leads to a body which another joint reaches leads to a copy of that
    body; the body and its copies have equal shares of its mass.
    """
    mechanism, needed = answer.mechanism, dict[tuple[str, ...], Array]()
    for quantity in TREE_FORCES:
        if not answer.has(quantity):
            continue
        values, units = answer.values[quantity], np.array(answer.values[quantity].units)
        names = values.components
        joints = [joint for joint in mechanism.joints if {*joint.coordinates} <= {*names}]
        tree = spanning_tree(mechanism, [joint.name for joint in joints])
        reached = all(edge.joint in joints for edge in tree.edges)
        if not reached or sorted(names) != sorted(name for joint in joints for name in joint.coordinates):
            nothing = np.full_like(values.array, np.nan)
            row = answer.residual(quantity, units[0], names, nothing, 1.0, (quantity,))
            yield {**row, "reason": "its components are not the joint coordinates of a tree of the mechanism"}
            continue
        if names not in needed:
            needed[names] = _required(answer, tree, {joint.name for joint in joints})[:, mechanism.columns(names)]
        for unit in dict.fromkeys(values.units):
            right = needed[names][:, units == unit]
            left = values.array[:, units == unit] - right
            some = [name for name, has in zip(names, units, strict=True) if has == unit]
            yield answer.residual(quantity, unit, some, left, largest(right), (quantity,))


def _required(answer: Answer, graph: Layout, joints: Collection[str]) -> Array:
    """Force along each joint coordinate of the open tree of some joints. Shape (n, n_q)."""
    tree, bodies, shares = open_tree(answer.mechanism, graph, joints)
    still = np.zeros_like(answer.q)
    wrenches = required_wrenches(answer, loaded=False)[0][:, bodies] * shares[:, None]
    return along(move(tree, TreeStates(answer.q, still, still)), wrenches)
