"""URDF of a mechanism's tree, and its loops file, for the closures that URDF cannot express: written and read.

A link's frame is the description's body frame; intermediate links of composite joints have no inertial. URDF of other
origin is read in `readings`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence, Set, Sized
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from screwgauge.models.formats import document, inverse, key, lines, number_text, rpy, vector_text
from screwgauge.models.layout import CUTS, Closure, Freedom, Link, lay_out
from screwgauge.reference.couplings import Coupling, check_couplings
from screwgauge.reference.description import read_axial, read_couplings, read_joint
from screwgauge.reference.errors import ModelFileError, ScrewgaugeError, shown
from screwgauge.reference.expressions import rotation_matrix, vector
from screwgauge.reference.files import LIMITS, check_count
from screwgauge.reference.mechanism import GROUND, Body, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_name, read_toml, required

_TOP = ("mechanism", "cut", "bodies", "tree", "independent", "spherical_axial", "joints", "couplings", "closures")
_SIDES = ("parent", "child")
#: Type of a closure -> what it names on each side, and how many.
_CLOSURES = {"point": ("points", 1), "points": ("points", 2), "weld": ("frame", 1)}


@dataclass(frozen=True, slots=True, eq=False)
class LoopsFile:
    """Content of a loops file.

    Attributes:
        mechanism: Name of the mechanism.
        cut: ``minimal`` or ``full``.
        bodies: Bodies of the description, ground and copies not among them.
        tree: Coordinates of the tree, in tree order.
        joints: All joints of the description, cut ones included.
        independent: Label -> coordinate.
        axial: Joint and direction (child axes, shape (3,)) of the rule ``spherical_axial``.
        couplings: Tree coordinates that are polynomials of others.
    """

    mechanism: str
    cut: str
    bodies: tuple[str, ...]
    tree: tuple[str, ...]
    joints: tuple[Joint, ...]
    closures: tuple[Closure, ...]
    independent: Mapping[str, str]
    axial: tuple[str, Array] | None
    couplings: tuple[Coupling, ...] = ()

    @property
    def home(self) -> dict[str, float]:
        """Coordinates of all joints at home [rad or m]."""
        return {name: float(q) for joint in self.joints for name, q in zip(joint.coordinates, joint.home, strict=True)}


def loops_of(mechanism: Mechanism, cut: str) -> LoopsFile:
    """Text of the loops file of a cut mechanism."""
    tree = lay_out(mechanism, cut)
    bodies = tuple(body.name for body in mechanism.bodies)
    named = mechanism.independent, mechanism.axial, mechanism.couplings
    return LoopsFile(mechanism.name, cut, bodies, tree.coordinates, mechanism.joints, tree.closures, *named)


def write_loops(mechanism: Mechanism, cut: str) -> str:
    """The loops file (TOML) of a cut mechanism."""
    file = loops_of(mechanism, cut)
    head = {"mechanism": file.mechanism, "cut": file.cut, "bodies": file.bodies, "tree": file.tree}
    top = ["# What the URDF beside this file cannot say; written by screwgauge models.", *lines(head)]
    joints = [(f"[joints.{key(joint.name)}]", _joint_entries(joint)) for joint in file.joints]
    closures = [("[[closures]]", _closure_entries(closure)) for closure in file.closures]
    return document(top, mechanism, joints, closures)


def _joint_entries(joint: Joint) -> dict[str, Any]:
    names = ["kind", *_SIDES, "axes", "coordinates", "home"]
    if np.isfinite(joint.limits).all():
        names.append("limits")
    if joint.actuated:
        names.append("actuated")
    return {name: getattr(joint, name) for name in (*names, "parent_frame", "child_frame")}


def _closure_entries(closure: Closure) -> dict[str, Any]:
    what, _ = _CLOSURES[closure.type]
    names = ["joint", "type", *(name for side in _SIDES for name in (side, f"{side}_{what}"))]
    return {name: getattr(closure, name) for name in names}


def read_loops(path: Path) -> LoopsFile:
    """Reads a loops file.

    Raises:
        ModelFileError: It cannot be read, or an entry is missing, unknown or wrong.
    """
    where = str(path)
    try:
        data = read_toml(path)
        check_keys(data, _TOP, where)
        cut = check_name("cut", str(required(data, "cut", where)), CUTS, f"{where}, cut")
        tables = _typed(data, "joints", dict, where)
        joints = tuple(read_joint(name, table, f"{where}, joints.{name}") for name, table in tables.items())
        file = LoopsFile(
            mechanism=_typed(data, "mechanism", str, where),
            cut=cut,
            bodies=_names(data, "bodies", where),
            tree=_names(data, "tree", where),
            joints=joints,
            closures=tuple(
                _read_closure(table, tables, joints, f"{where}, closures[{i}]")
                for i, table in enumerate(_typed(data, "closures", list, where, []))
            ),
            independent=_typed(data, "independent", dict, where),
            axial=read_axial(data.get("spherical_axial"), tables, f"{where}, spherical_axial"),
            couplings=read_couplings(data, where),
        )
        _check_names(file, where)
    except ModelFileError:
        raise
    except ScrewgaugeError as error:
        raise ModelFileError(error.what, error.where, error.remedy) from None
    return file


def _typed(table: Any, key: str, kind: type[Sized], where: str, default: Any = None) -> Any:
    value = required(table, key, where) if default is None else table.get(key, default)
    if not isinstance(value, kind):
        raise ModelFileError(f"{shown(value)} is not a {kind.__name__}", f"{where}, {key}", "write the models again")
    if key in LIMITS:
        check_count(len(value), key, where)
    return value


def _names(data: dict[str, Any], key: str, where: str) -> tuple[str, ...]:
    names = _typed(data, key, list, where)
    for name in names:
        if not isinstance(name, str):
            raise ModelFileError(f"{shown(name)} is not a name", f"{where}, {key}", "write names in quotes")
    return tuple(names)


def _read_closure(table: Any, tables: Mapping[str, Any], joints: tuple[Joint, ...], where: str) -> Closure:
    kind = _typed(table if isinstance(table, dict) else {}, "type", str, where)
    check_name("closure type", kind, _CLOSURES, where)
    what, count = _CLOSURES[kind]
    check_keys(table, ["joint", "type", *_SIDES, *(f"{side}_{what}" for side in _SIDES)], where)
    name = check_name("joint", _typed(table, "joint", str, where), tables, where)
    joint = joints[list(tables).index(name)]
    parent, child = (_typed(table, side, str, where) for side in _SIDES)
    if kind == "weld":
        frames = [_read_frame(required(table, f"{side}_frame", where), where) for side in _SIDES]
        none = np.zeros((0, 3))
        return Closure(name, kind, parent, child, none, none, frames[0], frames[1]).facing(joint)
    lists = [_typed(table, f"{side}_points", list, where) for side in _SIDES]
    points = [np.array([vector(point, where) for point in given]) for given in lists]
    if [len(given) for given in lists] != [count, count]:
        raise ModelFileError(f"a closure of type {kind} has another number of points", where, "mend the lists")
    near, far = joint.parent_frame, joint.child_frame
    if parent != joint.parent:
        near, far = far, near
    return Closure(name, kind, parent, child, points[0], points[1], near, far).facing(joint)


def _read_frame(table: Any, where: str) -> Frame:
    check_keys(table, ("position", "rotation"), where)
    position, rotation = (required(table, key, where) for key in ("position", "rotation"))
    return Frame(vector(position, where), rotation_matrix(rotation, where))


def _check_names(file: LoopsFile, where: str) -> None:
    bodies = (GROUND, *file.bodies)
    sides = [(side, joint.where) for joint in file.joints for side in (joint.parent, joint.child)]
    for closure in file.closures:
        sides += [(closure.parent, where), (closure.child.removesuffix(f"@{closure.joint}"), where)]
    for side, place in sides:
        check_name("body", side, bodies, place)
    coordinates = [name for joint in file.joints for name in joint.coordinates]
    closed = [closure.joint for closure in file.closures]
    named = {"bodies": file.bodies, "tree": file.tree, "joints": coordinates, "closures": closed}
    for what, names in named.items():
        if twice := [name for name in names if names.count(name) > 1]:
            raise ModelFileError(f"names '{twice[0]}' twice", f"{where}, {what}", "name it once")
    for name in (*file.tree, *file.independent.values()):
        check_name("coordinate", str(name), coordinates, where)
    check_couplings(file.couplings, file.tree)


#: Part of model files that brings it, see `screwgauge.models.generate`.
PART = "yaml"


def closure_frames(closure: Closure) -> list[tuple[tuple[str, str, Frame], tuple[str, str, Frame]]]:
    """Pairs of frames that coincide: name, link that it is fixed to, placement there. Two of an R joint's axis."""
    sides = (closure.parent, "parent"), (closure.child, "child")
    if closure.type == "weld":
        frames = [[closure.parent_frame], [closure.child_frame]]
    else:
        frames = [[Frame(p) for p in points] for points in (closure.parent_points, closure.child_points)]
    numbers = [""] if len(frames[0]) == 1 else ["1", "2"]
    named = [
        [(f"{closure.joint}@{side}{number}", link, frame) for number, frame in zip(numbers, placed, strict=True)]
        for (link, side), placed in zip(sides, frames, strict=True)
    ]
    return list(zip(*named, strict=True))


