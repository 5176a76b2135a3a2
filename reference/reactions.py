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
from screwgauge.reference.mechanism import Frame, Joint
from screwgauge.reference.rotations import Array, cross

_WORLD = ("x", "y", "z")


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
        joint = joints[i]
        point = joint_point(joint, R_child[i], p_child[i])
        for label, is_force, direction in _directions(joint, R_parent[i], R_child[i]):
            zero = np.zeros_like(direction)
            arrays = (direction, zero, point) if is_force else (zero, direction, point)
            rows.append((f"{joint.name}.{label}", "N" if is_force else "N m", i, *arrays))
    if not rows:
        return Reactions((), (), (), *[np.zeros((len(R_child[0]) if joints else 1, 0, 3))] * 3)
    names, units, owners, *stacks = zip(*rows, strict=True)
    return Reactions(names, units, owners, *(np.stack(arrays, axis=1) for arrays in stacks))


def _directions(joint: Joint, R_parent: Array, R_child: Array) -> list[tuple[str, bool, Array]]:
    """(label, is a force, direction in the world) of each component of one joint."""
    if joint.kind == "F":
        return []
    n = len(R_child)
    world = [(f"f{name}", True, np.tile(axis, (n, 1))) for name, axis in zip(_WORLD, np.eye(3), strict=True)]
    if joint.kind == "S":
        return world
    if joint.kind == "U":
        first = R_parent @ (joint.parent_frame.R @ joint.axes[0])
        second = R_child @ (joint.child_frame.R @ joint.axes[1])
        normal = cross(first, second)
        return [*world, ("m", False, normal / np.linalg.norm(normal, axis=1, keepdims=True))]
    across = _across(joint.axes[0], joint.child_frame, R_child)
    if joint.kind == "R":
        return [*world, *((f"m{name}", False, d) for name, d in across)]
    forces = [(f"f{name}", True, d) for name, d in across]
    if joint.kind == "C":
        return [*forces, *((f"m{name}", False, d) for name, d in across)]
    frame = R_child @ joint.child_frame.R
    return [*forces, *((f"m{name}", False, frame[..., k]) for k, name in enumerate(_WORLD))]


def _across(axis: Array, frame: Frame, R_child: Array) -> list[tuple[str, Array]]:
    """Two directions across a joint axis: those of the joint frame where the axis is one of its axes."""
    k = int(np.argmax(np.abs(axis)))
    others = [i for i in range(3) if i != k]
    R = R_child @ frame.R
    if abs(axis[k]) == 1.0:
        return [(_WORLD[i], R[..., i]) for i in others]
    first = cross(axis, np.eye(3)[others[0]])
    first /= np.linalg.norm(first)
    return [("1", R @ first), ("2", R @ cross(axis, first))]
