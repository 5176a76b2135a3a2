"""A mechanism as the text of a description, numbers in full: it reads back as the same mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from screwgauge.models.formats import TENSOR, document, key, lines
from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism


def description(mechanism: Mechanism, remarks: Sequence[str] = ()) -> str:
    """The description as TOML.

    Args:
        remarks: Sentences that stand above it as comments.
    """
    out = [f"# {line}" for remark in remarks for line in wrap(remark, 116)]
    head = {"name": mechanism.name, "title": mechanism.title, "source": mechanism.source, "group": mechanism.group}
    out += lines({name: value for name, value in head.items() if value})
    parts = [(f"[bodies.{key(body.name)}]", _body(body)) for body in mechanism.bodies]
    parts += [(f"[joints.{key(joint.name)}]", _joint(joint)) for joint in mechanism.joints]
    return document(out, mechanism, parts)


def _body(body: Body) -> dict[str, Any]:
    if not body.mass:
        return {"mass": 0.0}
    tensor = {name: body.inertia[place] for name, place in TENSOR.items() if body.inertia[place]}
    return {"mass": body.mass, **({"com": body.com} if body.com.any() else {}), "inertia": tensor}


def _joint(joint: Joint) -> dict[str, Any]:
    entries: dict[str, Any] = {name: getattr(joint, name) for name in ("kind", "parent", "child", "axes")}
    if joint.coordinates != (joint.name,):
        entries["coordinates"] = joint.coordinates
    if joint.home.any():
        entries["home"] = joint.home
    if np.isfinite(joint.limits).any():
        entries["limits"] = np.nan_to_num(joint.limits, posinf=1e10, neginf=-1e10)
    if joint.actuated:
        entries["actuated"] = True
    for name in ("parent_frame", "child_frame"):
        frame: Frame = getattr(joint, name)
        if not frame.is_identity:
            entries[name] = frame
    return entries