def write_loops_yaml(mechanism: Mechanism, cut: str) -> str:
    """The loops and motors of a cut mechanism; its URDF has the frames as links, see `closure_frames`."""
    pairs, types = list[list[str]](), list[str]()
    for closure in lay_out(mechanism, cut).closures:
        for first, second in closure_frames(closure):
            pairs.append([first[0], second[0]])
            types.append("6d" if closure.type == "weld" else "3d")
    motors = [joint.coordinates[0] for joint in mechanism.actuators]
    lines = ["# Written by screwgauge models.", f"closed_loop: {_flow(pairs)}", f"type: {_flow(types)}"]
    return "\n".join([*lines, f"name_mot: {_flow(motors)}"]) + "\n"


def _flow(value: Sequence[object]) -> str:
    """A list in YAML, of which JSON is a part."""
    return json.dumps(value, ensure_ascii=False)


#: Limits of a joint that has none. URDF wants some; "continuous" would do without, but Pinocchio then uses
#: two coordinates (cosine and sine) for the angle.
WIDE = 1e3
STRONG = 1e9


def write_urdf(mechanism: Mechanism, cut: str, *, include: Set[str] = frozenset()) -> str:
    """The tree of a cut mechanism as URDF; its closures go to the loops file.

    Args:
        cut: ``minimal`` or ``full``.
        include: ``limits`` writes the description's finite limits instead of wide ones; ``yaml`` adds the frames that
            a ``robot.yaml`` names.
    """
    tree = lay_out(mechanism, cut)
    robot = ET.Element("robot", name=mechanism.name)
    robot.append(ET.Comment(f" {cut} cut; loops are closed by the loops file; written by screwgauge models "))
    ET.SubElement(robot, "link", name=GROUND)
    for link in tree.links:
        _add(robot, link, "limits" in include)
    if PART in include:
        for name, link_name, frame in (side for one in tree.closures for pair in closure_frames(one) for side in pair):
            ET.SubElement(robot, "link", name=name)
            joint = ET.SubElement(robot, "joint", name=f"{name}.fixed", type="fixed")
            _placement(joint, frame)
            _ends(joint, link_name, name)
    ET.indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _add(robot: ET.Element, link: Link, limited: bool) -> None:
    """The elementary joints that lead to a link, the massless links between them, and the link."""
    name = link.joint.name
    names = [f"{name}.cross{i + 1}" for i in range(len(link.freedoms) - 1)]
    mounted = not link.far_frame.is_identity
    names.append(frame_link(link) if mounted else link.name)
    near, frame = link.near, link.near_frame
    for freedom, far in zip(link.freedoms, names, strict=True):
        _elementary(robot, freedom, near, far, frame, limited)
        if far != link.name:
            ET.SubElement(robot, "link", name=far)
        near, frame = far, Frame()
    if mounted:
        mount = ET.SubElement(robot, "joint", name=f"{name}.mount", type="fixed")
        _placement(mount, inverse(link.far_frame))
        _ends(mount, near, link.name)
    element = ET.SubElement(robot, "link", name=link.name)
    if link.body.mass:
        _inertial(element, link.body)


