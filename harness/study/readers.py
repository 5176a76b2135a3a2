"""A matrix of readers: each model file read by each library, and why where it is not read, or is read otherwise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from screwgauge.models.readings.read import libraries_for
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.solution import Failure
from screwgauge.study.apart import Limits
from screwgauge.study.loading import LOADING, Request, readings
from screwgauge.study.table import frame

#: Takes what two libraries read from one file; gives the largest difference of their torques at random states, on the
#: scale of the torques.
Torques = Callable[[Reading, Reading], float]
#: A larger relative difference of masses is one.
SAME_MASS = 1e-9
COLUMNS = {
    name: name
    for name in ("model", "format", "library", "loads", "freedoms", "mass", "closures", "couplings", "torque", "cause")
}


@dataclass(frozen=True, slots=True)
class ReaderRow:
    """One file by one library.

    Attributes:
        freedoms, closures, couplings: How many; NaN of a file that does not load.
        mass: Of all that moves [kg].
        torque: Difference to the library of the format, scaled; 0 of that itself, NaN where nothing was compared.
        cause: Why it does not load, or differs from the library of the format; what is dropped.
    """

    model: str
    format: str
    library: str
    loads: bool
    freedoms: float = math.nan
    mass: float = math.nan
    closures: float = math.nan
    couplings: float = math.nan
    torque: float = math.nan
    cause: str = ""


def reader_matrix(paths: Iterable[Path], torques: Torques | None = None, limits: Limits = LOADING) -> pd.DataFrame:
    """A row for each file and library.

    Args:
        torques: Compares two readings in motion; without it that column stays empty.
        limits: Of one reading.
    """
    return frame([row for path in paths for row in reader_rows(path, torques, limits)], COLUMNS)


def reader_rows(path: Path, torques: Torques | None = None, limits: Limits = LOADING) -> list[ReaderRow]:
    """One file by all libraries that read its format, its own first; see `reader_matrix`."""
    try:
        libraries = libraries_for(path)
    except ScrewgaugeError as error:
        return [ReaderRow(path.stem, "", "", False, cause=_without_path(str(error), path))]
    form = "urdf" if libraries[0] == "pinocchio" else "mjcf"
    found = readings({library: Request(path, library) for library in libraries}, limits)
    first, rows = found[libraries[0]], []
    for library, reading in found.items():
        if isinstance(reading, Failure):
            rows.append(ReaderRow(path.stem, form, library, False, cause=_without_path(reading.reason, path)))
            continue
        other = first if isinstance(first, Reading) and first is not reading else None
        row = ReaderRow(
            path.stem,
            form,
            library,
            True,
            sum(FREEDOMS[joint.kind] for joint in reading.joints.values()),
            reading.mass,
            len(reading.closures),
            len(reading.couplings),
            0.0 if reading is first else _torque(torques, first, reading),
            "; ".join(_causes(reading, other)),
        )
        rows.append(row)
    return rows


def _without_path(said: str, path: Path) -> str:
    """The row names the file already."""
    return said.removeprefix(f"{path}: ")


def _torque(torques: Torques | None, first: Reading | Failure, reading: Reading) -> float:
    if torques is None or isinstance(first, Failure) or {*first.joints} != {*reading.joints}:
        return math.nan
    return torques(first, reading)


def _causes(reading: Reading, first: Reading | None) -> list[str]:
    """What is dropped, and what is otherwise than in the reading by the library of the format."""
    said = [phrase for phrase in reading.ignored if phrase.endswith(" drops")]
    if first is None:
        return said
    for what, one, other in (("joints", first.joints, reading.joints), ("bodies", first.bodies, reading.bodies)):
        if further := [name for name in other if name not in one]:
            said.append(f"{len(further)} further {what}, among them {further[0]}")
    for name in [name for name in first.bodies if name in reading.bodies]:
        mass, other_mass = first.bodies[name].mass, reading.bodies[name].mass
        if not abs(mass - other_mass) <= SAME_MASS * max(mass, other_mass):
            said.append(f"mass of {name} {other_mass:.6g} kg, not {mass:.6g} kg")
            break
    kinds = [
        name for name, one in first.joints.items() if name in reading.joints and one.kind != reading.joints[name].kind
    ]
    if kinds:
        said.append(f"{kinds[0]} is a {reading.joints[kinds[0]].kind}, not a {first.joints[kinds[0]].kind}")
    if {*first.closures} != {*reading.closures}:
        said.append(f"{len(reading.closures)} closures, not {len(first.closures)}")
    if first.gravity is not None and reading.gravity is not None and not np.array_equal(first.gravity, reading.gravity):
        said.append("gravity of its own")
    return said
