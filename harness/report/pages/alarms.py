"""The report of ``screwgauge check --self-test``: false alarms and missed changes, by family."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Heading, Items, Paragraph, Table
from screwgauge.report.study import Study
from screwgauge.study.gate.alarms import CHANGE, NAME


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


def _banner(found: pd.DataFrame) -> Banner:
    return Banner(sentence(found), *(("✓ PASSED", "agree") if passed(found) else ("✗ FAILED", "differ")))


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


def _body(found: pd.DataFrame) -> list[Block]:
    return [Heading("By family"), *terminal(found)[1:]]


PAGE = Study(NAME, "False alarms and missed changes", _banner, _body, terminal)
DATA, write = PAGE.DATA, PAGE.write
