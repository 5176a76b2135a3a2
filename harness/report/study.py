"""The report of a study that is one table."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.report.blocks import LONG, Banner, Block, Folded, Heading, Picture, table
from screwgauge.report.console import console
from screwgauge.report.formatting import Row, grouped
from screwgauge.report.layout import TEXTS, Report, Value
from screwgauge.report.progress import Progress
from screwgauge.study.campaigns.imports import Public, listed_models, models_in


def study(
    file: str,
    title: str,
    banner: Callable[[pd.DataFrame], Banner],
    kept: Collection[str] = (),
    draw: Callable[[pd.DataFrame], Sequence[Picture]] = lambda found: (),
    grown: bool = True,
    texts: Path = TEXTS,
    **values: Value,
) -> Report:
    """A report whose text, in the folder `texts`, has the name of the table's file.

    Args:
        kept: Columns of the file, all by default.
    """
    return Report(
        text=str(texts / Path(file).stem),
        banner=banner,
        data={file: lambda found: found[[*kept]] if kept else found},
        values={
            "title": lambda found: title,
            "about": lambda found: {"table": f"{file}, {len(found)} rows"},
            **values,
        },
        draw=draw,
        grown=grown,
    )


def by_source(found: Iterable[Row], columns: str) -> list[Block]:
    """A heading and a table for each package or folder that models are from."""
    told: list[Block] = []
    for (source,), some in grouped(found, "source").items():
        every = table(some, columns)
        told += [Heading(str(source)), Folded(f"All {len(some)} models", (every,)) if some[LONG:] else every]
    return told


def counted(values: Iterable[Any]) -> str:
    """``3 agree, 1 differ``, the most frequent first."""
    return ", ".join(f"{count} {value}" for value, count in Counter(values).most_common())


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
