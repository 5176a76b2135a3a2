"""A matrix of readers: each model file read by each library, and why where it is not read, or is read otherwise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from screwgauge.diagnosis.asked import ASKED
from screwgauge.diagnosis.readers import compared
from screwgauge.models.readings.read import libraries_for
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.wording import first_few
from screwgauge.solution import Failure
from screwgauge.study.apart import Limits
from screwgauge.study.campaigns.imports import Public
from screwgauge.study.loading import LOADING, Request, readings
from screwgauge.study.table import columns_of, frame

#: Causes that are named; the others are counted.
NAMED = 3


@dataclass(frozen=True, slots=True)
class ReaderRow:
    """One file by one library.

    Attributes:
        format: ``urdf`` or ``mjcf``; empty of a file that is refused before a library sees it.
        freedoms, closures, couplings: How many; NaN of a file that does not load.
        mass: Of all that moves [kg].
        torque, rigid: Difference to the library of the format (see `diagnosis.readers.TwoReaders`); 0 of that itself,
            NaN where nothing could be compared.
        cause: Why it does not load, or differs from the library of the format; what is dropped.
    """

    model: str
    source: str
    format: str = ""
    library: str = ""
    loads: bool = False
    freedoms: float = math.nan
    mass: float = math.nan
    closures: float = math.nan
    couplings: float = math.nan
    torque: float = math.nan
    rigid: float = math.nan
    cause: str = ""


def reader_matrix(
    models: Sequence[Public],
    progress: Callable[[str, float], None] = lambda step, share: None,
    limits: Limits = LOADING,
) -> pd.DataFrame:
    """A row for each file and library, a column for each field of `ReaderRow`.

    Args:
        limits: Of one reading.
    """
    rows = []
    for i, model in enumerate(models):
        progress(model.name, i / len(models))
        rows += reader_rows(model, limits)
    return frame(rows, columns_of(ReaderRow))


def reader_rows(model: Public, limits: Limits = LOADING) -> list[ReaderRow]:
    """One file by all libraries that read its format and have dynamics, its own first."""
    blank = ReaderRow(model.name, model.source)
    try:
        libraries = [name for name in libraries_for(model.file) if name in ASKED]
    except ScrewgaugeError as error:
        return [replace(blank, cause=error.what)]
    form = "urdf" if libraries[0] == "pinocchio" else "mjcf"
    found = readings({library: Request(model.file, library, floating=model.floating) for library in libraries}, limits)
    return [
        _row(replace(blank, format=form, library=library), model, reading, found[libraries[0]])
        for library, reading in found.items()
    ]


def _row(blank: ReaderRow, model: Public, reading: Reading | Failure, first: Reading | Failure) -> ReaderRow:
    """Args: first: What the library of the format reads."""
    if isinstance(reading, Failure):
        return replace(blank, cause=reading.reason.removeprefix(f"{model.file}: "))
    torque, rigid, causes = math.nan, math.nan, list[str]()
    if reading is first:
        torque = rigid = 0.0
    elif isinstance(first, Reading):
        two = compared(model.file, first, reading, floating=model.floating)
        torque, rigid, causes = two.torque, two.rigid, [*two.causes]
    dropped = [phrase for phrase in reading.ignored if phrase.endswith(" drops")]
    return replace(
        blank,
        loads=True,
        freedoms=reading.freedom,
        mass=reading.mass,
        closures=len(reading.closures),
        couplings=len(reading.couplings),
        torque=torque,
        rigid=rigid,
        cause=first_few([*dropped, *causes], NAMED, "; "),
    )
