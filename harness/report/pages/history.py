"""The report of ``screwgauge history``: errors and run times of scenes over versions, machines and models."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Heading, Paragraph, folded, table
from screwgauge.report.formatting import Row, digits_text, grouped, rows
from screwgauge.report.study import Study

COLUMNS = "date | = status | worst | scaled = error | digits | time = time_s | new"


def _terminal(found: pd.DataFrame) -> list[Block]:
    """A table for each scene."""
    told: list[Block] = []
    for (name,), of in grouped(rows(found), "scene").items():
        told += [Heading(str(name)), folded(f"All {len(of)} checks", table(_lines(of), COLUMNS))]
    return told or [Paragraph("Nothing was kept.")]


def _lines(found: list[Row]) -> list[Row]:
    """A line for each check; versions and models only where they are others than before."""
    lines, before = [], {"versions": "{}", "files": "{}", "cpu": ""}
    for row in found:
        said = [f"{engine} {value}" for engine, value in _new(row, before, "versions").items()]
        said += [f"model of {engine}" for engine in _new(row, before, "files")] if before["cpu"] else []
        said += [row["cpu"]] if row["cpu"] != before["cpu"] else []
        digits = digits_text(row["error"])
        lines.append({**row, "digits": digits, "time_s": row["seconds"], "new": ", ".join(said)})
        before = row
    return lines


def _new(row: Mapping[str, Any], before: Mapping[str, Any], key: str) -> dict[str, str]:
    now, then = json.loads(row[key]), json.loads(before[key])
    return {name: value for name, value in now.items() if then.get(name) != value}


def _banner(found: pd.DataFrame) -> Banner:
    last = found.drop_duplicates("scene", keep="last")
    good, bad = int((last["status"] == "agree").sum()), [str(x) for x in last[last["status"] != "agree"]["scene"]]
    lost = f" Not: {', '.join(bad)}." if bad else ""
    text = f"{len(found)} checks of {len(last)} scenes were kept; {good} agreed when last checked.{lost}"
    return Banner(text, *(("✗ NOT ALL AGREE", "differ") if bad else ("✓ AGREE", "agree")))


def _body(found: pd.DataFrame) -> list[Block]:
    from screwgauge.report.figures.history import make_plots

    return [*make_plots(found), *_terminal(found)]


PAGE = Study("history.csv", "History", _banner, _body, _terminal)
