"""The report and the tables of a bench whose scene is simulated."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import pandas as pd

from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Heading, Marked, Paragraph, Picture, facts, table
from screwgauge.report.formatting import Row, duration, grouped, listed, missing, number, size
from screwgauge.report.pages.bench import slopes
from screwgauge.report.pages.sections import judged
from screwgauge.report.pages.simulation import theirs
from screwgauge.report.write import write_report
from screwgauge.study.bench.forward_score import Outcome
from screwgauge.study.bench.rows import CUT, FAILED, OK, bench_table
from screwgauge.study.bench.run import Bench as Contest
from screwgauge.study.bench.slopes import table as slope_table

ABSOLUTE = [
    *("family", "contestant", "setting", "unit", "max_abs", "energy_J", "wall_s", "cpu_s"),
    *("steps", "evaluations", "status", "reason"),
]
DATA = ("bench.csv", "forward.csv", "slopes.csv", "environment.json")
SIX = 1e-6
SHOWN = (
    "who = family | setting | observable off by = observable | energy off by [J] = energy | processor time = cpu | "
    "wall time = wall? | steps? | evaluations? | remark"
)
TERMINAL = "family | tolerance, step = label | observable = scaled | energy [J] = energy | cpu | wall? | = status"


def report(found: Contest, pictures: Iterable[Picture]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    section, plan = partial(blocks.section, "bench_simulation"), found.plan
    good = found.complete and all(fit.ok for fit in found.fits)
    how = {
        "threads": "One thread for linear algebra." if found.environment["one_thread"] else "Threads were not limited.",
        "reference": found.reference,
        "samples": len(found.scene.t),
        "rounds": plan.rounds,
        "each": number(plan.each),
        "budget": number(plan.budget),
    }
    return [
        Heading(f"{found.scene.title}: error against run time", 1),
        Banner(headline(found), status="agree" if good else "differ"),
        *(Banner(note, "Warning:") for note in found.notes),
        *([Paragraph(found.scene.description)] if found.scene.description else []),
        *section("Error against processor time", *pictures, table(_rows(found), SHOWN)),
        *section("Slopes", slopes(found.fits, "No contestant's error is a power of what is varied.")),
        *section("How it was measured", **how),
        *section("Environment", facts({**judged(found.provenance), **found.environment})),
    ]


def write(found: Contest, out: Path) -> Path:
    """Writes report, diagram, tables and environment."""
    from screwgauge.report.figures.bench_simulation import make_plots

    tables = bench_table(found.rows), absolute_table(found.outcomes), slope_table(found.fits)
    data = dict(zip(DATA, (*tables, found.environment), strict=True))
    return write_report(out, lambda: report(found, make_plots(found)), data, figures=6)


def absolute_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """The rows of ``forward.csv``: absolute errors by unit, energy, both times, and the work that was done."""
    body = [
        (
            c.family,
            c.name,
            c.setting,
            unit,
            largest,
            o.energy,
            o.wall,
            o.cpu,
            o.steps,
            o.evaluations,
            o.status,
            o.reason,
        )
        for o, c in ((outcome, outcome.contestant) for outcome in outcomes)
        for unit, largest in (o.largest or {"": float("nan")}).items()
    ]
    return pd.DataFrame(body, columns=ABSOLUTE)


def headline(found: Contest) -> str:
    """Counts, and who reaches six digits first."""
    t, outcomes = found.scene.t, found.outcomes
    parts = [f"{len(outcomes)} contestants on scene {found.scene.name}, {number(t[-1] - t[0])} s of motion."]
    if six := [o for o in outcomes if o.status == OK and o.scaled <= SIX]:
        best = min(six, key=_cpu)
        cheapest = f"{best.contestant.family} ({best.contestant.setting}): {duration(_cpu(best))} of processor time"
        parts.append(f"Six digits of the observables are cheapest with {cheapest}.")
    by_status = grouped(({"status": o.status, "family": o.contestant.family} for o in outcomes), "status")
    for status, words in ((FAILED, "Failed or stopped early"), (CUT, "Cut short")):
        names = dict.fromkeys(row["family"] for row in by_status.get((status,), []))
        parts += [f"{words}: {listed(names)}."] if names else []
    return " ".join(parts)


def _cpu(outcome: Outcome) -> float:
    return outcome.wall if missing(outcome.cpu) else outcome.cpu


def terminal(found: Contest) -> list[Block]:
    """What ``screwgauge bench`` prints of a simulated scene."""
    return [Paragraph(headline(found)), table(_rows(found), TERMINAL)]


def _rows(found: Contest) -> list[Row]:
    """What was found, and what others have published."""
    ours = [
        {
            "family": o.contestant.family,
            "setting": o.contestant.setting,
            "label": o.contestant.label,
            "status": o.status,
            "observable": ", ".join(f"{size(value)} {unit}" for unit, value in (o.largest or {}).items()),
            **{key: "" if missing(x) else size(x) for key, x in (("scaled", o.scaled), ("energy", o.energy))},
            "cpu": o.cpu,
            "wall": o.wall,
            "steps": o.steps or None,
            "evaluations": o.evaluations if o.steps else None,
            "remark": "" if o.status == OK else f"✗ {o.status}: {o.reason}",
        }
        for o in found.outcomes
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
