"""Reads a URDF or MJCF with Pinocchio, including the closures of an MJCF, and captures parser errors."""

from __future__ import annotations

import copy
import math
import os
import re
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import Content
from screwgauge.models.readings.assemble import assemble
from screwgauge.models.readings.reading import BodyReading, ClosureReading, JointReading, Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array


@contextmanager
def capture_errors() -> Iterator[list[str]]:
    """Suppress stderr within a `with` block and collect the errors printed there; the list is complete afterwards."""
    errors: list[str] = []
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield errors
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            matches = (re.fullmatch(r"Error:\s+(.+)", line) for line in lines)
            errors += dict.fromkeys(match[1].strip() for match in matches if match)


#: Magnitude above which a limit counts as infinite: parsers write the largest numbers of several types.
_UNLIMITED = 1e20
#: Class of a Pinocchio joint -> kind. All other joints are hinges, slides, or composed of these.
_KINDS = {"JointModelFreeFlyer": "free", "JointModelSpherical": "ball"}
#: Parts of a planar joint, named as in MuJoCo, and their numbers of coordinates; the angle has cosine and sine.
_PLANAR = (("TX", 1), ("TY", 1), ("RZ", 2))


@dataclass(frozen=True, slots=True)
class Part:
    """An elementary part of a Pinocchio joint.

    Attributes:
        joint: Index of the joint to which the part belongs.
        kind: ``free``, ``ball``, or empty for a hinge or slide, which the Jacobian distinguishes.
        q, n_q, v: Index of the first coordinate, number of coordinates, index of the first velocity.
    """

    name: str
    joint: int
    kind: str
    q: int
    n_q: int
    v: int


def read_pinocchio(source: Source, home: Mapping[str, float]) -> Reading:
    """Read a URDF or MJCF with Pinocchio.

    Raises:
        ModelFileError: Pinocchio rejects the file.
    """
    model = load_pinocchio(source)
    q, parts = start(model), list(elementary(model, source))
    for part in parts:
        if not part.kind and part.name in home:
            value = home[part.name]
            q[part.q : part.q + part.n_q] = value if part.n_q == 1 else (math.cos(value), math.sin(value))
    placed, J = placements(model, q)
    reading = assemble(
        dict(_links(model, placed, parts)),
        {part.name: joint_reading(model, placed[part.joint], part, J[:, part.v], home) for part in parts},
        str(source.path),
        name=source.name,
        library="pinocchio",
        couplings=source.mimics,
    )
    if source.form == "mjcf":
        unread = list[Content]()
        closed = closures(model, reading, source.root, unread)
        return replace(reading, closures=closed, gravity=np.array(model.gravity.linear), content=tuple(unread))
    phrases = (*_planar_axes(source), *_ignored_quaternions(source))
    return replace(
        reading, content=tuple(Content("read differently by the library", text, values=()) for text in phrases)
    )


def load_pinocchio(source: Source) -> Any:
    """Load a model file with Pinocchio.

    Raises:
        ModelFileError: Pinocchio rejects the file or drops a part of it.
    """
    import pinocchio

    errors: list[str] = []
    try:
        with capture_errors() as errors:
            if source.form == "urdf":
                model = pinocchio.buildModelFromXML(source.text)
            else:
                with as_file(source.root) as path:
                    model = pinocchio.buildModelFromMJCF(path)
    except (ValueError, RuntimeError, TypeError, LookupError) as error:
        # Boost exceptions begin with a source location
        reason = "; ".join(errors) or str(error).rpartition("message: ")[2]
        raise ModelFileError(f"Pinocchio refuses it ({reason})", str(source.path), "correct the file") from None
    if errors:  # Pinocchio would continue without mass and inertia
        raise ModelFileError(
            f"Pinocchio drops parts that it cannot read ({'; '.join(errors)})", str(source.path), "correct the file"
        )
    return model


def start(model: Any) -> Array:
    """Return the neutral coordinates, with free bodies at the poses that the MJCF defines.

    Pinocchio stores these poses as ``qpos0``, and additionally gives the joint of a rotated body a placement.
    """
    import pinocchio

    q: Array = pinocchio.neutral(model)
    at = next((np.array(kept.data()) for kept in model.referenceConfigurations if kept.key() == "qpos0"), None)
    for joint, placement in zip(model.joints, model.jointPlacements, strict=True):
        if at is not None and joint.shortname() in _KINDS and joint.nq == 7:
            part = slice(joint.idx_q, joint.idx_q + 7)
            q[part] = pinocchio.SE3ToXYZQUAT(placement.inverse() * pinocchio.XYZQUATToSE3(at[part]))
    return q


def elementary(model: Any, source: Source | None = None) -> Iterator[Part]:
    """Yield the parts of all joints, from the ground outwards."""
    for i, (name, joint) in enumerate(zip(model.names, model.joints, strict=True)):
        short = joint.shortname()
        if i == 0:
            continue
        if short in _KINDS or joint.nv == 1:
            yield Part(name, i, _KINDS.get(short, ""), joint.idx_q, joint.nq, joint.idx_v)
        elif short == "JointModelPlanar":
            for k, (end, n_q) in enumerate(_PLANAR):
                yield Part(f"{name}_{end}", i, "", joint.idx_q + k, n_q, joint.idx_v + k)
        else:
            yield from _several(model, i, source)


