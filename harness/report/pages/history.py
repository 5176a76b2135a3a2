"""The report of ``screwgauge history``: errors and run times of scenes over versions, machines and models."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Heading, Picture, table
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Spec, numbered
from screwgauge.report.formatting import Row, digits_text, grouped, rows
from screwgauge.report.layout import study
from screwgauge.study.outcome import EXIT

PASSED = [status for status, ends in EXIT.items() if not ends]
MOST = 7  # scenes that are drawn; all are in the table


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


def make_plots(checks: pd.DataFrame) -> list[Picture]:
    """Digits of the worst error above, time below, over the number of the check."""
    scenes = [str(name) for name in checks["scene"].unique()]
    looks, panels = chart.ways("name", {name: numbered(i) for i, name in enumerate(scenes[:MOST])}), []
    table = checks.assign(name=checks["scene"].astype(str), x=checks.groupby("scene").cumcount() + 1)
    table = table[table["name"].isin(looks["name"])].astype({"digits": float, "seconds": float})
    across = {"x_title": "check", "x_scale": {}, "x_axis": {"tickMinStep": 1}, "height": 110}
    scales: tuple[Spec, Spec] = {"y_scale": {}, "y_axis": {}}, chart.logarithm("y", table["seconds"])
    for column, title, scale in zip(("digits", "seconds"), ("digits", "time [s]"), scales, strict=True):
        points = table.assign(y=table[column])[["name", "x", "y"]].to_dict("records")
        panels.append(chart.filled("points", points=points, y_title=title, **across, **scale, **looks))
    left = [f"{len(scenes) - MOST} other scenes are in the table."] if len(scenes) > MOST else []
    title = "Digits of the worst error, and run time, check after check"
    return [chart.picture("history", title, lambda moving: {"vconcat": panels}, left)]


PAGE = study("history.csv", "History", _banner, draw=make_plots, scenes=lambda checks: [*_scenes(checks)])
