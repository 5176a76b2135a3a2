"""The report of a bench: what was found first, how it was timed and all rows after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from screwgauge.report.blocks import (
    Banner,
    Block,
    Column,
    Heading,
    Items,
    Numbers,
    Paragraph,
    Picture,
    folded,
    prose,
    section,
    table,
)
from screwgauge.report.formatting import Row, duration, listed, missing, number, plural, rows, size, tick
from screwgauge.report.pages.prose import BENCH_LIMITATIONS, LEAVING, MORE_THREADS, ONE_THREAD, POINTS, PROTOCOL
from screwgauge.report.pages.sections import facts, judged
from screwgauge.report.write import write_report
from screwgauge.study.bench.contestant import NOTHING, count
from screwgauge.study.bench.rows import CUT, FAILED, LEVELS, bench_table, reach, timing_table
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import Fit
from screwgauge.study.bench.slopes import table as slope_table

if TYPE_CHECKING:
    from screwgauge.report.plots import Plot

QUICKEST = "Quickest setting of each family, run time for each sample delivered; † starts from given joint motion."
NO_SLOPE = "None of the contestants has an expected slope."
NINE, SHOWN = LEVELS[2], ("joint_acceleration", "actuator_force")


def _measured(quantity: str) -> str:
    return "" if quantity == NOTHING else plural(quantity)


WHO = (Column("contestant", "contestant.name"), Column("setting", "contestant.setting"))
QUANTITY = Column("quantity", "quantity", _measured)
ALL = (
    *(Column("family", "contestant.family"), *WHO, QUANTITY),
    Numbers("max scaled", lambda row: size(row.max_scaled) if row.scored else ""),
    Numbers("rms scaled", lambda row: size(row.rms_scaled) if row.scored else ""),
    *(Numbers("time", "time_s", duration), Numbers("samples", "n_sample"), Column("status", "status")),
)
CUT_SHORT = (Column("cut short", "family"), Numbers("rows", "rows"), Column("", "names"))
SLOPE = (Numbers("expected", "expected", number), Numbers("fitted", "fitted", lambda value: number(value, 4)))
LESS = (
    Numbers("run time", "time_s", duration),
    Numbers("of everything", "ratio", lambda value: "" if missing(value) else f"{value:.2f}"),
    Numbers("largest difference", lambda r: size(r["max_difference"]) if r["status"] == "ok" else r["status"]),
    Column("numbers unchanged", lambda r: f"✗ {r['reason']}" if r["reason"] else tick(r["unchanged"])),
)


def report(bench: Bench, plots: Sequence[Plot]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    good = bench.complete and all(fit.ok for fit in bench.fits)
    fitted = slopes(bench.fits, Column("quantity", "quantity", plural), NO_SLOPE)
    return [
        Heading(f"{bench.scene.title or bench.scene.name}: error against run time", 1),
        Banner(headline(bench), status="agree" if good else "differ"),
        *([Items(bench.notes)] if bench.notes else []),
        *prose(POINTS),
        *section("Error against run time", *(Picture(plot) for plot in plots if not plot.name.endswith("slopes"))),
        *section("Time to reach an error", Paragraph(QUICKEST), *_reach(rows(reach(bench.rows)))),
        *section("Slopes", *(Picture(plot) for plot in plots if plot.name.endswith("slopes")), fitted),
        *section("What failed, and what was cut short", *_failures(bench)),
        *section("What leaving out buys", *prose(LEAVING), *_leaving(bench.leaving_out)),
        *section("All rows", folded(f"All {len(bench.rows)} rows", table(bench.rows, ALL))),
        *section("How it was timed", *_protocol(bench)),
        *section("Environment", facts({**dict(judged(bench.provenance)), **bench.environment})),
        *section("Known limitations", Items(BENCH_LIMITATIONS)),
    ]


def write(bench: Bench, out: Path) -> Path:
    """Writes report, plots, tables and environment.

    Raises:
        OutputError: The folder cannot be written.
    """
    from screwgauge.report.bench.drawing import make_plots

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
    families = dict.fromkeys(row.contestant.family for row in bench.rows)
    parts = [f"{len(bench.rows)} rows in {len(families)} families on scene {bench.scene.name}."]
    reached = rows(reach(bench.rows))
    for quantity in SHOWN:
        quick = [r for r in reached if r["quantity"] == quantity and r["error"] == NINE and not r["given"]]
        if quick:
            cheapest = f"{quick[0]['contestant']}: {duration(quick[0]['seconds_per_sample'])} a sample"
            parts.append(f"Nine digits of {plural(quantity)} are cheapest with {cheapest}.")
    if bench.fits:
        parts.append(f"{sum(fit.ok for fit in bench.fits)} of {len(bench.fits)} slopes are as expected.")
    failed = [row.contestant.name for row in bench.rows if row.status == FAILED]
    if failed:
        parts.append(f"{count(len(failed), 'row')} failed: {listed(dict.fromkeys(failed))}.")
    cut = _cut_short(bench)
    if cut:
        lost = f"{count(sum(row['rows'] for row in cut), 'row')} in {len(cut)} families"
        parts.append(f"The budget of {number(bench.plan.budget)} s cut short {lost}.")
    return " ".join(parts)


def _cut_short(bench: Bench) -> list[Row]:
    """What was cut short, one row for each family; what leaving out buys is one of them."""
    cut: dict[str, list[str]] = {}
    for row in bench.rows:
        if row.status == CUT:
            cut.setdefault(row.contestant.family, []).append(row.contestant.name)
    cut["leaving out"] = [row["engine"] for row in rows(bench.leaving_out) if row["status"] == CUT]
    return [{"family": k, "rows": len(v), "names": ", ".join(dict.fromkeys(v))} for k, v in cut.items() if v]


def terminal(bench: Bench) -> list[Block]:
    """What ``screwgauge bench`` prints: headline, time to reach nine digits, slopes, what was cut short."""
    blocks: list[Block] = [Paragraph(headline(bench))]
    if bench.reference != "truth":
        blocks.append(Paragraph(f"Errors are against {bench.reference}, not against a truth."))
    reached = [row for row in rows(reach(bench.rows)) if row["error"] == NINE and row["quantity"] in SHOWN]
    columns = (
        Column(f"to {NINE:.0e}", "quantity"),
        Column("family", lambda row: row["family"] + (" †" if row["given"] else "")),
        Numbers("a sample", "seconds_per_sample", duration),
        Column("contestant, setting", lambda row: f"{row['contestant']}: {row['setting']}"[:42]),
    )
    if reached:
        blocks += [table(reached, columns), Paragraph("† starts from given joint motion")]
    if bench.fits:
        named = (Column("slope", "family"), Column("quantity", "quantity"), *SLOPE, Column("", "ok", tick))
        blocks.append(table(rows(slope_table(bench.fits)), named))
    cut = _cut_short(bench)
    return [*blocks, table(cut, CUT_SHORT)] if cut else blocks


def slopes(fits: Sequence[Fit], quantity: Column, empty: str) -> Block:
    """Fitted slopes beside the expected ones."""
    columns = (Column("family", "family"), Column("varied", "parameter"), quantity, *SLOPE)
    return table(rows(slope_table(fits)), (*columns, Column("within 10 %", "ok", tick))) if fits else Paragraph(empty)


def _reach(reached: Sequence[Row]) -> list[Block]:
    """A table for each quantity: families by the time to the strictest error that they reach."""

    def time(level: float) -> Callable[[dict[float, Row]], str]:
        def text(at: dict[float, Row]) -> str:
            row = at.get(level)
            return duration(row["seconds_per_sample"]) + (" †" if row["given"] else "") if row else "-"

        return text

    def strictest(at: dict[float, Row]) -> list[float]:
        return [at[level]["seconds_per_sample"] if level in at else np.inf for level in reversed(LEVELS)]

    def smallest(at: dict[float, Row]) -> Row:
        return at[min(at)]

    columns = (
        Column("family", lambda at: smallest(at)["family"]),
        *(Numbers(f"to {level:.0e}", time(level)) for level in LEVELS),
        Column("setting that reaches the smallest", lambda at: "{contestant}: {setting}".format(**smallest(at))),
    )
    blocks: list[Block] = []
    for quantity in reversed(list(dict.fromkeys(row["quantity"] for row in reached))):
        families: dict[str, dict[float, Row]] = {}
        for row in reached:
            if row["quantity"] == quantity:
                families.setdefault(row["family"], {})[row["error"]] = row
        shown = table(sorted(families.values(), key=strictest), columns)
        blocks += [Paragraph(f"**{plural(quantity).capitalize()}**"), shown]
    return blocks or [Paragraph("Nothing was timed.")]


def _failures(bench: Bench) -> list[Block]:
    """What failed, row by row; what was cut short, family by family, then row by row."""
    failed, cut = ([row for row in bench.rows if row.status == status] for status in (FAILED, CUT))
    columns = (*WHO, QUANTITY, Column("status", "status"), Column("reason", "reason"))
    families = _cut_short(bench)
    return [
        *([table(failed, columns)] if failed else []),
        *([table(families, CUT_SHORT)] if families else []),
        *([folded(f"All {len(cut)} rows cut short", table(cut, columns))] if cut else []),
        *([] if failed or families else [Paragraph("Nothing.")]),
    ]


def _leaving(left_out: pd.DataFrame) -> list[Block]:
    blocks: list[Block] = []
    for engine in dict.fromkeys(left_out["engine"]):
        what = Column(engine, lambda row: " ".join(part for part in (row["group"], row["setting"]) if part))
        blocks.append(table(rows(left_out[left_out["engine"] == engine]), (what, *LESS)))
    return blocks or [Paragraph("Not asked for.")]


def _protocol(bench: Bench) -> list[Block]:
    plan, threads = bench.plan, ONE_THREAD if bench.environment["one_thread"] else MORE_THREADS
    return prose(
        PROTOCOL.format(samples=bench.n_compared, rounds=plan.rounds, budget=number(plan.budget), threads=threads)
    )
