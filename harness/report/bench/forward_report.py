"""The report and the tables of a forward bench."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from screwgauge.report.bench.forward_drawing import make_plots
from screwgauge.report.bench.report import duration
from screwgauge.report.formatting import (
    cell,
    digits,
    listed,
    markdown_table,
    missing,
    number,
    rows,
    size,
    text_table,
    tick,
)
from screwgauge.report.page import report_html
from screwgauge.report.plots import Plot
from screwgauge.report.sections import facts
from screwgauge.report.summary import json_text
from screwgauge.report.write import write_files
from screwgauge.study.bench.forward_run import Contest
from screwgauge.study.bench.forward_work import Outcome
from screwgauge.study.bench.rows import COLUMNS, CUT, FAILED, OK
from screwgauge.study.bench.slopes import table as slope_table

COVERS = "integration from start to end, closing of the loops and output at the samples; loading outside"
ABSOLUTE = [
    *("family", "contestant", "setting", "unit", "max_abs", "energy_J", "wall_s", "cpu_s"),
    *("steps", "evaluations", "status", "reason"),
]
LEVELS = (1e-3, 1e-6, 1e-9)
HOW = """\
- Every contestant integrates the scene once from its own model file; what takes less than a second is measured
  {rounds} times, and the shortest time counts. Processor time is what the process used itself (all its threads);
  wall time includes whatever else the machine did. {threads}
- **Error**: the largest difference of the observables from {reference} at {samples} times; scaled: over their largest
  magnitude by unit. **Energy**: kinetic, of gravity and springs, less the work of motors, loads and dampers since the
  start; its largest change, computed from each contestant's joint coordinates and rates by the same formulas.
- Tolerances rtol and atol of a step are alike, for angles, lengths and rates. `screw` integrates the independent
  coordinates and finds the closed pose at every evaluation. Pinocchio and MuJoCo only give accelerations of their
  whole trees under constraints; they are driven by the same methods of scipy. The families with the name of an
  integrator are the engines' own steppers at fixed steps: MuJoCo's with its default softness (refined: solimp 0.9999
  and proximal refinements), Pinocchio's with a projection onto the closed loops after every step.
- A contestant is stopped after {each} s, the whole bench after {budget} s. Both are marked `cut short`.
- Published results were measured on other machines, some decades ago: their times are comparable to an order of
  magnitude at best. Their accuracy is what they state, or what the values that they print differ from the reference.
- All contestants here but the engines' inner loops run under Python: its overhead is in every time."""


def write_contest(found: Contest, out: Path) -> Path:
    """Report, diagram, tables and environment.

    Raises:
        OutputError: The folder cannot be written.
    """
    plots = make_plots(found)
    report = report_markdown(found, plots)
    tables = {
        "bench.csv": bench_table(found.outcomes),
        "forward.csv": absolute_table(found.outcomes),
        "slopes.csv": slope_table(found.fits),
    }
    good = found.complete and all(fit.ok for fit in found.fits)
    texts = {
        **{f"plots/{plot.name}.svg": plot.svg for plot in plots},
        "report.md": report,
        "report.html": report_html(report, plots, "agree" if good else "differ"),
        **{
            name: table.to_csv(index=False, na_rep="nan", lineterminator="\n", float_format="%.6g")
            for name, table in tables.items()
        },
        "environment.json": json_text(found.environment),
    }
    return write_files(out, texts)


def bench_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """The rows of ``bench.csv``: two for each contestant, observable and energy. Times are wall times."""
    body = []
    for o in outcomes:
        for quantity, largest, rms in (
            ("observable", o.scaled, o.rms),
            ("energy", o.energy_scaled, float("nan")),
        ):
            who = (o.entrant.family, o.entrant.name, o.entrant.setting, quantity)
            body.append((*who, largest, rms, digits(largest), o.wall, o.n_sample, COVERS, o.status, o.reason))
    return pd.DataFrame(body, columns=COLUMNS)


def absolute_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """The rows of ``forward.csv``: absolute errors by unit, energy, both times, and the work that was done."""
    body = []
    for o in outcomes:
        for unit, largest in (o.largest or {"": float("nan")}).items():
            who = (o.entrant.family, o.entrant.name, o.entrant.setting, unit)
            did = (o.energy, o.wall, o.cpu, o.steps, o.evaluations, o.status, o.reason)
            body.append((*who, largest, *did))
    return pd.DataFrame(body, columns=ABSOLUTE)


