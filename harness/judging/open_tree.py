"""Joint forces of an engine's open tree, computed again body by body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from screwgauge.judging.allowed import Allowed
from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.judging.balance import required_wrenches
from screwgauge.judging.kinetics import across, unit_motions
from screwgauge.reference.graph import Layout, spanning_tree
from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.rotations import Array

TREE_FORCES = ("tree_force", "tree_force_soft")


def tree_forces(answer: Answer, allowed: Allowed) -> Iterator[Row]:
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
            needed[names] = _required(answer, allowed, tree, joints)[:, mechanism.columns(names)]
        for unit in dict.fromkeys(values.units):
            right = needed[names][:, units == unit]
            left = values.array[:, units == unit] - right
            some = [name for name, has in zip(names, units, strict=True) if has == unit]
            yield answer.residual(quantity, unit, some, left, largest(right), (quantity,))


def _required(answer: Answer, allowed: Allowed, tree: Layout, joints: Sequence[Joint]) -> Array:
    """Force along each joint coordinate of the open tree of some joints. Shape (n, n_q)."""
    mechanism, index, q = answer.mechanism, answer.mechanism.body_index, answer.q
    # ground has no copies: a joint that ends there leads from it to a copy of the other body
    copied = [(joint, joint.child == GROUND) for joint in tree.cuts if joint in joints]
    ends = [joint.parent if reverse else joint.child for joint, reverse in copied]
    shares = np.array([1.0 / (1 + ends.count(body.name)) for body in mechanism.bodies])
    wrenches = required_wrenches(answer, loaded=False)[0] * shares[:, None]
    alike = [edge.joint for edge in tree.edges] == [edge.joint for edge in answer.tree.edges]
    force = np.zeros_like(q)
    for column, motions in enumerate(allowed.units if alike else unit_motions(mechanism, tree, q, range(q.shape[1]))):
        force[:, column] = np.sum(wrenches * motions.velocities, axis=(1, 2))
        for (joint, reverse), end in zip(copied, ends, strict=True):
            own = mechanism.columns(joint.coordinates)
            rates = np.zeros((3, len(q), len(own)))
            rates[0], rates[1] = q[:, own], np.equal(own, column)
            start = motions.bodies.one(index[joint.child if reverse else joint.parent])
            copy = across(joint, start, rates, reverse=reverse)
            at = copy.shifted(copy.R @ mechanism.body(end).com)
            force[:, column] += np.sum(wrenches[:, index[end] - 1] * np.concatenate([at.v, at.w], axis=1), axis=1)
    return force
