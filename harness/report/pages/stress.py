"""The report of the stress cases: what broke first, then every ladder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from screwgauge.quantities import digits
from screwgauge.report.blocks import (
    LONG,
    Banner,
    Block,
    Column,
    Folded,
    Heading,
    Items,
    Numbers,
    Paragraph,
    Picture,
    Table,
    cross_table,
    prose,
    section,
    table,
)
from screwgauge.report.formatting import digits_text, listed, number, size, words
from screwgauge.report.pages.sections import facts, judged
from screwgauge.report.write import write_report
from screwgauge.study.stress.case import DEGRADED, REFUSED, SILENT, VERDICTS, Case
from screwgauge.study.stress.run import Row, Stress

if TYPE_CHECKING:
    from screwgauge.report.plots import Plot

READ = """\
Every case is a ladder of one severity. **Digits** are those of the scaled error against the truth (or of the largest
residual of the judge where no truth can be had). **ok**: nine digits or more. **degraded**: fewer, and the engine or
its error estimate says so. **refused**: no number, but a reason. **silently-wrong**: an error larger than any warning
admits, or a number that is none without a word."""

_BAD = (DEGRADED, REFUSED, SILENT)
_SHORT = {DEGRADED: " (degraded)", SILENT: " **silently wrong**"}
Group = tuple[Any, list[Row]]


def _groups(rows: Iterable[Row], key: Callable[[Row], Any]) -> list[Group]:
    """Rows that share a key, in order of appearance."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return list(groups.items())


def report(found: Stress, plots: Sequence[Plot]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    return [
        Heading("Stiff and extreme: where it breaks, and whether it says so", 1),
        Banner(headline(found), status="agree" if found.ok else "differ"),
        *(*prose(READ), *map(Picture, plots)),
        *section("Where it breaks", _overview(found)),
        *section("Silently wrong", _silent(found.rows)),
        *(block for case in found.cases for block in _case(case, [row for row in found.rows if row.case == case.name])),
        *section("Environment", facts({**dict(judged(found.provenance)), **found.environment})),
    ]


def write(found: Stress, out: Path) -> Path:
    """Writes report, page of small plots, table and environment.

    Raises:
        OutputError: The folder cannot be written.
    """
    from screwgauge.report.stress.drawing import make_plots

    data = {"stress.csv": found.table, "environment.json": found.environment}
    return write_report(out, report(found, make_plots(found)), data, figures=6)


def headline(found: Stress) -> str:
    """Counts by verdict, and who was silently wrong, in a few sentences."""
    counts = {verdict: sum(row.finding.verdict == verdict for row in found.rows) for verdict in VERDICTS}
    guilty = dict.fromkeys(row.finding.engine.split()[0] for row in found.rows if row.finding.verdict == SILENT)
    parts = [
        f"{len(found.cases)} cases, {len(found.rows)} rows: {listed(f'{n} {v}' for v, n in counts.items() if n)}.",
        f"Silently wrong: {listed(guilty)}." if guilty else "Nothing is wrong without saying so.",
        "Our own solver is nowhere among them." if guilty and found.ok else "",
    ]
    return " ".join(part for part in parts if part)


def _by_engine(found: Stress) -> list[tuple[Case, str, list[Row]]]:
    groups = dict(_groups(found.rows, lambda row: (row.case, row.finding.engine)))
    return [
        (case, engine, rows) for case in found.cases for (name, engine), rows in groups.items() if name == case.name
    ]


def _overview(found: Stress) -> Table:
    """For each case and engine: digits, and the first rung at which a quantity is not ok."""

    def first(verdict: str) -> Callable[[tuple[Case, str, list[Row]]], str]:
        def text(group: tuple[Case, str, list[Row]]) -> str:
            severities = [row.severity for row in group[2] if row.finding.verdict == verdict]
            return number((max if group[0].falling else min)(severities), 3) if severities else ""

        return text

    columns = (Numbers(f"{verdict.replace('-', ' ')} from", first(verdict)) for verdict in _BAD)
    return table(_by_engine(found), (*WHO, *columns))


def terminal(found: Stress) -> list[Block]:
    """What ``screwgauge stress`` prints: for each case and engine digits, and how many rows were what."""

    def count(verdict: str) -> Callable[[tuple[Case, str, list[Row]]], str]:
        return lambda group: str(sum(row.finding.verdict == verdict for row in group[2]) or "")

    columns = (Numbers(verdict.replace("-", " "), count(verdict)) for verdict in _BAD)
    return [Paragraph(headline(found)), table(_by_engine(found), (*WHO, *columns))]


def _span(rows: Sequence[Row]) -> str:
    """Fewest and most digits."""
    kept = [digits(row.finding.error) for row in rows if np.isfinite(row.finding.error)]
    return f"{min(kept):.1f} to {max(kept):.1f}" if kept else ""


WHO = (
    *(Column("case", lambda group: group[0].name), Column("engine", lambda group: group[1])),
    Numbers("digits", lambda group: _span(group[2])),
)
SILENTLY = (
    *(Column("case", lambda group: group[0][0]), Column("engine", lambda group: group[0][1])),
    Column("quantities", lambda group: ", ".join(dict.fromkeys(words(row.finding.quantity) for row in group[1]))),
    Column("severity", lambda group: _range(group[1])),
    Numbers("largest error", lambda group: size(np.max([row.finding.error for row in group[1]]))),
    Column("cause", lambda group: group[0][2]),
)


def _silent(rows: Sequence[Row]) -> Block:
    """Each engine of a case once for every cause."""
    silent = (row for row in rows if row.finding.verdict == SILENT)
    groups = _groups(silent, lambda row: (row.case, row.finding.engine, row.finding.told))
    return table(groups, SILENTLY) if groups else Paragraph("Nothing.")


def _range(rows: Sequence[Row]) -> str:
    ends = dict.fromkeys(number(end(row.severity for row in rows), 3) for end in (min, max))
    return " to ".join(ends)


def _case(case: Case, rows: Sequence[Row]) -> list[Block]:
    """Heading, words, and for each quantity a table: a line for each severity, a column for each engine."""
    blocks: list[Block] = [Heading(f"{case.name}: {case.title}"), *prose(case.about)]
    for quantity, some in _groups(rows, lambda row: row.finding.quantity):
        ladder = sorted(some, key=lambda row: row.severity, reverse=case.falling)
        severity = Numbers(case.axis, "severity", lambda value: number(value, 3))
        engines = dict.fromkeys(row.finding.engine for row in some)
        shown = cross_table(ladder, [severity], "finding.engine", _digits, engines)
        short = quantity == case.drawn or len(some) <= LONG
        blocks += [Paragraph(f"**{quantity}**"), shown] if short else [Folded(quantity, (shown,))]
    refused = (row for row in rows if row.finding.verdict == REFUSED)
    reasons = _groups(refused, lambda row: (row.finding.engine, row.finding.reason))
    items = tuple(f"{engine} at {_range(group)}: {reason}" for (engine, reason), group in reasons)
    return [*blocks, Paragraph("Refused:"), Items(items)] if items else blocks


def _digits(row: Row) -> str:
    if row.finding.verdict == REFUSED:
        return "refused"
    return digits_text(row.finding.error) + _SHORT.get(row.finding.verdict, "")