def _several(model: Any, i: int, source: Source | None) -> Iterator[Part]:
    """Yield the parts of a composite joint, named as in the file if their count matches, or else numbered."""
    import pinocchio

    joint = model.joints[i]
    subs = [(_KINDS.get(s.shortname(), ""), s.idx_q, s.nq, s.idx_v) for s in getattr(joint.extract(), "joints", ())]
    # a joint with three translations lacks sub-joints
    subs = subs or [("", joint.idx_q + k, 1, joint.idx_v + k) for k in range(joint.nv)]
    bodies = [f for f in model.frames if f.parentJoint == i and f.type == pinocchio.FrameType.BODY]
    names = [name for body in bodies for name in (source.joints_of(body.name) if source else ())]
    if len(names) != len(subs):
        names = [f"{model.names[i]}.{k + 1}" for k in range(len(subs))]
    for name, sub in zip(names, subs, strict=True):
        yield Part(name, i, *sub)


def placements(model: Any, q: Array) -> tuple[list[Any], Array]:
    """Compute the world placement of each joint and the Jacobian [linear; angular] at the world origin, (6, n_v).

    Pinocchio's Data is avoided because its size grows with the cube of n_v: creation takes half a minute for n_v = 490.
    """
    import pinocchio

    placed, J = [pinocchio.SE3.Identity()], np.zeros((6, model.nv))
    for i, joint in enumerate(model.joints[1:], start=1):
        data = joint.createData()
        joint.calc(data, q)
        placed.append(placed[model.parents[i]] * model.jointPlacements[i] * data.M)
        J[:, joint.idx_v : joint.idx_v + joint.nv] = placed[i].action @ np.reshape(data.S, (6, joint.nv))
    return placed, J


def _links(model: Any, placed: list[Any], parts: list[Part]) -> Iterator[tuple[str, BodyReading]]:
    """Yield every link; frames are identified by index because links and joints may share a name."""
    import pinocchio

    names = {i: tuple(part.name for part in parts if part.joint == i) for i in range(1, model.njoints)}
    kinds, inertias = pinocchio.FrameType, _inertias(model)
    for i, frame in enumerate(model.frames):
        if frame.type != kinds.BODY:
            continue
        joints: tuple[str, ...] = ()
        above = frame.parentFrame
        while above and model.frames[above].type != kinds.BODY:
            if model.frames[above].type == kinds.JOINT:
                joints = names[model.frames[above].parentJoint] + joints
            above = model.frames[above].parentFrame
        Y, near = inertias.get(i), model.frames[above].name if above else ""
        com, inertia = (np.array(Y.lever), np.array(Y.inertia)) if Y else (np.zeros(3), np.zeros((3, 3)))
        mass = float(Y.mass) if Y else 0.0
        pose = placed[frame.parentJoint] * frame.placement
        yield frame.name, BodyReading(mass, com, inertia, near, joints, np.array(pose.homogeneous))


def _inertias(model: Any) -> dict[int, Any]:
    """Return frame index -> inertia of each moving link with mass or inertia, in the frame of the link.

    Pinocchio adds the inertia of a link behind a fixed joint to the preceding moving link, and also stores it with the
    frame of the fixed joint.
    """
    import pinocchio

    joints = [f for f in model.frames if f.type == pinocchio.FrameType.FIXED_JOINT]
    fixed, inertias = [f for f in joints if not f.inertia.isZero(0.0)], {}
    for i, frame in enumerate(model.frames):
        if frame.type != pinocchio.FrameType.BODY or not frame.parentJoint:
            continue
        if model.frames[frame.parentFrame].type == pinocchio.FrameType.FIXED_JOINT:
            Y = model.frames[frame.parentFrame].inertia
        else:
            Y = model.inertias[frame.parentJoint]
            merged = [f.placement.act(f.inertia) for f in fixed if f.parentJoint == frame.parentJoint]
            # The rounding error that remains for a massless link must not be mistaken for a body.
            if Y.mass and abs(Y.mass - sum(share.mass for share in merged)) <= 1e-12 * abs(Y.mass):
                continue
            for share in merged:
                Y = Y - share
            Y = Y if frame.placement.isIdentity(0.0) else frame.placement.actInv(Y)
        if not Y.isZero(0.0):
            inertias[i] = Y
    return inertias


def _planar_axes(source: Source) -> Iterator[str]:
    """Yield planar joints whose plane Pinocchio ignores: it always uses the xy plane; URDF defaults to the yz plane."""
    for joint in source.root.iterfind("joint"):
        axis = joint.find("axis")
        xyz = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        if joint.get("type") == "planar" and [float(word) for word in xyz.split()][:2] != [0.0, 0.0]:
            yield f"axis {xyz} of planar joint {joint.get('name')}: Pinocchio uses 0 0 1"


