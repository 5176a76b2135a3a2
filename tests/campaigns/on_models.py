"""What the reports on public models have in common."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd
from campaigns.imports import Public, listed_models, models_in

from screwgauge.report.blocks import LONG, Block, Folded, Heading, table
from screwgauge.report.console import console
from screwgauge.report.formatting import Row, grouped
from screwgauge.report.layout import Report
from screwgauge.report.progress import Progress

TEXTS = Path(__file__).with_name("texts")


def by_source(found: Iterable[Row], columns: str) -> list[Block]:
    """A heading and a table for each package or folder that models are from."""
    told: list[Block] = []
    for (source,), some in grouped(found, "source").items():
        every = table(some, columns)
        told += [Heading(str(source)), Folded(f"All {len(some)} models", (every,)) if some[LONG:] else every]
    return told


def on_models(
    page: Report, study: Callable[[list[Public], Callable[[str, float], None]], pd.DataFrame], module: str, out: str
) -> int:
    """The command of a report on public models.

    Args:
        study: Makes its table.
        module: Of the page.
        out: Its usual folder below ``screwgauge-out``.
    """
    usual = Path("screwgauge-out") / out
    parser = argparse.ArgumentParser(
        prog=f"python -m screwgauge.report.pages.{module}", description=page.values["title"](None)
    )
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER", help="models besides those of the packages")
    parser.add_argument("--out", type=Path, default=usual, metavar="DIR", help=f"default: {usual}")
    options = parser.parse_args()
    with console(), Progress(sys.stderr) as progress:
        page.write(study([*models_in(options.folders), *listed_models()], progress.show), options.out)
    return 0
