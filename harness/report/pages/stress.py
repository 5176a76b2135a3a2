"""The report of the stress cases: where each engine breaks and whether it says so, then every ladder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Marked, Paragraph
from screwgauge.report.figures.stress import make_plots
from screwgauge.report.formatting import Row, digits_text, grouped, listed, number, rows, size, span, words
from screwgauge.report.layout import Report
from screwgauge.report.pages.scene import judged, short
from screwgauge.study.cases.question import DEGRADED, OK, REFUSED, SILENT, VERDICTS
from screwgauge.study.stress import Stress, StressCase

SHORT = {DEGRADED: " (degraded)", SILENT: " **silently wrong**"}
COLUMNS = {DEGRADED: "degraded", REFUSED: "refused", SILENT: "silent"}


def _rows(stress: Stress) -> list[Row]:
    table = rows(stress.table.assign(error=[row.error for row in stress.rows]))
    return [{**row, "who": row["engine"].split()[0]} for row in table]


def _silent_rows(stress: Stress) -> list[Row]:
    return [row for row in _rows(stress) if row["verdict"] == SILENT]


def _worst(stress: Stress) -> Iterator[Row]:
    """For each engine in how many cases it keeps its digits, says that it does not, or is wrong in silence."""
    for (engine,), group in grouped(_rows(stress), "who").items():
        cases = grouped(group, "case").values()
        worst = [max((row["verdict"] for row in case), key=VERDICTS.index) for case in cases]
        counts = {"kept": worst.count(OK), "silent": worst.count(SILENT)}
        counts["said"] = len(worst) - sum(counts.values())
        yield {"engine": engine, **{k: f"{n} of {len(worst)} cases" if n else "none" for k, n in counts.items()}}


def _banner(stress: Stress) -> Banner:
    """Orange where anything is wrong without saying so, red where that is our own solver."""
    if not stress.ok:
        return Banner(headline(stress), "✗ OUR SOLVER IS SILENTLY WRONG", "failed")
    silent = any(row.verdict == SILENT for row in stress.rows)
    return Banner.of(headline(stress), not silent, "ALL SAY SO", "SILENTLY WRONG")


def headline(stress: Stress) -> str:
    """Who gives wrong numbers without a word and from where on, what our own solver does, and counts."""
    known, parts = {case.name: case for case in stress.cases}, list[str]()
    by_engine, own = grouped(_rows(stress), "who"), {row.engine.split()[0] for row in stress.rows if row.own}
    for (engine,), group in grouped(_silent_rows(stress), "who").items():
        cases = grouped(group, "case")
        (case,), some = max(cases.items(), key=lambda item: np.nanmax([row["error"] for row in item[1]] + [-1.0]))
        where = f"worst in {case}, from {known[case].axis} = {_first(known[case], some)} on"
        parts.append(f"{engine} in {len(cases)} of {len(grouped(by_engine[engine,], 'case'))} cases ({where})")
    sentences = [f"Made extreme, these give wrong numbers without a word: {'; '.join(parts)}."] if parts else []
    if not parts:
        sentences = ["Made extreme, no engine gives a wrong number without saying so."]
    elif stress.ok and own:
        sentences.append(f"Our own solver ({listed(sorted(own))}) never does: it keeps its digits, warns or refuses.")
    verdicts = [row.verdict for row in stress.rows]
    counts = listed(f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in verdicts)
    return " ".join([*sentences, f"Of {len(stress.rows)} rows {counts}."])


def _first(case: StressCase, group: Sequence[Row]) -> str:
    """The first rung of some rows."""
    return number((max if case.falling else min)(row["severity"] for row in group), 3)


def _engines(stress: Stress) -> Iterator[Row]:
    """For each case and engine digits; of each verdict but ok the first rung, and how many rows there are."""
    known = {case.name: case for case in stress.cases}
    for (case, engine), group in grouped(_rows(stress), "case", "engine").items():
        kept = [row["digits"] for row in group if np.isfinite(row["digits"])]
        line = {"case": case, "engine": engine, "digits": span(f"{min(kept):.1f}", f"{max(kept):.1f}") if kept else ""}
        for verdict, name in COLUMNS.items():
            bad = [row for row in group if row["verdict"] == verdict]
            line |= {name: str(len(bad)) if bad else "", f"{name}_from": _first(known[case], bad) if bad else ""}
        yield line


def _silent(stress: Stress) -> Iterator[Row]:
    """Each engine of a case once for every cause."""
    for group in grouped(_silent_rows(stress), "case", "engine", "reason").values():
        quantities = ", ".join(dict.fromkeys(words(row["quantity"]) for row in group))
        largest = size(np.max([row["error"] for row in group]))
        yield {**group[0], "quantities": quantities, "range": _range(group), "largest": largest}


def _range(group: Sequence[Row]) -> str:
    low, high = (number(end(row["severity"] for row in group), 3) for end in (min, max))
    return span(low, high)


def _cases(stress: Stress) -> Iterator[Block]:
    """Heading, words, and for each quantity a table: a line for each severity, a column for each engine."""
    by_case = grouped(_rows(stress), "case")
    for case in stress.cases:
        rows = by_case.get((case.name,), [])
        yield from (Heading(f"{case.name}: {case.title}"), Paragraph(Marked(case.about)))
        for (quantity,), some in grouped(rows, "quantity").items():
            ladder = sorted(some, key=lambda row: float(row["severity"]), reverse=case.falling)
            cells = [{**row, "cell": _digits(row)} for row in ladder]
            across = blocks.table(cells, f"{case.axis} = severity || engine = cell")
            short = quantity == case.drawn or len(some) <= blocks.LONG
            yield from (Paragraph(Marked(f"**{quantity}**")), across) if short else (Folded(quantity, (across,)),)
        refused = grouped([row for row in rows if row["verdict"] == REFUSED], "engine", "reason")
        reasons = tuple(f"{engine} at {_range(group)}: {reason}" for (engine, reason), group in refused.items())
        yield from (Paragraph("Refused:"), Items(reasons)) if reasons else ()


def _digits(row: Row) -> str:
    if row["verdict"] == REFUSED:
        return "refused"
    return Marked(digits_text(row["error"]) + SHORT.get(row["verdict"], ""))


PAGE = Report(
    text="stress",
    banner=_banner,
    data={"stress.csv": lambda stress: stress.table},
    values={
        "title": lambda stress: "Stiff and extreme: where it breaks, and whether it says so",
        "headline": headline,
        "about": lambda stress: short(judged(stress.provenance)),
        "files": lambda stress: judged(stress.provenance),
        "worst": lambda stress: [*_worst(stress)],
        "engines": lambda stress: [*_engines(stress)],
        "silent": lambda stress: [*_silent(stress)],
        "cases": lambda stress: [*_cases(stress)],
    },
    draw=make_plots,
    plots=lambda stress, pictures: list(pictures),
    figures=6,
)
