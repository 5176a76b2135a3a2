"""The report of a run: verdict first, evidence after; with its summary, its tables, and what a terminal shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from screwgauge.environment import plain
from screwgauge.judging.compare import ERROR_COLUMNS
from screwgauge.report.blocks import (
    Banner,
    Block,
    Column,
    Heading,
    Items,
    Numbers,
    Paragraph,
    Picture,
    prose,
    section,
    table,
)
from screwgauge.report.formatting import Row, digits_text, rows, size, tick, words
from screwgauge.report.pages import sections
from screwgauge.report.pages.prose import COMPARED, CURVES, LIMITATIONS, SIMULATED, SIMULATED_LIMITATIONS
from screwgauge.report.pages.simulation import published
from screwgauge.report.verdict import compared, first_difference, verdict
from screwgauge.report.write import SAMPLES, check_writable, write_report
from screwgauge.solution import REFERENCE, Timing
from screwgauge.study.comparison import Comparison

if TYPE_CHECKING:
    from screwgauge.report.plots import Plot

RESIDUALS = "Residuals of the equations themselves, engine by engine; no second engine is needed."
JUDGE_KEYS = ("engine", "residual", "unit", "max_abs", "max_scaled", "tolerance", "ok")


def report(results: Comparison, plots: Sequence[Plot], errata: Sequence[Block] = ()) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``.

    Args:
        errata: The section "The paper, checked", left out if empty.
    """
    others, given = published(results), results.scene.forward is None
    lead = [Paragraph(CURVES)] if len(results.solutions) > 1 else []
    drawn: list[Block] = [*lead, *map(Picture, plots)] if plots else [Paragraph("Nothing to draw.")]
    return [
        Heading(f"{results.scene.title or results.scene.name}: verification report", 1),
        verdict(results),
        *(Banner(sentence, "Warning:") for sentence in results.warnings),
        *sections.overview(results),
        *section("Scene", *sections.scene(results)),
        *section("Engines", *sections.engines(results)),
        *section("Pairs", *sections.every_pair(results)),
        *section("Judge", Paragraph(RESIDUALS), *sections.judge(results)),
        *section("Estimated errors", *sections.estimates(results)),
        *section("Plots", *drawn),
        *section("Mechanism", sections.facts(results.mobility, "No facts of the mechanism were computed.")),
        *(section("The paper, checked", *errata) if errata else ()),
        *(section("Published results", *others) if others else ()),
        *section("How it was compared", *prose(COMPARED if given else SIMULATED)),
        *section("Run times", sections.timings(results)),
        *section("Environment", sections.facts(results.environment)),
        *section("Known limitations", Items(LIMITATIONS if given else SIMULATED_LIMITATIONS)),
    ]


def short(results: Comparison) -> list[Block]:
    """What fits one screen: verdict, the worst pair of each quantity and unit, conditioning."""
    pairs = _worst(compared(results), "quantity", "unit")
    return [
        verdict(results),
        *(Banner(sentence, "Warning") for sentence in results.warnings),
        *([table(pairs, (Column("quantity", "quantity"), *_columns("worst pair", _pair)))] if pairs else []),
        *([Banner(sections.estimates_line(results), "conditioning")] if results.guard else []),
    ]


def terminal(results: Comparison) -> list[Block]:
    """What ``screwgauge run`` prints: the same, and the worst engine of each residual of the judge."""
    residuals, blocks = _worst(rows(results.judge), "residual", "unit"), short(results)
    columns = (Column("judge: residual", "residual", words), *_columns("worst engine", "engine"))
    end = len(blocks) - bool(results.guard)
    return [*blocks[:end], *([table(residuals, columns)] if residuals else []), *blocks[end:]]


def _pair(row: Row) -> str:
    return f"{row['a']} - {row['b']}"


def _columns(head: str, who: Any) -> tuple[Column, ...]:
    return (
        *(Column("unit", "unit"), Column(head, who), Numbers("scaled", "max_scaled", size)),
        Numbers("digits", "max_scaled", lambda scaled: digits_text(scaled).replace("NaN", "-")),
        *(sections.TOLERANCE, Column("", "ok", tick)),
    )


def _worst(found: Sequence[Row], *keys: str) -> list[Row]:
    """Of each group: what is out of tolerance first, then the largest; a missing number is worse than any."""

    def badness(row: Row) -> tuple[bool, float]:
        return not row["ok"], np.inf if np.isnan(row["max_scaled"]) else float(row["max_scaled"])

    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in found:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return [max(group, key=badness) for group in groups.values()]


def write(results: Comparison, out: Path, *, samples: bool = False, errata: bool = False) -> Path:
    """Writes everything, see `screwgauge.report.results.Results.write`."""
    from screwgauge.report.pages.paper import errata_section
    from screwgauge.report.plots import make_plots

    check_writable(out, samples=samples)
    timings = [timing for solution in results.solutions.values() for timing in solution.timings]
    blocks = report(results, make_plots(results), errata_section(results.scene) if errata else ())
    data = {
        "errors.csv": results.errors[ERROR_COLUMNS],
        "timings.csv": pd.DataFrame(timings, columns=list(Timing.__dataclass_fields__)),
        "environment.json": results.environment,
        "summary.json": summary(results),
        **({SAMPLES: _samples(results)} if samples else {}),
    }
    return write_report(out, blocks, data)


def _samples(results: Comparison) -> pd.DataFrame:
    """Every sample: column t and one column ``engine/quantity/component`` for each value."""
    columns = {
        f"{engine}/{quantity}/{name}": column
        for engine, solution in results.solutions.items()
        for quantity, values in solution.values.items()
        for name, column in zip(values.components, values.array.T, strict=True)
    }
    return pd.DataFrame({"t": results.times, **columns})


def summary(results: Comparison) -> dict[str, Any]:
    """What ``summary.json`` says, as plain Python values: no NaN, no numpy."""
    told = results.provenance
    found: dict[str, Any] = plain(
        {
            "scene": results.scene.name,
            "ok": results.ok,
            "engines": {name: s.version for name, s in results.solutions.items() if name != REFERENCE},
            "failures": {name: failure.reason for name, failure in results.failures.items()},
            "warnings": results.warnings,
            "first_difference": first_difference(results),
            "quantities": [_quantity(row) for row in rows(results.pairs)],
            "judge": [{key: row[key] for key in JUDGE_KEYS} for row in rows(results.judge)],
            "guard": [{**asdict(row), "ok": row.ok} for row in results.guard],
            "refused": [
                {"engine": x.engine, "quantities": x.quantities, "samples": len(x.rows), "reason": x.sentence}
                for x in results.refusals
            ],
            "timings": [asdict(timing) for s in results.solutions.values() for timing in s.timings],
            "environment": results.environment,
            **{key: told.get(key) for key in ("models", "scene_file", "scene_sha256", "description", "date", "schema")},
        }
    )
    return found


def _quantity(row: Row) -> Row:
    worst = {"component": row["worst_component"], "t": row["worst_t"]}
    reason = {"reason": row["reason"]} if row.get("reason") else {}
    first = {key: row[key] for key in ("quantity", "a", "b", "unit", "max_abs", "rms", "max_scaled")}
    return {**first, "worst": worst, **{key: row[key] for key in ("rule", "unique", "tolerance", "ok")}, **reason}
