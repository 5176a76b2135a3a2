"""The page of a gate, and its files for CI services."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.judging.residual import JUDGE
from screwgauge.reference.errors import OutputError, first_few
from screwgauge.reference.files import why
from screwgauge.reference.outputs import save_file
from screwgauge.report.blocks import Banner, Picture, Text
from screwgauge.report.figures.run import pair_picture
from screwgauge.report.layout import Report
from screwgauge.report.left_out import additions
from screwgauge.report.text import markdown, terminal
from screwgauge.report.verdict import verdict
from screwgauge.report.write import Shown
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import digits_text, error_ratio, file_name, number, size
from screwgauge.study.gate.check import SHOWN, Check
from screwgauge.study.gate.check import check_with as check_items_with
from screwgauge.study.gate.items import GateRow
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.outcome import Outcome
from screwgauge.study.runner import Executor

#: Environment variable with the name of the file to which GitHub expects a job's summary to be appended.
SUMMARY = "GITHUB_STEP_SUMMARY"
WORDS: dict[Outcome, str] = {
    "agree": "✓ ok",
    "judged": "✓ judged",
    "unread": "✗ not read",
    "rigid": "✗ inertia left out",
    "unlike": "✗ models differ",
    "undecided": "✗ not decided",
    "partly": "✗ partly",
    "unjudged": "✗ not judged",
    "nothing": "✗ nothing compared",
    "faulted": "✗ out of tolerance",
    "differ": "✗ differ",
    "refused": "✗ refused",
    "failed": "✗ failed",
}


def _banners(check: Check) -> list[Banner]:
    """Return the verdict banner, and warnings about implausible models."""
    odd = [(row.scene, sentence) for row in check.rows for sentence in row.doubts]
    odd += [(row.scene, f"{row.more}.") for row in check.rows if row.more and row.ok]
    odd += [(row.scene, f"{sentence}.") for row in check.rows for sentence in row.remarks]
    return [_banner(check), *(Banner(f"{scene}: {sentence}", "Warning") for scene, sentence in odd)]


def _banner(check: Check) -> Banner:
    sentences = [f"{sum(row.ok for row in check.rows)} of {len(check.rows)} pass."]
    agree = [row for row in check.rows if row.status == "agree"]
    alone = [row.scene for row in check.rows if row.status == "judged"]
    judged = {any(error.b == JUDGE for error in row.errors) for row in agree}  # pairs of models are not judged
    if check.ok and judged == {True}:
        each = "In each of them" if not alone else "In the others" if len(agree) > 1 else f"In {agree[0].scene}"
        sentences.append(f"{each} all engines agree within tolerance, and the equations of mechanics hold.")
    elif check.ok and agree:
        sentences.append(f"Models {'and engines ' * (True in judged)}agree within tolerance.")
    if check.ok and alone:
        named = first_few(alone, SHOWN)
        sentences.append(
            f"Nothing was compared in {named}: one engine ran, and its results satisfy the equations of mechanics."
        )
    larger = [row.scene for row in check.rows if row.more and row.ok]
    if check.ok and larger:
        sentences.append(f"Only the rigid machine of {first_few(larger, SHOWN)} is compared: some forces are omitted.")
    sentences += filter(None, [check.left_alone])
    qualified = alone or larger or check.unread or any(row.admitted or row.doubts for row in check.rows)
    return Banner.of(" ".join(sentences), check.ok, "OK, but" if qualified else "OK", "FAILED")


def _admitted_differences(check: Check) -> list[str]:
    """List the allowed differences and their scenes."""
    scenes: dict[str, list[str]] = {}
    for row in check.rows:
        for each in row.admitted:
            scenes.setdefault(each, []).append(row.scene)
    return [f"{each} ({first_few(names, SHOWN)})" for each, names in scenes.items()]


def _lines(rows: Iterable[GateRow]) -> list[dict[str, Any]]:
    """Return a table row for each scene or pair, with its status and worst error."""
    nothing = dict.fromkeys(("quantity", "error", "digits", "tolerance", "reason"))
    lines = []
    for row in rows:
        worst = {**asdict(row.worst), "digits": digits_text(row.worst.error)} if row.worst else nothing
        scaled = size(row.worst.error) if row.worst else ""
        about = {"scene": row.scene, "word": WORDS[row.status], "took": f"{row.seconds:.1f} s"}
        lines.append({**worst, **about, "scaled": scaled})
    return lines


def _rows(check: Check) -> list[dict[str, Any]]:
    """Return rows for tables, sorted: failed rows first, then those closest to their tolerance."""

    def order(row: GateRow) -> tuple[bool, float]:
        return row.ok, -error_ratio(row.worst.error, row.worst.tolerance) if row.worst else 0.0

    return _lines(sorted(check.rows, key=order))


def _pictures(check: Check) -> list[Picture]:
    """Draw the worst component of each failed pair, with the values of both engines."""
    bad, drawn = [(row, row.worst) for row in check.rows if row.worst and row.curve], list[Picture]()
    for i, (row, worst) in enumerate(bad[:SHOWN], 1):
        title = f"{row.scene}: {worst.quantity} at {worst.component}"
        drawn.append(pair_picture(f"{i:02d}-{file_name(row.scene)}", title, worst, np.array(row.curve)))
    return drawn


def _facts(check: Check) -> dict[str, Any]:
    """Return the facts for the top of the page, such as the number of scenes, engines, files and date."""
    engines = dict.fromkeys(f"{name} {version}".strip() for row in check.rows for name, version in row.versions.items())
    files = [f"{name} (SHA-256 {digest.removeprefix('SHA-256 ')[:8]})" for name, digest in _files(check).items()]
    return {
        "scenes and pairs": len(check.rows),
        "motion": "a few samples of an exciting motion" if check.smoke else "the motion of each scene or pair",
        "duration": f"{sum(row.seconds for row in check.rows):.1f} s for all scenes together",
        "engines": ", ".join(engines),
        "files": first_few(files, SHOWN) + (", see Environment" if len(files) > SHOWN else ""),
        "date": check.date,
    }


def _files(check: Check) -> dict[str, str]:
    """Return the owner of each file -> the hash of the file."""
    return {f"{row.scene}: {of}": f"SHA-256 {digest}" for row in check.rows for of, digest in row.files.items()}


def _tolerances(check: Check) -> list[str]:
    """List the largest tolerance of each quantity, by the source of the tolerance."""
    by: dict[str, dict[str, float]] = {}
    for one in (error for row in check.rows for error in row.errors):
        sizes = by.setdefault(one.reason, {})
        sizes[one.quantity] = max(sizes.get(one.quantity, 0.0), one.tolerance)
    return [f"{why}: {', '.join(f'{name} {number(x, 2)}' for name, x in of.items())}" for why, of in by.items()]


class CheckReport(Shown, Check):
    """A check with its report, which notebooks display."""

    __slots__ = ()

    def markdown(self) -> str:
        """Render the summary of a CI job."""
        return markdown([Text("Screwgauge", 2), *self._screen()])

    def __repr__(self) -> str:
        return terminal(self._screen())

    def _report(self) -> Report:
        return PAGE


class _Page(Report):
    """A report with additional files for CI services."""

    def write(
        self,
        results: CheckReport,
        out: Path,
        *,
        junit: Path | None = None,
        baseline: Path | None = None,
        force: bool = False,
        **writing: Any,
    ) -> Path:
        """Write ``check.json``, the report and ``environment.json``; on request, a JUnit file and a baseline.

        Append the job's summary to the file that the environment variable `SUMMARY` names.
        """
        if junit is not None:
            save_file(junit, results.junit(), force=force)
        if summary := os.environ.get(SUMMARY):
            try:
                with Path(summary).open("a", encoding="utf-8") as file:
                    file.write(results.markdown())
            except OSError as error:
                what = f"cannot be written ({why(error)})"
                raise OutputError(what, f"{SUMMARY}, {summary}", "unset it, or set it to a file") from error
        super().write(results, out, force=force, **writing)
        if baseline is not None:
            results.write_baseline(baseline, force=force)
        return out


PAGE = _Page(
    text="check",
    banner=_banners,
    data={"check.json": lambda check: check.record},
    values={
        "title": lambda check: f"Check of {first_few([row.scene for row in check.rows], 3)}",
        "about": _facts,
        "files": _files,
        "rows": _rows,
        "tolerances": _tolerances,
        "unread": lambda check: [*check.unread],
        "admitted": _admitted_differences,
        "tested": lambda check: [f"{row.scene}: {row.coverage or row.sentence}" for row in check.rows if row.ok],
    },
    draw=_pictures,
)


def sentence_of(results: Comparison) -> str:
    """Return the verdict of a comparison as a sentence."""
    banner = verdict(results)
    return f"{banner.word}: {banner.text}"


def check_with(
    execute: Executor, what: Sequence[str | Path], *, smoke: bool = False, meshes: bool = False, **options: Any
) -> CheckReport:
    """Check scenes or pairs of models and add a report; for options see `study.gate.check`."""
    settings = GateSettings(sentence_of, smoke, more=additions, meshes=meshes)
    return CheckReport.of(check_items_with(execute, what, settings, **options))
