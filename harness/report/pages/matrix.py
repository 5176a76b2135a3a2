"""The report of ``screwgauge matrix``: which versions agree, and which discrepancies depend on the version."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.casebook.book import CASES
from screwgauge.report.blocks import Block, Folded, Heading, Items, Marked, Paragraph, Table, facts
from screwgauge.report.formatting import Row, number, rows
from screwgauge.report.write import write_table
from screwgauge.study.matrix import COLUMNS

NAME = "matrix.csv"
DATA = (NAME, "environment.json")
ENGINES = {"pin": "pinocchio", "mujoco": "mujoco"}
#: Column -> what became of a case.
STATUS = {"shown": "shown", "not_shown": "-", "failed": "failed"}
MEANING = """Each row is a fresh environment with these versions, in which `screwgauge check --smoke` looks at all
built-in scenes: how many pass, the fewest digits of two engines that agree, and where. **Cases** of the casebook are
discrepancies that have a name: how many `screwgauge diagnose --case` shows there."""
DEPENDS = """What is shown (the symptom is there) with some versions and not (-) with others; of engines that say
nothing of the kind, or other functions, the reproduction failed."""


def terminal(found: pd.DataFrame) -> list[Block]:
    """What is printed: a row for each pair."""
    return [_pairs(found), *_reasons(found)]


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    return [
        Heading("Versions of Pinocchio and MuJoCo", 1),
        Paragraph(Marked(MEANING)),
        _pairs(found),
        *_reasons(found),
        Heading("Discrepancies that depend on the version"),
        Paragraph(DEPENDS),
        *_cases(found),
        Heading("Environment"),
        facts({key: record[key] for key in ("platform", "cpu", "cores", "python", "commit") if key in record}),
    ]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``matrix.csv``, the report and ``environment.json``."""
    return write_table(out, NAME, found[[*COLUMNS]], report)


def _pairs(found: pd.DataFrame) -> Table:
    lines = []
    for row in rows(found):
        counts = [str(len(row[name].split())) for name in STATUS]
        passing = f"{row['passing']} of {row['scenes']}"
        lines.append(
            (row["pin"], row["mujoco"], row["status"], passing, number(row["digits"], 3), row["worst"], *counts)
        )
    heads = ("pin", "mujoco", "check", "scenes", "digits", "fewest in", "cases shown", "not shown", "failed")
    return Table(heads, tuple(lines))


def _reasons(found: pd.DataFrame) -> list[Block]:
    said = [
        f"pin {row['pin']}, mujoco {row['mujoco']}: {_amount(row)}{row['reason']}"
        for row in rows(found)
        if row["reason"]
    ]
    return [Folded("What does not pass", (Items(tuple(said)),))] if said else []


def _amount(row: Row) -> str:
    """In how many scenes which quantities differ."""
    return f"scenes out of tolerance in {row['differing']}; the first: " if row["differing"] else ""


def _cases(found: pd.DataFrame) -> list[Block]:
    """A row for each case that is not the same everywhere; engines of which nothing works are named once."""
    lost = {(package, row[package]) for row in rows(found) for package in ENGINES if _broken(row, package)}
    blocks: list[Block] = [Items(tuple(f"{name} {version}: no case runs at all." for name, version in sorted(lost)))]
    lines = []
    for name, case in CASES.items():
        packages = [package for package, engine in ENGINES.items() if engine in case.engines]
        by: dict[str, set[str]] = {}
        for row in rows(found):
            status = next((said for column, said in STATUS.items() if name in row[column].split()), None)
            if status and not lost & {(package, row[package]) for package in packages}:
                by.setdefault(" / ".join(row[package] for package in packages), set()).add(status)
        if len(set().union(*by.values())) > 1:
            said = (f"{version}: {' or '.join(sorted(by[version]))}" for version in sorted(by))
            lines.append((name, " / ".join(packages), "; ".join(said), case.title))
    table = Table(("case", "of", "version: what it does", "what users see"), tuple(lines))
    return [*(blocks if lost else []), table if lines else Paragraph("None.")]


def _broken(row: Row, package: str) -> bool:
    """Whether every case of one engine alone has failed, because it cannot even be imported."""
    own = {name for name, case in CASES.items() if case.engines == (ENGINES[package],)}
    failed, others = {*row["failed"].split()} & own, {*row["shown"].split(), *row["not_shown"].split()} & own
    return bool(failed) and not others
