"""The report of ``screwgauge check --self-test``: false alarms and missed changes, by family."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Block, Heading, Items, Paragraph, Table, facts
from screwgauge.report.write import write_table
from screwgauge.study.gate.alarms import CHANGE, NAME

DATA = (NAME, "environment.json")


def terminal(found: pd.DataFrame) -> list[Block]:
    """What is printed: counts by family, and every false alarm and missed change."""
    lines = tuple((str(name), *map(str, _counts(rows))) for name, rows in found.groupby("family"))
    bad = found[(found["quiet"] != "yes") | (found["caught"] == "no")]
    said = tuple(
        f"{row['family']} {row['seed']}: {_because(row)}" for row in map(dict[Any, Any], bad.to_dict("records"))
    )
    table = Table(("family", "mechanisms", "refused", "false alarms", "changed", "missed"), lines)
    return [Paragraph(sentence(found)), table, *([Items(said)] if said else [])]


def sentence(found: pd.DataFrame) -> str:
    """The counts in words."""
    n, refused, alarms, tried, missed = _counts(found)
    return (
        f"{n} random mechanisms of {found['family'].nunique()} families: {alarms} false alarms of {n - refused}"
        f" ({refused} refused); {missed} of {tried} changes of the dynamics by {CHANGE:g} missed."
    )


def passed(found: pd.DataFrame) -> bool:
    """Whether there is neither a false alarm nor a missed change, and something was looked at."""
    n, refused, alarms, tried, missed = _counts(found)
    return n > refused and bool(tried) and not alarms and not missed


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    head = Heading("False alarms and missed changes", 1)
    return [head, *terminal(found), Heading("Environment"), facts(record)]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``alarms.csv``, the report and ``environment.json``."""
    return write_table(out, NAME, found, report)


def _counts(rows: pd.DataFrame) -> tuple[int, int, int, int, int]:
    """Mechanisms, refused ones, false alarms, changes made, those missed."""
    quiet, caught = rows["quiet"], rows["caught"]
    return (
        len(rows),
        int((quiet == "refused").sum()),
        int((quiet == "no").sum()),
        int((caught != "").sum()),
        int((caught == "no").sum()),
    )


def _because(row: Mapping[str, Any]) -> str:
    missed = f"{row['parameter']} by {row['share']} missed ({row['error']}, tolerance {row['tolerance']})"
    return "; ".join([*([row["reason"]] if row["reason"] else []), *([missed] if row["caught"] == "no" else [])])
