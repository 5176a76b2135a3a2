"""Formats numbers, vectors, placements and TOML tables as text, and parses numbers of model files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.errors import ModelFileError
from screwgauge.reference.mechanism import Body, Frame, Joint, Mechanism
from screwgauge.reference.resistance import RESISTS
from screwgauge.reference.rotations import Array, rotation, skew

#: Limits to write for a joint without limits. URDF requires limits except for "continuous" joints, but Pinocchio uses
#: two coordinates (cosine and sine) for the angle of such a joint.
WIDE = 1e3
#: Entries of an inertia tensor, in MJCF order; the order in URDF differs.
TENSOR = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}


def number_text(value: float) -> str:
    """Format a number as the shortest decimal that reads back as the same float64; it has at most 17 digits."""
    text = repr(float(value) + 0.0)  # + 0.0 makes -0 a plain zero
    return text.removesuffix(".0")


def vector_text(values: ArrayLike) -> str:
    """Format numbers separated by spaces, as in XML attributes."""
    return " ".join(number_text(value) for value in np.ravel(values))


def tensor_text(I: Array) -> str:
    """Format an inertia tensor as the ``fullinertia`` of MJCF. Shape (3, 3)."""
    return vector_text([I[place] for place in TENSOR.values()])


def tensor(entries: Iterable[float]) -> Array:
    """Build an inertia tensor from its entries in the order of `TENSOR`. Shape (3, 3)."""
    I = np.zeros((3, 3))
    for (i, j), entry in zip(TENSOR.values(), entries, strict=True):
        I[i, j] = I[j, i] = entry
    return I


def rpy(R: Array) -> Array:
    """Compute the angles of ``R = Rz(yaw) Ry(pitch) Rx(roll)`` [rad], as in URDF. Shape (3, 3) -> (3,).

    Pitch and roll are computed after removing yaw; therefore, the three angles reproduce `R` even where yaw and roll
    are rotations about nearly the same axis.
    """
    yaw = math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


def of_rpy(angles: Array) -> Array:
    """Compute ``Rz(yaw) Ry(pitch) Rx(roll)``, the inverse of `rpy`. Shape (3,) -> (3, 3)."""
    x, y, z = (rotation(axis, angle) for axis, angle in zip(np.eye(3), angles, strict=True))
    return z @ y @ x


def quaternion(R: Array) -> Array:
    """Compute the unit quaternion (w, x, y, z) of a rotation matrix, w >= 0. Shape (..., 3, 3) -> (..., 4).

    The row with the largest component is used, which avoids cancellation.
    """
    t = np.trace(R, axis1=-2, axis2=-1)
    outer = np.empty((*t.shape, 4, 4))
    outer[..., 0, 0] = 1.0 + t
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        outer[..., i + 1, i + 1] = 1.0 + 2.0 * R[..., i, i] - t
        outer[..., 0, i + 1] = outer[..., i + 1, 0] = R[..., k, j] - R[..., j, k]
        outer[..., j + 1, k + 1] = outer[..., k + 1, j + 1] = R[..., j, k] + R[..., k, j]
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :]
    q = row / np.linalg.norm(row, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q))


def floats(words: Iterable[Any], n: int, what: str, where: str, *, infinite: bool = False) -> Array:
    """Parse n numbers of a model file. Shape (n,).

    Args:
        words: Strings or numbers.
        what: Name and owner of the attribute or element that contains the numbers.
        infinite: Accept infinite values.

    Raises:
        ModelFileError: A word is not a number or not finite, or the count differs from `n`.
    """
    words = [*words]
    try:
        values = np.array([float(word) for word in words])
    except (TypeError, ValueError):
        values = np.zeros(0)
    bad = np.isnan(values) if infinite else ~np.isfinite(values)
    if len(values) != n or bad.any():
        due, stated = f"{n} finite numbers" if n > 1 else "a finite number", " ".join(map(str, words))
        raise ModelFileError(f"{what} must be {due}, got '{stated[:60]}'", where, f"write {due}")
    return values


def adjoint(T: Array) -> Array:
    """Compute the adjoint matrix of a placement, for twists ``[angular; linear]``. Shape (4, 4) -> (6, 6)."""
    R, out = T[:3, :3], np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[3:, :3] = skew(T[:3, 3]) @ R
    return out


Table = tuple[str, Mapping[str, Any]]


def document(top: Sequence[str], mechanism: Mechanism, parts: Sequence[Table], last: Sequence[Table] = ()) -> str:
    """Assemble the TOML text: `top`, the table of independent coordinates, `parts`, the couplings and `last`."""
    tables: list[Table] = [("[independent]", mechanism.independent)]
    if mechanism.axial:
        tables.append(("[spherical_axial]", {"joint": mechanism.axial[0], "direction": mechanism.axial[1]}))
    tables += parts
    for one in mechanism.couplings:
        if not one.fixing:  # the kind of the joint implies a fixing
            tables.append((f"[couplings.{key(one.name)}]", {"coordinate": one.coordinate, **_law(one.function)}))
    out = [*top]
    for title, entries in (*tables, *last):
        out += ["", title, *lines(entries)]
    return "\n".join(out) + "\n"


def _law(function: PolynomialSum) -> dict[str, Any]:
    """Return the entries that define a function of coordinates in a table of ``[couplings]``."""
    if len(function.terms) > 1:
        return {"terms": function.polynomials}
    return {**({"of": function.lead} if function.terms else {}), "polynomial": function.polynomial}


def lines(entries: Mapping[str, Any]) -> list[str]:
    """Format each entry as a line ``key = value``."""
    return [f"{key(name)} = {value_text(value)}" for name, value in entries.items()]


def value_text(value: Any) -> str:
    """Format a string, number, frame, array or table as TOML. Numbers keep full precision."""
    match value:
        case bool():
            return str(value).lower()
        case str():  # JSON strings are TOML strings except for DEL
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case Frame():
            return f"{{ position = {value_text(value.p)}, rotation = {{ matrix = {value_text(value.R)} }} }}"
        case dict():
            return "{ " + ", ".join(lines(value)) + " }"
        case tuple() | np.ndarray():
            return "[" + ", ".join(map(value_text, value)) + "]"
    return number_text(value)


def key(name: str) -> str:
    """Format a name as a TOML key."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else value_text(name)


def body_entries(body: Body) -> dict[str, Any]:
    """Return the entries of a description for a body; omit zeros."""
    if not body.mass:
        return {"mass": 0.0}
    tensor = {name: body.inertia[place] for name, place in TENSOR.items() if body.inertia[place]}
    return {"mass": body.mass, **({"com": body.com} if body.com.any() else {}), "inertia": tensor}


def joint_entries(joint: Joint) -> dict[str, Any]:
    """Return the entries of a description for a joint; omit defaults."""
    names = ("kind", "parent", "child", *(() if joint.fixed else ("axes",)))
    entries: dict[str, Any] = {name: getattr(joint, name) for name in names}
    if joint.coordinates != (joint.name,):
        entries["coordinates"] = joint.coordinates
    if joint.home.any():
        entries["home"] = joint.home
    if np.isfinite(joint.limits).any():
        entries["limits"] = np.nan_to_num(joint.limits, posinf=1e10, neginf=-1e10)
    if joint.actuated:
        entries["actuated"] = True
    if joint.held:
        entries["held"] = joint.held
    entries |= {name: getattr(joint, name) for name in RESISTS if getattr(joint, name).any()}
    for name in ("parent_frame", "child_frame"):
        frame: Frame = getattr(joint, name)
        if not frame.is_identity:
            entries[name] = frame
    return entries
