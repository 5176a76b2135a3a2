"""A mechanism as the text of a description, numbers in full: it reads back as the same mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from screwgauge.models.placement import TENSOR
from screwgauge.models.tables import key, lines
from screwgauge.reference.couplings import Coupling
from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism


def description(mechanism: Mechanism, remarks: Sequence[str] = ()) -> str:
    """The description as TOML.

    Args:
        remarks: Sentences that stand above it as comments.
    """
    out = [f"# {line}" for remark in remarks for line in wrap(remark, 116)]
    head = {"name": mechanism.name, "title": mechanism.title, "source": mechanism.source, "group": mechanism.group}
    tables: list[tuple[str, dict[str, Any]]] = [("[independent]", dict(mechanism.independent))]
    if mechanism.axial:
        tables.append(("[spherical_axial]", {"joint": mechanism.axial[0], "direction": mechanism.axial[1]}))
    tables += [(f"[bodies.{key(body.name)}]", _body(body)) for body in mechanism.bodies]
    tables += [(f"[joints.{key(joint.name)}]", _joint(joint)) for joint in mechanism.joints]
    tables += [(f"[couplings.{key(one.name)}]", _coupling(one)) for one in mechanism.couplings]
    out += lines({name: value for name, value in head.items() if value})
    for title, entries in tables:
        out += ["", title, *lines(entries)]
    return "\n".join(out) + "\n"


def _body(body: Body) -> dict[str, Any]:
    if not body.mass:
        return {"mass": 0.0}
    tensor = {name: body.inertia[place] for name, place in TENSOR.items() if body.inertia[place]}
    return {"mass": body.mass, **({"com": body.com} if body.com.any() else {}), "inertia": tensor}


def _coupling(coupling: Coupling) -> dict[str, Any]:
    of = {"of": coupling.of} if coupling.of else {}
    return {"coordinate": coupling.coordinate, **of, "polynomial": coupling.polynomial}


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
