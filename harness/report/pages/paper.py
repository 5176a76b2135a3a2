"""The report of ``screwgauge paper``: the errata, each with the size of its effect."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.environment import environment
from screwgauge.quantities import MAX_DIGITS
from screwgauge.report.blocks import (
    Banner,
    Block,
    Folded,
    Marked,
    Paragraph,
    Picture,
    Table,
    facts,
    section,
    table,
)
from screwgauge.report.formatting import number, unit_text
from screwgauge.report.layout import laid_out
from screwgauge.report.pages.sections import judged, short
from screwgauge.report.write import write_report
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.study.paper.case import SCENE
from screwgauge.study.paper.errata import KINDS, Erratum
from screwgauge.study.paper.measure import NUMBERS, Paper, is_the_papers, measured
from screwgauge.study.provenance import provenance

DATA = ("errata.csv", "environment.json")
ABOUT = ("scene file", "description", "date", "cpu", "python")  # of what was judged and where, on the first screen
NOISE = 10.0**-MAX_DIGITS  # nothing here is known better than to the last bit of one
SOURCE = "Zhao, Wei, Sun: Dynamics of a 3-UPS-UPU-S Parallel Mechanism, Appl. Sci. 2023, 13, 3912"
MEANING = Paragraph(", ".join(f"{key} {word}" for key, word in KINDS.items()))


def _value(value: float) -> str:
    """Three figures; a residual of rounding as its power of ten."""
    if abs(value) < NOISE:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:.0f}"
    return number(value, 1 if abs(value) < 1e-9 else 3)


SHOWN = "no. = no | equation | measured = measure | effect | as printed → gives = printed | right → gives = right"
NUMERIC = ("printed", "right", "effect")
TERMINAL = "no | equation | measured = measure | printed | right | effect | unit"


def _shown(errata: Sequence[Erratum]) -> Table:
    rows = [
        {
            "no": f"{row.number} {row.kind}",
            "equation": row.equation,
            "measure": row.measure,
            "effect": f"{_value(row.effect)} {unit_text(row.unit)}".removesuffix(" 1"),
            "printed": f"{row.printed_form} → {_value(row.printed)}",
            "right": f"{row.right_form} → {_value(row.right)}",
        }
        for row in errata
    ]
    return table(rows, SHOWN)


def errata_frame(errata: Sequence[Erratum]) -> pd.DataFrame:
    """The table of ``errata.csv``."""
    rows = [
        {
            "number": row.number,
            "equation": f"{row.equation}: {row.measure}",
            "printed": f"{row.printed_form} -> {number(row.printed)}",
            "right": f"{row.right_form} -> {number(row.right)}",
            "effect": row.effect,
            "unit": row.unit,
        }
        for row in errata
    ]
    return pd.DataFrame(rows)


def terminal(paper: Paper) -> list[Block]:
    """What ``screwgauge paper`` prints."""
    rows = (
        {**asdict(row), "no": f"{row.number:2} {row.kind}", **{k: _value(getattr(row, k)) for k in NUMERIC}}
        for row in paper.errata
    )
    return [table(rows, TERMINAL), MEANING, Paragraph(paper.reach.sentence)]


def report(paper: Paper, pictures: Iterable[Picture], record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``; `record`: files, date and environment."""
    count, drawn = len({row.number for row in paper.errata}), list(pictures)
    sentence = (
        f"{count} of {len(NUMBERS)} errata of the paper are measured, each by running the form as printed beside the "
        f"right one, in {len(paper.errata)} rows. {paper.reach.sentence}"
    )
    banner = Banner(sentence, "✓ COMPLETE", "agree") if paper.complete else Banner(sentence, "✗ INCOMPLETE", "failed")
    folds = (Folded(picture.title, (picture,)) for picture in drawn[1:])
    body = [*section("paper", "Errata", _shown(paper.errata), MEANING), *section("paper", "Plots", *folds)]
    appendix = [*section("paper", "How it was measured"), *section("paper", "Environment", facts(record))]
    about = {"paper": SOURCE, **short({key: record[key] for key in ABOUT if key in record})}
    return laid_out(
        "The paper, checked", [banner], body, appendix, first=[facts(about)], picture=drawn[0] if drawn else None
    )


def write(paper: Paper, out: Path, *, date: datetime | None = None) -> Path:
    """Writes ``errata.csv``, the report with its plots, and ``environment.json``; `date`: now by default."""
    from screwgauge.report.figures.paper import make_plots

    record, files = environment(), judged(provenance(load_scene(SCENE), {}, date=date))
    data = dict(zip(DATA, (errata_frame(paper.errata), record), strict=True))
    return write_report(out, lambda: report(paper, make_plots(paper.runs, paper.axial), {**files, **record}), data)


def errata_section(scene: Scene) -> list[Block]:
    """A section of the report of a run; empty for a scene that is not the paper's."""
    if not is_the_papers(scene):
        return []
    paper = measured()
    lead = f"{paper.reach.sentence} `screwgauge paper` writes this table, its plots and how it was measured."
    return [Paragraph(Marked(lead)), Folded(f"All {len(paper.errata)} measurements", (_shown(paper.errata), MEANING))]