def _ignored_quaternions(source: Source) -> Iterator[str]:
    """Yield a message if the parser ignores quaternions: it reads them from URDF 1.1 on, but the default is 1.0."""
    origins = [*source.root.iterfind("joint/origin"), *source.root.iterfind("link/inertial/origin")]
    if source.root.get("version", "1.0") == "1.0" and any("quat_xyzw" in origin.attrib for origin in origins):
        yield "origin quat_xyzw, as the file does not declare version 1.1"


def joint_reading(model: Any, placed: Any, part: Part, column: Array, home: Mapping[str, float]) -> JointReading:
    """Convert a part of a Pinocchio joint to a reading.

    Args:
        placed: World placement of the joint.
        column: Column of the Jacobian [linear; angular] at the world origin. Shape (6,).
    """
    centre, axis = np.array(placed.translation), np.concatenate([column[3:], column[:3]])
    kind = part.kind or ("hinge" if axis[:3].any() else "slide")
    if kind == "hinge":  # use the axis point nearest to the joint, which may have several parts
        centre = np.cross(axis[:3], axis[3:]) + axis[:3] * (axis[:3] @ centre)
    limits = float(model.lowerPositionLimit[part.q]), float(model.upperPositionLimit[part.q])
    counts = not part.kind and part.n_q == 1  # the limits of a cosine are meaningless
    return JointReading(
        kind=kind,
        screw=np.zeros(6) if part.kind else axis,
        centre=centre,
        home=0.0 if part.kind else float(home.get(part.name, 0.0)),
        limits=(
            limits[0] if counts and limits[0] > -_UNLIMITED else -math.inf,
            limits[1] if counts and limits[1] < _UNLIMITED else math.inf,
        ),
        armature=float(model.armature[part.v]),
        damping=float(model.damping[part.v]),
        friction=float(model.friction[part.v]),
    )


_CLOSING = {"connect": "point", "weld": "weld"}
_LOST = "dropped by the library"
_JOINED = ("body1", "body2", "site1", "site2")


@contextmanager
def as_file(root: ET.Element) -> Iterator[str]:
    """Write an MJCF to a temporary file and yield its path, since Pinocchio cannot read an MJCF from a string.

    Keyframes are omitted, since Pinocchio rejects them if it drops a part of the model. Attached models
    are omitted, since Pinocchio drops them.
    """
    root = copy.copy(root)
    for section in (*root.findall("keyframe"), *root.findall("asset")):
        root.remove(section)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.xml"
        path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
        yield str(path)


def _number_closures(root: ET.Element, known: Collection[str], unread: list[Content]) -> list[tuple[str, str]]:
    """Rename closures between known frames in file order, and remove all other closures.

    Returns:
        Kind and original name of each remaining closure.
    """
    named = list[tuple[str, str]]()
    for section in root.iterfind("equality"):
        for row in [row for row in section if row.tag in _CLOSING]:
            if missing := [row.get(side, "") for side in _JOINED if side in row.attrib and row.get(side) not in known]:
                section.remove(row)
                unread.append(Content(_LOST, f"{row.tag} {row.get('name')}: Pinocchio cannot place {missing[0]}"))
            else:
                named.append((_CLOSING[row.tag], row.get("name", "")))
                row.set("name", f"{len(named):06}")
    return named


def closures(model: Any, reading: Reading, root: ET.Element, unread: list[Content]) -> dict[str, ClosureReading]:
    """Read the closures of an MJCF, by name.

    Pinocchio 4.1 crashes on closures of dropped bodies, and reads the placement of sites on fixed bodies from
    uninitialised memory; therefore, such closures are removed first and added to `unread`.
    """
    import pinocchio

    root = copy.deepcopy(root)
    named = _number_closures(root, {frame.name for frame in model.frames}, unread)
    build = getattr(pinocchio, "buildModelAndLegacyConstraintsFromMJCF", None)
    if build is None:  # before Pinocchio 4
        unread += [Content(_LOST, f"closure {name}") for _, name in named]
    if build is None or not named:
        return {}
    try:
        with capture_errors(), as_file(root) as path:
            model, constraints = build(path)
    except (ValueError, RuntimeError, LookupError) as error:
        unread.append(Content(_LOST, f"closures, which Pinocchio refuses ({' '.join(str(error).split())})"))
        return {}
    kinds = ["weld" if c.type == pinocchio.ContactType.CONTACT_6D else "point" for c in constraints]
    # Pinocchio discards the names; it lists points first, and each kind in the order of the names set above
    named.sort(key=lambda entry: entry[0])
    if [kind for kind, _ in named] != kinds:
        named = [(kind, f"{kind}_{i + 1}") for i, kind in enumerate(kinds)]
    at = {0: (GROUND, np.eye(4))}  # joint -> body that it carries, and its frame in that body
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY and frame.parentJoint not in at:
            body, T = reading.end_on(frame.name)
            at[frame.parentJoint] = body, T @ np.linalg.inv(frame.placement.homogeneous)
    closed = {}
    for (kind, name), c in zip(named, constraints, strict=True):
        sides = ((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement))
        (first, T1), (second, T2) = ((at[i][0], at[i][1] @ placement.homogeneous) for i, placement in sides)
        closed[name] = ClosureReading(kind, first, T1, second, T2)
    return closed
