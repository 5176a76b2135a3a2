"""Reads mechanism descriptions in TOML; unknown keys are errors, and each error names the file and the entry."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.reference.couplings import Coupling, PolynomialSum
from screwgauge.reference.errors import DescriptionError, UnknownNameError, quote
from screwgauge.reference.expressions import number, rotation_matrix, unit_vector, vector
from screwgauge.reference.graph import check_connected
from screwgauge.reference.inertia import settle_tensors
from screwgauge.reference.left_out import LeftOut, read_left_out
from screwgauge.reference.mechanism import GROUND, KINDS, Body, Frame, Joint, Mechanism
from screwgauge.reference.resistance import RESISTS
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import (
    check_keys,
    check_length,
    check_name,
    check_text,
    merge,
    read_coefficients,
    read_flag,
    read_name,
    read_names,
    read_table,
    read_text,
    read_toml,
    require,
)

_TOP = {"name", "title", "source", "group", "extends", "bodies", "joints", "couplings"}
_TOP |= {"independent", "spherical_axial", "left_out", "allow"}
_BODY = {"mass", "com", "inertia", "inertia_rotation"}
_JOINT = {"kind", "parent", "child", "axes", "coordinates", "home", "limits", "actuated"}
_JOINT |= {"parent_frame", "child_frame", "held", *RESISTS}
#: Keys of a fixed joint, which has neither axes nor coordinates.
_FIXED = {"kind", "parent", "child", "parent_frame", "child_frame"}
_COUPLING = ("coordinate", "of", "polynomial", "terms")
#: Default axes of a joint with three axes.
XYZ = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
_TENSOR = ("xx", "xy", "xz", "yy", "yz", "zz")


def read_mechanism(path: Path, find: Callable[[str], Path] = Path) -> Mechanism:
    """Read a mechanism.

    Args:
        path: TOML file.
        find: Function that returns the path of the mechanism that ``extends`` names.

    Raises:
        DescriptionError: The file does not describe a mechanism.
    """
    data = read_tables(path, find)
    where = str(path)
    if "mechanism" in data:
        raise DescriptionError("is a scene, not a mechanism", where, f"use its mechanism, {quote(data['mechanism'])}")
    check_keys(data, _TOP, where)
    name = read_name(require(data, "name", where), f"{where}, name")
    bodies, joints = read_table(data, "bodies", where), read_table(data, "joints", where)
    read_joints = tuple(read_joint(key, value, f"{where}, joints.{key}") for key, value in joints.items())
    given = [_body(key, value, f"{where}, bodies.{key}") for key, value in bodies.items()]
    couplings, allow = read_couplings(data, read_joints, where), read_names(data.get("allow", []), f"{where}, allow")
    settled_bodies, remarks = settle_tensors(given, read_joints, couplings, allow, where)
    mechanism = Mechanism(
        name=name,
        title=check_text(data.get("title", name), f"{where}, title"),
        source=check_text(data.get("source", ""), f"{where}, source"),
        group=check_text(data.get("group", "others"), f"{where}, group"),
        bodies=settled_bodies,
        joints=read_joints,
        independent=read_table(data, "independent", where),
        axial=read_axial(data.get("spherical_axial"), joints, f"{where}, spherical_axial"),
        where=where,
        couplings=couplings,
        remarks=remarks,
        left_out=_left_out(data, read_joints, bodies, where),
    )
    _check_names(mechanism, where)
    check_connected(mechanism, where)
    if not mechanism.mass:
        raise DescriptionError("no body has mass", f"{where}, bodies", "give mass to at least one body")
    return mechanism


def read_tables(path: Path, find: Callable[[str], Path], seen: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Read a description and merge it into the descriptions that it extends; numbers remain strings."""
    data = read_toml(path)
    if path.resolve() in seen:
        raise DescriptionError("extends itself", str(path), "remove the cycle of 'extends'")
    if "extends" not in data:
        return data
    base = find(check_text(data.pop("extends"), f"{path}, extends"))
    return merge(read_tables(base, find, (*seen, path.resolve())), data)


def _left_out(
    data: dict[str, Any], joints: Sequence[Joint], bodies: Collection[str], where: str
) -> tuple[LeftOut, ...]:
    coordinates = [name for joint in joints if not joint.fixed for name in joint.coordinates]
    turning = [joint.name for joint in joints if joint.angles == 3]
    return read_left_out(data, where, coordinates, turning, bodies)


