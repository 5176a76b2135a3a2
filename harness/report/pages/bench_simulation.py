"""The report and the tables of a bench whose scene is simulated."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from screwgauge.report import blocks
from screwgauge.report.blocks import Block, Items, Marked, Paragraph, Picture, facts, table
from screwgauge.report.formatting import Row, duration, listed, missing, number, size
from screwgauge.report.pages.bench import bench_report, slopes
from screwgauge.report.pages.sections import judged
from screwgauge.report.pages.simulation import theirs
from screwgauge.report.write import write_report
from screwgauge.study.bench.rows import CUT, FAILED, OK, absolute_table, bench_table, pairs
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import table as slope_table

DATA = ("bench.csv", "forward.csv", "slopes.csv", "environment.json")
SIX = 1e-6
WORDS = {3: "three", 6: "six", 9: "nine"}
SHOWN = (
    "who = family | setting | observable off by = observable | energy off by [J] = energy | processor time = cpu | "
    "wall time = wall? | steps? | evaluations? | remark"
)
TERMINAL = "family | tolerance, step = label | observable = scaled | energy [J] = energy | cpu | wall? | = status"


def report(found: Bench, pictures: Iterable[Picture]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    section, plan, drawn = partial(blocks.section, "bench_simulation"), found.plan, list(pictures)
    how = {
        "threads": "One thread for linear algebra." if found.environment["one_thread"] else "Threads were not limited.",
        "reference": found.reference,
        "samples": len(found.scene.t),
        "rounds": plan.rounds,
        "each": number(plan.each),
        "budget": number(plan.budget),
    }
    about = [Paragraph(found.scene.description)] if found.scene.description else []
    body = [*section("Error against processor time", *about, *drawn[1:], table(_rows(found), SHOWN))]
    appendix = [
        *section("Slopes", slopes(found.fits, "No contestant's error is a power of what is varied.")),
        *section("How it was measured", *([Items(found.notes)] if found.notes else []), **how),
        *section("Environment", facts({**judged(found.provenance), **found.environment})),
    ]
    cheapest = table(_cheapest(found), "digits | cheapest | setting | processor time = cpu | next | times as long")
    return bench_report(
        found, headline(found), body, appendix, [cheapest] if cheapest.body else [], next(iter(drawn), None)
    )


def write(found: Bench, out: Path) -> Path:
    """Writes report, diagram, tables and environment."""
    from screwgauge.report.figures.bench import make_plots

    tables = bench_table(found.rows), absolute_table(found.rows), slope_table(found.fits)
    data = dict(zip(DATA, (*tables, found.environment), strict=True))
    return write_report(out, lambda: report(found, make_plots(found)), data, figures=6)


def _cheapest(found: Bench) -> list[Row]:
    """For three, six and nine digits the quickest method, and how much longer that of another family takes."""
    told = []
    for digits in WORDS:
        reached = [row for row, _ in pairs(found.rows) if row.status == OK and row.max_scaled <= 10.0**-digits]
        order = sorted(reached, key=lambda row: row.work_s)
        if order:
            best, family = order[0], order[0].contestant.family
            other = next((row for row in order if row.contestant.family != family), None)
            lead = {"next": other.contestant.family if other else "none"}
            lead |= {"times_as_long": number(other.work_s / best.work_s, 3) if other else ""}
            who = {"digits": str(digits), "cheapest": family, "setting": best.contestant.setting}
            told.append({**who, "cpu": best.work_s, **lead})
    return told


def headline(found: Bench) -> str:
    """Who reaches six digits (or as many as anybody does) first and by how much; what failed."""
    t, rows = found.scene.t, [row for row, _ in pairs(found.rows)]
    parts, cheapest = list[str](), {row["digits"]: row for row in _cheapest(found)}
    if best := cheapest.get("6", [*cheapest.values()][-1:][0] if cheapest else None):
        what = f"{WORDS[int(best['digits'])].capitalize()} digits of the observables are cheapest with"
        lead = f"; {best['next']} takes {best['times_as_long']} times as long" if best["times_as_long"] else ""
        parts.append(f"{what} {best['cheapest']} ({best['setting']}): {duration(best['cpu'])} of processor time{lead}.")
    parts.append(f"{len(rows)} contestants on {number(t[-1] - t[0])} s of motion.")
    for status, words in ((FAILED, "Failed or stopped early"), (CUT, "Cut short")):
        names = dict.fromkeys(row.contestant.family for row in rows if row.status == status)
        parts += [f"{words}: {listed(names)}."] if names else []
    return " ".join(parts)


def terminal(found: Bench) -> list[Block]:
    """What ``screwgauge bench`` prints of a simulated scene."""
    return [Paragraph(headline(found)), table(_rows(found), TERMINAL)]


def _rows(found: Bench) -> list[Row]:
    """What was found, and what others have published."""
    ours = [
        {
            "family": row.contestant.family,
            "setting": row.contestant.setting,
            "label": row.contestant.label,
            "status": row.status,
            "observable": ", ".join(f"{size(value)} {unit}" for unit, value in row.largest.items()),
            "scaled": "" if missing(row.max_scaled) else size(row.max_scaled),
            "energy": "".join(size(value) for value in energy.largest.values() if not missing(value)),
            "cpu": row.cost.cpu_s,
            "wall": row.cost.wall_s,
            "steps": row.cost.steps or None,
            "evaluations": row.cost.evaluations if row.cost.steps else None,
            "remark": "" if row.status == OK else f"✗ {row.status}: {row.reason}",
        }
        for row, energy in pairs(found.rows)
    ]
    published = [
        {
            "family": Marked("*published*"),
            "setting": item.who,
            "label": item.who[:18],
            "status": "other machine",
            **theirs(item),
            "cpu": item.cpu_s,
            "remark": " - ".join(part for part in (item.remark, item.source, "other machine") if part),
        }
        for item in found.scene.published
    ]
    return [*ours, *({**row, "scaled": row["observable"]} for row in published)]
