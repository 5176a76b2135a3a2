"""The report of the stress cases: where each engine breaks and whether it says so, then every ladder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Marked, Paragraph, Picture, Table, facts
from screwgauge.report.formatting import Row, digits_text, grouped, listed, number, rows, size, span, words
from screwgauge.report.layout import laid_out
from screwgauge.report.pages.sections import judged, short
from screwgauge.report.write import write_report
from screwgauge.study.cases.case import DEGRADED, OK, REFUSED, SILENT, VERDICTS, Case
from screwgauge.study.stress import Stress

BAD = (DEGRADED, REFUSED, SILENT)
DATA = ("stress.csv", "environment.json")
WHO = ("case", "engine", "digits")
SHORT = {DEGRADED: " (degraded)", SILENT: " **silently wrong**"}
WORST = ("engine", "nine digits in all of", "says that it keeps fewer, or refuses, in", "silently wrong in")


def report(found: Stress, pictures: Iterable[Picture]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    told, section, drawn = _rows(found), partial(blocks.section, "stress"), list(pictures)
    engines = {k: v for k, v in found.environment.get("packages", {}).items() if k in PACKAGES}
    by_case, silent = grouped(told, "case"), [row for row in told if row["verdict"] == SILENT]
    return laid_out(
        "Stiff and extreme: where it breaks, and whether it says so",
        [_banner(found)],
        [*section("How to read it", *drawn), *section("Silently wrong", _silent(silent))],
        [
            *section("Where it breaks", _overview(found.cases, told)),
            *(block for case in found.cases for block in _case(case, by_case.get((case.name,), []))),
            *section("Environment", facts({**judged(found.provenance), **found.environment})),
        ],
        first=[_worst(found), facts({**short(judged(found.provenance)), **engines})],
    )


PACKAGES = ("pin", "mujoco", "screwgauge")


def write(found: Stress, out: Path) -> Path:
    """Writes report, page of small plots, table and environment."""
    from screwgauge.report.figures.stress import make_plots

    data = dict(zip(DATA, (found.table, found.environment), strict=True))
    return write_report(out, lambda: report(found, make_plots(found)), data, figures=6)


def _rows(found: Stress) -> list[Row]:
    return rows(found.table.assign(error=[row.error for row in found.rows]))


def _by_worst(found: Stress) -> dict[str, dict[str, list[str]]]:
    """Engine without its settings -> worst verdict -> cases."""
    told: dict[str, dict[str, list[str]]] = {}
    for (case, engine), group in grouped(_named(found), "case", "who").items():
        worst = max((row["verdict"] for row in group), key=VERDICTS.index)
        told.setdefault(engine, {}).setdefault(worst, []).append(case)
    return told


def _named(found: Stress) -> list[Row]:
    return [{**row, "who": row["engine"].split()[0]} for row in _rows(found)]


def _worst(found: Stress) -> Table:
    """For each engine in how many cases it keeps its digits, says that it does not, or is wrong in silence."""
    lines = []
    for engine, by in _by_worst(found).items():
        counts = len(by.get(OK, [])), len(by.get(DEGRADED, [])) + len(by.get(REFUSED, [])), len(by.get(SILENT, []))
        lines.append((engine, *(f"{n} of {sum(counts)} cases" if n else "none" for n in counts)))
    return Table(WORST, tuple(lines))


def _banner(found: Stress) -> Banner:
    """Orange where anything is wrong without saying so, red where that is our own solver."""
    silent = any(row.verdict == SILENT for row in found.rows)
    if not found.ok:
        return Banner(headline(found), "✗ OUR SOLVER IS SILENTLY WRONG", "failed")
    return Banner(headline(found), *(("✗ SILENTLY WRONG", "differ") if silent else ("✓ ALL SAY SO", "agree")))


def headline(found: Stress) -> str:
    """Who gives wrong numbers without a word and from where on, what our own solver does, and counts."""
    first, parts = {case.name: max if case.falling else min for case in found.cases}, list[str]()
    axes, own = {case.name: case.axis for case in found.cases}, {row.engine.split()[0] for row in found.rows if row.own}
    asked = grouped(_named(found), "who")
    bad = grouped([row for row in _named(found) if row["verdict"] == SILENT], "who")
    for (engine,), group in bad.items():
        cases = grouped(group, "case")
        (case,), some = max(cases.items(), key=lambda item: np.nanmax([row["error"] for row in item[1]] + [-1.0]))
        at = number(first[case](row["severity"] for row in some), 3)
        where = f"worst in {case}, from {axes[case]} = {at} on"
        parts.append(f"{engine} in {len(cases)} of {len(grouped(asked[engine,], 'case'))} cases ({where})")
    told = [f"Made extreme, these give wrong numbers without a word: {'; '.join(parts)}."] if parts else []
    if not parts:
        told = ["Made extreme, no engine gives a wrong number without saying so."]
    elif found.ok and own:
        told.append(f"Our own solver ({listed(sorted(own))}) never does: it keeps its digits, warns or refuses.")
    verdicts = [row.verdict for row in found.rows]
    counts = listed(f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in verdicts)
    return " ".join([*told, f"Of {len(found.rows)} rows {counts}."])


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
        kept = [row["digits"] for row in group if np.isfinite(row["digits"])]
        digits = span(f"{min(kept):.1f}", f"{max(kept):.1f}") if kept else ""
        lines.append((case, engine, digits, *(cell(case, bad) if bad else "" for bad in by_verdict)))
    return Table((*WHO, f"degraded{word}", f"refused{word}", f"silently wrong{word}"), tuple(lines))


def _silent(silent: Sequence[Row]) -> Block:
    """Each engine of a case once for every cause."""
    lines = []
    for (case, engine, cause), group in grouped(silent, "case", "engine", "reason").items():
        quantities = ", ".join(dict.fromkeys(words(row["quantity"]) for row in group))
        lines.append((case, engine, quantities, _range(group), size(np.max([row["error"] for row in group])), cause))
    head = ("case", "engine", "quantities", "severity", "largest error, scaled", "cause")
    return blocks.folded(f"All {len(lines)}", Table(head, tuple(lines))) if lines else Paragraph("Nothing.")


def _range(group: Sequence[Row]) -> str:
    low, high = (number(end(row["severity"] for row in group), 3) for end in (min, max))
    return span(low, high)


def _case(case: Case, found: Sequence[Row]) -> list[Block]:
    """Heading, words, and for each quantity a table: a line for each severity, a column for each engine."""
    told: list[Block] = [Heading(f"{case.name}: {case.title}"), Paragraph(Marked(case.about))]
    for (quantity,), some in grouped(found, "quantity").items():
        ladder = sorted(some, key=lambda row: float(row["severity"]), reverse=case.falling)
        cells = [{**row, "cell": _digits(row)} for row in ladder]
        across = blocks.cross_table(cells, f"{case.axis} = severity", "engine", "cell")
        short = quantity == case.drawn or len(some) <= blocks.LONG
        told += [Paragraph(Marked(f"**{quantity}**")), across] if short else [Folded(quantity, (across,))]
    refused = grouped([row for row in found if row["verdict"] == REFUSED], "engine", "reason")
    reasons = tuple(f"{engine} at {_range(group)}: {reason}" for (engine, reason), group in refused.items())
    return [*told, Paragraph("Refused:"), Items(reasons)] if reasons else told


def _digits(row: Row) -> str:
    if row["verdict"] == REFUSED:
        return "refused"
    return Marked(digits_text(row["error"]) + SHORT.get(row["verdict"], ""))
