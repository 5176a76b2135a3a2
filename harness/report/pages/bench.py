"""The report of a bench: which method is cheapest for which accuracy, how it was timed, and all rows after."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Folded, Items, Marked, Paragraph, Picture, Table, facts, table
from screwgauge.report.formatting import Row, duration, grouped, listed, missing, number, rows, size, tick, words
from screwgauge.report.layout import laid_out
from screwgauge.report.pages.sections import judged, short
from screwgauge.report.write import write_report
from screwgauge.study.bench.contestant import count
from screwgauge.study.bench.rows import CUT, FAILED, LEVELS, bench_table, reach, timing_table
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import Fit
from screwgauge.study.bench.slopes import table as slope_table

NINE, SHOWN = LEVELS[2], ("actuator_force", "joint_acceleration")
WHO = "contestant | setting | quantity"
ALL = f"family | {WHO} | max scaled? | rms scaled? | time = time_s | samples = n_sample | status"
CHEAPEST = "digits | cheapest | a sample = a_sample:cpu | next | times as long"
LEFT_OUT = "what = asked | run time = time_s | of everything = share | largest difference | numbers unchanged = same"
DATA = ("bench.csv", "slopes.csv", "timings.csv", "reach.csv", "leaving_out.csv", "environment.json")
CUT_SHORT = "cut short = family | rows | contestants"


def report(bench: Bench, pictures: Iterable[Picture]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    section, drawn = partial(blocks.section, "bench"), list(pictures)
    over_time, over_setting = ([p for p in drawn if p.name.endswith("slopes") is side] for side in (False, True))
    protocol = {"samples": len(bench.scene.t), "rounds": bench.plan.rounds, "budget": number(bench.plan.budget)}
    threads = section("One thread" if bench.environment["one_thread"] else "More threads")[1:]
    every = rows(bench_table(bench.rows))
    body = [
        *section("Error against run time", *(Folded(picture.title, (picture,)) for picture in over_time[1:])),
        *section("Time to reach an error", *_reach(bench)),
        *section("What failed, and what was cut short", *_failures(bench)),
    ]
    appendix = [
        *section("Slopes", *over_setting, slopes(bench.fits, "None of the contestants has an expected slope.")),
        *section("What leaving out buys", *_leaving(bench)),
        *section("All rows", table(every, ALL)),
        *section("How it was timed", *threads, *([Items(bench.notes)] if bench.notes else []), **protocol),
        *section("Environment", facts({**judged(bench.provenance), **bench.environment})),
        *section("Known limitations"),
    ]
    cheapest = _cheapest(bench, SHOWN[0]) or _cheapest(bench, SHOWN[1])
    shown: list[Block] = [table(cheapest, CHEAPEST)] if cheapest else []
    first = next(iter(over_time), None)
    return bench_report(bench, headline(bench), body, appendix, shown, first)


def bench_report(
    bench: Bench, found: str, body: list[Block], appendix: list[Block], first: list[Block], picture: Picture | None
) -> list[Block]:
    """A bench of any scene: `found` in a few sentences, `first` what is cheapest."""
    good, name = bench.complete and all(fit.ok for fit in bench.fits), bench.scene.title or bench.scene.name
    banner = Banner(found, "✓ MEASURED" if good else "✗ NOT ALL MEASURED AS EXPECTED", "agree" if good else "differ")
    about: dict[str, Any] = {**short(judged(bench.provenance)), "compared": count(len(bench.scene.t), "sample")}
    about |= {"errors against": bench.reference, "machine": bench.environment.get("cpu", "")}
    title = f"{name}: error against run time"
    return laid_out(title, [banner], body, appendix, first=[*first, facts(about)], picture=picture)


def write(bench: Bench, out: Path) -> Path:
    """Writes report, plots, tables and environment."""
    from screwgauge.report.figures.bench import make_plots

    tables = bench_table(bench.rows), slope_table(bench.fits), timing_table(bench.rows), reach(bench.rows)
    data = dict(zip(DATA, (*tables, bench.leaving_out, bench.environment), strict=True))
    return write_report(out, lambda: report(bench, make_plots(bench)), data, figures=6)


def _cheapest(bench: Bench, quantity: str) -> list[Row]:
    """For each error the quickest family that closes the loops itself, and how much longer the next one takes."""
    reached = grouped(rows(reach(bench.rows)), "quantity", "given", "error")
    found = []
    for level in LEVELS:
        for best, *others in [reached[key]] if (key := (quantity, False, level)) in reached else []:
            lead = {"next": "none", "times_as_long": ""}
            if others:
                times = others[0]["seconds_per_sample"] / best["seconds_per_sample"]
                lead = {"next": others[0]["family"], "times_as_long": number(times, 3)}
            digits = {"digits": number(-np.log10(level)), "level": level}
            found.append({**digits, "cheapest": best["family"], "a_sample": best["seconds_per_sample"], **lead})
    return found


def headline(bench: Bench) -> str:
    """Which method is cheapest for which accuracy and by how much; slopes, what failed, what was cut short."""
    found, parts = rows(bench_table(bench.rows)), list[str]()
    for quantity in SHOWN:
        for best in (row for row in _cheapest(bench, quantity) if row["level"] == NINE):
            lead = f", then {best['next']} ({best['times_as_long']} times as long)" if best["times_as_long"] else ""
            what = f"{words(quantity).capitalize()} to nine digits is cheapest by {best['cheapest']}"
            parts.append(f"{what}, {duration(best['a_sample'])} a sample{lead}.")
    if bench.fits:
        parts.append(f"{sum(fit.ok for fit in bench.fits)} of {len(bench.fits)} slopes are as theory expects.")
    parts.append(f"{count(len(found), 'row')} in {len(grouped(found, 'family'))} families of methods.")
    if failed := [row["contestant"] for row in found if row["status"] == FAILED]:
        parts.append(f"{count(len(failed), 'row')} failed: {listed(dict.fromkeys(failed))}.")
    if cut := _cut_short(bench):
        lost = f"{count(sum(row['rows'] for row in cut), 'row')} of: {listed(row['family'] for row in cut)}"
        parts.append(f"The budget of {number(bench.plan.budget)} s cut short {lost}.")
    return " ".join(parts)


def terminal(bench: Bench) -> list[Block]:
    """What ``screwgauge bench`` prints: headline, time to reach nine digits, slopes, what was cut short."""
    told: list[Block] = [Paragraph(headline(bench))]
    if bench.reference != "truth":
        told.append(Paragraph(f"Errors are against {bench.reference}, not against a truth."))
    reached = [
        {**row, "family": row["family"] + " †" * row["given"], "who": f"{row['contestant']}: {row['setting']}"[:42]}
        for row in rows(reach(bench.rows))
        if row["error"] == NINE and row["quantity"] in SHOWN
    ]
    if reached:
        columns = f"to {NINE:.0e} = quantity | family | a sample = seconds_per_sample | contestant, setting = who"
        told += [table(reached, columns), Paragraph("† starts from given joint motion")]
    if bench.fits:
        told.append(table(rows(slope_table(bench.fits)), "slope = family | quantity | expected | fitted | = ok"))
    cut = _cut_short(bench)
    return [*told, table(cut, CUT_SHORT)] if cut else told


def slopes(fits: Sequence[Fit], empty: str) -> Block:
    """Fitted slopes beside the expected ones."""
    columns = "family | varied = parameter | error of = quantity | expected | fitted | within 10 % = ok"
    return table(rows(slope_table(fits)), columns) if fits else Paragraph(empty)


def _cut_short(bench: Bench) -> list[Row]:
    """What was cut short, one row for each family; what leaving out buys is one of them."""
    left_out = [{**row, "family": "leaving out", "contestant": row["engine"]} for row in rows(bench.leaving_out)]
    cut = [row for row in [*rows(bench_table(bench.rows)), *left_out] if row["status"] == CUT]
    families = ((name, [row["contestant"] for row in group]) for (name,), group in grouped(cut, "family").items())
    return [{"family": name, "rows": len(c), "contestants": ", ".join(dict.fromkeys(c))} for name, c in families]


def _reach(bench: Bench) -> list[Block]:
    """A table for each quantity: families by the time to the strictest error that they reach."""
    told: list[Block] = []
    head = ("family", *(f"to {level:.0e}" for level in LEVELS), "setting that reaches the smallest")
    for (quantity,), reached in reversed(grouped(rows(reach(bench.rows)), "quantity").items()):
        lines = []
        for (family,), group in grouped(reached, "family").items():
            at = {row["error"]: row for row in group}
            order = [at[x]["seconds_per_sample"] if x in at else np.inf for x in reversed(LEVELS)]
            times = [duration(at[x]["seconds_per_sample"]) + " †" * at[x]["given"] if x in at else "-" for x in LEVELS]
            lines.append((order, (family, *times, "{contestant}: {setting}".format(**at[min(at)]))))
        across, title = Table(head, tuple(line for _, line in sorted(lines))), words(quantity).capitalize()
        told += [Folded(title, (across,))] if told else [Paragraph(Marked(f"**{title}**")), across]
    return told or [Paragraph("Nothing was timed.")]


def _failures(bench: Bench) -> list[Block]:
    """What failed, row by row; what was cut short, family by family, then row by row."""
    by_status, columns = grouped(rows(bench_table(bench.rows)), "status"), f"{WHO} | status | reason"
    told: list[Block] = [table(by_status[FAILED,], columns)] if (FAILED,) in by_status else []
    if families := _cut_short(bench):
        cut = table(by_status.get((CUT,), []), columns)
        told += [table(families, CUT_SHORT), Folded(f"All {len(cut.body)} rows cut short", (cut,))]
    return told or [Paragraph("Nothing.")]


def _leaving(bench: Bench) -> list[Block]:
    """What each engine saves, with the numbers that remain."""

    def line(row: Row) -> Row:
        left = size(row["max_difference"]) if row["status"] == "ok" else row["status"]
        said = {"asked": f"{row['group']} {row['setting']}".strip(), "largest_difference": left}
        share = "" if missing(row["ratio"]) else f"{row['ratio']:.2f}"
        return {
            **row,
            **said,
            "share": share,
            "same": f"✗ {row['reason']}" if row["reason"] else tick(row["unchanged"]),
        }

    groups = grouped(rows(bench.leaving_out), "engine").items()
    told = [table(map(line, group), LEFT_OUT.replace("what", engine, 1)) for (engine,), group in groups]
    return list(told) or [Paragraph("Not asked for.")]
