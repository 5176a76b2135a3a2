"""The loops file: what a URDF cannot say. Closures, composite joints, what is driven, what is independent."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from screwgauge.models.layout import CUTS, Closure, lay_out
from screwgauge.models.placement import number_text
from screwgauge.reference.description import check_keys, read_joint, read_toml, required
from screwgauge.reference.errors import ModelFileError, ScrewgaugeError, UnknownNameError
from screwgauge.reference.expressions import rotation_matrix, unit_vector, vector
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array

_TOP = ("mechanism", "cut", "bodies", "tree", "independent", "spherical_axial", "joints", "closures")
_CLOSURES = {
    "point": ("joint", "type", "parent", "parent_points", "child", "child_points"),
    "points": ("joint", "type", "parent", "parent_points", "child", "child_points"),
    "weld": ("joint", "type", "parent", "parent_frame", "child", "child_frame"),
}


@dataclass(frozen=True, slots=True, eq=False)
class LoopsFile:
    """What was read from a loops file.

    Attributes:
        mechanism: Name of the mechanism.
        cut: ``minimal`` or ``full``.
        bodies: Bodies of the description, ground and copies not among them.
        tree: Coordinates of the tree, in tree order.
        joints: All joints of the description, cut ones included.
        independent: Label -> coordinate.
        axial: Joint and direction (child axes, shape (3,)) of the rule ``spherical_axial``.
    """

    mechanism: str
    cut: str
    bodies: tuple[str, ...]
    tree: tuple[str, ...]
    joints: tuple[Joint, ...]
    closures: tuple[Closure, ...]
    independent: Mapping[str, str]
    axial: tuple[str, Array] | None


def loops_of(mechanism: Mechanism, cut: str) -> LoopsFile:
    """What the loops file of a cut mechanism says."""
    tree = lay_out(mechanism, cut)
    return LoopsFile(
        mechanism=mechanism.name,
        cut=cut,
        bodies=tuple(body.name for body in mechanism.bodies),
        tree=tree.coordinates,
        joints=mechanism.joints,
        closures=tree.closures,
        independent=mechanism.independent,
        axial=mechanism.axial,
    )


def write_loops(mechanism: Mechanism, cut: str) -> str:
    """The loops file (TOML) of a cut mechanism."""
    file = loops_of(mechanism, cut)
    lines = [
        "# What the URDF beside this file cannot say; written by screwgauge models.",
        f"mechanism = {_text(file.mechanism)}",
        f"cut = {_text(file.cut)}",
        f"bodies = {_list(file.bodies)}",
        f"tree = {_list(file.tree)}",
        "",
        "[independent]",
        *(f"{_key(label)} = {_text(name)}" for label, name in file.independent.items()),
    ]
    if file.axial:
        name, direction = file.axial
        lines += ["", "[spherical_axial]", f"joint = {_text(name)}", f"direction = {_numbers(direction)}"]
    for joint in file.joints:
        lines += ["", *_joint_lines(joint)]
    for closure in file.closures:
        lines += ["", *_closure_lines(closure)]
    return "\n".join(lines) + "\n"


def _joint_lines(joint: Joint) -> list[str]:
    lines = [
        f"[joints.{_key(joint.name)}]",
        f"kind = {_text(joint.kind)}",
        f"parent = {_text(joint.parent)}",
        f"child = {_text(joint.child)}",
        f"axes = {_numbers(joint.axes)}",
        f"coordinates = {_list(joint.coordinates)}",
        f"home = {_numbers(joint.home)}",
    ]
    if np.isfinite(joint.limits).all():
        lines.append(f"limits = {_numbers(joint.limits)}")
    if joint.actuated:
        lines.append("actuated = true")
    return [
        *lines,
        f"parent_frame = {_frame(joint.parent_frame)}",
        f"child_frame = {_frame(joint.child_frame)}",
    ]


def _closure_lines(closure: Closure) -> list[str]:
    lines = ["[[closures]]", f"joint = {_text(closure.joint)}", f"type = {_text(closure.type)}"]
    sides = (
        ("parent", closure.parent, closure.parent_points, closure.parent_frame),
        ("child", closure.child, closure.child_points, closure.child_frame),
    )
    for side, body, points, frame in sides:
        lines.append(f"{side} = {_text(body)}")
        if closure.type == "weld":
            lines.append(f"{side}_frame = {_frame(frame)}")
        else:
            lines.append(f"{side}_points = {_numbers(points)}")
    return lines


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # JSON strings are TOML strings but for DEL


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _list(values: tuple[str, ...]) -> str:
    return "[" + ", ".join(map(_text, values)) + "]"


def _numbers(values: ArrayLike) -> str:
    array = np.asarray(values, dtype=float)
    if array.ndim == 0:
        return number_text(float(array))
    return "[" + ", ".join(map(_numbers, array)) + "]"


def _frame(frame: Frame) -> str:
    return f"{{ position = {_numbers(frame.p)}, rotation = {{ matrix = {_numbers(frame.R)} }} }}"


def read_loops(path: Path) -> LoopsFile:
    """Reads a loops file.

    Raises:
        ModelFileError: It cannot be read, or an entry is missing, unknown or wrong.
    """
    where = str(path)
    try:
        data = read_toml(path)
        check_keys(data, _TOP, where)
        cut = required(data, "cut", where)
        if cut not in CUTS:
            raise UnknownNameError("cut", str(cut), CUTS, f"{where}, cut")
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
            axial=_read_axial(data.get("spherical_axial"), tables, f"{where}, spherical_axial"),
        )
        _check_names(file, where)
    except ModelFileError:
        raise
    except ScrewgaugeError as error:
        raise ModelFileError(error.what, error.where, error.remedy) from None
    return file


def _typed(table: Any, key: str, kind: type, where: str, default: Any = None) -> Any:
    value = required(table, key, where) if default is None else table.get(key, default)
    if not isinstance(value, kind):
        raise ModelFileError(f"{value!r} is not a {kind.__name__}", f"{where}, {key}", "write the models again")
    return value


def _names(data: dict[str, Any], key: str, where: str) -> tuple[str, ...]:
    names = _typed(data, key, list, where)
    for name in names:
        if not isinstance(name, str):
            raise ModelFileError(f"{name!r} is not a name", f"{where}, {key}", "write names in quotes")
    return tuple(names)


def _read_closure(table: Any, tables: Mapping[str, Any], joints: tuple[Joint, ...], where: str) -> Closure:
    kind = _typed(table if isinstance(table, dict) else {}, "type", str, where)
    if kind not in _CLOSURES:
        raise UnknownNameError("closure type", kind, _CLOSURES, where)
    check_keys(table, _CLOSURES[kind], where)
    name = _typed(table, "joint", str, where)
    if name not in tables:
        raise UnknownNameError("joint", name, tables, where)
    joint = joints[list(tables).index(name)]
    parent, child = (_typed(table, side, str, where) for side in ("parent", "child"))
    if kind == "weld":
        frames = [_read_frame(required(table, f"{side}_frame", where), where) for side in ("parent", "child")]
        return Closure(name, kind, parent, child, np.zeros((0, 3)), np.zeros((0, 3)), frames[0], frames[1])
    points = [
        np.array([vector(point, where) for point in _typed(table, f"{side}_points", list, where)])
        for side in ("parent", "child")
    ]
    if len(points[0]) != len(points[1]) or len(points[0]) != (1 if kind == "point" else 2):
        raise ModelFileError(f"a closure of type {kind} has another number of points", where, "mend the lists")
    return Closure(name, kind, parent, child, points[0], points[1], joint.parent_frame, joint.child_frame)


def _read_frame(table: Any, where: str) -> Frame:
    check_keys(table, ("position", "rotation"), where)
    return Frame(
        p=vector(required(table, "position", where), where),
        R=rotation_matrix(required(table, "rotation", where), where),
    )


def _read_axial(table: Any, joints: Mapping[str, Any], where: str) -> tuple[str, Array] | None:
    if table is None:
        return None
    check_keys(table, ("joint", "direction"), where)
    joint = _typed(table, "joint", str, where)
    if joint not in joints:
        raise UnknownNameError("joint", joint, joints, where)
    return joint, unit_vector(required(table, "direction", where), where)


def _check_names(file: LoopsFile, where: str) -> None:
    bodies = (GROUND, *file.bodies)
    sides = [(side, joint.where) for joint in file.joints for side in (joint.parent, joint.child)]
    for closure in file.closures:
        sides += [(closure.parent, where), (closure.child.removesuffix(f"@{closure.joint}"), where)]
    for side, place in sides:
        if side not in bodies:
            raise UnknownNameError("body", side, bodies, place)
    coordinates = [name for joint in file.joints for name in joint.coordinates]
    for name in (*file.tree, *file.independent.values()):
        if name not in coordinates:
            raise UnknownNameError("coordinate", str(name), coordinates, where)
