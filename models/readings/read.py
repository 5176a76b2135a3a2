"""Reads model files with any library that supports the format, lists unread content and rejects impossible models."""

from __future__ import annotations

import copy
import io
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.content import Content, Extra, Values, beyond_reading, kind_of
from screwgauge.models.poses import screw
from screwgauge.models.readings.assemble import assemble
from screwgauge.models.readings.mujoco import read_mujoco
from screwgauge.models.readings.pinocchio import read_pinocchio
from screwgauge.models.readings.reading import OWN, BodyReading, JointReading, Reading
from screwgauge.models.readings.sdf import read_sdf
from screwgauge.models.readings.source import Source, prepare
from screwgauge.models.readings.usd import read_usd
from screwgauge.reference.errors import ModelFileError, UnknownNameError, first_few, remedy_of_import
from screwgauge.reference.lint import Solid, of_bodies, size_of, too_far
from screwgauge.reference.rotations import Array, widest

#: Type of a joint in URDF -> kind; `fixed` is absent.
_KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "floating": "free"}


def read_yourdfpy(source: Source, home: Mapping[str, float]) -> Reading:
    """Read a URDF with yourdfpy.

    Raises:
        ModelFileError: yourdfpy rejects the file, or the file has a planar joint.
    """
    import yourdfpy

    where = str(source.path)
    try:
        options = {"load_meshes": False, "load_collision_meshes": False}
        robot = yourdfpy.URDF.load(io.BytesIO(_without_mimics(source.root)), **options)
        robot.update_cfg({name: home.get(name, 0.0) for name in robot.actuated_joint_names})
        joints = {j.name: _joint(robot, j, home.get(j.name, 0.0)) for j in robot.joint_map.values() if j.type in _KINDS}
    except Exception as error:  # yourdfpy does not catch exceptions of its dependencies
        reason = f"{type(error).__name__}: {error}"
        raise ModelFileError(f"yourdfpy refuses it ({reason})", where, "correct the file") from None
    if planar := [joint.name for joint in robot.joint_map.values() if joint.type == "planar"]:
        raise ModelFileError(f"yourdfpy cannot place planar joint {planar[0]}", where, "choose another library")
    rest = {"name": source.name, "library": "yourdfpy", "couplings": source.mimics}
    return assemble(dict(_links(robot)), joints, where, **rest)


