"""The report of ``screwgauge matrix``: which versions agree, and which discrepancies depend on the version."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from screwgauge.casebook.book import CASES
from screwgauge.report.blocks import Banner, Block, Folded, Items
from screwgauge.report.formatting import Row, listed, rows
from screwgauge.report.layout import study
from screwgauge.study.matrix import COLUMNS

ENGINES = {"pin": "pinocchio", "mujoco": "mujoco"}
#: Column -> what became of a case.
STATUS = {"shown": "shown", "not_shown": "-", "failed": "failed"}


def _banner(table: pd.DataFrame) -> Banner:
    bad = ["pin {pin} with mujoco {mujoco}".format(**row) for row in rows(table) if row["status"] != "agree"]
    count, lost = f"{len(table) - len(bad)} of {len(table)}", f" Not on {listed(bad)}." * bool(bad)
    text = f"On {count} pairs of versions all built-in scenes pass.{lost}"
    return Banner.of(text, not bad)


def _pairs(table: pd.DataFrame) -> list[Row]:
    return [{**row, **{name: len(row[name].split()) for name in STATUS}} for row in rows(table)]


def _reasons(table: pd.DataFrame) -> list[Block]:
    """What does not pass, in how many scenes which quantities differ."""
    where, amount = "pin {pin} with mujoco {mujoco}: ", "scenes out of tolerance in {differing}; the first: "
    bad = [row for row in rows(table) if row["reason"]]
    reasons = tuple((where + amount * bool(row["differing"]) + "{reason}").format(**row) for row in bad)
    return [Folded("What does not pass", (Items(reasons),))] if reasons else []


def _lost(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Versions of which nothing works, because they cannot even be imported: every case of one alone has failed."""

    def broken(row: Row, package: str) -> bool:
        own = {name for name, case in CASES.items() if case.engines == (ENGINES[package],)}
        failed, others = {*row["failed"].split()} & own, {*row["shown"].split(), *row["not_shown"].split()} & own
        return bool(failed) and not others

    return sorted({(package, row[package]) for row in rows(table) for package in ENGINES if broken(row, package)})


def _cases(table: pd.DataFrame) -> Iterator[Row]:
    """A row for each case that is not the same everywhere."""
    lost = {*_lost(table)}
    for name, case in CASES.items():
        packages = [package for package, engine in ENGINES.items() if engine in case.engines]
        by: dict[str, set[str]] = {}
        for row in rows(table):
            status = next((word for column, word in STATUS.items() if name in row[column].split()), None)
            if status and not lost & {(package, row[package]) for package in packages}:
                by.setdefault(" / ".join(row[package] for package in packages), set()).add(status)
        if len(set().union(*by.values())) > 1:
            by_version = "; ".join(f"{version}: {' or '.join(sorted(by[version]))}" for version in sorted(by))
            yield {"case": name, "of": " / ".join(packages), "versions": by_version, "title": case.title}


PAGE = study(
    "matrix.csv",
    "Versions of Pinocchio and MuJoCo",
    _banner,
    COLUMNS,
    about=lambda table: {name: ", ".join(dict.fromkeys(table[name])) for name in ENGINES},
    pairs=_pairs,
    reasons=_reasons,
    lost=lambda table: [f"{name} {version}: no case runs at all." for name, version in _lost(table)],
    cases=lambda table: [*_cases(table)],
)
