"""The report of ``screwgauge paper``: the errata, each with the size of its effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from screwgauge.environment import environment
from screwgauge.quantities import MAX_DIGITS
from screwgauge.report.blocks import (
    Banner,
    Block,
    Column,
    Folded,
    Heading,
    Numbers,
    Paragraph,
    Picture,
    prose,
    section,
    table,
)
from screwgauge.report.formatting import number, unit_text
from screwgauge.report.pages.sections import facts, judged
from screwgauge.report.write import write_report
from screwgauge.scene.scene import Scene, load_scene
from screwgauge.study.paper.errata import KINDS, SCENE, Erratum
from screwgauge.study.paper.measure import NUMBERS, Paper, is_the_papers, measured
from screwgauge.study.provenance import provenance

if TYPE_CHECKING:
    from screwgauge.report.plots import Plot

NOISE = 10.0**-MAX_DIGITS  # nothing here is known better than to the last bit of one
SOURCE = "Zhao, Wei, Sun: Dynamics of a 3-UPS-UPU-S Parallel Mechanism, Appl. Sci. 2023, 13, 3912"
HOW = """\
Every row is one measurement: the same quantity by the form as printed and by the right form, on the paper's own
case (eq. 59, Tables 1 to 3, wrist angles of Table 2; loads act on the platform), every 0.05 s of its 10 s unless the
row says otherwise. *Effect* is the difference of the two, or what its unit says; for an error, the right form's own
value shows how well that is known. Forces are those of the smallest driving forces, eq. (56) apart. Lengths are in
metres: the condition numbers, and what is left over where rad/s and m/s are mixed, depend on that.

- **8**: a gap is the distance between the end of a leg, by its own joint angles, and its place on the platform as the
  S joint's angles have it.
- **6** is counted in a list of all references to equations that was made by reading; nothing but reading tells what
  is meant."""


def _value(value: float) -> str:
    """Three figures; a residual of rounding as its power of ten."""
    if abs(value) < NOISE:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:.0f}"
    return number(value, 1 if abs(value) < 1e-9 else 3)


PLACE = (Column("equation", "equation"), Column("measured", "measure"))
TABLE = (
    *(Column("no.", lambda row: f"{row.number} {row.kind}"), *PLACE),
    Column("effect", lambda row: f"{_value(row.effect)} {unit_text(row.unit)}".removesuffix(" 1")),
    Column("as printed → gives", lambda row: f"{row.printed_form} → {_value(row.printed)}"),
    Column("right → gives", lambda row: f"{row.right_form} → {_value(row.right)}"),
)
TERMINAL = (
    *(Column("no", lambda row: f"{row.number:2} {row.kind}"), *PLACE),
    *(Numbers(name, name, _value) for name in ("printed", "right", "effect")),
    Column("unit", "unit"),
)
CSV = (
    *(Column("number", "number"), Column("equation", lambda row: f"{row.equation}: {row.measure}")),
    Column("printed", lambda row: f"{row.printed_form} -> {number(row.printed)}"),
    Column("right", lambda row: f"{row.right_form} -> {number(row.right)}"),
    *(Column("effect", "effect"), Column("unit", "unit")),
)
MEANING = Paragraph(", ".join(f"{key} {word}" for key, word in KINDS.items()))


def errata_frame(errata: Sequence[Erratum]) -> pd.DataFrame:
    """The table of ``errata.csv``: columns number, equation, printed, right, effect, unit."""
    numbers = {name: [getattr(row, name) for row in errata] for name in ("number", "effect")}
    texts = table(errata, CSV)
    return pd.DataFrame(texts.body, columns=list(texts.head)).assign(**numbers)


def terminal(paper: Paper) -> list[Block]:
    """What ``screwgauge paper`` prints."""
    return [table(paper.errata, TERMINAL), MEANING, Paragraph(paper.reach.sentence)]


def report(paper: Paper, plots: Sequence[Plot], record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``; `record`: files, date and environment."""
    count = len({row.number for row in paper.errata})
    sentence = f"{count} of {len(NUMBERS)} errata measured, in {len(paper.errata)} rows. {paper.reach.sentence}"
    found = Banner(sentence, "✓ COMPLETE", "agree") if paper.complete else Banner(sentence, "✗ INCOMPLETE", "failed")
    return [
        Heading("The paper, checked", 1),
        found,
        Paragraph(SOURCE),
        *section("Errata", table(paper.errata, TABLE), MEANING),
        *section("How it was measured", *prose(HOW)),
        *section("Plots", *map(Picture, plots)),
        *section("Environment", facts(record)),
    ]


def write(paper: Paper, out: Path, *, date: datetime | None = None) -> Path:
    """Writes ``errata.csv``, the report with its plots, and ``environment.json``.

    Args:
        date: When the errata were measured; now by default.

    Raises:
        OutputError: The folder cannot be written.
    """
    from screwgauge.report.paper.plots import make_paper_plots

    record = environment()
    files = dict(judged(provenance(load_scene(SCENE), {}, date=date)))
    blocks = report(paper, make_paper_plots(paper.runs, paper.axial), {**files, **record})
    return write_report(out, blocks, {"errata.csv": errata_frame(paper.errata), "environment.json": record})


def errata_section(scene: Scene) -> list[Block]:
    """A section of the report of a run; empty for a scene that is not the paper's."""
    if not is_the_papers(scene):
        return []
    paper = measured()
    lead = f"{paper.reach.sentence} `screwgauge paper` writes this table, its plots and how it was measured."
    long = table(paper.errata, TABLE)
    return [Paragraph(lead), Folded(f"All {len(paper.errata)} measurements", (long, MEANING))]
