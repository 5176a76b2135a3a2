"""A matrix of readers: each model file read by each library, and why it is not, or is read in another way."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import pandas as pd
from campaigns.page import counted, study
from campaigns.public import Public, by_source
from campaigns.rows import rows_in_turn
from campaigns.two_readers import SAME, compared

from screwgauge.diagnosis.libraries import ASKED
from screwgauge.judging.residual import columns_of, frame
from screwgauge.models.readings.read import libraries_for
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError, first_few
from screwgauge.report.blocks import Banner
from screwgauge.solution import Failure
from screwgauge.study.formatting import Row, group_rows, is_empty, number, rows, size
from screwgauge.study.loading import read_isolated

#: Causes that are named; the others are counted.
NAMED = 3


@dataclass(frozen=True, slots=True)
class ReaderRow:
    """One file by one library.

    Attributes:
        format: ``urdf`` or ``mjcf``; empty of a file that is refused before a library sees it.
        freedoms, closures, couplings: How many; NaN of a file that does not load.
        mass: Of all that moves [kg].
        torque, rigid: Difference to the library of the format (see `two_readers.TwoReaders`); 0 of that itself,
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


def reader_matrix(models: Sequence[Public], progress: Callable[[str, float], None]) -> pd.DataFrame:
    both = [model for model in models if model.file.suffix in (".urdf", ".xml")]
    table = rows_in_turn([(model.name, partial(reader_rows, model)) for model in both], progress)
    return frame(chain.from_iterable(table), columns_of(ReaderRow))


def reader_rows(model: Public) -> list[ReaderRow]:
    blank = ReaderRow(model.name, model.source)
    try:
        libraries = [name for name in libraries_for(model.file) if name in ASKED]
    except ScrewgaugeError as error:
        return [replace(blank, cause=error.what)]
    form = "urdf" if libraries[0] == "pinocchio" else "mjcf"
    read = {library: _reading(model, library) for library in libraries}
    return [
        _row(replace(blank, format=form, library=library), model, reading, read[libraries[0]])
        for library, reading in read.items()
    ]


def _reading(model: Public, library: str) -> Reading | Failure:
    try:
        return read_isolated(model.file, library, model.floating)
    except ScrewgaugeError as error:
        return Failure(library, str(error))


def _row(blank: ReaderRow, model: Public, reading: Reading | Failure, first: Reading | Failure) -> ReaderRow:
    if isinstance(reading, Failure):
        return replace(blank, cause=reading.reason.removeprefix(f"{model.file}: "))
    torque, rigid, causes = math.nan, math.nan, list[str]()
    if reading is first:
        torque = rigid = 0.0
    elif isinstance(first, Reading):
        two = compared(model.file, first, reading, floating=model.floating)
        torque, rigid, causes = two.torque, two.rigid, [*two.causes]
    else:
        causes = [f"{first.engine} does not read it"]
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


def _banner(table: pd.DataFrame) -> Banner:
    models = group_rows(rows(table), "source", "model", "format").values()
    text = f"{len(models)} models: {counted(map(_outcome, models))}."
    return Banner(text, "", "agree" if all(_outcome(lines) == "equal" for lines in models) else "note")


def _line(lines: Sequence[Row]) -> Row:
    read = {row["library"]: row for row in lines if row["loads"]}
    cells = {n: f"{row['freedoms']:g}, {number(row['mass'])}" if (row := read.get(n)) else "no" for n in ASKED}
    names = {"torque": "torques", "rigid": "rigid_body"}
    sizes = {names[k]: "" if is_empty(lines[-1][k]) else size(lines[-1][k]) for k in names}
    return {**lines[0], **cells, **sizes, "found": _outcome(lines)}


def _outcome(lines: Sequence[Row]) -> str:
    read = [row["library"] for row in lines if row["loads"]]
    if len(read) < len(ASKED):
        return f"read by {read[0]} alone" if read else "read by neither"
    torque, rigid = lines[-1]["torque"], lines[-1]["rigid"]
    if is_empty(torque):
        return "other joints"
    if torque <= SAME:
        return "equal"
    return "equal as rigid bodies" if rigid <= SAME else "other torques"


SHOWN = f"model | format | {' | '.join(f'{name} [1, kg] = {name}' for name in ASKED)} | torques | rigid body | found"
PAGE = study(
    "readers.csv",
    "Readers of public models",
    _banner,
    causes=lambda table: [row for row in rows(table) if row["cause"]],
    models=lambda table: by_source(map(_line, group_rows(rows(table), "source", "model", "format").values()), SHOWN),
)
