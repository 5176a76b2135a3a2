"""Reads a mechanism from TOML. Unknown keys are errors; every complaint names the file and the entry."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.reference.couplings import Coupling
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.expressions import number, rotation_matrix, unit_vector, vector
from screwgauge.reference.files import LIMITS, check_count, check_plain, read_file
from screwgauge.reference.graph import check_connected
from screwgauge.reference.mechanism import GROUND, KINDS, Body, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array

_TOP = {"name", "title", "source", "group", "extends", "bodies", "joints", "couplings"}
_TOP |= {"independent", "spherical_axial"}
_BODY = {"mass", "com", "inertia", "inertia_rotation"}
_JOINT = {"kind", "parent", "child", "axes", "coordinates", "home", "limits", "actuated"}
_JOINT |= {"parent_frame", "child_frame"}
_COUPLING = ("coordinate", "of", "polynomial")
#: Tables that are one thing: what extends a description replaces all of their entries.
WHOLE = ("inertia", "independent")
#: Default of three axes.
XYZ = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
#: Of a line: texts, words, dots and whatever else is between spaces.
_WORDS = re.compile(r"""(?P<part>"(?:[^"\\]|\\.)*+"?|'[^']*+'?|[\w-]++)|\.|\S""")
_TENSOR = ("xx", "xy", "xz", "yy", "yz", "zz")


def read_toml(path: Path) -> dict[str, Any]:
    """Reads a TOML file; decimals stay text, so that they can be read exactly.

    Raises:
        DescriptionError: The file cannot be read or is not TOML.
    """
    text = read_file(path)
    _check_dots(text, str(path))
    try:
        data = tomllib.loads(text, parse_float=str)
    except tomllib.TOMLDecodeError as error:
        raise DescriptionError(f"TOML syntax error: {error}", str(path), "mend that line") from None
    except (ValueError, RecursionError):  # integers of thousands of digits, lists in lists in lists
        raise DescriptionError("holds what TOML readers refuse to read", str(path), "simplify it") from None
    check_plain(data, str(path))
    return data


def _check_dots(text: str, where: str) -> None:
    """Refuses keys of very many parts: the time that `tomllib` takes grows with the square of these."""
    for line in text.splitlines():
        parts, joined = 0, False
        for word in _WORDS.finditer(line) if line.count(".") >= LIMITS["parts of a dotted key"] else ():
            if word["part"]:
                parts = parts + 1 if joined else 1
                check_count(parts, "parts of a dotted key", where)
            elif word[0] != ".":
                parts = 0
            joined = word[0] == "."


def check_keys(table: Any, known: Iterable[str], where: str) -> None:
    """Refuses a table with unknown keys, or what is no table."""
    known = list(known)
    if not isinstance(table, dict):
        raise DescriptionError(f"{table!r} is not a table", where, "write key = value entries")
    for key in table:
        if key not in known:
            raise UnknownNameError("key", key, sorted(known), where)


def required(table: dict[str, Any], key: str, where: str) -> Any:
    if key not in table:
        raise DescriptionError(f"'{key}' is missing", where, f"add {key} = ...")
    return table[key]


def read_text(table: dict[str, Any], key: str, where: str, default: str | None = None) -> str:
    """An entry that is text; required if it has no default."""
    value = required(table, key, where) if default is None else table.get(key, default)
    if not isinstance(value, str):
        raise DescriptionError(f"{value!r} is not text", f"{where}, {key}", "write it in quotes")
    return value