def _without_mimics(root: ET.Element) -> bytes:
    """Remove every `<mimic>`, since yourdfpy would move those joints; couplings are read separately."""
    root = copy.deepcopy(root)
    for joint in root.iterfind("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    return ET.tostring(root)


def _links(robot: Any) -> Iterator[tuple[str, BodyReading]]:
    above = {joint.child: joint for joint in robot.joint_map.values()}
    below: dict[str, list[str]] = {}
    for joint in robot.joint_map.values():
        below.setdefault(joint.parent, []).append(joint.child)
    waiting = [robot.base_link]
    while waiting:
        name = waiting.pop()
        waiting += below.get(name, [])
        joint, inertial = above.get(name), robot.link_map[name].inertial
        mass, com, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        if inertial:
            origin = np.eye(4) if inertial.origin is None else inertial.origin
            mass, com = float(inertial.mass or 0.0), origin[:3, 3]
            if inertial.inertia is not None:
                inertia = origin[:3, :3] @ inertial.inertia @ origin[:3, :3].T
        moving = (joint.name,) if joint and joint.type in _KINDS else ()
        pose = robot.get_transform(name, robot.base_link)
        yield name, BodyReading(mass, com, inertia, joint.parent if joint else "", moving, pose)


def _joint(robot: Any, joint: Any, home: float) -> JointReading:
    kind, T = _KINDS[joint.type], robot.get_transform(joint.child, robot.base_link)
    bounds, dynamics = joint.limit, joint.dynamics
    limits = (-math.inf, math.inf)
    if bounds is not None and joint.type in ("revolute", "prismatic"):
        limits = (float(bounds.lower or 0.0), float(bounds.upper or 0.0))
    single = kind != "free"
    return JointReading(
        kind,
        screw(kind == "hinge", T[:3, :3] @ joint.axis / np.linalg.norm(joint.axis), T[:3, 3])
        if single
        else np.zeros(6),
        T[:3, 3],
        home if single else 0.0,
        limits,
        damping=float((dynamics and dynamics.damping) or 0.0),
        friction=float((dynamics and dynamics.friction) or 0.0),
    )


#: Number of links and joints that are named; further items are only counted.
_NAMED = 3


def unread_content(source: Source, reading: Reading) -> tuple[Content, ...]:
    """List the content that the reading lacks; dropped links and joints come first.

    The text of an MJCF compiled by MuJoCo is not searched: the compiled arrays contain everything that it defines.
    """
    known = source.form == "mjcf" and reading.library == "mujoco"
    roots = () if known else (source.root, *source.attached.values())
    extras = chain.from_iterable(beyond_reading(root, source.form, reading.library) for root in roots)
    extra_content = [_content(source, extra) for extra in extras]
    if source.form == "mjcf" and source.root.find("worldbody//geom") is not None:
        extra_content.append(Content("contacts of geoms", "contacts of geoms"))
    own = (each for each in reading.content if source.form != "urdf" or each.kind != "force limits")
    return (*dropped_parts(source, reading), *_removed_content(source, reading), *own, *extra_content)


def _content(source: Source, extra: Extra) -> Content:
    """Convert an extra to content; values are omitted for MJCF, where default classes add attributes to elements."""
    kind = kind_of(extra.what)
    if source.form == "mjcf" or extra.element is None:
        return Content(kind, extra.what, extra.whose)
    joint = extra.whose.removeprefix(" of joint ")
    of = (("joints", joint, 1.0),) if joint != extra.whose else ()
    value = extra.element.get(extra.attribute) if extra.attribute else None
    values: Values = tuple(_canonical(extra.element)) if value is None else ((extra.attribute, _number(value)),)
    if extra.what == "limit effort" and isinstance(effort := _number(value or ""), float):  # as MuJoCo stores it
        values = ("actfrcrange[0]", -effort), ("actfrcrange[1]", effort)
    return Content(kind, extra.what, extra.whose, of, values)


def _canonical(element: ET.Element) -> Iterator[tuple[str, float | str]]:
    """Yield the numbers and strings of an element and its children, regardless of spacing and attribute order."""
    yield "element", element.tag
    for name, value in sorted(element.attrib.items()):
        yield from ((name, _number(word)) for word in value.split())
    yield from ((element.tag, _number(word)) for word in (element.text or "").split())
    for child in element:
        yield from _canonical(child)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _removed_content(source: Source, reading: Reading) -> Iterator[Content]:
    """Yield the content that was removed before a library read the file; only MuJoCo would take mass from meshes."""
    for each in source.content:
        idle = each.kind == "mass from meshes" and reading.library != "mujoco"
        yield replace(each, kind="put in place") if idle else each


def dropped_parts(source: Source, reading: Reading) -> list[Content]:
    """List links, moving joints and attached models of the file that the library ignores."""
    fixed = (name for body in reading.bodies.values() for name in body.fixed)
    joints = {joint.removesuffix(end) for joint in reading.joints for end in ("", "_TX", "_TY", "_RZ")}
    lost = source.attached and reading.library != "mujoco"
    phrases = [f"attached models, which {reading.library} drops"] if lost else []
    for what, known in (
        ("link" if source.form == "urdf" else "body", {*reading.bodies, *reading.fixed, *fixed}),
        ("joint", joints),
    ):
        names = [name for name in source.names(what) if name not in known]
        if names:
            phrases.append(f"{what} {first_few(names, _NAMED)}, which {reading.library} drops")
    return [Content("dropped by the library", phrase) for phrase in phrases]


def implausible(reading: Reading) -> tuple[str, ...]:
    """List messages about implausible bodies and joints."""
    tied = {name for one in reading.couplings.values() for name in one.named}
    free = ((name, one) for name, one in reading.joints.items() if one.kind == "hinge" and name not in tied)
    return (
        *of_bodies([*_solids(reading)]),
        *(text for name, one in free for text in too_far(name, one.home, one.limits)),
    )


def _solids(reading: Reading) -> Iterator[Solid]:
    """Yield the bodies of a reading that have mass and rotate."""
    turning = set[str]()
    for name, body in reading.bodies.items():
        if body.near in turning or any(reading.joints[joint].kind != "slide" for joint in body.joints):
            turning.add(name)
    joints = {name: joint.centre for name, joint in reading.joints.items() if joint.kind != "free"}
    places: dict[str, list[Array]] = {name: [] for name in reading.bodies}
    for name, body in reading.bodies.items():
        at = [joints[joint] for joint in body.joints if joint in joints]
        places[name] += at[-1:]
        if body.near in places:
            places[body.near] += at[:1]
    for side, frame in (end for name in reading.closures for end in reading.ends(name)):
        if side in places:
            places[side].append(frame[:3, 3])
    heavy = {name: body.centre for name, body in reading.bodies.items() if body.mass > 0.0}
    extent = widest([*joints.values(), *heavy.values()])
    for name, centre in heavy.items():
        body = reading.bodies[name]
        if name in turning and np.isfinite(body.inertia).all():
            points = [*places[name], centre]
            yield Solid(name, body.mass, body.inertia, size_of(points, extent), widest(points))


def _read_here(source: Source) -> Reading:
    """Read an SDF or USD file."""
    if source.form == "usd":
        return read_usd(source.path, source.name)
    return read_sdf(source.root, source.name, str(source.path))


#: Library -> formats that it reads, native format first, and reader.
LIBRARIES: dict[str, tuple[tuple[str, ...], Callable[[Source, Mapping[str, float]], Reading]]] = {
    "pinocchio": (("urdf", "mjcf"), read_pinocchio),
    "mujoco": (("mjcf", "urdf"), read_mujoco),
    "yourdfpy": (("urdf",), read_yourdfpy),
    OWN: (("sdf", "usd"), lambda source, _: _read_here(source)),
}


def libraries_for(path: Path) -> tuple[str, ...]:
    """List the installed libraries that read a model file; libraries native to its format come first.

    Raises:
        ScrewgaugeError: The file is not a model, or is rejected before a library reads it.
    """
    return libraries_of(prepare(path).form)


def libraries_of(form: str) -> tuple[str, ...]:
    """List the installed libraries that read a format; libraries native to the format come first."""
    able = [name for name, (forms, _) in LIBRARIES.items() if form in forms and find_spec(name)]
    return tuple(sorted(able, key=lambda name: LIBRARIES[name][0].index(form)))


def read(path: Path, library: str, *, home: Mapping[str, float] | None = None, floating: bool = False) -> Reading:
    """Read a model file in this process; a crash of the library also ends the process.

    Args:
        library: One of `LIBRARIES`.
        home: Home coordinates of hinges and slides [rad or m]; by default, the home coordinates of the file.
        floating: Give a URDF a floating base.

    Raises:
        UnknownNameError: The library is not one of `LIBRARIES`.
        ScrewgaugeError: The file is unreadable, or this library cannot read it.
    """
    if library not in LIBRARIES:
        raise UnknownNameError("library", library, LIBRARIES)
    return read_source(prepare(path, floating=floating), library, home=home)


def read_source(source: Source, library: str, *, home: Mapping[str, float] | None = None) -> Reading:
    """Read a prepared model file in this process."""
    (forms, reader), path = LIBRARIES[library], source.path
    if source.form not in forms:
        raise ModelFileError(f"{library} does not read {source.form.upper()}", str(path), "choose another library")
    try:
        reading = reader(source, home or {})
    except ImportError as error:
        package = "pin" if library == "pinocchio" else library
        remedy = f"{remedy_of_import(error, package)}, or choose another library"
        raise ModelFileError(f"{library} cannot be loaded ({error})", str(path), remedy) from None
    _check(reading, str(path), source.form)
    frames = {**reading.frames, **source.fixed_joints}
    return replace(reading, form=source.form, content=unread_content(source, reading), frames=frames)


def _check(reading: Reading, where: str, form: str) -> None:
    """Reject a reading without degrees of freedom, with non-finite values, with a zero axis, or with negative mass.

    Raises:
        ModelFileError: The reading has one of these defects.
    """
    if not reading.joints:
        remedy = f"add a joint{', or a floating base (--floating of import)' * (form == 'urdf')}"
        raise ModelFileError(f"has no degree of freedom, as {reading.library} reads it", where, remedy)
    for name, body in reading.bodies.items():
        values: dict[str, float | Array] = {
            "mass": body.mass,
            "centre of mass": body.com,
            "inertia": body.inertia,
            "pose": body.pose,
        }
        for what, value in values.items():
            if not np.isfinite(value).all():
                raise ModelFileError(f"{what} of body {name} is not finite", where, "write finite numbers")
        if body.mass < 0.0:
            raise ModelFileError(f"mass of body {name} is {body.mass:g} kg", where, "use a mass that is not negative")
    for name, joint in reading.joints.items():
        if not (np.isfinite(joint.screw).all() and np.isfinite(joint.centre).all()):
            raise ModelFileError(f"axis of joint {name} is not finite", where, "write finite numbers")
        if joint.kind in ("hinge", "slide") and not joint.screw.any():
            raise ModelFileError(f"axis of joint {name} is 0", where, "set a direction")
