"""The report of ``screwgauge diagnose``: what differs, what that explains, and the proof."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from screwgauge.diagnosis.compare import STATES
from screwgauge.diagnosis.diagnose import Diagnosis, summary
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.differences.static import sorted_by_size
from screwgauge.diagnosis.model import Model
from screwgauge.report.blocks import Banner, Block, Heading, Items
from screwgauge.report.figures.diagnosis import make_plots, share_text
from screwgauge.report.layout import Report
from screwgauge.report.text import terminal
from screwgauge.study.formatting import Row, number, size, unit_text


def _banners(diagnosis: Diagnosis) -> list[Banner]:
    """The verdict, and what no machine has."""
    return [_banner(diagnosis), *(Banner(sentence, "Warning") for sentence in diagnosis.doubts)]


def _banner(diagnosis: Diagnosis) -> Banner:
    if diagnosis.left_out or diagnosis.exit_status == 3:
        return Banner(diagnosis.headline, "✗ STOPPED" if diagnosis.left_out else "✗ FAILED", "failed")
    if diagnosis.undecided:
        return Banner(diagnosis.headline, "✗ NOT ALL COMPARED", "note")
    return Banner.of(diagnosis.headline, diagnosis.same, "SAME", "DIFFER")


def _differences(diagnosis: Diagnosis) -> list[Row]:
    """Each one, by the number of its cause; none where the causes are the differences."""
    causes = {i: k for k, cause in enumerate(diagnosis.causes, 1) for i in cause.differences}

    def line(i: int, each: Difference) -> Row:
        item = each.item_a or each.item_b
        sentence = each.sentence.removeprefix(f"{item}: ")
        return {"number": causes.get(i, ""), "of": item, "difference": sentence, "kind": each.kind}

    if {cause.sentence for cause in diagnosis.causes} == {each.sentence for each in diagnosis.differences}:
        return []
    lines = [line(i, each) for i, each in enumerate(diagnosis.differences)]
    return sorted(lines, key=lambda row: row["number"] or len(lines) + 1)


TORQUES = "inverse dynamics"


def _causes(diagnosis: Diagnosis) -> list[Row]:
    """A row for each cause."""
    return [
        {
            "number": k,
            "share": share_text(cause),
            "cause": cause.sentence,
            "short": cause.short,
            "of": len(cause.differences),
        }
        for k, cause in enumerate(diagnosis.causes, 1)
    ]


def _scale(diagnosis: Diagnosis) -> str:
    """What shares are of."""
    if diagnosis.attribution is None or not diagnosis.attribution.seen:
        return ""
    rows = (row for row in diagnosis.rows if row.quantity == TORQUES)
    most = next((f", at most {number(row.max_abs, 3)} {unit_text(row.unit)}" for row in rows), "")
    rests = any(not math.isnan(cause.of_rest) for cause in diagnosis.causes)
    rest = "; those of the rest are of what is left when the causes before are put right" if rests else ""
    return (
        f"Shares are of the torque difference at {STATES} random states{most}, torques of each unit over the largest "
        f"of it; a negative one partly cancels the others{rest}."
    )


def _proof(diagnosis: Diagnosis) -> str:
    """What is left when all changes are made."""
    if diagnosis.proof is None:
        return ""
    left, where = diagnosis.proof.left, "file, read again" if diagnosis.proof.on == "file" else "reading"
    amount = f"{number(left.value, 2)} {unit_text(left.unit)}, {size(left.scaled)} of the largest"
    return f"With the changes made in a copy of B's {where}, {amount}, are left."


def _witnesses(diagnosis: Diagnosis) -> list[Row]:
    return [
        {"model": x.side, "library": x.library, "apart": x.failed or size(max(x.scaled.values())), "omits": x.omits}
        for x in diagnosis.witnesses
    ]


def _map(diagnosis: Diagnosis) -> list[Row]:
    pairing = diagnosis.pairing
    lines = [(name, other, pairing.how[name]) for name, other in pairing.joints.items()]
    lines += [(name, "", "only in A") for name in pairing.only_a] + [("", name, "only in B") for name in pairing.only_b]
    return [dict(zip("AB", line, strict=False), by=line[2]) for line in lines]


def _ignored(diagnosis: Diagnosis) -> list[str]:
    """Content that libraries ignore, without what the list of things not compared has."""
    whats = [(side, what) for side, model in _sides(diagnosis) for what in model.reading.ignored]
    return [f"{what} in {side}" for side, what in whats if f"{what} in {side}" not in diagnosis.not_compared]


def _sides(diagnosis: Diagnosis) -> tuple[tuple[str, Model], tuple[str, Model]]:
    return ("A", diagnosis.a), ("B", diagnosis.b)


def _about(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        side: f"{Path(m.label).name}{f' (SHA-256 {m.sha256[:8]})' if m.sha256 else ''}, read by {m.library}"
        for side, m in _sides(diagnosis)
    } | {"date": diagnosis.date}


def _file(model: Model) -> str:
    read = f"{model.label}, read by {model.library}"
    read += f", SHA-256 {model.sha256}" if model.sha256 else ""
    return f"{read}; loops of {model.loops}, SHA-256 {model.loops_sha256}" if model.loops else read


def every_difference(diagnosis: Diagnosis) -> str:
    """What is printed, and each difference."""
    items = Items(tuple(each.sentence for each in sorted_by_size(diagnosis.differences)))
    more: list[Block] = [Heading("All differences"), items] if diagnosis.differences else []
    return terminal([*PAGE.terminal(diagnosis), *more])


PAGE = Report(
    text="diagnosis",
    banner=_banners,
    data={"diagnosis.json": summary},
    values={
        "title": lambda diagnosis: " and ".join(f"{Path(m.label).name} ({m.library})" for _, m in _sides(diagnosis)),
        "about": _about,
        "differences": _differences,
        "causes": _causes,
        "scale": _scale,
        "proof": _proof,
        "rows alone": lambda diagnosis: () if diagnosis.differences else diagnosis.rows,
        "witnesses": _witnesses,
        "map": _map,
        "permutation": lambda diagnosis: f"q_b = q_a[{[*diagnosis.order.permutation]}]" if diagnosis.order else "",
        "ignored": _ignored,
        "not compared": lambda diagnosis: diagnosis.not_compared,
        "models": lambda diagnosis: {side: _file(m) for side, m in _sides(diagnosis)},
    },
    draw=make_plots,
    plots=lambda diagnosis, pictures: [*pictures],
)