def headline(found: Contest) -> str:
    """Counts, and who reaches six digits first."""
    scene, outcomes = found.scene, found.outcomes
    parts = [
        f"{len(outcomes)} contestants on scene {scene.name}, "
        f"{number(scene.motion.t[-1] - scene.motion.t[0])} s of motion."
    ]
    six = [o for o in outcomes if o.status == OK and o.scaled <= LEVELS[1]]
    if six:
        best = min(six, key=_cpu)
        parts.append(
            f"Six digits of the observables are cheapest with {best.entrant.family} ({best.entrant.setting}): "
            f"{duration(_cpu(best))} of processor time."
        )
    for status, words in ((FAILED, "failed or stopped early"), (CUT, "cut short")):
        names = dict.fromkeys(o.entrant.family for o in outcomes if o.status == status)
        if names:
            parts.append(f"{words.capitalize()}: {listed(names)}.")
    return " ".join(parts)


def _cpu(outcome: Outcome) -> float:
    return outcome.wall if missing(outcome.cpu) else outcome.cpu


def report_markdown(found: Contest, plots: Sequence[Plot]) -> str:
    """The text of ``report.md``."""
    threads = "One thread for linear algebra." if found.environment["one_thread"] else "Threads were not limited."
    how = HOW.format(
        rounds=found.plan.rounds,
        threads=threads,
        reference=found.reference,
        samples=len(found.scene.motion),
        each=number(found.plan.each),
        budget=number(found.plan.budget),
    )
    parts = [
        f"# {cell(found.scene.title)}: error against run time",
        f"> {cell(headline(found))}",
        *(f"> **Warning:** {cell(note)}" for note in found.notes),
        cell(found.scene.description),
        "## Error against processor time",
        *(f"![{cell(plot.title)}](plots/{plot.name}.svg)" for plot in plots),
        _table(found),
        "## Slopes",
        _slopes(found),
        "## How it was measured",
        how,
        "## Environment",
        facts(found.environment, "Not recorded."),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _table(found: Contest) -> str:
    head = ["who", "setting", "observable off by", "energy off by [J]", "processor time", "wall time"]
    head += ["steps", "evaluations", "remark"]
    body = [_row(o) for o in found.outcomes]
    for item in found.scene.published:
        off = "" if np.isnan(item.accuracy) else size(item.accuracy)
        energy = item.measure == "energy"
        time = "" if np.isnan(item.cpu_s) else duration(item.cpu_s)
        remark = " - ".join(part for part in (item.remark, item.source, "other machine") if part)
        errors = ["" if energy else off, off if energy else ""]
        body.append(["*published*", item.who, *errors, time, "", "", "", remark])
    return markdown_table(head, body, (2, 3, 4, 5, 6, 7))


def _row(o: Outcome) -> list[str]:
    errors = ", ".join(f"{size(value)} {unit}" for unit, value in (o.largest or {}).items())
    counts = [str(o.steps), str(o.evaluations)] if o.steps else ["", ""]
    state = "" if o.status == OK else f"✗ {o.status}: {o.reason}"
    times = [duration(o.cpu), duration(o.wall)]
    energy = "" if missing(o.energy) else size(o.energy)
    return [o.entrant.family, o.entrant.setting, errors, energy, *times, *counts, state]


def _slopes(found: Contest) -> str:
    if not found.fits:
        return "No contestant's error is a power of what is varied."
    body = [
        [
            r["family"],
            r["parameter"],
            r["quantity"],
            number(r["expected"]),
            number(r["fitted"], 4),
            tick(r["ok"]),
        ]
        for r in rows(slope_table(found.fits))
    ]
    return markdown_table(["family", "varied", "error of", "expected", "fitted", "within 10 %"], body, (3, 4))


def format_terminal(found: Contest) -> str:
    """What ``screwgauge bench`` prints of a forward scene. Fits 100 columns."""
    head = ("family", "tolerance, step", "observable", "energy [J]", "cpu", "wall", "")
    body = [
        (
            o.entrant.family,
            o.entrant.label,
            "" if missing(o.scaled) else size(o.scaled),
            "" if missing(o.energy) else size(o.energy),
            duration(o.cpu),
            duration(o.wall),
            o.status,
        )
        for o in found.outcomes
    ]
    theirs = [
        (
            p.who[:18],
            "published",
            size(p.accuracy) if p.measure == "observable" and not missing(p.accuracy) else "",
            size(p.accuracy) if p.measure == "energy" and not missing(p.accuracy) else "",
            duration(p.cpu_s),
            "",
            "other machine",
        )
        for p in found.scene.published
    ]
    parts = [
        *textwrap.wrap(headline(found), 100),
        "",
        *text_table(head, [*body, *theirs], right=(2, 3, 4, 5)),
    ]
    return "\n".join(line[:100].rstrip() for line in parts)
