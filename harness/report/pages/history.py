"""The report of ``screwgauge history``: errors and run times of scenes over versions, machines and models."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Block, Heading, Paragraph, Table, facts
from screwgauge.report.formatting import digits_text, duration, grouped, rows, size
from screwgauge.report.write import write_table

NAME = "history.csv"
DATA = (NAME, "environment.json")


def terminal(found: pd.DataFrame) -> list[Block]:
    """What is printed: a table for each scene."""
    return [block for name, of in grouped(rows(found), "scene").items() for block in _scene(name[0], of)]


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    from screwgauge.report.figures.history import make_plots

    return [Heading("History", 1), *terminal(found), *make_plots(found), Heading("Environment"), facts(record)]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``history.csv``, the report with its plots and ``environment.json``."""
    return write_table(out, NAME, found, report)


def _scene(name: str, found: list[dict[str, Any]]) -> list[Block]:
    """A line for each check; versions and models only where they are others than before."""
    lines, before = [], {"versions": "{}", "files": "{}", "cpu": ""}
    for row in found:
        said = [f"{engine} {value}" for engine, value in _new(row, before, "versions").items()]
        said += [f"model of {engine}" for engine in _new(row, before, "files")] if before["cpu"] else []
        said += [row["cpu"]] if row["cpu"] != before["cpu"] else []
        numbers = size(row["error"]), digits_text(row["error"]), duration(row["seconds"])
        lines.append((row["date"], row["status"], row["worst"], *numbers, ", ".join(said)))
        before = row
    head = ("date", "", "worst", "scaled", "digits", "time", "new")
    return [Heading(name), Table(head, tuple(lines))] if lines else [Paragraph("Nothing was kept.")]


def _new(row: Mapping[str, Any], before: Mapping[str, Any], key: str) -> dict[str, str]:
    now, then = json.loads(row[key]), json.loads(before[key])
    return {name: value for name, value in now.items() if then.get(name) != value}
