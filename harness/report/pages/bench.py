"""The report of a bench: what was found first, how it was timed and all rows after."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Heading, Items, Paragraph, Picture, Table, facts, folded, table
from screwgauge.report.formatting import Row, duration, grouped, listed, missing, number, rows, size, tick, words
from screwgauge.report.pages.sections import judged
from screwgauge.report.write import write_report
from screwgauge.study.bench.contestant import count
from screwgauge.study.bench.rows import CUT, FAILED, LEVELS, bench_table, reach, timing_table
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import Fit
from screwgauge.study.bench.slopes import table as slope_table

NINE, SHOWN = LEVELS[2], ("joint_acceleration", "actuator_force")
WHO = "contestant | setting | quantity"
ALL = f"family | {WHO} | max scaled? | rms scaled? | time = time_s | samples = n_sample | status"
CUT_SHORT = "cut short = family | rows | contestants"


def report(bench: Bench, pictures: Iterable[Picture]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    section, drawn = partial(blocks.section, "bench"), list(pictures)
    over_time, over_setting = ([p for p in drawn if p.name.endswith("slopes") is side] for side in (False, True))
    protocol = {"samples": len(bench.scene.t), "rounds": bench.plan.rounds, "budget": number(bench.plan.budget)}
    threads = section("One thread" if bench.environment["one_thread"] else "More threads")[1:]
    return [
        *title(bench, headline(bench)),
        *([Items(bench.notes)] if bench.notes else []),
        *section("Error against run time", *over_time),
        *section("Time to reach an error", *_reach(bench)),
        *section("Slopes", *over_setting, slopes(bench.fits, "None of the contestants has an expected slope.")),
        *section("What failed, and what was cut short", *_failures(bench)),
        *section("What leaving out buys", *_leaving(bench)),
        *section("All rows", _all(bench)),
        *section("How it was timed", *threads, **protocol),
        *section("Environment", facts({**judged(bench.provenance), **bench.environment})),
        *section("Known limitations"),
    ]


def title(bench: Bench, found: str) -> list[Block]:
    """Heading, and what was found in a few sentences."""
    good = bench.complete and all(fit.ok for fit in bench.fits)
    name = bench.scene.title or bench.scene.name
    return [Heading(f"{name}: error against run time", 1), Banner(found, status="agree" if good else "differ")]


def write(bench: Bench, out: Path) -> Path:
    """Writes report, plots, tables and environment."""
    from screwgauge.report.figures.bench import make_plots

    data = {
        "bench.csv": bench_table(bench.rows),
        "slopes.csv": slope_table(bench.fits),
        "timings.csv": timing_table(bench.rows),
        "reach.csv": reach(bench.rows),
        "leaving_out.csv": bench.leaving_out,
        "environment.json": bench.environment,
    }
    return write_report(out, report(bench, make_plots(bench)), data, figures=6)


def headline(bench: Bench) -> str:
    """Counts, slopes and what reaches nine digits first, in a few sentences."""
    found, reached = rows(bench_table(bench.rows)), grouped(rows(reach(bench.rows)), "quantity", "error", "given")
    parts = [f"{count(len(found), 'row')} in {len(grouped(found, 'family'))} families on scene {bench.scene.name}."]
    for quantity in SHOWN:
        for best in reached.get((quantity, NINE, False), [])[:1]:
            cheapest = f"{best['contestant']}: {duration(best['seconds_per_sample'])} a sample"
            parts.append(f"Nine digits of {words(quantity)} are cheapest with {cheapest}.")
    if bench.fits:
        parts.append(f"{sum(fit.ok for fit in bench.fits)} of {len(bench.fits)} slopes are as expected.")
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
        told += [
            Paragraph(f"**{words(quantity).capitalize()}**"),
            Table(head, tuple(line for _, line in sorted(lines))),
        ]
    return told or [Paragraph("Nothing was timed.")]


def _failures(bench: Bench) -> list[Block]:
    """What failed, row by row; what was cut short, family by family, then row by row."""
    by_status, columns = grouped(rows(bench_table(bench.rows)), "status"), f"{WHO} | status | reason"
    told: list[Block] = [table(by_status[FAILED,], columns)] if (FAILED,) in by_status else []
    if families := _cut_short(bench):
        cut = table(by_status.get((CUT,), []), columns)
        told += [table(families, CUT_SHORT), folded(f"All {len(cut.body)} rows cut short", cut)]
    return told or [Paragraph("Nothing.")]


def _all(bench: Bench) -> Block:
    found = rows(bench_table(bench.rows))
    return folded(f"All {len(found)} rows", table(found, ALL))


def _leaving(bench: Bench) -> list[Block]:
    """What each engine saves, with the numbers that remain."""
    told: list[Block] = []
    for (engine,), group in grouped(rows(bench.leaving_out), "engine").items():
        body = tuple(
            (
                " ".join(part for part in (row["group"], row["setting"]) if part),
                duration(row["time_s"]),
                "" if missing(row["ratio"]) else f"{row['ratio']:.2f}",
                size(row["max_difference"]) if row["status"] == "ok" else row["status"],
                f"✗ {row['reason']}" if row["reason"] else tick(row["unchanged"]),
            )
            for row in group
        )
        told.append(Table((engine, "run time", "of everything", "largest difference", "numbers unchanged"), body))
    return told or [Paragraph("Not asked for.")]
