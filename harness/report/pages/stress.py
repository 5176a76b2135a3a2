"""The report of a stress run: severities at which engines break, with or without warning, then each series of cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from screwgauge.quantities import digits
from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Group, Items, Marked, Picture, Text
from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import Look, Spec, looks_by_camp
from screwgauge.report.layout import Report
from screwgauge.report.record import judged_files, shorten_hashes
from screwgauge.study.bench.question import DEGRADED, GOOD, OK, REFUSED, SILENT, VERDICTS, Finding
from screwgauge.study.bench.stress import Stress, StressCase
from screwgauge.study.formatting import Row, digits_text, group_rows, join_all, number, rows, size, span, words

SHORT = {DEGRADED: " (degraded)", SILENT: " **silently wrong**"}
COLUMNS = {DEGRADED: "degraded", REFUSED: "refused", SILENT: "silent"}
TITLE = "Digits kept as scenes become extreme"
NOTES = (
    "Severity grows to the right; the severity of a ratio grows to both sides.",
    "In the shaded part, below nine digits, a result needs a warning.",
    "Full: ok. Hollow: degraded, and says so. Cross below the axis: refused. Square in a red frame: silently wrong.",
)
WORST = ("Worst result of each engine in each case, over all settings, quantities and severities.",)
NO_NUMBER, APART = -0.9, 0.55  # position of the first line of crosses, distance of lines, one per colour


def _rows(stress: Stress) -> list[Row]:
    table = rows(stress.table.assign(error=[row.error for row in stress.rows]))
    return [{**row, "who": row["engine"].split()[0]} for row in table]


def _silent_rows(stress: Stress) -> list[Row]:
    return [row for row in _rows(stress) if row["verdict"] == SILENT]


def _worst(stress: Stress) -> Iterator[Row]:
    """Count the cases in which each engine keeps its digits, reports that it loses digits, or is silently wrong."""
    for (engine,), group in group_rows(_rows(stress), "who").items():
        cases = group_rows(group, "case").values()
        worst = [max((row["verdict"] for row in case), key=VERDICTS.index) for case in cases]
        counts = {"kept": worst.count(OK), "silent": worst.count(SILENT)}
        counts["reported"] = len(worst) - sum(counts.values())
        yield {"engine": engine, **{k: f"{n} of {len(worst)} cases" if n else "none" for k, n in counts.items()}}


def _banner(stress: Stress) -> Banner:
    """Return an orange banner if any engine is silently wrong, and a red one if our own solver is."""
    if not stress.ok:
        return Banner(headline(stress), "✗ OUR SOLVER IS SILENTLY WRONG", "failed")
    silent = any(row.verdict == SILENT for row in stress.rows)
    return Banner.of(headline(stress), not silent, "ALL SAY SO", "SILENTLY WRONG")


def headline(stress: Stress) -> str:
    """Name silently wrong engines with their first severity, state how our own solver does, and count the verdicts."""
    known, parts = {case.name: case for case in stress.cases}, list[str]()
    by_engine, own = group_rows(_rows(stress), "who"), {row.engine.split()[0] for row in stress.rows if row.own}
    for (engine,), group in group_rows(_silent_rows(stress), "who").items():
        cases = group_rows(group, "case")
        (case,), some = max(cases.items(), key=lambda item: np.nanmax([row["error"] for row in item[1]] + [-1.0]))
        where = f"worst in {case}, starting at {known[case].axis} = {_first(known[case], some)}"
        parts.append(f"{engine} in {len(cases)} of {len(group_rows(by_engine[engine,], 'case'))} cases ({where})")
    sentences = (
        [f"In extreme scenes these engines return wrong numbers without a warning: {'; '.join(parts)}."]
        if parts
        else []
    )
    if not parts:
        sentences = ["In extreme scenes no engine returns a wrong number without a warning."]
    elif stress.ok and own:
        sentences.append(f"Our own solver ({join_all(sorted(own))}) never does: it keeps its digits, warns or refuses.")
    verdicts = [row.verdict for row in stress.rows]
    counts = join_all(f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in verdicts)
    return " ".join([*sentences, f"Of {len(stress.rows)} rows {counts}."])


def _first(case: StressCase, group: Sequence[Row]) -> str:
    """Return the first severity, in order of difficulty, of a group of rows."""
    return number((max if case.falling else min)(row["severity"] for row in group), 3)


def _engines(stress: Stress) -> Iterator[Row]:
    """Yield digits for each case and engine, and the number of rows and first severity for each verdict but ok."""
    known = {case.name: case for case in stress.cases}
    for (case, engine), group in group_rows(_rows(stress), "case", "engine").items():
        kept = [row["digits"] for row in group if np.isfinite(row["digits"])]
        line = {"case": case, "engine": engine, "digits": span(f"{min(kept):.1f}", f"{max(kept):.1f}") if kept else ""}
        for verdict, name in COLUMNS.items():
            bad = [row for row in group if row["verdict"] == verdict]
            line |= {name: str(len(bad)) if bad else "", f"{name}_from": _first(known[case], bad) if bad else ""}
        yield line


def _silent(stress: Stress) -> Iterator[Row]:
    """Yield one row for each case, engine and cause of silently wrong results."""
    for group in group_rows(_silent_rows(stress), "case", "engine", "reason").values():
        quantities = ", ".join(dict.fromkeys(words(row["quantity"]) for row in group))
        largest = size(np.max([row["error"] for row in group]))
        yield {**group[0], "quantities": quantities, "range": _range(group), "largest": largest}


def _range(group: Sequence[Row]) -> str:
    low, high = (number(end(row["severity"] for row in group), 3) for end in (min, max))
    return span(low, high)


def _cases(stress: Stress) -> Iterator[Block]:
    """Yield heading, text, and a table for each quantity, with a line per severity and a column per engine."""
    by_case = group_rows(_rows(stress), "case")
    for case in stress.cases:
        rows = by_case.get((case.name,), [])
        yield from (Text(f"{case.name}: {case.title}", 2), Text(Marked(case.about)))
        for (quantity,), some in group_rows(rows, "quantity").items():
            ladder = sorted(some, key=lambda row: float(row["severity"]), reverse=case.falling)
            cells = [{**row, "cell": _digits(row)} for row in ladder]
            across = blocks.table(cells, f"{case.axis} = severity || engine = cell")
            short = quantity == case.drawn or len(some) <= blocks.LONG
            yield from (Text(Marked(f"**{quantity}**")), across) if short else (Group("folded", (across,), quantity),)
        refused = group_rows([row for row in rows if row["verdict"] == REFUSED], "engine", "reason")
        reasons = tuple(f"{engine} at {_range(group)}: {reason}" for (engine, reason), group in refused.items())
        yield from (Text("Refused:"), Items(reasons)) if reasons else ()


def _digits(row: Row) -> str:
    if row["verdict"] == REFUSED:
        return "refused"
    return Marked(digits_text(row["error"]) + SHORT.get(row["verdict"], ""))


def make_plots(stress: Stress) -> list[Picture]:
    """Draw the overview and the series of cases, unless there are no rows."""
    drawn = {
        case: [r for r in stress.rows if r.case == case.name and r.quantity in (case.drawn, "judge")]
        for case in stress.cases
    }
    looks = inks([[row.engine for row in rows] for rows in drawn.values()])
    panels = [_panel(case, rows, own) for (case, rows), own in zip(drawn.items(), looks, strict=True) if rows]
    resolve = {"scale": dict.fromkeys(("color", "stroke", "strokeDash", "fill", "shape"), "independent")}
    spec = {"concat": panels, "columns": 2, "resolve": resolve}
    if not panels:
        return []
    rows = [{"who": row.engine.split()[0], "case": row.case, "k": VERDICTS.index(row.verdict)} for row in stress.rows]
    worst = chart.fill_template("worst", rows=rows, engines=list(dict.fromkeys(row["who"] for row in rows)))
    return [
        chart.picture("01-worst", "Cases by outcome", lambda moving: worst, WORST),
        chart.picture("02-digits", TITLE, lambda moving: spec, NOTES),
    ]


def inks(plots: Sequence[Sequence[str]]) -> list[dict[str, Look]]:
    """Return the styles of engines in each plot; engines without settings look the same in all plots.

    Args:
        plots: Names of the engines in each plot; a setting may follow after a space.
    """
    common = looks_by_camp(name for names in plots for name in names if " " not in name)
    own = [looks_by_camp([n for n in names if n not in common], [n for n in names if n in common]) for names in plots]
    return [{n: (common | some)[n] for n in names} for names, some in zip(plots, own, strict=True)]


def _panel(case: StressCase, rows: Sequence[Finding], looks: dict[str, Look]) -> Spec:
    """Draw the panel of one case; `rows` contains only the quantity drawn."""
    severities = sorted({row.severity for row in rows})
    zero = next((severity for severity in severities if severity > 0.0), 1.0) / 10.0  # where severity 0 is drawn
    camps, points = list(dict.fromkeys(look.colour for look in looks.values())), list[Spec]()
    for row in sorted(rows, key=lambda row: row.severity):
        kept, look = digits(row.error), looks[row.engine]
        below = NO_NUMBER - APART * (camps.index(look.colour) % 3)
        drawn = {"x": row.severity or zero, "y": below if np.isnan(kept) else kept, "kept": kept}
        fields = {name: getattr(row, name) for name in ("engine", "severity", "verdict", "reason")}
        points.append({**fields, **drawn, "colour": look.colour, "dash": look.dash})
    scales = chart.logarithm("x", severities, most=5)
    scales["x_scale"]["reverse"] = case.falling
    if severities[0] == 0.0:
        ticks = [zero, *(tick for tick in scales["x_axis"]["values"] if tick > 3.0 * zero)]
        scales["x_axis"] = {"values": ticks, "labelExpr": f"datum.value < {1.5 * zero} ? '0' : {chart.POWER}"}
    values = {"head": case.title, "across": case.axis, "limit": digits(GOOD), "points": points}
    return chart.fill_template("ladder", **values, **scales, **chart.ways("engine", looks))


PAGE = Report(
    text="stress",
    banner=_banner,
    data={"stress.csv": lambda stress: stress.table},
    values={
        "title": lambda stress: "Stiff and extreme: where it breaks, and whether it says so",
        "headline": headline,
        "about": lambda stress: shorten_hashes(judged_files(stress.provenance)),
        "files": lambda stress: judged_files(stress.provenance),
        "worst": lambda stress: [*_worst(stress)],
        "engines": lambda stress: [*_engines(stress)],
        "silent": lambda stress: [*_silent(stress)],
        "cases": lambda stress: [*_cases(stress)],
    },
    draw=make_plots,
    plots=lambda stress, pictures: list(pictures),
    figures=6,
)
