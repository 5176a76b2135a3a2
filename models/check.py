"""Checks model files against the description: compares each value that a library reads, relative to its scale."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

import numpy as np

from screwgauge.models.files.loops import LoopsFile, closure_readings, loops_of, read_loops
from screwgauge.models.generate import stem
from screwgauge.models.layout import CUTS, Closure, Link, Tree, lay_out, length_scale
from screwgauge.models.poses import exponential, matrix, screw
from screwgauge.models.readings.assemble import assemble
from screwgauge.models.readings.read import read
from screwgauge.models.readings.reading import (
    FREE,
    OWN,
    ActuatorReading,
    BodyReading,
    ClosureReading,
    CouplingReading,
    JointReading,
    Reading,
    collapse,
    couplings_of,
)
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.resistance import RESISTS
from screwgauge.reference.rotations import Array

T = TypeVar("T")
#: Tolerance relative to the scale of a value. Reading a number has an error of 1e-16; roll-pitch-yaw angles,
#: quaternions and the products along a chain of ten joints add about 2e-16 each.
TOLERANCE = 1e-14
#: MuJoCo stores principal moments and axes; its diagonalisation has an error of up to 1.1e-14 of the largest moment
#: (worst of 1200 random tensors, mujoco 4.0.0).
INERTIA_TOLERANCE = 5e-14


@dataclass(frozen=True, slots=True)
class CheckRow:
    """A compared property. `difference` is NaN for names, and otherwise relative to the same scale as `tolerance`."""

    item: str
    what: str
    expected: str
    found: str
    difference: float
    tolerance: float
    ok: bool
    file: str = ""
    reading: str = ""


def _names(item: str, what: str, expected: object, actual: object) -> CheckRow:
    """Compare names or other strings."""
    return CheckRow(item, what, str(expected), str(actual), math.nan, 0.0, expected == actual)


def _numbers(
    item: str, what: str, expected: Array, actual: Array, scale: float = 1.0, tolerance: float = TOLERANCE
) -> CheckRow:
    """Compare numbers relative to a scale."""
    # the condition treats NaN as a difference
    difference = float(np.abs(expected - actual).max()) / scale
    return CheckRow(item, what, _format(expected), _format(actual), difference, tolerance, difference <= tolerance)


def _keys(what: str, expected: Mapping[str, T], actual: Mapping[str, T]) -> CheckRow:
    """Compare the names of one kind of item."""
    return _names("", f"{what} names", sorted(expected), sorted(actual))


def _common(expected: Mapping[str, T], actual: Mapping[str, T]) -> list[tuple[str, T, T]]:
    """Return name, expected and actual value of each item that both mappings contain."""
    return [(name, want, actual[name]) for name, want in expected.items() if name in actual]


def _format(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in np.ravel(values))


def compare_readings(expected: Reading, actual: Reading, mechanism: Mechanism) -> Iterator[CheckRow]:
    """Compare all properties of an expected and an actual reading."""
    length = length_scale(mechanism)
    actual = collapse(actual, keep=expected.bodies)  # a URDF splits a composite joint
    yield _keys("body", expected.bodies, actual.bodies)
    yield _keys("coordinate", expected.joints, actual.joints)
    yield _numbers("", "total mass", np.array([expected.mass]), np.array([actual.mass]), mechanism.mass)
    yield from _compare_bodies(_common(expected.bodies, actual.bodies), length, mechanism.mass)
    for name, want, have in _common(expected.joints, actual.joints):
        scale = np.repeat([1.0, length], 3) if want.screw[:3].any() else np.ones(6)
        yield _numbers(name, "home axis", want.screw / scale, have.screw / scale)
        # a run measures excess amounts in the file; URDF lacks an element for rotors
        amounts = {"rotor": "armature"} if actual.form != "urdf" else {}
        for what, key in (amounts | {"damping": "damping", "friction": "friction"}).items():
            if amount := getattr(want, key):
                yield _numbers(name, what, np.array([amount]), np.array([min(getattr(have, key), amount)]), amount)
    if actual.gravity is None or expected.gravity is None:
        return
    size = float(np.linalg.norm(expected.gravity)) or 9.81
    yield _numbers("", "gravity", expected.gravity, actual.gravity, size)
    yield _names("", "actuators", dict(expected.actuators), dict(actual.actuators))
    yield _keys("closure", expected.closures, actual.closures)
    for name, shut, otherwise in _common(expected.closures, actual.closures):
        yield from _compare_closures(name, shut, otherwise, length)
    yield from _compare_couplings(expected.couplings, actual.couplings)


def _compare_couplings(
    expected: Mapping[str, CouplingReading], actual: Mapping[str, CouplingReading]
) -> Iterator[CheckRow]:
    if not (expected or actual):
        return
    yield _keys("coupling", expected, actual)
    for name, want, written in _common(expected, actual):
        have = written.solve_for(want.joint)
        yield _names(name, "coupling", *((each.joint, *sorted(each.function.terms)) for each in (want, have)))
        wanted, other = want.function.paired_coefficients(have.function)
        yield _numbers(name, "coupling polynomial", wanted, other, float(np.abs(wanted).max()) or 1.0)


def _compare_closures(name: str, want: ClosureReading, have: ClosureReading, length: float) -> Iterator[CheckRow]:
    if (have.first, have.second) == (want.second, want.first):  # the order of the sides does not matter
        have = ClosureReading(have.kind, have.second, have.second_frame, have.first, have.first_frame)
    bodies = ((closure.kind, closure.first, closure.second) for closure in (want, have))
    yield _names(name, "closure bodies", *bodies)
    metres = np.array([1.0, 1.0, 1.0, length])
    frames = [np.array([closure.first_frame, closure.second_frame]) / metres for closure in (want, have)]
    yield _numbers(name, "closure frames", *frames)


def _compare_bodies(
    pairs: list[tuple[str, BodyReading, BodyReading]], length: float, total: float
) -> Iterator[CheckRow]:
    for name, want, have in pairs:
        yield _names(name, "parent and joints", (want.near, *want.joints), (have.near, *have.joints))
        yield _numbers(name, "mass", np.array([want.mass]), np.array([have.mass]), want.mass or total)
        if want.mass:
            yield _numbers(name, "centre of mass", want.com, have.com, length)
            # a point mass has no moments of inertia, so mass and mechanism length define the scale
            scale = float(np.abs(want.inertia).max()) or want.mass * length**2
            yield _numbers(name, "inertia tensor", want.inertia, have.inertia, scale, INERTIA_TOLERANCE)
        metres = np.array([1.0, 1.0, 1.0, length])
        yield _numbers(name, "home pose", want.pose[:3] / metres, have.pose[:3] / metres)


def compare_loops(expected: LoopsFile, actual: LoopsFile, mechanism: Mechanism) -> Iterator[CheckRow]:
    """Compare all properties of an expected and an actual loops file."""
    length = length_scale(mechanism)
    for what in ("mechanism", "cut"):
        yield _names("", what, getattr(expected, what), getattr(actual, what))
    for what in ("bodies", "tree"):  # in any order
        yield _names("", what, sorted(getattr(expected, what)), sorted(getattr(actual, what)))
    yield _names("", "independent", dict(expected.independent), dict(actual.independent))
    yield _names("", "spherical_axial", *(axial and axial[0] for axial in (expected.axial, actual.axial)))
    if expected.axial and actual.axial:
        yield _numbers("", "direction of spherical_axial", expected.axial[1], actual.axial[1])
    joints = [{joint.name: joint for joint in file.joints} for file in (expected, actual)]
    yield _keys("joint", *joints)
    for name, want, have in _common(*joints):
        yield _names(name, "joint", _joint_facts(want), _joint_facts(have))
        yield _names(name, "joint limits", want.limits.tolist(), have.limits.tolist())
        for what in RESISTS:
            one, other = getattr(want, what), getattr(have, what)
            if len(one) == len(other) and (size := max(one.max(initial=0.0), other.max(initial=0.0))):
                yield _numbers(name, what, one, other, size)
        if want.kind == have.kind:
            yield _numbers(name, "joint axes and frames", _joint_values(want, length), _joint_values(have, length))
    yield from _compare_couplings(*(couplings_of(file.couplings) for file in (expected, actual)))
    closures = [{closure.joint: closure for closure in file.closures} for file in (expected, actual)]
    yield _keys("closure", *closures)
    for name, shut, other in _common(*closures):
        yield _names(name, "closure", _closure_facts(shut), _closure_facts(other))
        if shut.type == other.type:
            values = _closure_values(shut, length), _closure_values(other, length)
            yield _numbers(name, "closure points and frames", *values)


def _joint_facts(joint: Joint) -> tuple[object, ...]:
    return joint.kind, joint.parent, joint.child, joint.coordinates, joint.actuated, joint.held


def _joint_values(joint: Joint, length: float) -> Array:
    turns = [turn for turn, _ in joint.freedoms]
    home = np.where(turns, joint.home, joint.home / length)
    return np.concatenate([joint.axes.ravel(), home, *_frames(joint, length)])


def _closure_facts(closure: Closure) -> tuple[object, ...]:
    return closure.type, closure.parent, closure.child


def _closure_values(closure: Closure, length: float) -> Array:
    points = [closure.parent_points.ravel() / length, closure.child_points.ravel() / length]
    return np.concatenate([*points, *_frames(closure, length)])


def _frames(item: Joint | Closure, length: float) -> list[Array]:
    frames = item.parent_frame, item.child_frame
    return [values for frame in frames for values in (frame.p / length, frame.R.ravel())]


#: Reader -> suffix of the model file that it reads. Screwgauge itself reads the loops file.
SUFFIXES = {"loops": ".loops.toml", "yourdfpy": ".urdf", "pinocchio": ".urdf", "mujoco": ".xml"}


def installed_readers() -> tuple[str, ...]:
    """List the readers whose library is installed."""
    return tuple(name for name in SUFFIXES if name == "loops" or find_spec(name))


def check_models(
    mechanism: Mechanism,
    folder: Path,
    *,
    readers: Iterable[str] | None = None,
    gravity: Sequence[float] | Array = GRAVITY,
) -> list[CheckRow]:
    """Compare all model files of a mechanism with its description.

    Args:
        folder: Folder with the files that `write_models` wrote.
        readers: Subset of `SUFFIXES`; by default, the readers whose library is installed.
        gravity: Gravity expected in the MJCF [m/s^2]. Shape (3,).

    Raises:
        UnknownNameError: A reader is not one of `SUFFIXES`.
    """
    rows = []
    for cut in CUTS:
        for reader in installed_readers() if readers is None else readers:
            if reader not in SUFFIXES:
                raise UnknownNameError("reader", reader, SUFFIXES)
            path = folder / f"{stem(mechanism.name, cut)}{SUFFIXES[reader]}"
            rows += check_file(mechanism, cut, path, reader, gravity=gravity)
    return rows


def check_file(
    mechanism: Mechanism, cut: str, path: Path, reader: str, *, gravity: Sequence[float] | Array = GRAVITY
) -> list[CheckRow]:
    """Compare one model file, as one library reads it, with the description.

    If the file cannot be read or the library is missing, the result is a single row that gives the reason.
    """
    home = dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
    try:
        if reader == "loops":
            rows = [*compare_loops(loops_of(mechanism, cut), read_loops(path), mechanism)]
        else:
            expected = expected_reading(mechanism, cut, gravity)
            rows = [*compare_readings(expected, read(path, reader, home=home), mechanism)]
    except Exception as error:  # libraries raise arbitrary exceptions for a file
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        rows = [CheckRow("", "file", "can be read", reason, math.nan, 0.0, False)]
    return [replace(row, file=path.name, reading=reader) for row in rows]


def check_table(rows: Sequence[CheckRow]) -> str:
    """Format a line for each file, reading and property, with its worst item, followed by all rows that failed."""
    groups: dict[tuple[str, str, str], list[CheckRow]] = {}
    for row in rows:
        groups.setdefault((row.file, row.reading, row.what), []).append(row)
    lines = [("file", "reading", "property", "items", "worst", "at", "tolerance", "")]
    for (file, reading, what), group in groups.items():
        numbers = [row for row in group if not math.isnan(row.difference)]
        worst = max(numbers, key=lambda row: row.difference, default=None)
        figures = (f"{worst.difference:.1e}", worst.item, f"{worst.tolerance:.0e}") if worst else ("", "", "")
        verdict = "ok" if all(row.ok for row in group) else "DIFFERS"
        lines.append((file, reading, what, str(len(group)), *figures, verdict))
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    text += [
        f"{row.file} as read by {row.reading}: {row.what} of {row.item or 'the model'}: "
        f"expected {row.expected}, found {row.found}"
        for row in rows
        if not row.ok
    ]
    return "\n".join(text) + "\n"


def expected_reading(mechanism: Mechanism, cut: str, gravity: Sequence[float] | Array) -> Reading:
    """Build the reading of a model file that matches the description exactly; joint limits are omitted."""
    tree = lay_out(mechanism, cut)
    poses = home_poses(tree)
    bodies: dict[str, BodyReading] = {}
    joints: dict[str, JointReading] = {}
    for link in tree.links:
        names, body = tuple(freedom.coordinate for freedom in link.moves), link.body
        copy_of = link.original if link.name != link.original else ""
        matter = body.mass, body.com, body.inertia
        bodies[link.name] = BodyReading(*matter, link.near, names, poses[link.name], copy_of=copy_of)
        joints |= {} if link.joint.fixed else _joints(link, poses)
    driven = zip(mechanism.actuator_names, mechanism.actuators, strict=False)
    bodies, fixed, closures = _merge_links(mechanism, bodies, closure_readings(tree.closures))
    return Reading(
        name=mechanism.name,
        library=OWN,
        bodies=bodies,
        joints=joints,
        fixed=fixed,
        closures=closures,
        couplings=couplings_of(mechanism.couplings),
        actuators={name: ActuatorReading(joint.coordinates[0]) for name, joint in driven},
        gravity=np.asarray(gravity, dtype=float),
    )


def _merge_links(
    mechanism: Mechanism, links: dict[str, BodyReading], closures: dict[str, ClosureReading]
) -> tuple[dict[str, BodyReading], dict[str, Array], dict[str, ClosureReading]]:
    """Merge links connected by fixed joints; return bodies, links fixed to the ground, and closures."""
    if len(mechanism.moving) == len(mechanism.coordinates):
        return links, {}, closures
    below = {name: replace(link, near=link.near if link.near != GROUND else "") for name, link in links.items()}
    merged = assemble(below, {}, mechanism.where, name=mechanism.name, library=OWN)
    moved = {}
    for name, one in closures.items():
        (first, T1), (second, T2) = merged.end_on(one.first), merged.end_on(one.second)
        A, B = T1 @ one.first_frame, T2 @ one.second_frame
        moved[name] = replace(one, first=first, second=second, first_frame=A, second_frame=B)
    return dict(merged.bodies), dict(merged.fixed), moved


def with_limits(reading: Reading, mechanism: Mechanism) -> Reading:
    """Add the joint limits of the description to an expected reading."""
    limits = dict(zip(mechanism.coordinates, map(tuple, mechanism.limits.tolist()), strict=True))
    joints = {name: replace(joint, limits=limits.get(name, joint.limits)) for name, joint in reading.joints.items()}
    return replace(reading, joints=joints)


def home_poses(tree: Tree) -> dict[str, Array]:
    """Compute the world poses of the ground, bodies and copies of bodies at the home pose. Shape (4, 4) each."""
    poses = {GROUND: np.eye(4)}
    for link in tree.links:
        T = joint_transform(link.joint, link.joint.home)
        poses[link.name] = poses[link.near] @ (np.linalg.inv(T) if link.reverse else T)
    return poses


def joint_transform(joint: Joint, q: Array) -> Array:
    """Compute ``T(parent, child) = parent_frame  X(q)  child_frame^-1``. Shape (4, 4)."""
    T = _matrix(joint.parent_frame)
    for value, (turns, axis) in zip(q, joint.freedoms, strict=True):
        T = T @ _step(float(value), turns, axis)
    return T @ np.linalg.inv(_matrix(joint.child_frame))


def _matrix(frame: Frame) -> Array:
    return matrix(frame.p, frame.R)


def _step(value: float, turns: bool, axis: Array) -> Array:
    return exponential("hinge" if turns else "slide", axis, np.zeros(3), value)


def _joints(link: Link, poses: dict[str, Array]) -> dict[str, JointReading]:
    """Return a reading of each degree of freedom of a joint: motions of the outer body relative to the inner body."""
    joint = link.joint
    sign = -1.0 if link.reverse else 1.0
    T, joints = poses[link.name if link.reverse else link.near] @ _matrix(joint.parent_frame), {}
    numbers = joint.coordinates, joint.home, joint.freedoms, joint.rotor, joint.damping, joint.friction
    for name, value, (turns, axis), rotor, damping, friction in zip(*numbers, strict=True):
        S, kind = sign * screw(turns, T[:3, :3] @ axis, T[:3, 3]), "hinge" if turns else "slide"
        amounts = float(rotor), float(damping), float(friction)
        joints[name] = JointReading(kind, S, T[:3, 3], float(value), FREE, *amounts)
        T = T @ _step(float(value), turns, axis)
    return joints