def _body(name: str, table: Any, where: str) -> Body:
    """Read a body; its tensor is checked later, see `settle_tensors`."""
    read_name(name, where)
    check_keys(table, _BODY, where)
    mass = number(require(table, "mass", where), f"{where}.mass")
    com = vector(table.get("com", [0, 0, 0]), f"{where}.com")
    entries = table.get("inertia", {}) if mass == 0.0 else require(table, "inertia", where)
    check_keys(entries, _TENSOR, f"{where}.inertia")
    xx, xy, xz, yy, yz, zz = (number(entries.get(key, 0), f"{where}.inertia.{key}") for key in _TENSOR)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    R = rotation_matrix(table.get("inertia_rotation", []), f"{where}.inertia_rotation")
    if "inertia_rotation" in table:  # eq. (52): the file gives the tensor in rotated axes
        tensor = R @ tensor @ R.T
        tensor = 0.5 * (tensor + tensor.T)
    return Body(name, mass, com, tensor, where, allowed=True)


def read_joint(name: str, table: Any, where: str) -> Joint:
    """Read one entry of ``[joints]`` in a description or loops file."""
    read_name(name, where)
    check_keys(table, _JOINT, where)
    kind = check_name("joint kind", str(require(table, "kind", where)), KINDS, where)
    if kind == "fixed":
        check_keys(table, _FIXED, where)
        table = {**table, "axes": [[0, 0, 1]]}
    n, n_axes = len(KINDS[kind]), max(1, sum(KINDS[kind]))
    axes, at = table.get("axes", XYZ) if n_axes == 3 else require(table, "axes", where), f"{where}.axes"
    check_length(axes, n_axes, f"a {kind} joint has {n_axes} axes", at, "write a list of unit vectors")
    slides = ["x", "y", "z"] if KINDS[kind].count(False) == 3 else []
    labels = [*slides, *(f"q{i + 1}" for i in range(n - len(slides)))]
    coordinates = table.get("coordinates", [name] if n == 1 else [f"{name}.{label}" for label in labels])
    what = f"a {kind} joint has {n} coordinates"
    check_length(coordinates, n, what, f"{where}.coordinates", f"write {n} names")
    return Joint(
        name=name,
        kind=kind,
        parent=check_text(require(table, "parent", where), f"{where}.parent"),
        child=check_text(require(table, "child", where), f"{where}.child"),
        axes=np.array([unit_vector(axis, at) for axis in axes]),
        coordinates=tuple(read_name(item, f"{where}.coordinates") for item in coordinates),
        home=vector(table.get("home", [0] * n), f"{where}.home", n),
        limits=_limits(table.get("limits"), n, f"{where}.limits"),
        parent_frame=_frame(table.get("parent_frame", {}), f"{where}.parent_frame"),
        child_frame=_frame(table.get("child_frame", {}), f"{where}.child_frame"),
        actuated=read_flag(table, "actuated", where),
        held=read_names(table.get("held", []), f"{where}.held"),
        where=where,
        **{key: _amounts(table[key], n, f"{where}.{key}") for key in RESISTS if key in table},
    )


def _amounts(value: Any, n: int, where: str) -> Array:
    """Read one number per coordinate; brackets are optional for a single number."""
    return vector(value if isinstance(value, list) else [value], where, n)


def read_couplings(data: dict[str, Any], joints: Sequence[Joint], where: str) -> tuple[Coupling, ...]:
    """Read an optional ``[couplings]`` table of a description or loops file; add the couplings of fixed joints."""
    tables = read_table(data, "couplings", where) if "couplings" in data else {}
    read = tuple(_coupling(name, table, f"{where}, couplings.{name}") for name, table in tables.items())
    fixed, known = fixings(joints), [name for joint in joints if not joint.fixed for name in joint.coordinates]
    for one in read:
        for held in fixed:
            if held.coordinate in one.named:
                raise UnknownNameError("coordinate", held.coordinate, known, one.where)
            if held.name == one.name:
                raise DescriptionError(
                    f"the fixed joint '{one.name}' has the same name", one.where, "rename the coupling"
                )
    return (*read, *fixed)


def fixings(joints: Iterable[Joint]) -> tuple[Coupling, ...]:
    """Build the couplings that lock fixed joints."""
    fixed = (joint for joint in joints if joint.fixed)
    zero = PolynomialSum(0.0, {})
    return tuple(Coupling(joint.name, joint.coordinates[0], zero, joint.where, fixing=True) for joint in fixed)


