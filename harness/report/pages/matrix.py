"""The report of ``screwgauge matrix``: which versions agree, and which discrepancies depend on the version."""

from __future__ import annotations

import pandas as pd

from screwgauge.casebook.book import CASES
from screwgauge.report.blocks import Banner, Block, Folded, Items, Paragraph, Table
from screwgauge.report.formatting import Row, listed, number, rows
from screwgauge.report.study import Study, said
from screwgauge.study.matrix import COLUMNS

NAME = "matrix.csv"
ENGINES = {"pin": "pinocchio", "mujoco": "mujoco"}
#: Column -> what became of a case.
STATUS = {"shown": "shown", "not_shown": "-", "failed": "failed"}


def terminal(found: pd.DataFrame) -> list[Block]:
    """What is printed: a row for each pair."""
    return [_pairs(found), *_reasons(found)]


def _banner(found: pd.DataFrame) -> Banner:
    good, bad = sum(found["status"] == "agree"), [f"pin {r['pin']}, mujoco {r['mujoco']}" for r in rows(found)]
    bad = [name for name, status in zip(bad, found["status"], strict=True) if status != "agree"]
    text = (
        f"On {good} of {len(found)} pairs of versions all built-in scenes pass.{f' Not on {listed(bad)}.' * bool(bad)}"
    )
    return Banner(text, *(("✗ NOT ALL AGREE", "differ") if bad else ("✓ AGREE", "agree")))


def _body(found: pd.DataFrame) -> list[Block]:
    depends = said("Discrepancies that depend on the version", *_cases(found))
    return [*said("Versions", _pairs(found), *_reasons(found)), *depends]


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
    said = [f"pin {row['pin']}, mujoco {row['mujoco']}: {row['reason']}" for row in rows(found) if row["reason"]]
    return [Folded("What does not pass", (Items(tuple(said)),))] if said else []


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


PAGE = Study(NAME, "Versions of Pinocchio and MuJoCo", _banner, _body, terminal, tuple(COLUMNS))
DATA, write = PAGE.DATA, PAGE.write
