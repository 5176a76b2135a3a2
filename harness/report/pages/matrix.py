"""The report of ``screwgauge matrix``: which versions agree."""

from __future__ import annotations

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Folded, Items
from screwgauge.report.layout import Report
from screwgauge.study.formatting import listed, rows
from screwgauge.study.matrix import COLUMNS

PACKAGES = "pin", "mujoco"


def _banner(table: pd.DataFrame) -> Banner:
    bad = ["pin {pin} with mujoco {mujoco}".format(**row) for row in rows(table) if row["status"] != "agree"]
    count, lost = f"{len(table) - len(bad)} of {len(table)}", f" Not on {listed(bad)}." * bool(bad)
    text = f"On {count} pairs of versions all built-in scenes pass.{lost}"
    return Banner.of(text, not bad)


def _reasons(table: pd.DataFrame) -> list[Block]:
    """What does not pass, in how many scenes which quantities differ."""
    where, amount = "pin {pin} with mujoco {mujoco}: ", "scenes out of tolerance in {differing}; the first: "
    bad = [row for row in rows(table) if row["reason"]]
    reasons = tuple((where + amount * bool(row["differing"]) + "{reason}").format(**row) for row in bad)
    return [Folded("What does not pass", (Items(reasons),))] if reasons else []


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
