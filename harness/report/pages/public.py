"""The report on public models: ``python -m screwgauge.report.pages.public [FOLDER ...] [--out DIR]``.

Models are those of the extra ``study``, and all in the folders named.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Block, Heading, Paragraph, Table, facts
from screwgauge.report.console import console
from screwgauge.report.formatting import grouped, rows
from screwgauge.report.progress import Progress
from screwgauge.report.write import write_table
from screwgauge.study.imports import Public, imports, listed_models, models_in

NAME = "imports.csv"
OUT = Path("screwgauge-out/public-models")
MEANING = """Each model was imported, and its description driven in screw, Pinocchio and MuJoCo by the motion that
import gives it, at a few samples. Joints: R turns, P slides, U, S, C, F as in a description; loops and couplings beyond
the tree; error: the largest scaled one of any quantity. Refused: by import, or before any engine ran; failed: an engine
gives no answer."""
COLUMNS = ("model", "format", "bodies", "joints", "freedoms", "loops", "couplings", "actuators", "verdict", "error")


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    blocks: list[Block] = [Heading("Public models", 1), Paragraph(_sentence(found)), Paragraph(MEANING)]
    for (source,), group in grouped(rows(found), "source").items():
        lines = [[str(row["max_scaled" if key == "error" else key]) for key in COLUMNS] for row in group]
        blocks += [Heading(str(source)), Table(COLUMNS, tuple(map(tuple, lines)))]
    told = [(row["model"], row["verdict"], row["reason"]) for row in rows(found) if row["reason"]]
    if told:
        blocks += [Heading("Why not"), Table(("model", "verdict", "reason"), tuple(told))]
    left = [(row["model"], row["left_out"]) for row in rows(found) if row["left_out"]]
    if left:
        blocks += [Heading("What descriptions do not hold"), Table(("model", "left out"), tuple(left))]
    return [*blocks, Heading("Environment"), facts(record)]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``imports.csv``, the report and ``environment.json``."""
    return write_table(out, NAME, found, report)


def _sentence(found: pd.DataFrame) -> str:
    counts = Counter(found["verdict"])
    closed = found[found["loops"] > 0]
    return (
        f"{len(found)} models: {', '.join(f'{count} {verdict}' for verdict, count in counts.most_common())}. "
        f"{len(closed)} have closed loops, {sum('F' in kinds for kinds in found['joints'])} bodies that move freely."
    )


def on_models(
    page: str,
    meaning: str,
    out: Path,
    study: Callable[[list[Public], Callable[[str, float], None]], pd.DataFrame],
    write: Callable[[pd.DataFrame, Path], Path],
) -> int:
    """The command of a report on public models.

    Args:
        page: Its module.
        out: Its usual folder.
        study: Makes its table.
    """
    parser = argparse.ArgumentParser(prog=f"python -m screwgauge.report.pages.{page}", description=meaning)
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER", help="models besides those of the packages")
    parser.add_argument("--out", type=Path, default=out, metavar="DIR", help=f"default: {out}")
    options = parser.parse_args()
    with console(), Progress(sys.stderr) as progress:
        write(study([*models_in(options.folders), *listed_models()], progress.show), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(on_models("public", str(__doc__), OUT, imports, write))
