"""Writes and reads loops files, which close the loops of a URDF, and applies them to a reading."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sized
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.models.formats import document, key, lines
from screwgauge.models.layout import CUTS, Closure, lay_out
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import ActuatorReading, ClosureReading, Reading, couplings_of
from screwgauge.reference.couplings import Coupling, check_couplings
from screwgauge.reference.description import read_axial, read_couplings, read_joint
from screwgauge.reference.errors import ModelFileError, ScrewgaugeError, UnknownNameError, quote
from screwgauge.reference.expressions import rotation_matrix, vector
from screwgauge.reference.files import LIMITS, check_count
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.resistance import RESISTS, rotors_of
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import check_keys, check_name, read_toml, require

#: Suffix of loops files in screwgauge's own format.
OWN = ".loops.toml"
_TOP = ("mechanism", "cut", "bodies", "tree", "independent", "spherical_axial", "joints", "couplings", "closures")
_SIDES = ("parent", "child")
#: Type of a closure -> entry that locates it on each side, and the number of points or frames in that entry.
_CLOSURES = {"point": ("points", 1), "points": ("points", 2), "weld": ("frame", 1)}


@dataclass(frozen=True, slots=True, eq=False)
class LoopsFile:
    """Content of a loops file.

    Attributes:
        mechanism: Name of the mechanism.
        cut: ``minimal`` or ``full``.
        bodies: Bodies of the description, without the ground and copies.
        tree: Coordinates of the tree, in tree order.
        joints: All joints of the description, including cut joints.
        independent: Label -> coordinate.
        axial: Joint and direction (in child axes, shape (3,)) for the rule ``spherical_axial``.
        couplings: Tree coordinates that are polynomials of other coordinates.
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
        """Coordinates of all joints at the home pose [rad or m]."""
        return {name: float(q) for joint in self.joints for name, q in zip(joint.coordinates, joint.home, strict=True)}


def loops_of(mechanism: Mechanism, cut: str) -> LoopsFile:
    """Build the content of the loops file for a mechanism, given its cut."""
    tree = lay_out(mechanism, cut)
    bodies = tuple(body.name for body in mechanism.bodies)
    named = mechanism.independent, mechanism.axial, mechanism.couplings
    return LoopsFile(mechanism.name, cut, bodies, tree.coordinates, mechanism.joints, tree.closures, *named)


def write_loops(mechanism: Mechanism, cut: str) -> str:
    """Format the loops file of a cut mechanism as TOML."""
    file = loops_of(mechanism, cut)
    head = {"mechanism": file.mechanism, "cut": file.cut, "bodies": file.bodies, "tree": file.tree}
    top = ["# Data that the URDF in the same folder cannot express; written by screwgauge models.", *lines(head)]
    joints = [(f"[joints.{key(joint.name)}]", _joint_entries(joint)) for joint in file.joints]
    closures = [("[[closures]]", _closure_entries(closure)) for closure in file.closures]
    return document(top, mechanism, joints, closures)


def _joint_entries(joint: Joint) -> dict[str, Any]:
    names = ["kind", *_SIDES, *(() if joint.fixed else ("axes", "coordinates", "home"))]
    if np.isfinite(joint.limits).all():
        names.append("limits")
    if joint.actuated:
        names.append("actuated")
    if joint.held:
        names.append("held")
    names += [name for name in RESISTS if getattr(joint, name).any()]
    return {name: getattr(joint, name) for name in (*names, "parent_frame", "child_frame")}


def _closure_entries(closure: Closure) -> dict[str, Any]:
    what, _ = _CLOSURES[closure.type]
    names = ["joint", "type", *(name for side in _SIDES for name in (side, f"{side}_{what}"))]
    return {name: getattr(closure, name) for name in names}


def read_loops(path: Path) -> LoopsFile:
    """Read a loops file.

    Raises:
        ModelFileError: The file cannot be read, or an entry is missing, unknown or invalid.
    """
    where = str(path)
    try:
        data = read_toml(path)
        check_keys(data, _TOP, where)
        cut = check_name("cut", str(require(data, "cut", where)), CUTS, f"{where}, cut")
        tables = _entry(data, "joints", dict, where)
        joints = tuple(read_joint(name, table, f"{where}, joints.{name}") for name, table in tables.items())
        file = LoopsFile(
            mechanism=_entry(data, "mechanism", str, where),
            cut=cut,
            bodies=_names(data, "bodies", where),
            tree=_names(data, "tree", where),
            joints=joints,
            closures=tuple(
                _read_closure(table, tables, joints, f"{where}, closures[{i}]")
                for i, table in enumerate(_entry(data, "closures", list, where, []))
            ),
            independent=_entry(data, "independent", dict, where),
            axial=read_axial(data.get("spherical_axial"), tables, f"{where}, spherical_axial"),
            couplings=read_couplings(data, joints, where),
        )
        _check_names(file, where)
    except ModelFileError:
        raise
    except ScrewgaugeError as error:
        raise ModelFileError(error.what, error.where, error.remedy) from None
    return file


