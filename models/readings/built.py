"""Reads models built with Pinocchio in Python, and the constraints that close their loops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from screwgauge.models.readings.assemble import assemble
from screwgauge.models.readings.pinocchio import elementary, joint_reading, placements, start
from screwgauge.models.readings.reading import BodyReading, ClosureReading, Reading
from screwgauge.reference.errors import DescriptionError, ModelFileError, quote
from screwgauge.reference.rotations import Array

#: Constraint class, or, before Pinocchio 4, type of the only constraint class -> kind of closure.
_CLOSURES = {
    "PointAnchorConstraintModel": "point",
    "FrameAnchorConstraintModel": "weld",
    "CONTACT_3D": "point",
    "CONTACT_6D": "weld",
}


def read_model(model: Any, constraints: Sequence[Any], q: Array | None, where: str) -> Reading:
    """Read a model: one body for each joint, named after a frame that the joint carries, or after the joint.

    Args:
        q: Home configuration, near which the constraints close; by default, the neutral configuration. Shape (nq,).
        where: Location to report in errors.

    Raises:
        ScrewgaugeError: The object is not a model, or a constraint is not supported.
    """
    import pinocchio

    if not isinstance(model, pinocchio.Model):
        raise DescriptionError(f"{quote(model)} is not a pinocchio.Model", where, "pass a pinocchio.Model")
    home = start(model) if q is None else np.asarray(q, dtype=float)
    if home.shape != (model.nq,) or not np.isfinite(home).all():
        raise DescriptionError(f"q must be {model.nq} finite numbers", where, "pass a configuration of the model")
    parts = [*elementary(model)]
    placed, J = placements(model, home)
    at = {part.name: float(home[part.q]) for part in parts if not part.kind and part.n_q == 1}
    at |= {p.name: math.atan2(home[p.q + 1], home[p.q]) for p in parts if not p.kind and p.n_q == 2}
    frames = [frame for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
    names = {i: next((f.name for f in frames if f.parentJoint == i), model.names[i]) for i in range(1, model.njoints)}
    links = {
        name: BodyReading(
            float(model.inertias[i].mass),
            np.array(model.inertias[i].lever),
            np.array(model.inertias[i].inertia),
            names.get(model.parents[i], ""),
            tuple(part.name for part in parts if part.joint == i),
            np.array(placed[i].homogeneous),
        )
        for i, name in names.items()
    }
    reading = assemble(
        links,
        {part.name: joint_reading(model, placed[part.joint], part, J[:, part.v], at) for part in parts},
        where,
        name=model.name or "model",
        library="pinocchio",
        gravity=np.array(model.gravity.linear),
    )
    named = {getattr(one, "name", "") or f"loop{k + 1}": one for k, one in enumerate(constraints)}
    return replace(reading, closures={name: _closure(one, reading, names, where) for name, one in named.items()})


def _closure(one: Any, reading: Reading, names: dict[int, str], where: str) -> ClosureReading:
    """Convert a constraint between frames of two joints; joint 0 is the ground."""
    kind = _CLOSURES.get(type(one).__name__) or _CLOSURES.get(getattr(getattr(one, "type", None), "name", ""))
    if kind is None:
        remedy = "use points or frames that coincide (CONTACT_3D, CONTACT_6D, PointAnchor, FrameAnchor)"
        raise ModelFileError(f"constraint {quote(one)} is not a supported loop closure", where, remedy)
    ends = []
    for joint, placement in ((one.joint1_id, one.joint1_placement), (one.joint2_id, one.joint2_placement)):
        body, T = reading.end_on(names[joint] if joint else "")
        ends.append((body, T @ placement.homogeneous))
    return ClosureReading(kind, *ends[0], *ends[1])
