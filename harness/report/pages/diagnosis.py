"""The report of ``screwgauge diagnose``: differences, their effects, and the proof."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from screwgauge.diagnosis.answer import Diagnosis
from screwgauge.diagnosis.findings import summary
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.shares import STATES
from screwgauge.report.blocks import Banner, Block, Items, Text
from screwgauge.report.figures.diagnosis import has_share, make_plots, share_text
from screwgauge.report.layout import Report
from screwgauge.report.text import terminal
from screwgauge.study.formatting import Row, size


def _banners(diagnosis: Diagnosis) -> list[Banner]:
    """Build banners for the verdict and for unphysical content."""
    return [_banner(diagnosis), *(Banner(sentence, "Warning") for sentence in diagnosis.doubts)]


def _banner(diagnosis: Diagnosis) -> Banner:
    if diagnosis.left_out or diagnosis.exit_status == 3:
        return Banner(diagnosis.headline, "✗ STOPPED" if diagnosis.left_out else "✗ FAILED", "failed")
    if diagnosis.undecided:
        return Banner(diagnosis.headline, "✗ NOT ALL COMPARED", "note")
    return Banner.of(diagnosis.headline, diagnosis.same, "SAME", "DIFFER")


def _differences(diagnosis: Diagnosis) -> list[Row]:
    """Return rows of differences with the number of their cause; empty if every cause is a single difference."""
    if all(len(cause.differences) == 1 for cause in diagnosis.causes):
        return []
    numbers = {i: k for k, cause in enumerate(diagnosis.causes, 1) for i in cause.differences}
    rows = [
        {"number": numbers.get(i, ""), "difference": each.sentence, "kind": each.kind}
        for i, each in enumerate(diagnosis.differences)
    ]
    return sorted(rows, key=lambda row: row["number"] or len(rows) + 1)


def _causes(diagnosis: Diagnosis) -> list[Row]:
    """Return a row for each cause."""
    return [
        {
            "number": k,
            "share": share_text(cause),
            "family": cause.family,
            "cause": cause.sentence,
            "short": cause.short,
            "of": len(cause.differences),
        }
        for k, cause in enumerate(diagnosis.causes, 1)
    ]


def _scale(diagnosis: Diagnosis) -> str:
    """Return a sentence on what the shares refer to; empty if no cause has a share."""
    if not any(map(has_share, diagnosis.causes)):
        return ""
    return (
        f"Each share is the part of the torque difference that the cause alone produces at {STATES} random states, "
        "with torques divided by the largest of the same unit; a negative share partly cancels the others."
    )


def _agreement(diagnosis: Diagnosis) -> list[Row]:
    """Return rows for the torque differences that remain when the readings agree."""
    found = diagnosis.found
    both = found.together.row if found.together is not None else None
    pairs = (("torques of the readings", found.agreement), ("torques of the libraries for the loaded files", both))
    return [{"quantity": name, **asdict(row), "max_abs": row.value} for name, row in pairs if row is not None]


def _torques(diagnosis: Diagnosis) -> list[Row]:
    """Return the torque effects of the differences, largest first."""
    rows = [{"component": name, "change": change} for name, change in diagnosis.found.by_joint if change > 0.0]
    return sorted(rows, key=lambda row: -row["change"])


def _witnesses(diagnosis: Diagnosis) -> list[Row]:
    return [
        {"model": x.side, "library": x.library, "apart": x.failed or size(max(x.scaled.values())), "omits": x.omits}
        for x in diagnosis.found.witnesses
    ]


def _map(diagnosis: Diagnosis) -> list[Row]:
    pair = diagnosis.found.pair
    lines = [(name, pair.partner(name).name, how) for name, how in diagnosis.found.how.items()]
    lines += [("/".join(link.names), "", "only in A") for link in pair.only_a]
    lines += [("", "/".join(link.names), "only in B") for link in pair.only_b]
    return [dict(zip("AB", line, strict=False), by=line[2]) for line in lines]


def _permutation(diagnosis: Diagnosis) -> str:
    order = diagnosis.found.order
    return f"q_b = q_a[{[*order.permutation]}]" if order else ""


def _ignored_content(diagnosis: Diagnosis) -> list[str]:
    """List content that libraries ignore and that `not_compared` does not mention."""
    whats = [(side, what) for side, model in _sides(diagnosis) for what in model.reading.ignored]
    return [f"{what} in {side}" for side, what in whats if f"{what} in {side}" not in diagnosis.not_compared]


def _sides(diagnosis: Diagnosis) -> tuple[tuple[str, Model], tuple[str, Model]]:
    return ("A", diagnosis.a), ("B", diagnosis.b)


def _facts(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        side: f"{Path(m.label).name}{f' (SHA-256 {m.sha256[:8]})' if m.sha256 else ''}, read by {m.library}"
        for side, m in _sides(diagnosis)
    } | {"date": diagnosis.date}


def _file(model: Model) -> str:
    read = f"{model.label}, read by {model.library}"
    read += f", SHA-256 {model.sha256}" if model.sha256 else ""
    return f"{read}; loops of {model.loops}, SHA-256 {model.loops_sha256}" if model.loops else read


def every_difference(diagnosis: Diagnosis) -> str:
    """Format the report and every difference as text."""
    ranked = sorted(diagnosis.differences, key=lambda each: -each.size)
    items = Items(tuple(each.sentence for each in ranked))
    more: list[Block] = [Text("All differences", 2), items] if diagnosis.differences else []
    return terminal([*PAGE.terminal(diagnosis), *more])


PAGE = Report(
    text="diagnosis",
    banner=_banners,
    data={"diagnosis.json": summary},
    values={
        "title": lambda diagnosis: " and ".join(f"{Path(m.label).name} ({m.library})" for _, m in _sides(diagnosis)),
        "about": _facts,
        "differences": _differences,
        "causes": _causes,
        "scale": _scale,
        "agreement": _agreement,
        "torques": _torques,
        "witnesses": _witnesses,
        "map": _map,
        "permutation": _permutation,
        "ignored": _ignored_content,
        "not compared": lambda diagnosis: diagnosis.not_compared,
        "models": lambda diagnosis: {side: _file(m) for side, m in _sides(diagnosis)},
    },
    draw=make_plots,
    plots=lambda diagnosis, pictures: [*pictures],
)
