"""The report of ``screwgauge matrix``: the versions that agree."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from screwgauge.report.blocks import Banner
from screwgauge.report.layout import Report
from screwgauge.study.formatting import Row, join_all, rows
from screwgauge.study.matrix import COLUMNS

PACKAGES = "pin", "mujoco"


def _banner(table: pd.DataFrame) -> Banner:
    bad = [row for row in rows(table) if row["status"] != "agree"]
    count, lost = f"{len(table) - len(bad)} of {len(table)}", f", but not on {_pairs(bad)}" * bool(bad)
    text = f"All built-in scenes pass on {count} pairs of versions{lost}."
    return Banner.of(text, not bad)


def _pairs(some: Iterable[Row]) -> str:
    """List version pairs, with the Pinocchio versions grouped by MuJoCo version."""
    grouped: dict[str, list[str]] = {}
    for row in some:
        grouped.setdefault(row["mujoco"], []).append(row["pin"])
    return join_all([f"pin {join_all(pins)} with mujoco {mujoco}" for mujoco, pins in grouped.items()])


def _reasons(table: pd.DataFrame) -> list[str]:
    """List reasons for failures, with the number of failing scenes; version pairs with the same reason share a line."""
    amount, grouped = "scenes out of tolerance, by quantity: {differing}; the first: ", dict[str, list[Row]]()
    for row in rows(table):
        if row["reason"]:
            grouped.setdefault((amount * bool(row["differing"]) + "{reason}").format(**row), []).append(row)
    return [f"{_pairs(some)}: {reason}" for reason, some in grouped.items()]


PAGE = Report(
    text="matrix",
    banner=_banner,
    data={"matrix.csv": lambda table: table[[*COLUMNS]]},
    values={
        "title": lambda table: "Versions of Pinocchio and MuJoCo",
        "about": lambda table: {name: ", ".join(dict.fromkeys(table[name])) for name in PACKAGES},
        "pairs": rows,
        "reasons": _reasons,
    },
)
