"""The matrix of readers of public models: ``python -m campaigns.readers_page [FOLDER ...] [--out DIR]``.

Models are those of the extra ``study``, and all in the folders named.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import pandas as pd
from campaigns.on_models import TEXTS, by_source, on_models
from campaigns.readers import reader_matrix
from campaigns.two_readers import SAME

from screwgauge.diagnosis.asked import ASKED
from screwgauge.report.blocks import Banner
from screwgauge.report.formatting import Row, grouped, missing, number, rows, size
from screwgauge.report.study import counted, study

COLUMNS = f"model | format | {' | '.join(f'{name} [1, kg] = {name}' for name in ASKED)} | torques | rigid body | found"


def _banner(found: pd.DataFrame) -> Banner:
    models = grouped(rows(found), "source", "model", "format").values()
    text = f"{len(models)} models: {counted(map(_found, models))}."
    return Banner(text, "", "agree" if all(_found(lines) == "equal" for lines in models) else "note")


def _line(lines: Sequence[Row]) -> Row:
    read = {row["library"]: row for row in lines if row["loads"]}
    cells = {n: f"{row['freedoms']:g}, {number(row['mass'])}" if (row := read.get(n)) else "no" for n in ASKED}
    names = {"torque": "torques", "rigid": "rigid_body"}
    sizes = {names[k]: "" if missing(lines[-1][k]) else size(lines[-1][k]) for k in names}
    return {**lines[0], **cells, **sizes, "found": _found(lines)}


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


PAGE = study(
    "readers.csv",
    "Readers of public models",
    _banner,
    grown=False,
    texts=TEXTS,
    causes=lambda found: [row for row in rows(found) if row["cause"]],
    models=lambda found: by_source(map(_line, grouped(rows(found), "source", "model", "format").values()), COLUMNS),
)

if __name__ == "__main__":
    sys.exit(on_models(PAGE, reader_matrix, "readers", "readers"))
