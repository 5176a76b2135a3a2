"""The report of a bench in Markdown: what was found first, the protocol and all rows after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from screwgauge.report.bench.drawing import WORDS
from screwgauge.report.bench.prose import LEAVING, LIMITS, MORE_THREADS, ONE_THREAD, PROTOCOL, READ
from screwgauge.report.formatting import cell, listed, markdown_table, missing, number, rows, size, tick
from screwgauge.report.plots import Plot
from screwgauge.report.sections import facts, folded
from screwgauge.study.bench.contestant import count
from screwgauge.study.bench.rows import CUT, FAILED, LEVELS, Row, reach
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import table as slope_table


def report_markdown(bench: Bench, plots: Sequence[Plot]) -> str:
    """The text of ``report.md``; plots are linked as ``plots/NAME.svg``."""
    parts = [
        f"# {cell(bench.scene.title or bench.scene.name)}: error against run time",
        f"> {cell(headline(bench))}",
        "\n".join(f"- {note}" for note in bench.notes),
        READ,
        "## Error against run time",
        *(f"![{cell(plot.title)}](plots/{plot.name}.svg)" for plot in plots if not plot.name.endswith("slopes")),
        "## Time to reach an error",
        "Quickest setting of each family, run time for each sample delivered; † starts from given joint motion.",
        *_reach(bench),
        "## Slopes",
        *(f"![{cell(plot.title)}](plots/{plot.name}.svg)" for plot in plots if plot.name.endswith("slopes")),
        _slopes(bench),
        "## What failed, and what was cut short",
        _failures(bench),
        "## What leaving out buys",
        LEAVING,
        *_leaving(bench.leaving_out),
        "## All rows",
        _all(bench.rows),
        "## How it was timed",
        _protocol(bench),
        "## Environment",
        facts(bench.environment, "Not recorded."),
        "## Known limitations",
        "\n".join(f"- {sentence}" for sentence in LIMITS),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def headline(bench: Bench) -> str:
    """Counts, slopes and what reaches nine digits first, in a few sentences."""
    families = dict.fromkeys(row.contestant.family for row in bench.rows)
    failed, cut = ([r for r in bench.rows if r.status == status] for status in (FAILED, CUT))
    parts = [f"{len(bench.rows)} rows in {len(families)} families on scene {bench.scene.name}."]
    table = reach(bench.rows)
    for quantity in ("joint_acceleration", "actuator_force"):
        here = table[(table["quantity"] == quantity) & (table["error"] == 1e-9) & ~table["given"].astype(bool)]
        if len(here):
            best = here.iloc[0]
            seconds = duration(best["seconds_per_sample"])
            parts.append(
                f"Nine digits of {WORDS[quantity]} are cheapest with {best['contestant']}: {seconds} a sample."
            )
    good = sum(fit.ok for fit in bench.fits)
    if bench.fits:
        parts.append(f"{good} of {len(bench.fits)} slopes are as expected.")
    if failed:
        parts.append(f"{count(len(failed), 'row')} failed: {listed(dict.fromkeys(r.contestant.name for r in failed))}.")
    if cut or (bench.leaving_out["status"] == CUT).any():
        names = listed(dict.fromkeys(r.contestant.name for r in cut)) or "what leaving out buys"
        parts.append(f"The budget of {number(bench.plan.budget)} s cut short: {names}.")
    return " ".join(parts)


def duration(seconds: float) -> str:
    """``12.3 µs``."""
    if missing(seconds):
        return ""
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def _reach(bench: Bench) -> list[str]:
    """A table for each quantity: families by the time to the strictest error that they reach."""
    table, parts = rows(reach(bench.rows)), []
    for quantity in reversed(list(dict.fromkeys(row["quantity"] for row in table))):
        here = {(row["family"], row["error"]): row for row in table if row["quantity"] == quantity}
        families = sorted({family for family, _ in here}, key=lambda family: _order(family, here))
        body = []
        for family in families:
            found = [here.get((family, level)) for level in LEVELS]
            last = next(row for row in reversed(found) if row)
            body.append([family, *(_time(row) for row in found), f"{last['contestant']}: {last['setting']}"])
        head = ["family", *(f"to {level:.0e}" for level in LEVELS), "setting that reaches the smallest"]
        parts += [f"**{WORDS[quantity].capitalize()}**", markdown_table(head, body, (1, 2, 3, 4))]
    return parts or ["Nothing was timed."]


def _order(family: str, here: dict[tuple[str, float], dict[str, float]]) -> list[float]:
    times = (here.get((family, level)) for level in reversed(LEVELS))
    return [row["seconds_per_sample"] if row else np.inf for row in times]


def _time(row: dict[str, float] | None) -> str:
    return duration(row["seconds_per_sample"]) + (" †" if row["given"] else "") if row else "-"


def _slopes(bench: Bench) -> str:
    if not bench.fits:
        return "None of the contestants has an expected slope."
    body = [
        [
            r["family"],
            r["parameter"],
            WORDS[r["quantity"]],
            number(r["expected"]),
            number(r["fitted"], 4),
            tick(r["ok"]),
        ]
        for r in rows(slope_table(bench.fits))
    ]
    return markdown_table(["family", "varied", "quantity", "expected", "fitted", "within 10 %"], body, (3, 4))


def _protocol(bench: Bench) -> str:
    threads = ONE_THREAD if bench.environment["one_thread"] else MORE_THREADS
    plan = bench.plan
    return PROTOCOL.format(samples=bench.n_compared, rounds=plan.rounds, budget=number(plan.budget), threads=threads)


def _failures(bench: Bench) -> str:
    bad = [row for row in bench.rows if row.status in (FAILED, CUT)]
    if not bad:
        return "Nothing."
    body = [[r.contestant.name, r.contestant.setting, WORDS.get(r.quantity, ""), r.status, r.reason] for r in bad]
    return markdown_table(["contestant", "setting", "quantity", "status", "reason"], body)


def _leaving(table: pd.DataFrame) -> list[str]:
    parts = []
    for engine in dict.fromkeys(table["engine"]):
        body = [
            [
                " ".join(part for part in (row["group"], row["setting"]) if part),
                duration(row["time_s"]),
                "" if missing(row["ratio"]) else f"{row['ratio']:.2f}",
                size(row["max_difference"]) if row["status"] == "ok" else row["status"],
                tick(row["unchanged"]) if not row["reason"] else f"✗ {row['reason']}",
            ]
            for row in rows(table[table["engine"] == engine])
        ]
        head = [engine, "run time", "of everything", "largest difference", "numbers unchanged"]
        parts.append(markdown_table(head, body, (1, 2, 3)))
    return parts or ["Not asked for."]


def _all(table: Sequence[Row]) -> str:
    head = [
        "family",
        "contestant",
        "setting",
        "quantity",
        "max scaled",
        "rms scaled",
        "time",
        "samples",
        "status",
    ]
    body = [
        [
            row.contestant.family,
            row.contestant.name,
            row.contestant.setting,
            WORDS.get(row.quantity, ""),
            size(row.max_scaled) if row.scored else "",
            size(row.rms_scaled) if row.scored else "",
            duration(row.time_s),
            row.n_sample,
            row.status,
        ]
        for row in table
    ]
    return folded(f"All {len(body)} rows", markdown_table(head, body, (4, 5, 6, 7)), len(body))