def merge(base: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """`base` with the entries of `change`, table by table; `WHOLE` ones are replaced as a whole."""
    result = dict(base)
    for key, value in change.items():
        deep = isinstance(value, dict) and isinstance(result.get(key), dict) and key not in WHOLE
        result[key] = merge(result[key], value) if deep else value
    return result


def read_mechanism(path: Path, find: Callable[[str], Path] = Path) -> Mechanism:
    """Reads a mechanism.

    Args:
        path: TOML file.
        find: Path of the mechanism that ``extends`` names.

    Raises:
        DescriptionError: The file does not describe a mechanism.
    """
    data = read_tables(path, find)
    where = str(path)
    if "mechanism" in data:
        raise DescriptionError("is a scene, not a mechanism", where, f"give its mechanism, {data['mechanism']!r}")
    check_keys(data, _TOP, where)
    name = _name(required(data, "name", where), f"{where}, name")
    bodies, joints = _table(data, "bodies", where), _table(data, "joints", where)
    mechanism = Mechanism(
        name=name,
        title=_text(data.get("title", name), f"{where}, title"),
        source=_text(data.get("source", ""), f"{where}, source"),
        group=_text(data.get("group", "others"), f"{where}, group"),
        bodies=tuple(_body(key, value, f"{where}, bodies.{key}") for key, value in bodies.items()),
        joints=tuple(read_joint(key, value, f"{where}, joints.{key}") for key, value in joints.items()),
        independent=_table(data, "independent", where),
        axial=_axial(data.get("spherical_axial"), joints, f"{where}, spherical_axial"),
        where=where,
        couplings=read_couplings(data, where),
    )
    _check_names(mechanism, where)
    check_connected(mechanism, where)
    if not mechanism.mass:
        raise DescriptionError("no body has mass", f"{where}, bodies", "give mass to one at least")
    return mechanism


def read_tables(path: Path, find: Callable[[str], Path], seen: tuple[Path, ...] = ()) -> dict[str, Any]:
    """The tables of a description, merged with those that it extends; numbers are still text."""
    data = read_toml(path)
    if path.resolve() in seen:
        raise DescriptionError("extends itself", str(path), "remove the circle of 'extends'")
    if "extends" not in data:
        return data
    base = find(_text(data.pop("extends"), f"{path}, extends"))
    return merge(read_tables(base, find, (*seen, path.resolve())), data)


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or (value == "" and not where.endswith("source")):
        raise DescriptionError(f"{value!r} is not text", where, "write a name in quotes")
    return value


def _name(value: Any, where: str) -> str:
    """A name that can stand in file names, URDF and MJCF ('@' marks the parts that these add)."""
    if not re.fullmatch(r"\w[\w.:+-]*", _text(value, where)):
        raise DescriptionError(f"{value!r} is not a name", where, "use letters, digits and . _ - + : only")
    return str(value)


def _table(data: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    table = required(data, key, where)
    if not isinstance(table, dict) or not table:
        raise DescriptionError(f"'{key}' has no entries", where, f"write at least one [{key}.NAME]")
    if key in LIMITS:
        check_count(len(table), key, where)
    return table


def _body(name: str, table: Any, where: str) -> Body:
    _name(name, where)
    check_keys(table, _BODY, where)
    mass = number(required(table, "mass", where), f"{where}.mass")
    com = vector(table.get("com", [0, 0, 0]), f"{where}.com")
    entries = table.get("inertia", {}) if mass == 0.0 else required(table, "inertia", where)
    check_keys(entries, _TENSOR, f"{where}.inertia")
    xx, xy, xz, yy, yz, zz = (number(entries.get(key, 0), f"{where}.inertia.{key}") for key in _TENSOR)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    R = rotation_matrix(table.get("inertia_rotation", []), f"{where}.inertia_rotation")
    if "inertia_rotation" in table:  # eq. (52): the tensor is given in rotated axes
        tensor = R @ tensor @ R.T
        tensor = 0.5 * (tensor + tensor.T)
    return Body(name, mass, com, tensor, where)


def read_joint(name: str, table: Any, where: str) -> Joint:
    """Reads one entry of ``[joints]``, also of a loops file."""
    _name(name, where)
    check_keys(table, _JOINT, where)
    kind = required(table, "kind", where)
    if not isinstance(kind, str) or kind not in KINDS:
        raise UnknownNameError("joint kind", kind, KINDS, where)
    n, n_axes = len(KINDS[kind]), max(1, sum(KINDS[kind]))
    axes, at = table.get("axes", XYZ) if n_axes == 3 else required(table, "axes", where), f"{where}.axes"
    _check_length(axes, n_axes, f"a {kind} joint has {n_axes} axes", at, "write a list of unit vectors")
    slides = ["x", "y", "z"] if KINDS[kind].count(False) == 3 else []
    labels = [*slides, *(f"q{i + 1}" for i in range(n - len(slides)))]
    coordinates = table.get("coordinates", [name] if n == 1 else [f"{name}.{label}" for label in labels])
    what = f"a {kind} joint has {n} coordinates"
    _check_length(coordinates, n, what, f"{where}.coordinates", f"write {n} names")
    actuated = table.get("actuated", False)
    if not isinstance(actuated, bool):
        raise DescriptionError(f"'{actuated}' is not true or false", f"{where}.actuated", "write true or false")
    return Joint(
        name=name,
        kind=kind,
        parent=_text(required(table, "parent", where), f"{where}.parent"),
        child=_text(required(table, "child", where), f"{where}.child"),
        axes=np.array([unit_vector(axis, at) for axis in axes]),
        coordinates=tuple(_name(item, f"{where}.coordinates") for item in coordinates),
        home=vector(table.get("home", [0] * n), f"{where}.home", n),
        limits=_limits(table.get("limits"), n, f"{where}.limits"),
        parent_frame=_frame(table.get("parent_frame", {}), f"{where}.parent_frame"),
        child_frame=_frame(table.get("child_frame", {}), f"{where}.child_frame"),
        actuated=actuated,
        where=where,
    )


def read_couplings(data: dict[str, Any], where: str) -> tuple[Coupling, ...]:
    """Reads ``[couplings]``, also of a loops file; there may be none."""
    tables = _table(data, "couplings", where) if "couplings" in data else {}
    return tuple(_coupling(name, table, f"{where}, couplings.{name}") for name, table in tables.items())


def _coupling(name: str, table: Any, where: str) -> Coupling:
    _name(name, where)
    check_keys(table, _COUPLING, where)
    given, at = required(table, "polynomial", where), f"{where}.polynomial"
    if not isinstance(given, list) or not given:
        raise DescriptionError(f"{given!r} is no list of coefficients", at, "write them lowest first: [0, 2]")
    check_count(len(given), "coefficients", at)
    coordinate = read_text(table, "coordinate", where)
    return Coupling(name, coordinate, read_text(table, "of", where, ""), vector(given, at, len(given)), where)


def _check_length(value: Any, n: int, what: str, where: str, remedy: str) -> None:
    if not isinstance(value, list) or len(value) != n:
        raise DescriptionError(what, where, remedy)


def _frame(table: Any, where: str) -> Frame:
    check_keys(table, {"position", "rotation"}, where)
    position = vector(table.get("position", [0, 0, 0]), f"{where}.position")
    return Frame(position, rotation_matrix(table.get("rotation", []), f"{where}.rotation"))


def _limits(value: Any, n: int, where: str) -> Array:
    if value is None:
        return np.tile([-np.inf, np.inf], (n, 1))
    _check_length(value, n, f"expected {n} pairs [low, high]", where, "write one pair for each coordinate")
    limits = np.array([vector(pair, where, 2) for pair in value])
    if (limits[:, 0] >= limits[:, 1]).any():
        raise DescriptionError(f"{limits.tolist()} has low >= high", where, "write [low, high]")
    return limits


def _axial(table: Any, joints: dict[str, Any], where: str) -> tuple[str, Array] | None:
    if table is None:
        return None
    check_keys(table, {"joint", "direction"}, where)
    joint = _text(required(table, "joint", where), where)
    if joint not in joints:
        raise UnknownNameError("joint", joint, joints, where)
    if KINDS.get(str(joints[joint].get("kind"))) != (True, True, True):
        raise DescriptionError(f"joint '{joint}' is not spherical", where, "name an S joint")
    return joint, unit_vector(required(table, "direction", where), where)


def _check_sides(joint: Joint, bodies: Sequence[str]) -> None:
    for side in (joint.parent, joint.child):
        if side not in bodies:
            raise UnknownNameError("body", side, bodies, joint.where)
    if joint.parent == joint.child:
        raise DescriptionError(f"joins '{joint.parent}' to itself", joint.where, "name two bodies")


def _check_names(mechanism: Mechanism, where: str) -> None:
    bodies = [body.name for body in mechanism.bodies]
    for name, what in ((GROUND, "the fixed world"), ("environment", "who exerts the loads of a scene")):
        if name in bodies:
            raise DescriptionError(f"'{name}' is {what}", where, "name the body otherwise")
    for joint in mechanism.joints:
        _check_sides(joint, [GROUND, *bodies])
    for name in mechanism.coordinates:
        if mechanism.coordinates.count(name) > 1:
            raise DescriptionError(f"two coordinates are called '{name}'", where, "name them apart")
    for label, name in mechanism.independent.items():
        _name(label, f"{where}, independent")
        if name not in mechanism.coordinates:
            raise UnknownNameError("coordinate", str(name), mechanism.coordinates, f"{where}, independent.{label}")
    if len(set(mechanism.independent.values())) < len(mechanism.independent):
        raise DescriptionError("one coordinate is named twice", f"{where}, independent", "name different ones")