def _coupling(name: str, table: Any, where: str) -> Coupling:
    read_name(name, where)
    check_keys(table, _COUPLING, where)
    polynomials = {of: read_coefficients(p, f"{where}.{key}") for key, of, p in written_polynomials(table, where)}
    return Coupling(name, read_text(table, "coordinate", where), PolynomialSum.of(polynomials), where)


def written_polynomials(table: dict[str, Any], where: str) -> list[tuple[str, str, Any]]:
    """List the polynomials of a coupling table as (key, coordinate, coefficients).

    Raises:
        DescriptionError: A polynomial is missing, or `terms` is given together with `polynomial` or `of`.
    """
    if "terms" not in table:
        of, polynomial = read_text(table, "of", where, ""), require(table, "polynomial", where)
        if not of and isinstance(polynomial, list) and len(polynomial) > 1:
            what = f"a polynomial of {len(polynomial)} coefficients must name the coordinate that it depends on"
            raise DescriptionError(what, where, "add of = ..., or write one number")
        return [("polynomial", of, polynomial)]
    if beside := [key for key in ("of", "polynomial") if key in table]:
        remedy = "put the polynomials of all coordinates into 'terms', or use 'of' and 'polynomial' for a single one"
        raise DescriptionError(f"has both 'terms' and '{beside[0]}'", where, remedy)
    terms = read_table(table, "terms", where)
    for name, polynomial in terms.items():
        if isinstance(polynomial, dict):
            what = f"'{check_text(name, f'{where}.terms')}' is followed by a dot"
            raise DescriptionError(what, f"{where}.terms", "put names with dots in quotes")
    return [(f"terms.{name}", check_text(name, f"{where}.terms"), polynomial) for name, polynomial in terms.items()]


def _frame(table: Any, where: str) -> Frame:
    check_keys(table, {"position", "rotation"}, where)
    position = vector(table.get("position", [0, 0, 0]), f"{where}.position")
    return Frame(position, rotation_matrix(table.get("rotation", []), f"{where}.rotation"))


def _limits(value: Any, n: int, where: str) -> Array:
    if value is None:
        return np.tile([-np.inf, np.inf], (n, 1))
    check_length(value, n, f"expected {n} pairs [low, high]", where, "write one pair for each coordinate")
    limits = np.array([vector(pair, where, 2) for pair in value])
    if (limits[:, 0] >= limits[:, 1]).any():
        raise DescriptionError(f"{limits.tolist()} has low >= high", where, "write [low, high]")
    return limits


def read_axial(table: Any, joints: Mapping[str, Any], where: str) -> tuple[str, Array] | None:
    """Read an optional ``[spherical_axial]`` table of a description or loops file."""
    if table is None:
        return None
    check_keys(table, {"joint", "direction"}, where)
    joint = check_name("joint", check_text(require(table, "joint", where), where), joints, where)
    if KINDS.get(str(joints[joint].get("kind"))) != (True, True, True):
        raise DescriptionError(f"joint '{joint}' is not spherical", where, "choose an S joint")
    return joint, unit_vector(require(table, "direction", where), where)


def _check_sides(joint: Joint, bodies: Sequence[str]) -> None:
    for side in (joint.parent, joint.child):
        check_name("body", side, bodies, joint.where)
    if joint.parent == joint.child:
        raise DescriptionError(f"connects '{joint.parent}' to itself", joint.where, "choose two bodies")


def _check_names(mechanism: Mechanism, where: str) -> None:
    bodies = [body.name for body in mechanism.bodies]
    for name, what in ((GROUND, "the fixed world"), ("environment", "the source of a scene's loads")):
        if name in bodies:
            raise DescriptionError(f"'{name}' is reserved for {what}", where, "rename the body")
    for joint in mechanism.joints:
        _check_sides(joint, [GROUND, *bodies])
    for name in mechanism.coordinates:
        if mechanism.coordinates.count(name) > 1:
            raise DescriptionError(f"two coordinates have the name '{name}'", where, "rename one")
    for label, name in mechanism.independent.items():
        read_name(label, f"{where}, independent")
        check_name("coordinate", str(name), mechanism.moving, f"{where}, independent.{label}")
    if len(set(mechanism.independent.values())) < len(mechanism.independent):
        raise DescriptionError("a coordinate occurs twice", f"{where}, independent", "choose different coordinates")
