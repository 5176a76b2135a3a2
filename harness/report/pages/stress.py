"""The report of the stress cases: what broke first, then every ladder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Paragraph, Picture, Table, facts
from screwgauge.report.formatting import Row, digits_text, grouped, listed, number, rows, size, words
from screwgauge.report.pages.sections import judged
from screwgauge.report.write import write_report
from screwgauge.study.cases.case import DEGRADED, REFUSED, SILENT, VERDICTS, Case
from screwgauge.study.stress import Stress

BAD = (DEGRADED, REFUSED, SILENT)
WHO = ("case", "engine", "digits")
SHORT = {DEGRADED: " (degraded)", SILENT: " **silently wrong**"}


def report(found: Stress, pictures: Iterable[Picture]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    rows, section = _rows(found), partial(blocks.section, "stress")
    by_case = grouped(rows, "case")
    return [
        Heading("Stiff and extreme: where it breaks, and whether it says so", 1),
        Banner(headline(found), status="agree" if found.ok else "differ"),
        *section("How to read it", *pictures),
        *section("Where it breaks", _overview(found.cases, rows)),
        *section("Silently wrong", _silent([row for row in rows if row["verdict"] == SILENT])),
        *(block for case in found.cases for block in _case(case, by_case.get((case.name,), []))),
        *section("Environment", facts({**judged(found.provenance), **found.environment})),
    ]


def write(found: Stress, out: Path) -> Path:
    """Writes report, page of small plots, table and environment."""
    from screwgauge.report.figures.stress import make_plots

    data = {"stress.csv": found.table, "environment.json": found.environment}
    return write_report(out, report(found, make_plots(found)), data, figures=6)


def _rows(found: Stress) -> list[Row]:
    return rows(found.table.assign(error=[row.error for row in found.rows]))


def headline(found: Stress) -> str:
    """Counts by verdict, and who was silently wrong, in a few sentences."""
    verdicts = [row.verdict for row in found.rows]
    counts = listed(f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in verdicts)
    guilty = dict.fromkeys(row.engine.split()[0] for row in found.rows if row.verdict == SILENT)
    parts = [
        f"{len(found.cases)} cases, {len(found.rows)} rows: {counts}.",
        f"Silently wrong: {listed(guilty)}." if guilty else "Nothing is wrong without saying so.",
        *(["Our own solver is nowhere among them."] if guilty and found.ok else []),
    ]
    return " ".join(parts)


def _overview(cases: Sequence[Case], found: Sequence[Row]) -> Table:
    """For each case and engine: digits, and the first rung at which a quantity is not ok."""
    first = {case.name: max if case.falling else min for case in cases}
    return _by_engine(found, " from", lambda case, bad: number(first[case](row["severity"] for row in bad), 3))


def terminal(found: Stress) -> list[Block]:
    """What ``screwgauge stress`` prints: for each case and engine digits, and how many rows were what."""
    return [Paragraph(headline(found)), _by_engine(_rows(found), "", lambda case, bad: str(len(bad)))]


def _by_engine(found: Sequence[Row], word: str, cell: Callable[[str, list[Row]], str]) -> Table:
    """A line for each case and engine, a cell for each verdict but ok."""
    lines = []
    for (case, engine), group in grouped(found, "case", "engine").items():
        by_verdict = ([row for row in group if row["verdict"] == verdict] for verdict in BAD)
        lines.append((case, engine, _span(group), *(cell(case, bad) if bad else "" for bad in by_verdict)))
    return Table((*WHO, f"degraded{word}", f"refused{word}", f"silently wrong{word}"), tuple(lines))


def _span(group: Sequence[Row]) -> str:
    """Fewest and most digits."""
    kept = [row["digits"] for row in group if np.isfinite(row["digits"])]
    return f"{min(kept):.1f} to {max(kept):.1f}" if kept else ""


def _silent(silent: Sequence[Row]) -> Block:
    """Each engine of a case once for every cause."""
    lines = []
    for (case, engine, cause), group in grouped(silent, "case", "engine", "reason").items():
        quantities = ", ".join(dict.fromkeys(words(row["quantity"]) for row in group))
        lines.append((case, engine, quantities, _range(group), size(np.max([row["error"] for row in group])), cause))
    head = ("case", "engine", "quantities", "severity", "largest error", "cause")
    return Table(head, tuple(lines)) if lines else Paragraph("Nothing.")


def _range(group: Sequence[Row]) -> str:
    return " to ".join(dict.fromkeys(number(end(row["severity"] for row in group), 3) for end in (min, max)))


def _case(case: Case, found: Sequence[Row]) -> list[Block]:
    """Heading, words, and for each quantity a table: a line for each severity, a column for each engine."""
    told: list[Block] = [Heading(f"{case.name}: {case.title}"), Paragraph(case.about)]
    for (quantity,), some in grouped(found, "quantity").items():
        ladder = sorted(some, key=lambda row: float(row["severity"]), reverse=case.falling)
        cells = [{**row, "cell": _digits(row)} for row in ladder]
        across = blocks.cross_table(cells, f"{case.axis} = severity", "engine", "cell")
        short = quantity == case.drawn or len(some) <= blocks.LONG
        told += [Paragraph(f"**{quantity}**"), across] if short else [Folded(quantity, (across,))]
    refused = grouped([row for row in found if row["verdict"] == REFUSED], "engine", "reason")
    reasons = tuple(f"{engine} at {_range(group)}: {reason}" for (engine, reason), group in refused.items())
    return [*told, Paragraph("Refused:"), Items(reasons)] if reasons else told


def _digits(row: Row) -> str:
    return "refused" if row["verdict"] == REFUSED else digits_text(row["error"]) + SHORT.get(row["verdict"], "")
