"""The report of ``screwgauge history``: errors and run times of scenes over versions, machines and models."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Heading, table
from screwgauge.report.figures.history import make_plots
from screwgauge.report.formatting import Row, digits_text, grouped, rows
from screwgauge.report.layout import study
from screwgauge.study.gate.items import EXIT

PASSED = [status for status, ends in EXIT.items() if not ends]


def _scenes(checks: pd.DataFrame) -> Iterator[Block]:
    """A table for each scene."""
    columns = "date | check = status | worst | scaled = error | digits | time = seconds:time_s | new"
    for (name,), of in grouped(rows(checks), "scene").items():
        yield from (Heading(str(name), 3), table(_lines(of), columns))


def _lines(checks: list[Row]) -> Iterator[Row]:
    """A line for each check; versions and models only where they are others than before."""
    before: Mapping[str, Any] = {"versions": "{}", "files": "{}", "cpu": ""}
    for row in checks:
        changes = [f"{engine} {value}" for engine, value in _new(row, before, "versions").items()]
        changes += [f"model of {engine}" for engine in _new(row, before, "files")] if before["cpu"] else []
        changes += [row["cpu"]] if row["cpu"] != before["cpu"] else []
        yield {**row, "digits": digits_text(row["error"]), "new": ", ".join(changes)}
        before = row


def _new(row: Mapping[str, Any], before: Mapping[str, Any], key: str) -> dict[str, str]:
    now, then = json.loads(row[key]), json.loads(before[key])
    return {name: value for name, value in now.items() if then.get(name) != value}


def _banner(checks: pd.DataFrame) -> Banner:
    last = checks.drop_duplicates("scene", keep="last")
    good, bad = int(last["status"].isin(PASSED).sum()), [str(x) for x in last[~last["status"].isin(PASSED)]["scene"]]
    lost = f" Not: {', '.join(bad)}." if bad else ""
    text = f"{len(checks)} checks of {len(last)} scenes were kept; {good} passed when last checked.{lost}"
    return Banner.of(text, not bad)


PAGE = study("history.csv", "History", _banner, draw=make_plots, scenes=lambda checks: [*_scenes(checks)])
