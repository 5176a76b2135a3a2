"""The report on public models: ``python -m campaigns.imports_page [FOLDER ...] [--out DIR]``.

Models are those of the extra ``study``, and all in the folders named.
"""

from __future__ import annotations

import sys

import pandas as pd
from campaigns.imports import imports
from campaigns.on_models import TEXTS, by_source, on_models

from screwgauge.report.blocks import Banner
from screwgauge.report.formatting import rows
from screwgauge.report.study import counted, study

COLUMNS = "model | format | bodies | joints | freedoms | loops | couplings | actuators | verdict | error = {max_scaled}"


def _banner(found: pd.DataFrame) -> Banner:
    closed, free = int((found["loops"] > 0).sum()), sum("F" in kinds for kinds in found["joints"])
    have = f"{closed} have closed loops, {free} bodies that move freely."
    return Banner(f"{len(found)} models: {counted(found['verdict'])}. {have}")


PAGE = study(
    "imports.csv",
    "Public models",
    _banner,
    grown=False,
    texts=TEXTS,
    reasons=lambda found: [row for row in rows(found) if row["reason"]],
    models=lambda found: by_source(rows(found), COLUMNS),
    omitted=lambda found: [row for row in rows(found) if row["left_out"]],
)

if __name__ == "__main__":
    sys.exit(on_models(PAGE, imports, "public", "public-models"))