def frame_link(link: Link) -> str:
    """Name of the massless link that stands in the joint's frame on the far body."""
    return f"{link.original}@{link.joint.name}.frame"


def _elementary(robot: ET.Element, freedom: Freedom, near: str, far: str, frame: Frame, limited: bool) -> None:
    kind = "revolute" if freedom.turns else "prismatic"
    joint = ET.SubElement(robot, "joint", name=freedom.coordinate, type=kind)
    _placement(joint, frame)
    _ends(joint, near, far)
    ET.SubElement(joint, "axis", xyz=vector_text(freedom.axis))
    low, high = np.clip(freedom.limits, -WIDE, WIDE) if limited else (-WIDE, WIDE)
    bounds = {"lower": low, "upper": high, "effort": STRONG, "velocity": STRONG}
    ET.SubElement(joint, "limit", {key: number_text(value) for key, value in bounds.items()})


def _ends(joint: ET.Element, near: str, far: str) -> None:
    ET.SubElement(joint, "parent", link=near)
    ET.SubElement(joint, "child", link=far)


def _placement(joint: ET.Element, frame: Frame) -> None:
    if not frame.is_identity:
        ET.SubElement(joint, "origin", xyz=vector_text(frame.p), rpy=vector_text(rpy(frame.R)))


def _inertial(link: ET.Element, body: Body) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=vector_text(body.com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=number_text(body.mass))
    ET.SubElement(inertial, "inertia", moments(body.inertia))


def moments(I: Array) -> dict[str, str]:
    """The attributes of an ``<inertia>``, ixx, ixy, ixz, iyy, iyz, izz, for a tensor [kg m^2]. Shape (3, 3)."""
    return {f"i{'xyz'[i]}{'xyz'[j]}": number_text(I[i, j]) for i in range(3) for j in range(i, 3)}
