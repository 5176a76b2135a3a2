"""What yourdfpy reads from a URDF: a second, independent reading."""

from __future__ import annotations

import copy
import io
import math
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.readings.assemble import Link, assemble, screw
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.models.readings.source import Source
from screwgauge.reference.errors import ModelFileError

#: Type of a joint in URDF -> kind; `fixed` has none.
_KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "floating": "free"}


def read_yourdfpy(source: Source, home: Mapping[str, float]) -> Reading:
    """Reads a URDF by yourdfpy.

    Raises:
        ModelFileError: yourdfpy refuses it, or it has a planar joint.
    """
    import yourdfpy

    where = str(source.path)
    try:
        options = {"load_meshes": False, "load_collision_meshes": False}
        robot = yourdfpy.URDF.load(io.BytesIO(_independent(source.root)), **options)
        robot.update_cfg({name: home.get(name, 0.0) for name in robot.actuated_joint_names})
        joints = {j.name: _joint(robot, j, home.get(j.name, 0.0)) for j in robot.joint_map.values() if j.type in _KINDS}
    except Exception as error:  # it raises what its own parts raise
        reason = f"{type(error).__name__}: {error}"
        raise ModelFileError(f"yourdfpy refuses it ({reason})", where, "mend the file") from None
    if planar := [joint.name for joint in robot.joint_map.values() if joint.type == "planar"]:
        raise ModelFileError(f"yourdfpy cannot place planar joint {planar[0]}", where, "take another library")
    assembly = assemble(_links(robot), where)
    return Reading(
        name=source.name,
        library="yourdfpy",
        bodies=assembly.bodies,
        joints=joints,
        fixed=assembly.fixed,
        couplings=source.mimics,
    )


def _independent(root: ET.Element) -> bytes:
    """The file without `<mimic>`: yourdfpy would place those joints by others, and couplings are read apart."""
    root = copy.deepcopy(root)
    for joint in root.iterfind("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    return ET.tostring(root)


def _links(robot: Any) -> Iterator[Link]:
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
        yield Link(name, joint.parent if joint else "", moving, mass, com, inertia, pose)


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
