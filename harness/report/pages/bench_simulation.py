"""The report and the tables of a bench whose scene is simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from screwgauge.quantities import digits
from screwgauge.report.blocks import (
    Banner,
    Block,
    Column,
    Heading,
    Numbers,
    Paragraph,
    Picture,
    Table,
    prose,
    section,
    table,
)
from screwgauge.report.formatting import Row, blank, duration, listed, missing, number, size
from screwgauge.report.pages.bench import slopes
from screwgauge.report.pages.prose import SIMULATED_PROTOCOL
from screwgauge.report.pages.sections import facts, judged
from screwgauge.report.pages.simulation import theirs
from screwgauge.report.write import write_report
from screwgauge.study.bench.forward_run import Contest
from screwgauge.study.bench.forward_work import Outcome
from screwgauge.study.bench.rows import COLUMNS, CUT, FAILED, OK
from screwgauge.study.bench.slopes import table as slope_table

if TYPE_CHECKING:
    from screwgauge.report.plots import Plot

COVERS = "integration from start to end, closing of the loops and output at the samples; loading outside"
ABSOLUTE = [
    *("family", "contestant", "setting", "unit", "max_abs", "energy_J", "wall_s", "cpu_s"),
    *("steps", "evaluations", "status", "reason"),
]
SIX = 1e-6
NO_POWER = "No contestant's error is a power of what is varied."
TABLE = (
    *(Column("who", "who"), Column("setting", "setting")),
    *(Numbers("observable off by", "observable"), Numbers("energy off by [J]", "energy")),
    *(Numbers("processor time", "cpu", duration), Numbers("wall time", "wall", duration)),
    *(Numbers("steps", "steps"), Numbers("evaluations", "evaluations"), Column("remark", "remark")),
)
TERMINAL = (
    *(Column("family", "family"), Column("tolerance, step", "label")),
    *(Numbers("observable", "scaled"), Numbers("energy [J]", "energy")),
    *(Numbers("cpu", "cpu", duration), Numbers("wall", "wall", duration), Column("", "status")),
)


def write(found: Contest, out: Path) -> Path:
    """Writes report, diagram, tables and environment.

    Raises:
        OutputError: The folder cannot be written.
    """
    from screwgauge.report.bench.forward_drawing import make_plots

    data = {
        "bench.csv": bench_table(found.outcomes),
        "forward.csv": absolute_table(found.outcomes),
        "slopes.csv": slope_table(found.fits),
        "environment.json": found.environment,
    }
    return write_report(out, report(found, make_plots(found)), data, figures=6)


def bench_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """The rows of ``bench.csv``: two for each contestant, observable and energy. Times are wall times."""
    body = [
        (*_who(o), quantity, largest, rms, digits(largest), o.wall, o.n_sample, COVERS, o.status, o.reason)
        for o in outcomes
        for quantity, largest, rms in (("observable", o.scaled, o.rms), ("energy", o.energy_scaled, float("nan")))
    ]
    return pd.DataFrame(body, columns=COLUMNS)


def absolute_table(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """The rows of ``forward.csv``: absolute errors by unit, energy, both times, and the work that was done."""
    body = [
        (*_who(o), unit, largest, o.energy, o.wall, o.cpu, o.steps, o.evaluations, o.status, o.reason)
        for o in outcomes
        for unit, largest in (o.largest or {"": float("nan")}).items()
    ]
    return pd.DataFrame(body, columns=ABSOLUTE)


def _who(o: Outcome) -> tuple[str, str, str]:
    return o.entrant.family, o.entrant.name, o.entrant.setting


def headline(found: Contest) -> str:
    """Counts, and who reaches six digits first."""
    t, outcomes = found.scene.motion.t, found.outcomes
    parts = [f"{len(outcomes)} contestants on scene {found.scene.name}, {number(t[-1] - t[0])} s of motion."]
    six = [o for o in outcomes if o.status == OK and o.scaled <= SIX]
    if six:
        best = min(six, key=_cpu)
        cheapest = f"{best.entrant.family} ({best.entrant.setting}): {duration(_cpu(best))} of processor time"
        parts.append(f"Six digits of the observables are cheapest with {cheapest}.")
    for status, words in ((FAILED, "Failed or stopped early"), (CUT, "Cut short")):
        names = dict.fromkeys(o.entrant.family for o in outcomes if o.status == status)
        parts += [f"{words}: {listed(names)}."] if names else []
    return " ".join(parts)


def _cpu(outcome: Outcome) -> float:
    return outcome.wall if missing(outcome.cpu) else outcome.cpu


def report(found: Contest, plots: Sequence[Plot]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    good = found.complete and all(fit.ok for fit in found.fits)
    how = SIMULATED_PROTOCOL.format(
        rounds=found.plan.rounds,
        threads="One thread for linear algebra." if found.environment["one_thread"] else "Threads were not limited.",
        reference=found.reference,
        samples=len(found.scene.motion),
        each=number(found.plan.each),
        budget=number(found.plan.budget),
    )
    return [
        Heading(f"{found.scene.title}: error against run time", 1),
        Banner(headline(found), status="agree" if good else "differ"),
        *(Banner(note, "Warning:") for note in found.notes),
        *([Paragraph(found.scene.description)] if found.scene.description else []),
        *section("Error against processor time", *map(Picture, plots), _table(found)),
        *section("Slopes", slopes(found.fits, Column("error of", "quantity"), NO_POWER)),
        *section("How it was measured", *prose(how)),
        *section("Environment", facts({**dict(judged(found.provenance)), **found.environment})),
    ]


def _table(found: Contest) -> Table:
    published = [
        {
            **theirs(item),
            "who": "*published*",
            "setting": item.who,
            "wall": None,
            "steps": "",
            "evaluations": "",
            "remark": " - ".join(part for part in (item.remark, item.source, "other machine") if part),
        }
        for item in found.scene.published
    ]
    return table([*map(_row, found.outcomes), *published], TABLE)


def _row(o: Outcome) -> Row:
    return {
        "who": o.entrant.family,
        "setting": o.entrant.setting,
        "observable": ", ".join(f"{size(value)} {unit}" for unit, value in (o.largest or {}).items()),
        "energy": blank(size)(o.energy),
        "cpu": o.cpu,
        "wall": o.wall,
        "steps": o.steps or "",
        "evaluations": o.evaluations if o.steps else "",
        "remark": "" if o.status == OK else f"✗ {o.status}: {o.reason}",
    }


def terminal(found: Contest) -> list[Block]:
    """What ``screwgauge bench`` prints of a simulated scene."""
    ours: list[Mapping[str, object]] = [
        {
            "family": o.entrant.family,
            "label": o.entrant.label,
            "scaled": blank(size)(o.scaled),
            "energy": blank(size)(o.energy),
            "cpu": o.cpu,
            "wall": o.wall,
            "status": o.status,
        }
        for o in found.outcomes
    ]
    others = (theirs(item) for item in found.scene.published)
    fixed = {"label": "published", "wall": np.nan, "status": "other machine"}
    published = ({**row, **fixed, "family": row["who"][:18], "scaled": row["observable"]} for row in others)
    return [Paragraph(headline(found)), table([*ours, *published], TERMINAL)]