def _entry(table: Any, key: str, kind: type[Sized], where: str, default: Any = None) -> Any:
    value = require(table, key, where) if default is None else table.get(key, default)
    if not isinstance(value, kind):
        raise ModelFileError(f"{quote(value)} is not a {kind.__name__}", f"{where}, {key}", "write the models again")
    if key in LIMITS:
        check_count(len(value), key, where)
    return value


def _names(data: dict[str, Any], key: str, where: str) -> tuple[str, ...]:
    names = _entry(data, key, list, where)
    for name in names:
        if not isinstance(name, str):
            raise ModelFileError(f"{quote(name)} is not a name", f"{where}, {key}", "write names in quotes")
    return tuple(names)


def _read_closure(table: Any, tables: Mapping[str, Any], joints: tuple[Joint, ...], where: str) -> Closure:
    kind = _entry(table if isinstance(table, dict) else {}, "type", str, where)
    check_name("closure type", kind, _CLOSURES, where)
    what, count = _CLOSURES[kind]
    check_keys(table, ["joint", "type", *_SIDES, *(f"{side}_{what}" for side in _SIDES)], where)
    name = check_name("joint", _entry(table, "joint", str, where), tables, where)
    joint = joints[list(tables).index(name)]
    parent, child = (_entry(table, side, str, where) for side in _SIDES)
    if kind == "weld":
        frames = [_read_frame(require(table, f"{side}_frame", where), where) for side in _SIDES]
        none = np.zeros((0, 3))
        return Closure(name, kind, parent, child, none, none, frames[0], frames[1]).orient(joint)
    lists = [_entry(table, f"{side}_points", list, where) for side in _SIDES]
    points = [np.array([vector(point, where) for point in given]) for given in lists]
    if [len(given) for given in lists] != [count, count]:
        what = f"a closure of type {kind} must have {count} points on each side"
        raise ModelFileError(what, where, "correct the lists")
    near, far = joint.parent_frame, joint.child_frame
    if parent != joint.parent:
        near, far = far, near
    return Closure(name, kind, parent, child, points[0], points[1], near, far).orient(joint)


def _read_frame(table: Any, where: str) -> Frame:
    check_keys(table, ("position", "rotation"), where)
    position, rotation = (require(table, key, where) for key in ("position", "rotation"))
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


def closure_readings(closures: Iterable[Closure]) -> dict[str, ClosureReading]:
    """Convert closures to readings, named as in the exported MJCF; two pairs of points yield two readings."""
    found = {}
    for closure in closures:
        kind = "weld" if closure.type == "weld" else "point"
        for number, *frames in closure.pairs:
            T1, T2 = (matrix(frame.p, frame.R) for frame in frames)
            name = f"{closure.joint}.{number}".removesuffix(".")
            found[name] = ClosureReading(kind, closure.parent, T1, closure.child, T2)
    return found


def with_loops_file(reading: Reading, path: Path) -> Reading:
    """Add the closures, couplings and motors of a loops file to a reading."""
    file, closures = read_loops(path), {}
    for name, one in closure_readings(file.closures).items():
        first, T1 = place_in(reading, one.first, path)
        second, T2 = place_in(reading, one.second, path)
        closures[name] = ClosureReading(one.kind, first, T1 @ one.first_frame, second, T2 @ one.second_frame)
    driven = {joint.name: joint.coordinates[0] for joint in file.joints if joint.actuated}
    rotors = rotors_of(file.joints)
    joints = {n: replace(j, armature=rotors[n]) if n in rotors else j for n, j in reading.joints.items()}
    couplings = {**reading.couplings, **couplings_of(file.couplings)}
    motor = motors(reading, driven, path)
    return replace(reading, joints=joints, closures=closures, couplings=couplings, actuators=motor)


def place_in(reading: Reading, name: str, path: Path) -> tuple[str, Array]:
    """Return the body that contains a link, and the link's frame there; `name` is the link or its joint."""
    place = reading.place(name)
    if place is None:
        links = [*reading.bodies, *reading.fixed, *(link for body in reading.bodies.values() for link in body.fixed)]
        joints = [body.joints[-1] for body in reading.bodies.values()]
        known = dict.fromkeys([*links, *joints, *reading.frames])
        raise UnknownNameError("link or joint", name, known, str(path))
    return place


def motors(reading: Reading, driven: Mapping[str, str], path: Path) -> dict[str, ActuatorReading]:
    """Build an actuator for each driven hinge or slide. `driven`: actuator -> joint."""
    for name in driven.values():
        single = [joint for joint, each in reading.joints.items() if each.kind in ("hinge", "slide")]
        if name not in single:
            raise UnknownNameError("hinge or slide", name, single, str(path))
    return {actuator: ActuatorReading(joint) for actuator, joint in driven.items()}
