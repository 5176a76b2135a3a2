"""What ``screwgauge paper`` leaves: ``errata.csv``, the report, and the table for the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.environment import environment
from screwgauge.report.formatting import MAX_DIGITS, markdown_table, number, text_table, unit_text
from screwgauge.report.page import report_html
from screwgauge.report.paper.plots import make_paper_plots
from screwgauge.report.plots import Plot
from screwgauge.report.sections import facts, folded
from screwgauge.report.summary import json_text
from screwgauge.report.write import write_files
from screwgauge.scene.scene import Scene
from screwgauge.study.paper.errata import KINDS
from screwgauge.study.paper.measure import NUMBERS, Paper, is_the_papers, measured

COLUMNS = ("number", "equation", "printed", "right", "effect", "unit")
WIDTH = 100
_KINDS = ", ".join(f"{key} {word}" for key, word in KINDS.items())
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


def errata_frame(paper: Paper) -> pd.DataFrame:
    """The table of ``errata.csv``: columns number, equation, printed, right, effect, unit."""
    rows = [
        (
            row.number,
            f"{row.equation}: {row.measure}",
            f"{row.printed_form} -> {number(row.printed)}",
            f"{row.right_form} -> {number(row.right)}",
            row.effect,
            row.unit,
        )
        for row in paper.errata
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def format_terminal(paper: Paper) -> str:
    """The table in 100 columns."""
    head = ("no", "", "equation", "measured", "printed", "right", "effect", "unit")
    body = [
        (
            str(row.number),
            row.kind,
            row.equation,
            row.measure,
            _value(row.printed),
            _value(row.right),
            _value(row.effect),
            row.unit,
        )
        for row in paper.errata
    ]
    lines = [line.replace("  ", " ", 1) for line in text_table(head, body, right=(0, 4, 5, 6))]
    return "\n".join([*lines, "", _KINDS, *textwrap.wrap(paper.reach.sentence, WIDTH)])


def _value(value: float) -> str:
    """Three figures; a residual of rounding as its power of ten."""
    if abs(value) < NOISE:
        return "0"
    if 1e3 <= abs(value) < 1e6:
        return f"{value:.0f}"
    return number(value, 1 if abs(value) < 1e-9 else 3)


def errata_table(paper: Paper) -> str:
    """The table as Markdown."""
    head = ["no.", "equation", "measured", "effect", "as printed → gives", "right → gives"]
    body = [
        [
            f"{row.number} {row.kind}",
            row.equation,
            row.measure,
            f"{_value(row.effect)} {unit_text(row.unit)}".removesuffix(" 1"),
            f"{row.printed_form} → {_value(row.printed)}",
            f"{row.right_form} → {_value(row.right)}",
        ]
        for row in paper.errata
    ]
    return f"{markdown_table(head, body)}\n\n{_KINDS}"


def report_markdown(paper: Paper, plots: Sequence[Plot], record: dict[str, Any]) -> str:
    """The text of ``report.md``."""
    found = len({row.number for row in paper.errata})
    verdict = f"{found} of {len(NUMBERS)} errata measured, in {len(paper.errata)} rows."
    pictures = [f"![{plot.title}](plots/{plot.name}.svg)" for plot in plots]
    parts = [
        "# The paper, checked",
        f"> **{'✓ COMPLETE' if paper.complete else '✗ INCOMPLETE'}**: {verdict} {paper.reach.sentence}",
        SOURCE,
        "## Errata",
        errata_table(paper),
        "## How it was measured",
        HOW,
        "## Plots",
        *pictures,
        "## Environment",
        facts(record, "Not recorded."),
    ]
    return "\n\n".join(parts) + "\n"


def write_paper(paper: Paper, out: Path) -> Path:
    """Writes ``errata.csv``, the report with its plots, and ``environment.json``.

    Raises:
        OutputError: The folder cannot be written.
    """
    plots, record = make_paper_plots(paper.runs, paper.axial), environment()
    text = report_markdown(paper, plots, record)
    return write_files(
        out,
        {
            **{f"plots/{plot.name}.svg": plot.svg for plot in plots},
            "report.md": text,
            "report.html": report_html(text, plots, "agree" if paper.complete else "failed"),
            "errata.csv": errata_frame(paper).to_csv(index=False, na_rep="nan", lineterminator="\n"),
            "environment.json": json_text(record),
        },
    )


def paper_section(scene: Scene) -> str:
    """The section of the default report; empty for a scene that is not the paper's."""
    if not is_the_papers(scene):
        return ""
    paper = measured()
    lead = f"{paper.reach.sentence} `screwgauge paper` writes this table, its plots and how it was measured."
    return f"{lead}\n\n{folded(f'All {len(paper.errata)} measurements', errata_table(paper), len(paper.errata))}"
