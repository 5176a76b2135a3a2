"""The report on public models: ``python -m screwgauge.report.pages.public [FOLDER ...] [--out DIR]``.

Models are those of the extra ``study``, and all in the folders named.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Heading, folded, table
from screwgauge.report.formatting import grouped, rows
from screwgauge.report.study import Study, counted, on_models, said
from screwgauge.study.imports import imports

COLUMNS = "model | format | bodies | joints | freedoms | loops | couplings | actuators | verdict | error = worst"


def _banner(found: pd.DataFrame) -> Banner:
    closed, free = int((found["loops"] > 0).sum()), sum("F" in kinds for kinds in found["joints"])
    have = f"{closed} have closed loops, {free} bodies that move freely."
    return Banner(f"{len(found)} models: {counted(found['verdict'])}. {have}")


def _body(found: pd.DataFrame) -> Iterator[Block]:
    every = [{**row, "worst": row["max_scaled"]} for row in rows(found)]
    told = [row for row in every if row["reason"]]
    yield from said("Why not", folded("All", table(told, "model | verdict | reason"))) if told else ()
    yield from said("Public models")[1:]
    for (source,), group in grouped(every, "source").items():
        yield from (Heading(str(source)), folded(f"All {len(group)} models", table(group, COLUMNS)))
    left = [row for row in every if row["left_out"]]
    if left:
        yield from said("What descriptions do not hold", folded("All", table(left, "model | left out")))


PAGE = Study("imports.csv", "Public models", _banner, _body)
NAME, write = PAGE.NAME, PAGE.write

if __name__ == "__main__":
    sys.exit(on_models(PAGE, imports, "public", "public-models"))
