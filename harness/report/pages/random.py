"""The report of ``screwgauge bench --random``: many random mechanisms, by family, by size and by reason."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Block, Heading, Marked, Paragraph, Table, facts
from screwgauge.report.formatting import grouped, rows
from screwgauge.report.write import write_table
from screwgauge.study.campaign import CERTIFIED, ENGINES

NAME = "random.csv"
DATA = (NAME, "environment.json")
VERDICTS = ("agree", "estimated", "judged", "differ", "failed", "refused")
MEANING = """**agree**: all engines within tolerance; **estimated**: beyond it, but within the error that an engine
estimates; **judged**: pairs agree, a residual of the judge is out of tolerance; **differ**: out of tolerance;
**failed**: an engine gives no answer; **refused**: by all, before any ran. `screwgauge.random(seed, family)` is the
mechanism of a row of `random.csv`."""


def terminal(found: pd.DataFrame) -> list[Block]:
    """What is printed: verdicts by family, and reasons."""
    return [Paragraph(_sentence(found)), _families(found), *_reasons(found)]


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    return [
        Heading("Random mechanisms", 1),
        Paragraph(_sentence(found)),
        Paragraph(Marked(MEANING)),
        Heading("By family"),
        _families(found),
        Heading("Who did not agree, and why"),
        *(_reasons(found) or [Paragraph("All agreed.")]),
        Heading("Processor time"),
        Paragraph("Solving only, in s, all samples of a scene: the median over mechanisms with so many bodies."),
        _costs(found),
        Heading("Environment"),
        facts(record),
    ]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``random.csv``, the report and ``environment.json``."""
    return write_table(out, NAME, found, report)


def _sentence(found: pd.DataFrame) -> str:
    counts = Counter(found["verdict"])
    said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    asked, branches = [text for text in found["truth"] if text], Counter(found["branch"][found["branch"] != ""])
    return (
        f"{len(found)} random mechanisms of {found['family'].nunique()} families: {said}. "
        f"All engines were in the same assembly in {branches['same']} of {branches.total()}. "
        f"The truth certified {asked.count(CERTIFIED)} of {len(asked)}."
    )


def _families(found: pd.DataFrame) -> Table:
    verdicts, lines = [verdict for verdict in VERDICTS if (found["verdict"] == verdict).any()], []
    for (family,), group in grouped(rows(found), "family").items():
        counts, asked = Counter(row["verdict"] for row in group), [row["truth"] for row in group if row["truth"]]
        measured = [row for row in group if row["max_scaled"] != ""]
        worst = max(measured, key=lambda row: float(row["max_scaled"]) / float(row["tolerance"]), default={})
        error = (str(worst.get(key, "")) for key in ("max_scaled", "quantity", "seed"))
        counted = (str(counts[verdict]) for verdict in verdicts)
        lines.append((family, str(len(group)), *counted, f"{asked.count(CERTIFIED)}/{len(asked)}", *error))
    return Table(("family", "drawn", *verdicts, CERTIFIED, "worst error", "of", "seed"), tuple(lines))


def _reasons(found: pd.DataFrame) -> list[Block]:
    """Reasons without names and numbers, the most frequent first, each with one mechanism that has it."""
    told = [
        {"reason": plain(text), "first": f"{row['family']} {row['seed']}"}
        for row in rows(found)
        for text in (
            f"{row['verdict']}: {row['reason'] or row['judge']}" * (row["verdict"] not in VERDICTS[:2]),
            f"truth: {row['truth']}" * (row["truth"] not in ("", CERTIFIED)),
        )
        if text
    ]
    groups = sorted(grouped(told, "reason").items(), key=lambda item: (-len(item[1]), item[0]))
    lines = tuple((str(len(group)), reason, group[0]["first"]) for (reason,), group in groups)
    return [Table(("count", "reason", "first seen in"), lines)] if lines else []


def plain(reason: str) -> str:
    """A reason without what differs from one mechanism to the next: quoted names, numbers, lists of them."""
    text = re.sub(r"'[^']*'", "'...'", reason)
    text = re.sub(r"(\S+ = (\[[^]]*\]|[^\s,]+)(, (?=\S+ =))?)+", "...", text)
    return re.sub(r"(?<![\w-])-?\d[\d.]*(e-?\d+)?", "N", text)


def _costs(found: pd.DataFrame) -> Table:
    keys, lines = [*(f"{engine}_s" for engine in ENGINES), "cpu_s"], []
    for low, high in pairwise((1, 4, 7, 10, 13, 100)):
        group = [row for row in rows(found) if low <= row["bodies"] < high]
        times = ([float(row[key]) for row in group if row[key] != ""] for key in keys)
        lines.append((f"{low} to {high - 1}", *(f"{median(each):.3f}" if each else "" for each in times)))
    return Table(("bodies", *ENGINES, "all, with comparison"), tuple(lines))
