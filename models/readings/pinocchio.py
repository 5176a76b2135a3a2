"""What Pinocchio reads from a URDF or MJCF."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.readings.assemble import Link, assemble
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.rotations import Array

#: Names that stand for unlimited.
_UNLIMITED = 1e20
_FREE, _BALL, _PLANAR = "JointModelFreeFlyer", "JointModelSpherical", "JointModelPlanar"


@dataclass(frozen=True, slots=True)
class _Part:
    """An elementary joint: where it is in the vectors of coordinates and velocities. `kind` None: hinge or slide."""

    name: str
    joint: int
    kind: str | None
    at: int
    n_q: int
    dof: int


def read_pinocchio(source: Source, home: Mapping[str, float]) -> Reading:
    """Reads a URDF or MJCF by Pinocchio.

    Raises:
        ModelFileError: Pinocchio refuses it.
    """
    import pinocchio

    try:
        model = _model(source)
    except (ValueError, RuntimeError, TypeError, IndexError) as error:
        raise ModelFileError(f"Pinocchio refuses it ({error})", str(source.path), "mend the file") from None
    data, q = model.createData(), _start(model)
    parts = list(_parts(model, source))
    for part in parts:
        if part.kind is None and part.name in home:
            value = home[part.name]
            q[part.at : part.at + part.n_q] = value if part.n_q == 1 else (math.cos(value), math.sin(value))
    pinocchio.computeJointJacobians(model, data, q)
    pinocchio.updateFramePlacements(model, data)
    assembly = assemble(_links(model, data, parts), str(source.path))
    J = np.reshape(data.J, (6, model.nv))  # one column alone comes as a vector
    return Reading(
        source.name,
        "pinocchio",
        assembly.bodies,
        {part.name: _joint(model, data, part, J, home) for part in parts},
        assembly.fixed,
        couplings=source.mimics,
        gravity=np.array(model.gravity.linear) if source.form == "mjcf" else None,
        ignored=source.ignored,
    )


def _model(source: Source) -> Any:
    import pinocchio

    if source.form == "urdf":
        return pinocchio.buildModelFromXML(source.text)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.xml"
        path.write_text(source.text, encoding="utf-8")
        return pinocchio.buildModelFromMJCF(str(path))


def _start(model: Any) -> Array:
    """Neutral, free bodies where the file has them."""
    import pinocchio

    q: Array = pinocchio.neutral(model)
    kept = {entry.key(): np.array(entry.data()) for entry in model.referenceConfigurations}
    if "qpos0" in kept:
        for joint in model.joints[1:]:
            if joint.shortname() == _FREE:
                q[joint.idx_q : joint.idx_q + 7] = kept["qpos0"][joint.idx_q : joint.idx_q + 7]
    return q


def _parts(model: Any, source: Source) -> Iterator[_Part]:
    """All elementary joints, from the ground outwards."""
    for i, (name, joint) in enumerate(zip(model.names, model.joints, strict=True)):
        if not i:
            continue
        short = joint.shortname()
        if short == _FREE:
            yield _Part(name, i, "free", joint.idx_q, 7, joint.idx_v)
        elif short == _BALL:
            yield _Part(name, i, "ball", joint.idx_q, 4, joint.idx_v)
        elif joint.nv == 1:
            yield _Part(name, i, None, joint.idx_q, joint.nq, joint.idx_v)
        elif short == _PLANAR:  # its angle is kept as cosine and sine
            for k, n_q in enumerate((1, 1, 2)):
                yield _Part(f"{name}.{k + 1}", i, None, joint.idx_q + k, n_q, joint.idx_v + k)
        else:
            yield from _several(model, i, source)


def _several(model: Any, i: int, source: Source) -> Iterator[_Part]:
    """Elementary joints of a composite one, by their names in the file if it has as many."""
    joint = model.joints[i]
    subs = list(joint.extract().joints) if "Composite" in joint.shortname() else []
    names = [name for frame in model.frames if frame.parentJoint == i for name in source.joints_of(frame.name)]
    if len(names) != (len(subs) or joint.nv):
        names = [f"{model.names[i]}.{k + 1}" for k in range(len(subs) or joint.nv)]
    if not subs:  # three slides
        for k, name in enumerate(names):
            yield _Part(name, i, None, joint.idx_q + k, 1, joint.idx_v + k)
    for name, sub in zip(names, subs, strict=False):
        kind = {_BALL: "ball", _FREE: "free"}.get(sub.shortname())
        yield _Part(name, i, kind, sub.idx_q, sub.nq, sub.idx_v)


def _links(model: Any, data: Any, parts: list[_Part]) -> Iterator[Link]:
    """Every link. Links and joints may share a name, so frames are told apart by their numbers."""
    import pinocchio

    names = {i: tuple(part.name for part in parts if part.joint == i) for i in range(1, model.njoints)}
    kinds, inertias = pinocchio.FrameType, _inertias(model)
    for i, frame in enumerate(model.frames):
        if frame.type != kinds.BODY:
            continue
        joints, above = (), frame.parentFrame
        while above and model.frames[above].type != kinds.BODY:
            if model.frames[above].type == kinds.JOINT:
                joints = names[model.frames[above].parentJoint] + joints
            above = model.frames[above].parentFrame
        Y, near = inertias.get(i), model.frames[above].name if above else ""
        moments = (float(Y.mass), np.array(Y.lever), np.array(Y.inertia)) if Y else (0.0, np.zeros(3), np.zeros((3, 3)))
        yield Link(frame.name, near, joints, *moments, np.array(data.oMf[i].homogeneous))


def _inertias(model: Any) -> dict[int, Any]:
    """Frame number of each moving link with mass -> its inertia in the link's frame.

    Pinocchio adds a link behind a fixed joint to the moving link before it, and keeps its share in the frame of the
    fixed joint.
    """
    import pinocchio

    fixed = {i: f for i, f in enumerate(model.frames) if f.type == pinocchio.FrameType.FIXED_JOINT and f.inertia.mass}
    inertias = {}
    for i, frame in enumerate(model.frames):
        if frame.type != pinocchio.FrameType.BODY or not frame.parentJoint:
            continue
        if model.frames[frame.parentFrame].type == pinocchio.FrameType.FIXED_JOINT:
            Y = model.frames[frame.parentFrame].inertia
        else:
            Y = model.inertias[frame.parentJoint]
            merged = [f.placement.act(f.inertia) for f in fixed.values() if f.parentJoint == frame.parentJoint]
            # What rounding leaves of a massless link must not pass for a body.
            if merged and Y.mass - sum(share.mass for share in merged) <= 1e-12 * Y.mass:
                continue
            for share in merged:
                Y = Y - share
            Y = Y if frame.placement.isIdentity(0.0) else frame.placement.actInv(Y)
        if Y.mass:
            inertias[i] = Y
    return inertias


def _joint(model: Any, data: Any, part: _Part, J: Array, home: Mapping[str, float]) -> JointReading:
    column = J[:, part.dof]  # [linear; angular]
    where = np.array(data.oMi[part.joint].translation)
    at, dof = part.at, part.dof
    kind, axis = part.kind or ("hinge" if column[3:].any() else "slide"), np.zeros(6)
    if part.kind is None:
        axis = np.concatenate([column[3:], column[:3]])
        if kind == "hinge":  # the point of its axis next to the joint
            point = np.cross(axis[:3], axis[3:])
            where = point + axis[:3] * (axis[:3] @ where)
    low, high = float(model.lowerPositionLimit[at]), float(model.upperPositionLimit[at])
    limited = part.kind is None and part.n_q == 1
    return JointReading(
        kind,
        axis,
        where,
        float(home.get(part.name, 0.0)) if part.kind is None else 0.0,
        (
            low if limited and low > -_UNLIMITED else -math.inf,
            high if limited and high < _UNLIMITED else math.inf,
        ),
        float(model.armature[dof]),
        float(model.damping[dof]),
        float(model.upperDryFrictionLimit[dof]),
    )
