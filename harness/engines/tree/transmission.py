"""Reactions of all joints from the wrenches that an engine transmits through its tree and from the multipliers."""

from __future__ import annotations

import numpy as np

from screwgauge.engines.tree.closed import ClosedTree
from screwgauge.engines.tree.closure import Loops
from screwgauge.engines.tree.protocol import BodyPoses, Tree
from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.reactions import Reactions, joint_point, reaction_components
from screwgauge.reference.rotations import Array


def joint_reactions(
    closed: ClosedTree, at: BodyPoses, transmitted: Array, multipliers: Array
) -> tuple[Reactions, Array]:
    """Reaction components of every joint of the description, tree and cut ones alike.

    Args:
        transmitted: Wrench on each body from its tree parent, about its origin. Shape (n, n_body + 1, 6).
        multipliers: Forces of the anchors on their child side. Shape (n, 3 n_anchor).

    Returns:
        The components, and their values [N or N m], shape (n, m).
    """
    file, tree, loops, n = closed.file, closed.tree, closed.loops, len(at.p)
    force, moment = np.zeros((n, len(file.joints), 3)), np.zeros((n, len(file.joints), 3))
    sides = [joint_sides(joint, loops) for joint in file.joints]
    for j, (joint, (parent, child)) in enumerate(zip(file.joints, sides, strict=True)):
        if joint in loops.cut:
            wrench, body = _closing(joint, loops, at, multipliers), child
        elif _tree_parent(tree, loops, child) == parent:
            wrench, body = transmitted[:, child], child
        else:  # declared against the direction of the tree
            wrench, body = -transmitted[:, parent], parent
        point = joint_point(joint, at.R[:, child], at.p[:, child])
        force[:, j] = wrench[:, :3]
        moment[:, j] = wrench[:, 3:] - np.cross(point - at.p[:, body], wrench[:, :3])
    reactions = reaction_components(
        file.joints,
        [at.R[:, parent] for parent, _ in sides],
        [at.R[:, child] for _, child in sides],
        [at.p[:, child] for _, child in sides],
    )
    return reactions, reactions.read(force, moment)


def joint_sides(joint: Joint, loops: Loops) -> tuple[int, int]:
    """Parent and child of a joint in the tree, where a copy stands for the body if the joint has its own."""
    found = [loops.index.get(f"{side}@{joint.name}", loops.index[side]) for side in (joint.parent, joint.child)]
    return found[0], found[1]


def _tree_parent(tree: Tree, loops: Loops, body: int) -> int:
    return loops.index[tree.parents[body - 1]] if body else loops.index[GROUND]


def _closing(joint: Joint, loops: Loops, at: BodyPoses, multipliers: Array) -> Array:
    """Wrench of a cut joint on its child, about the child's origin, from its anchors. Shape (n, 6)."""
    out = np.zeros((len(at.p), 6))
    for k, anchor in enumerate(loops.anchors):
        if anchor.joint == joint.name:
            f = multipliers[:, 3 * k : 3 * k + 3]
            out[:, :3] += f
            out[:, 3:] += np.cross(at.R[:, anchor.child] @ anchor.at_child, f)
    return out
