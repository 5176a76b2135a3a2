"""The report of a run: verdict first, evidence after; with its summary, its tables, and what a terminal shows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from screwgauge.judging.compare import ERROR_COLUMNS
from screwgauge.judging.conditioning import LIMIT
from screwgauge.report import blocks
from screwgauge.report.blocks import Banner, Block, Paragraph, Picture, facts, table
from screwgauge.report.folder import SAMPLES
from screwgauge.report.formatting import Row, digits_text, grouped, number, rows
from screwgauge.report.layout import laid_out
from screwgauge.report.pages import sections
from screwgauge.report.pages.simulation import published
from screwgauge.report.record import samples_table, summary, timings
from screwgauge.report.stage.picture import stage, told
from screwgauge.report.verdict import compared, verdict
from screwgauge.report.write import write_report
from screwgauge.solution import Timing
from screwgauge.study.comparison import Comparison

TIMING = "engine | setting | stage | samples = n_sample | min [s] = min_s | median [s] = median_s"
SCALED = "scaled = max_scaled | digits | tolerance | = ok"
__all__ = ["DATA", "pictures", "report", "summary", "terminal", "write"]
DATA = ("errors.csv", "timings.csv", "environment.json", "summary.json")


def report(results: Comparison, pictures: Iterable[Picture], errata: Sequence[Block] = ()) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``.

    Args:
        pictures: That of the mechanism, if there is one, is called ``mechanism`` and stands on the first screen.
        errata: The section "The paper, checked", left out if empty.
    """
    section = partial(blocks.section, "run" if not results.scene.simulated else "simulation")
    drawn = {picture.name: picture for picture in pictures}
    first, others = drawn.pop("mechanism", None), published(results)
    held = told(first) if first and first.stage else []
    body = [
        *sections.differing(results),
        *section("Digits of agreement", *sections.overview(results)),
        *section("Judge", sections.judge(results)),
        *section("Plots", *sections.plots(results, list(drawn.values()))),
        *(section("Published results", others) if others else []),
        *section("Coverage", *sections.coverage(results)),
    ]
    appendix = [
        *section("Scene", *sections.scene(results)),
        *section("Engines", *sections.engines(results)),
        *section("Pairs", sections.every_pair(results)),
        *section("Residuals", sections.every_residual(results)),
        *section("Estimated errors", *sections.estimates(results), limit=LIMIT),
        *section("Parameters", sections.parameters(results)),
        *section("Mechanism", facts(results.mobility, "No facts of the mechanism were computed.")),
        *(section("The paper, checked", *errata) if errata else []),
        *section("How it was compared"),
        *section("Run times", _times(results)),
        *section("Environment", facts(results.environment)),
        *section("Known limitations"),
    ]
    return laid_out(
        f"{results.scene.title or results.scene.name}: verification report",
        [verdict(results), *(Banner(sentence, "Warning:") for sentence in results.warnings)],
        body,
        appendix,
        first=[*sections.worst_three(results), facts(sections.what(results)), *held],
        picture=first,
    )


def _times(results: Comparison) -> Block:
    """Measured stages with what the clock covers."""
    found = [{**asdict(x), "each": number(1e6 * x.median_s / max(x.n_sample, 1), 3)} for x in timings(results)]
    columns = f"{TIMING} | median per sample [µs] = each | covers"
    return table(found, columns) if found else Paragraph("Nothing was timed.")


def terminal(results: Comparison, *, judge: bool = True) -> list[Block]:
    """What ``screwgauge run`` prints: verdict, the worst pair of each quantity and unit, the worst engine of each
    residual of the judge, conditioning."""
    shown: list[Block] = []
    if pairs := _worst(compared(results), "quantity"):
        shown.append(table(pairs, f"quantity | unit | worst pair = pair | {SCALED}"))
    if judged := _worst(rows(results.judge), "residual") if judge else []:
        shown.append(table(judged, f"judge: residual = residual | unit | worst engine = engine | {SCALED}"))
    return [
        verdict(results),
        *(Banner(sentence, "Warning") for sentence in results.warnings),
        *shown,
        *([Banner(sections.conditioning(results), "conditioning")] if results.guard else []),
    ]


def _worst(found: Sequence[Row], key: str) -> list[Row]:
    """Of each key and unit: what is out of tolerance first, then the largest; a missing number is worse than any."""

    def badness(row: Row) -> tuple[bool, float]:
        return not row["ok"], np.inf if np.isnan(row["max_scaled"]) else float(row["max_scaled"])

    worst = [max(group, key=badness) for group in grouped(found, key, "unit").values()]
    return [{**row, "digits": digits_text(row["max_scaled"]).replace("NaN", "-")} for row in worst]


def pictures(results: Comparison) -> list[Picture]:
    """The mechanism, then what engines say of each quantity."""
    from screwgauge.report.figures.run import make_plots

    return [stage(results.scene, results.solutions), *make_plots(results)]


def _errata(results: Comparison) -> list[Block]:
    from screwgauge.report.pages.paper import errata_section  # brings all that measures them

    return errata_section(results.scene)


def write(results: Comparison, out: Path, *, samples: bool = False, errata: bool = False, pdf: bool = False) -> Path:
    """Writes everything, see `screwgauge.report.results.Results.write`."""
    timed = pd.DataFrame(timings(results), columns=list(Timing.__dataclass_fields__))
    tables = results.errors[ERROR_COLUMNS], timed, results.environment, summary(results)
    data = dict(zip(DATA, tables, strict=True)) | ({SAMPLES: samples_table(results)} if samples else {})

    def tell() -> list[Block]:
        return report(results, pictures(results), _errata(results) if errata else ())

    return write_report(out, tell, data, pdf=pdf)
