"""Joint kinds of the witness, and conversion of mechanisms to trees of links.

The table `JOINT_KINDS` is derived from the meaning of the kinds, not from the solver's table of joint types, so that
the witness reveals a wrong sign or direction in that table.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.graph import Layout
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.witness.tree import (
    FixedFrame,
    LoopConstraint,
    SpanningTree,
    TreeLink,
    coupled_column,
    stack_frames,
)

#: Kind -> its elementary joints in order, and the directions of its constraint forces and of its constraint moments:
#: axes of the world or of the child's joint frame, directions across or along the joint's axis, or the normal to its
#: two axes.
JOINT_KINDS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "R": (("hinge",), "world", "across"),
    "P": (("slide",), "across", "frame"),
    "U": (("hinge", "hinge"), "world", "normal"),
    "S": (("hinge", "hinge", "hinge"), "world", ""),
    "C": (("hinge", "slide"), "across", "across"),
    "E": (("slide", "slide", "hinge"), "along", "across"),
    "F": (("slide",) * 3 + ("hinge",) * 3, "", ""),
    "fixed": (("hinge",), "world", "across"),
}


def freedoms(joint: Joint) -> list[tuple[str, Array]]:
    """List a joint's elementary joints in order: kind, and axis in the joint's frame.

    Hinges rotate about the joint's axes. A single slide moves along the first axis, two slides move orthogonally to
    this axis, and three slides move along the frame's axes.
    """
    kinds = JOINT_KINDS[joint.kind][0]
    ways = {2: list(orthogonal_axes(joint.axes[0]).values()), 3: list(np.eye(3))}
    hinges, slides = iter(joint.axes), iter(ways.get(kinds.count("slide"), joint.axes))
    return [(kind, next(hinges if kind == "hinge" else slides)) for kind in kinds]


def orthogonal_axes(axis: Array) -> dict[str, Array]:
    """Return two directions orthogonal to an axis, with labels.

    If the axis is a frame axis, the directions are the other frame axes, labelled x, y or z. If not, they are
    constructed from one frame axis and labelled 1 and 2.
    """
    main = int(np.abs(axis).argmax())
    others = [i for i in range(3) if i != main]
    if not axis[others].any():
        return {"xyz"[i]: np.eye(3)[i] for i in others}
    one = np.cross(axis, np.eye(3)[others[0]])
    one = one / np.sqrt(one @ one)
    return {"1": one, "2": np.cross(axis, one)}


@dataclass(frozen=True, eq=False, kw_only=True)
class MechanismTree(SpanningTree):
    """The tree of a mechanism; coordinates and velocities are the joint coordinates and their rates.

    Attributes:
        mechanism: The mechanism.
        body_frames: Frames of ground and the bodies, by name.
    """

    mechanism: Mechanism
    body_frames: Mapping[str, FixedFrame]

    def fix(self, body: str, frame: Frame) -> FixedFrame:
        """Convert a frame given in a body to a frame fixed to a link."""
        return self.body_frames[body].place(frame.R, frame.p)


def mechanism_tree(mechanism: Mechanism, graph: Layout, length: float = 1.0) -> MechanismTree:
    """Convert a mechanism to the spanning tree of a graph.

    A joint that closes a loop moves a massless copy of its child; a weld constraint aligns the copy with the child.
    """
    links, at = _span(mechanism, graph)
    closures = {
        joint.name: LoopConstraint("weld", at[joint.child], _append_links(links, mechanism, joint, at[joint.parent]))
        for joint in graph.cuts
    }
    column = {name: (i, i) for i, name in enumerate(mechanism.coordinates)}
    return MechanismTree(
        links=tuple(links),
        freedom=len(column),
        bodies=stack_frames([at[body.name] for body in mechanism.bodies]),
        mass=mechanism.masses,
        com=mechanism.mass_centres,
        inertia=mechanism.inertias,
        closures=closures,
        couplings={one.name: coupled_column(column, one.coordinate, one.function) for one in mechanism.couplings},
        length=length,
        mechanism=mechanism,
        body_frames=at,
    )


def open_tree(mechanism: Mechanism, graph: Layout, joints: Collection[str]) -> tuple[SpanningTree, list[int], Array]:
    """Build the open tree of the named joints; a joint that would close a loop moves a copy of its body.

    A body and its copies have equal shares of the mass. Ground has no copies: a joint whose child is ground is
    traversed from ground.

    Returns:
        The tree; for each body of the tree, copies last, its index in the mechanism; and its share of the mass, (m,).
    """
    links, at = _span(mechanism, graph)
    number = {body.name: i for i, body in enumerate(mechanism.bodies)}
    ends, frames = list(number), [at[name] for name in number]
    for joint in graph.cuts:
        if joint.name in joints:
            near, far = joint.bodies[:: -1 if joint.child == GROUND else 1]
            ends.append(far)
            frames.append(_append_links(links, mechanism, joint, at[near], reverse=near == joint.child))
    rows = [number[name] for name in ends]
    shares = np.array([1.0 / ends.count(name) for name in ends])
    parts = (
        shares * mechanism.masses[rows],
        mechanism.mass_centres[rows],
        shares[:, None, None] * mechanism.inertias[rows],
    )
    tree = SpanningTree(tuple(links), len(mechanism.coordinates), stack_frames(frames), *parts)
    return tree, rows, shares


def _span(mechanism: Mechanism, graph: Layout) -> tuple[list[TreeLink], dict[str, FixedFrame]]:
    """Build the links of a spanning tree's joints, and frames of ground and bodies."""
    links, at = list[TreeLink](), {GROUND: FixedFrame()}
    for edge in graph.edges:
        at[edge.far] = _append_links(links, mechanism, edge.joint, at[edge.near], reverse=edge.reverse)
    return links, at


def _append_links(
    links: list[TreeLink], mechanism: Mechanism, joint: Joint, near: FixedFrame, *, reverse: bool = False
) -> FixedFrame:
    """Append the links of a joint; return the frame of the body at its other end.

    Args:
        near: Frame of the body from which the links start; if `reverse`, this body is the joint's child.
    """
    (_, start), (_, end) = joint.sides[::-1] if reverse else joint.sides
    steps = [*zip(freedoms(joint), mechanism.columns(joint.coordinates), strict=True)]
    at = near.place(start.R, start.p)
    for (kind, axis), column in reversed(steps) if reverse else steps:
        links.append(TreeLink(kind, at, axis, column, column, sign=-1.0 if reverse else 1.0))
        at = FixedFrame(len(links))
    return at.place(end.R.T, -end.R.T @ end.p)
