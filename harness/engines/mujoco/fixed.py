"""Represent a description's fixed joints, which are nested bodies in an MJCF, by hinges that equalities lock."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco

from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Joint


def editable(mjcf: Path, joints: Sequence[Joint]) -> mujoco.MjSpec:
    """Build the uncompiled model with a hinge about z for each fixed joint, and an equality that locks the hinge.

    If there are fixed joints, keyframes are removed, because they lack the coordinates of the hinges.

    Raises:
        ModelFileError: In the MJCF, neither body of a fixed joint is the parent of the other body.
    """
    spec, fixed = mujoco.MjSpec.from_file(str(mjcf)), [joint for joint in joints if joint.fixed]
    held = {each.name for each in spec.joints}
    for joint in (joint for joint in fixed if joint.name not in held):
        near, far = spec.body(joint.parent) or spec.worldbody, spec.body(joint.child) or spec.worldbody
        reverse = near.parent is not None and near.parent.name == far.name
        if not reverse and (far.parent is None or far.parent.name != near.name):
            what = f"joint '{joint.name}' fixes bodies {joint.parent} and {joint.child}, but neither contains the other"
            raise ModelFileError(what, str(mjcf), "nest one of them in the other")
        (body, frame), sign = ((near, joint.parent_frame), -1.0) if reverse else ((far, joint.child_frame), 1.0)
        body.add_joint(name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, pos=frame.p, axis=sign * frame.R[:, 2])
        objects = {"objtype": mujoco.mjtObj.mjOBJ_JOINT, "name1": joint.name}
        spec.add_equality(name=joint.name, type=mujoco.mjtEq.mjEQ_JOINT, **objects)
    for key in [*spec.keys] if fixed else ():
        spec.delete(key)
    return spec
