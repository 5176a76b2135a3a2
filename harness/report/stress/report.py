"""The report of the stress cases in Markdown: what broke first, then every ladder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from screwgauge.report.formatting import cell, digits, listed, markdown_table, number, size
from screwgauge.report.plots import Plot
from screwgauge.report.sections import facts, folded
from screwgauge.study.stress.case import DEGRADED, REFUSED, SILENT, VERDICTS, Case
from screwgauge.study.stress.run import Row, Stress

READ = """\
Every case is a ladder of one severity. **Digits** are those of the scaled error against the truth (or of the largest
residual of the judge where no truth can be had). **ok**: nine digits or more. **degraded**: fewer, and the engine or
the guard says so. **refused**: no number, but a reason. **silently-wrong**: an error larger than any warning admits,
or a number that is none without a word."""

_BAD = (DEGRADED, REFUSED, SILENT)
_SHORT = {DEGRADED: " (degraded)", SILENT: " **silently wrong**"}


def report_markdown(found: Stress, plots: Sequence[Plot]) -> str:
    """The text of ``report.md``; plots are linked as ``plots/NAME.svg``."""
    parts = [
        "# Stiff and extreme: where it breaks, and whether it says so",
        f"> {cell(headline(found))}",
        READ,
        *(f"![{cell(plot.title)}](plots/{plot.name}.svg)" for plot in plots),
        "## Where it breaks",
        _overview(found),
        "## Silently wrong",
        _silent(found),
        *(text for case in found.cases for text in _case(found, case)),
        "## Environment",
        facts(found.environment, "Not recorded."),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def headline(found: Stress) -> str:
    """Counts by verdict, and who was silently wrong, in a few sentences."""
    counts = {verdict: sum(r.finding.verdict == verdict for r in found.rows) for verdict in VERDICTS}
    parts = [f"{len(found.cases)} cases, {len(found.rows)} rows: {_counted(counts)}."]
    guilty = dict.fromkeys(r.finding.engine.split()[0] for r in found.rows if r.finding.verdict == SILENT)
    own = [name for name in guilty if name.startswith("screw")]
    parts.append(f"Silently wrong: {listed(guilty)}." if guilty else "Nothing is wrong without saying so.")
    if guilty and not own:
        parts.append("Our own solver is nowhere among them.")
    return " ".join(parts)


def _counted(counts: dict[str, int]) -> str:
    return listed(f"{n} {verdict}" for verdict, n in counts.items() if n)


def _overview(found: Stress) -> str:
    """For each case and engine: digits, and the first rung at which a quantity is not ok."""
    body = []
    for case in found.cases:
        rows = [row for row in found.rows if row.case == case.name]
        for engine in dict.fromkeys(row.finding.engine for row in rows):
            here = [row for row in rows if row.finding.engine == engine]
            body.append([case.name, engine, _span(here), *(_first(case, here, v) for v in _BAD)])
    head = ["case", "engine", "digits", "degraded from", "refused from", "silently wrong from"]
    return markdown_table(head, body, range(2, len(head)))


def _span(rows: Sequence[Row]) -> str:
    kept = [digits(row.finding.error) for row in rows if np.isfinite(row.finding.error)]
    return f"{min(kept):.1f} to {max(kept):.1f}" if kept else ""


def _first(case: Case, rows: Sequence[Row], verdict: str) -> str:
    severities = [row.severity for row in rows if row.finding.verdict == verdict]
    if not severities:
        return ""
    return number(max(severities) if case.falling else min(severities), 3)


def _silent(found: Stress) -> str:
    """Each engine of a case once for every cause."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in found.rows:
        if row.finding.verdict == SILENT:
            groups.setdefault((row.case, row.finding.engine, row.finding.told), []).append(row)
    if not groups:
        return "Nothing."
    body = [
        [case, engine, _quantities(rows), _range(rows), _worst(rows), cause]
        for (case, engine, cause), rows in groups.items()
    ]
    return markdown_table(["case", "engine", "quantities", "severity", "largest error", "cause"], body, (4,))


def _quantities(rows: Sequence[Row]) -> str:
    return ", ".join(name.replace("_", " ") for name in dict.fromkeys(row.finding.quantity for row in rows))


def _range(rows: Sequence[Row]) -> str:
    low, high = min(r.severity for r in rows), max(r.severity for r in rows)
    return number(low, 3) if low == high else f"{number(low, 3)} to {number(high, 3)}"


def _worst(rows: Sequence[Row]) -> str:
    errors = [row.finding.error for row in rows]
    return size(max(errors)) if np.isfinite(errors).all() else "NaN"


def _case(found: Stress, case: Case) -> list[str]:
    """Heading, words, and for each quantity a table: a line for each severity, a column for each engine."""
    rows = [row for row in found.rows if row.case == case.name]
    parts = [f"## {case.name}: {cell(case.title)}", case.about]
    for quantity in dict.fromkeys(row.finding.quantity for row in rows):
        here = [row for row in rows if row.finding.quantity == quantity]
        table = _ladder(case, here)
        parts.append(f"**{quantity}**\n\n{table}" if quantity == case.drawn else folded(quantity, table, len(here)))
    reasons = _reasons(rows)
    return [*parts, reasons] if reasons else parts


def _ladder(case: Case, rows: Sequence[Row]) -> str:
    engines = list(dict.fromkeys(row.finding.engine for row in rows))
    severities = sorted({row.severity for row in rows}, reverse=case.falling)
    found = {(row.severity, row.finding.engine): row for row in rows}
    body = [
        [number(severity, 3), *(_digits(found.get((severity, engine))) for engine in engines)]
        for severity in severities
    ]
    return markdown_table([case.axis, *engines], body, range(len(engines) + 1))


def _digits(row: Row | None) -> str:
    if row is None:
        return ""
    if row.finding.verdict == REFUSED:
        return "refused"
    value = digits(row.finding.error)
    return ("NaN" if np.isnan(value) else f"{value:.1f}") + _SHORT.get(row.finding.verdict, "")


def _reasons(rows: Sequence[Row]) -> str:
    """Why rows were refused, each reason once."""
    reasons: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.finding.verdict == REFUSED:
            reasons.setdefault((row.finding.engine, row.finding.reason), []).append(row)
    lines = [f"- {engine} at {_range(group)}: {cell(reason)}" for (engine, reason), group in reasons.items()]
    return "Refused:\n\n" + "\n".join(lines) if lines else ""
