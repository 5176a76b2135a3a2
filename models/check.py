"""Model check: do the libraries read from the model files what the description says?

Before any motion is compared, so that a difference of engines is never one of models.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from screwgauge.models.expected import expected_reading
from screwgauge.models.generate import GRAVITY, stem
from screwgauge.models.layout import CUTS, length_scale
from screwgauge.models.readings import READERS, Reading
from screwgauge.reference.errors import UnknownNameError
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array

#: Of the scale of a value. A number is read to 1e-16; roll-pitch-yaw, quaternions and the products along a chain of
#: ten joints add about 2e-16 each.
TOLERANCE = 1e-14
#: MuJoCo keeps principal moments and axes; its diagonalisation leaves 1.1e-14 of the largest moment (the worst of
#: 1200 random tensors, mujoco 4.0.0).
INERTIA_TOLERANCE = 5e-14


@dataclass(frozen=True, slots=True)
class CheckRow:
    """One comparison. `difference` is scaled as `tolerance` is; NaN where names are compared."""

    file: str
    reading: str
    item: str
    what: str
    expected: str
    found: str
    difference: float
    tolerance: float
    ok: bool


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
        readers: Names of `READERS`; by default those whose library is installed.
        gravity: What the MJCF should say [m/s^2]. Shape (3,).
    """
    names = [name for name in READERS if find_spec(name)] if readers is None else list(readers)
    rows = []
    for cut in CUTS:
        for name in names:
            if name not in READERS:
                raise UnknownNameError("reader", name, READERS)
            path = folder / f"{stem(mechanism.name, cut)}{READERS[name][0]}"
            rows += check_file(mechanism, cut, path, name, gravity=gravity)
    return rows


def check_file(
    mechanism: Mechanism,
    cut: str,
    path: Path,
    reader: str,
    *,
    gravity: Sequence[float] | Array = GRAVITY,
) -> list[CheckRow]:
    """Compares one model file, as one library reads it, with the description."""
    home = dict(zip(mechanism.coordinates, map(float, mechanism.home), strict=True))
    try:
        found = READERS[reader][1](path, home)
    except Exception as error:  # whatever a library raises about a file is a row
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return [CheckRow(path.name, reader, "", "file", "can be read", reason, math.nan, 0.0, False)]
    comparison = _Comparison(path.name, reader)
    _compare(comparison, expected_reading(mechanism, cut, gravity), found, mechanism)
    return comparison.rows


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


@dataclass(frozen=True, slots=True, eq=False)
class _Comparison:
    file: str
    reading: str
    rows: list[CheckRow] = field(default_factory=list)

    def names(self, item: str, what: str, expected: object, found: object) -> None:
        same = expected == found
        self._add(item, what, str(expected), str(found), math.nan, 0.0, same)

    def numbers(
        self, item: str, what: str, expected: Array, found: Array, scale: float, tolerance: float = TOLERANCE
    ) -> None:
        # written so that NaN is a difference, not agreement
        difference = float(np.abs(expected - found).max()) / scale
        self._add(item, what, _short(expected), _short(found), difference, tolerance, difference <= tolerance)

    def _add(
        self, item: str, what: str, expected: str, found: str, difference: float, tolerance: float, ok: bool
    ) -> None:
        self.rows.append(CheckRow(self.file, self.reading, item, what, expected, found, difference, tolerance, ok))


def _short(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in np.ravel(values))


def _compare(out: _Comparison, expected: Reading, found: Reading, mechanism: Mechanism) -> None:
    length = length_scale(mechanism)
    out.names("", "body names", sorted(expected.bodies), sorted(found.bodies))
    out.names("", "coordinate names", sorted(expected.screws), sorted(found.screws))
    total = sum(body.mass for body in found.bodies.values())
    out.numbers("", "total mass", np.array([mechanism.mass]), np.array([total]), mechanism.mass)
    _compare_bodies(out, expected, found, length)
    for name in _common(expected.screws, found.screws):
        scale = np.repeat([1.0, length], 3) if expected.screws[name][:3].any() else np.ones(6)
        out.numbers(name, "joint axis at home", expected.screws[name] / scale, found.screws[name] / scale, 1.0)
    if found.gravity is None:
        return
    wanted = np.asarray(expected.gravity)
    out.numbers("", "gravity", wanted, found.gravity, float(np.linalg.norm(wanted)) or 9.81)
    out.names("", "actuators", dict(expected.actuators), dict(found.actuators))
    out.names("", "closure names", sorted(expected.closures), sorted(found.closures))
    for name in _common(expected.closures, found.closures):
        body1, p1, body2, p2 = expected.closures[name]
        other1, r1, other2, r2 = found.closures[name]
        out.names(name, "closure bodies", (body1, body2), (other1, other2))
        out.numbers(name, "closure points", np.array([p1, p2]), np.array([r1, r2]), length)


def _compare_bodies(out: _Comparison, expected: Reading, found: Reading, length: float) -> None:
    for name in _common(expected.bodies, found.bodies):
        want, have = expected.bodies[name], found.bodies[name]
        out.names(name, "parent and joints", (want.near, *want.coordinates), (have.near, *have.coordinates))
        out.numbers(name, "mass", np.array([want.mass]), np.array([have.mass]), want.mass)
        out.numbers(name, "centre of mass", want.com, have.com, length)
        # a point has no moments; then the mass and the length of the mechanism say what is small
        scale = float(np.abs(want.inertia).max()) or want.mass * length**2
        out.numbers(name, "inertia tensor", want.inertia, have.inertia, scale, INERTIA_TOLERANCE)
        metres = np.array([1.0, 1.0, 1.0, length])
        out.numbers(name, "pose at home", want.pose[:3] / metres, have.pose[:3] / metres, 1.0)


def _common(expected: Mapping[str, object], found: Mapping[str, object]) -> list[str]:
    return [name for name in expected if name in found]
