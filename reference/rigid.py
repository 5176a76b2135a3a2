"""Merges bodies that are connected by fixed joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.mechanism import GROUND, Body, Frame, Joint, Mechanism

#: Body -> merged body that contains it, and frame of the body in the merged body.
Places = dict[str, tuple[str, Frame]]


def without_fixed_joints(mechanism: Mechanism) -> Mechanism:
    """Merge bodies that are connected by fixed joints, under the name of the body nearest to the ground.

    The result has the coordinates `Mechanism.moving`; it lacks the forces that the import left out.
    """
    if len(mechanism.moving) == len(mechanism.coordinates):
        return mechanism
    places: Places = {GROUND: (GROUND, Frame())}
    for edge in spanning_tree(mechanism).edges:
        whole, frame = places[edge.near]
        near, far = (edge.joint.parent_frame, edge.joint.child_frame)[:: -1 if edge.reverse else 1]
        held = whole, compose(frame, compose(near, inverse(far)))
        places[edge.far] = held if edge.joint.fixed else (edge.far, Frame())
    parts: dict[str, list[Body]] = {}
    for body in mechanism.bodies:
        whole, frame = places[body.name]
        parts.setdefault(whole, []).append(_place(body, frame))
    parts.pop(GROUND, None)
    couplings = tuple(one for one in mechanism.couplings if not one.fixing)
    axial = mechanism.axial
    if axial is not None:
        axial = axial[0], places[mechanism.joint(axial[0]).child][1].R @ axial[1]
    return replace(
        mechanism,
        bodies=tuple(_join(name, some) for name, some in parts.items()),
        joints=tuple(_reattach(joint, places) for joint in mechanism.joints if not joint.fixed),
        couplings=couplings,
        axial=axial,
        left_out=(),
    )


def compose(first: Frame, second: Frame) -> Frame:
    """Compose two placements; the second is given relative to the first."""
    return Frame(first.p + first.R @ second.p, first.R @ second.R)


def inverse(frame: Frame) -> Frame:
    """Invert a placement."""
    return Frame(-frame.R.T @ frame.p, frame.R.T)


def _reattach(joint: Joint, places: Places) -> Joint:
    (parent, near), (child, far) = places[joint.parent], places[joint.child]
    near, far = compose(near, joint.parent_frame), compose(far, joint.child_frame)
    return replace(joint, parent=parent, child=child, parent_frame=near, child_frame=far)


def _place(body: Body, frame: Frame) -> Body:
    """Express a body in a different frame."""
    com = frame.p + frame.R @ body.com if body.mass else body.com
    return replace(body, com=com, inertia=frame.R @ body.inertia @ frame.R.T)


def _join(name: str, parts: list[Body]) -> Body:
    """Merge bodies that are expressed in a common frame."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / (mass or 1.0)
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia = inertia + part.inertia + part.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    return Body(name, mass, com, inertia, parts[0].where, allowed=True)
