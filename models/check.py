"""Model check: the libraries read from the model files what the description says, by plain matrices.

It precedes any comparison of motions, so that a difference between engines is never one of models.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from screwgauge.models.comparison import CheckRow, ModelComparison, compare_loops, compare_readings
from screwgauge.models.generate import stem
from screwgauge.models.layout import CUTS, Link, Tree, lay_out
from screwgauge.models.loops import loops_of, read_loops
from screwgauge.models.readings.assemble import matrix, screw
from screwgauge.models.readings.loops import closure_readings
from screwgauge.models.readings.read import read
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading, couplings_of
from screwgauge.reference.applied import GRAVITY
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import GROUND, Frame, Joint, Mechanism
from screwgauge.reference.rotations import Array, rotation

#: Reader -> suffix of the model file that it reads. The loops file is read by our own reader.
SUFFIXES = {"loops": ".loops.toml", "yourdfpy": ".urdf", "pinocchio": ".urdf", "mujoco": ".xml"}


def installed_readers() -> tuple[str, ...]:
    """Readers whose library is installed."""
    return tuple(name for name in SUFFIXES if name == "loops" or find_spec(name))


def check_models(
    mechanism: Mechanism,
    folder: Path,
    *,
    readers: Iterable[str] | None = None,
    gravity: Sequence[float] | Array = GRAVITY,
) -> list[CheckRow]:
    """Compares all model files of a mechanism with its description.

    Args:
        folder: Where the files of `write_models` lie.
        readers: Some of `SUFFIXES`; by default those whose library is installed.
        gravity: What the MJCF should say [m/s^2]. Shape (3,).

    Raises:
        UnknownNameError: There is no such reader.
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
    """Compares one model file, as one library reads it, with the description.

    A file that cannot be read, or a library that is missing, is a row with the reason.
    """
    out = ModelComparison(path.name, reader)
    home = dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
    try:
        if reader == "loops":
            compare_loops(out, loops_of(mechanism, cut), read_loops(path), mechanism)
        else:
            compare_readings(out, expected_reading(mechanism, cut, gravity), read(path, reader, home=home), mechanism)
    except Exception as error:  # libraries raise what they like about a file
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return [CheckRow(path.name, reader, "", "file", "can be read", reason, math.nan, 0.0, False)]
    return out.rows


def check_table(rows: Sequence[CheckRow]) -> str:
    """One line for each file, reading and property, the worst item named; then every row that is not ok."""
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
    """The reading of a model file that says exactly what the description says, limits left out."""
    tree = lay_out(mechanism, cut)
    poses = home_poses(tree)
    bodies: dict[str, BodyReading] = {}
    joints: dict[str, JointReading] = {}
    for link in tree.links:
        names, body = tuple(freedom.coordinate for freedom in link.freedoms), link.body
        copy_of = link.original if link.name != link.original else ""
        matter = body.mass, body.com, body.inertia
        bodies[link.name] = BodyReading(link.near, names, *matter, poses[link.name], copy_of=copy_of)
        joints |= _joints(link, poses)
    driven = zip(mechanism.actuator_names, mechanism.actuators, strict=True)
    return Reading(
        name=mechanism.name,
        library="screwgauge",
        bodies=bodies,
        joints=joints,
        closures=closure_readings(tree.closures),
        couplings=couplings_of(mechanism.couplings),
        actuators={name: (joint.coordinates[0], 1.0) for name, joint in driven},
        gravity=np.asarray(gravity, dtype=float),
    )


def home_poses(tree: Tree) -> dict[str, Array]:
    """World pose of the ground, of every body and of every copy at the home coordinates. Shape (4, 4) each."""
    poses = {GROUND: np.eye(4)}
    for link in tree.links:
        T = joint_transform(link.joint, link.joint.home)
        poses[link.name] = poses[link.near] @ (np.linalg.inv(T) if link.reverse else T)
    return poses


def joint_transform(joint: Joint, q: Array) -> Array:
    """``T(parent, child) = parent_frame  X(q)  child_frame^-1``. Shape (4, 4)."""
    T = _matrix(joint.parent_frame)
    for value, (turns, axis) in zip(q, joint.freedoms, strict=True):
        T = T @ _step(float(value), turns, axis)
    return T @ np.linalg.inv(_matrix(joint.child_frame))


def _matrix(frame: Frame) -> Array:
    return matrix(frame.p, frame.R)


def _step(value: float, turns: bool, axis: Array) -> Array:
    if turns:
        return matrix(np.zeros(3), rotation(axis, np.array(value)))
    return matrix(value * axis, np.eye(3))


def _joints(link: Link, poses: dict[str, Array]) -> dict[str, JointReading]:
    """A joint's freedoms, as its outer body moves against the inner one."""
    joint = link.joint
    sign = -1.0 if link.reverse else 1.0
    T, joints = poses[link.name if link.reverse else link.near] @ _matrix(joint.parent_frame), {}
    for name, value, (turns, axis) in zip(joint.coordinates, joint.home, joint.freedoms, strict=True):
        S = sign * screw(turns, T[:3, :3] @ axis, T[:3, 3])
        joints[name] = JointReading("hinge" if turns else "slide", S, T[:3, 3], float(value))
        T = T @ _step(float(value), turns, axis)
    return joints
