"""The report of a study that is one table, said by its sections."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.environment import environment
from screwgauge.report.blocks import Banner, Block, facts, section
from screwgauge.report.console import console
from screwgauge.report.layout import laid_out
from screwgauge.report.progress import Progress
from screwgauge.report.write import write_report
from screwgauge.study.imports import Public, listed_models, models_in

RECORD = "environment.json"
said = partial(section, "studies")


@dataclass(frozen=True, slots=True)
class Study:
    """What a report tells of a table.

    Attributes:
        NAME: File of the table.
        banner: What was found, in a sentence.
        body: Sections, each with its heading.
        terminal: What is printed.
        kept: Columns of the file; all by default.
    """

    NAME: str
    title: str
    banner: Callable[[pd.DataFrame], Banner]
    body: Callable[[pd.DataFrame], Iterable[Block]]
    terminal: Callable[[pd.DataFrame], list[Block]] = lambda found: []
    kept: tuple[str, ...] = ()

    @property
    def DATA(self) -> tuple[str, str]:
        """Files beside the pages."""
        return self.NAME, RECORD

    def report(self, found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
        """The blocks of ``report.md`` and ``report.html``."""
        about = {"table": f"{self.NAME}, {len(found)} rows", **{k: record[k] for k in SHOWN if k in record}}
        last = said("Environment", facts(record))
        return laid_out(self.title, [self.banner(found)], self.body(found), last, first=[facts(about)])

    def write(self, found: pd.DataFrame, out: Path) -> Path:
        """Writes the table, the report and ``environment.json``."""
        record, shown = environment(), found[[*self.kept]] if self.kept else found
        return write_report(out, lambda: self.report(found, record), {self.NAME: shown, RECORD: record})


SHOWN = ("platform", "cpu", "python", "commit")


def counted(values: Iterable[Any]) -> str:
    """``3 agree, 1 differ``, the most frequent first."""
    return ", ".join(f"{count} {value}" for value, count in Counter(values).most_common())


def on_models(
    page: Study, study: Callable[[list[Public], Callable[[str, float], None]], pd.DataFrame], module: str, out: str
) -> int:
    """The command of a report on public models.

    Args:
        study: Makes its table.
        module: Of the page.
        out: Its usual folder below ``screwgauge-out``.
    """
    usual = Path("screwgauge-out") / out
    parser = argparse.ArgumentParser(prog=f"python -m screwgauge.report.pages.{module}", description=page.title)
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER", help="models besides those of the packages")
    parser.add_argument("--out", type=Path, default=usual, metavar="DIR", help=f"default: {usual}")
    options = parser.parse_args()
    with console(), Progress(sys.stderr) as progress:
        page.write(study([*models_in(options.folders), *listed_models()], progress.show), options.out)
    return 0
