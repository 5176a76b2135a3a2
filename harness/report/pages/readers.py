"""The matrix of readers of public models: ``python -m screwgauge.report.pages.readers [FOLDER ...] [--out DIR]``.

Models are those of the extra ``study``, and all in the folders named.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.diagnosis.asked import ASKED
from screwgauge.diagnosis.readers import SAME
from screwgauge.report.blocks import Block, Heading, Paragraph, Table, facts
from screwgauge.report.formatting import Row, grouped, missing, number, rows, size
from screwgauge.report.pages.public import on_models
from screwgauge.report.write import write_table
from screwgauge.study.readers import reader_matrix

NAME = "readers.csv"
OUT = Path("screwgauge-out/readers")
MEANING = """Each file was read by both libraries: degrees of freedom and mass of all that moves [kg], as each has it.
Torques: the inverse dynamics of each library itself at the same random states; rigid body: the same from mass matrix
and bias alone, without what joints and the medium add. Both columns: the largest difference over the largest torque;
up to 1e-9 is equal."""
HEAD = ("model", "format", *(f"{name} [1, kg]" for name in ASKED), "torques", "rigid body", "found")


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    models = grouped(rows(found), "source", "model", "format")
    counts = Counter(_found(lines) for lines in models.values())
    said = ", ".join(f"{count} {what}" for what, count in counts.most_common())
    blocks: list[Block] = [Heading("Readers of public models", 1), Paragraph(f"{len(models)} models: {said}.")]
    blocks.append(Paragraph(MEANING))
    for (source,), group in grouped(rows(found), "source").items():
        lines = [_line(key, of) for key, of in grouped(group, "model", "format").items()]
        blocks += [Heading(str(source)), Table(HEAD, tuple(lines))]
    told = [(row["model"], row["library"], row["cause"]) for row in rows(found) if row["cause"]]
    if told:
        blocks += [Heading("Why"), Table(("model", "library", "cause"), tuple(told))]
    return [*blocks, Heading("Environment"), facts(record)]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``readers.csv``, the report and ``environment.json``."""
    return write_table(out, NAME, found, report)


def _line(key: tuple[Any, ...], lines: Sequence[Row]) -> tuple[str, ...]:
    read = {row["library"]: row for row in lines if row["loads"]}
    cells = [f"{row['freedoms']:g}, {number(row['mass'])}" if (row := read.get(name)) else "no" for name in ASKED]
    other = lines[-1]
    sizes = ["" if missing(other[what]) else size(other[what]) for what in ("torque", "rigid")]
    return (*map(str, key), *cells, *sizes, _found(lines))


def _found(lines: Sequence[Row]) -> str:
    """What becomes of a model, in few words."""
    read = [row["library"] for row in lines if row["loads"]]
    if len(read) < len(ASKED):
        return f"read by {read[0]} alone" if read else "read by neither"
    torque, rigid = lines[-1]["torque"], lines[-1]["rigid"]
    if missing(torque):
        return "other joints"
    if torque <= SAME:
        return "equal"
    return "equal as rigid bodies" if rigid <= SAME else "other torques"


if __name__ == "__main__":
    sys.exit(on_models("readers", str(__doc__), OUT, reader_matrix, write))
