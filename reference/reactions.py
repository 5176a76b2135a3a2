"""Components of joint reactions: which there are, where they act, along which directions.

A reaction is the wrench of the joint's parent (ground side) on its child. Each component is a unit force or a unit
moment; they are reciprocal to the joint's freedoms and complete, so a component is also the projection of the whole
wrench on its direction. A coupling has one component, its force along the coordinate that it couples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.reference.couplings import Coupling, component_name
from screwgauge.reference.equations.joint_types import JointPose, components
from screwgauge.reference.mechanism import Joint
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Reactions:
    """Reaction components of all joints, for n samples.

    Attributes:
        names: ``leg1.base.fx`` and so on; joints of one role together (all bases, all slides, ...). Then those of the
            couplings, of which all that follows knows nothing.
        units: N or N m.
        joints: Index of the joint of each component.
        force, moment: Unit direction in world axes, zero for the other kind. Shape (n, m, 3).
        point: Where it acts [m], world. Shape (n, m, 3).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    joints: tuple[int, ...]
    force: Array
    moment: Array
    point: Array

    def read(self, force: Array, moment: Array) -> Array:
        """Components of joint wrenches.

        Args:
            force: Force of parent on child of each joint [N]. Shape (n, n_joint, 3).
            moment: Moment about the joint's point [N m]. Shape (n, n_joint, 3).

        Returns:
            Shape (n, m).
        """
        rows, along = list(self.joints), "nmx,nmx->nm"
        return np.asarray(np.einsum(along, force[:, rows], self.force) + np.einsum(along, moment[:, rows], self.moment))

    def with_couplings(self, couplings: Sequence[Coupling], units: Mapping[str, str]) -> Reactions:
        """The same with a component for each coupling after them.

        Args:
            units: Coordinate -> rad or m.
        """
        names = (*self.names, *(component_name(one) for one in couplings))
        forces = ("N m" if units[one.coordinate] == "rad" else "N" for one in couplings)
        return replace(self, names=names, units=(*self.units, *forces))


def by_role(joints: Sequence[Joint]) -> list[int]:
    """Indices of the joints, grouped by role in the order in which the roles first appear."""
    roles = list(dict.fromkeys(joint.role for joint in joints))
    return sorted(range(len(joints)), key=lambda i: roles.index(joints[i].role))


def joint_point(joint: Joint, R: Array, p: Array) -> Array:
    """World position of a joint on its child, where its reaction is taken. Shapes (n, 3, 3), (n, 3) -> (n, 3)."""
    return p + R @ joint.child_frame.p


def reaction_components(
    joints: Sequence[Joint], R_parent: Sequence[Array], R_child: Sequence[Array], p_child: Sequence[Array]
) -> Reactions:
    """Components for joints whose bodies have the given poses.

    Args:
        joints: The joints, in the order of the description.
        R_parent, R_child: Orientation of the bodies of each joint. Shape (n, 3, 3) each.
        p_child: Origin of the child of each joint [m]. Shape (n, 3) each.
    """
    rows = []
    for i in by_role(joints):
        joint, (parent, child) = joints[i], (joints[i].parent_frame, joints[i].child_frame)
        point = joint_point(joint, R_child[i], p_child[i])
        at = JointPose(joint, R_parent[i] @ parent.R, point, R_child[i] @ child.R, point)
        directions = [*_each(at.type.forces(at), point), *_each(at.type.moments(at), point)]
        for (label, unit), direction in zip(components(joint), directions, strict=True):
            zero = np.zeros_like(direction)
            arrays = (direction, zero, point) if unit == "N" else (zero, direction, point)
            rows.append((f"{joint.name}.{label}", unit, i, *arrays))
    if not rows:
        return Reactions((), (), (), *[np.zeros((len(R_child[0]) if joints else 1, 0, 3))] * 3)
    names, units, owners, *stacks = zip(*rows, strict=True)
    return Reactions(names, units, owners, *(np.stack(arrays, axis=1) for arrays in stacks))


def _each(directions: Array, point: Array) -> Array:
    """Unit directions at every sample. Shape (..., m, 3), (n, 3) -> (m, n, 3)."""
    length = np.linalg.norm(directions, axis=-1, keepdims=True)  # of a U joint's moment 1 where the loop is closed
    return np.moveaxis(np.broadcast_to(directions / length, (len(point), *directions.shape[-2:])), 1, 0)
