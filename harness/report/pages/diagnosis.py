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
from screwgauge.report.formatting import Row, number, size, unit_text
from screwgauge.report.layout import Report
from screwgauge.report.text import terminal


def _banners(found: Diagnosis) -> list[Banner]:
    """The verdict, and what no machine has."""
    return [_banner(found), *(Banner(sentence, "Warning") for sentence in found.doubts)]


def _banner(found: Diagnosis) -> Banner:
    if found.left_out or found.exit_status == 3:
        return Banner(found.headline, "✗ STOPPED" if found.left_out else "✗ FAILED", "failed")
    if found.undecided:
        return Banner(found.headline, "✗ NOT ALL COMPARED", "note")
    return Banner.of(found.headline, found.same, "SAME", "DIFFER")


def _differences(found: Diagnosis) -> list[Row]:
    """Each one, by the number of its cause; none where the causes are the differences."""
    causes = {i: k for k, cause in enumerate(found.causes, 1) for i in cause.differences}

    def line(i: int, each: Difference) -> Row:
        item = each.item_a or each.item_b
        said = each.sentence.removeprefix(f"{item}: ")
        return {"number": causes.get(i, ""), "of": item, "difference": said, "kind": each.kind}

    if {cause.sentence for cause in found.causes} == {each.sentence for each in found.differences}:
        return []
    lines = [line(i, each) for i, each in enumerate(found.differences)]
    return sorted(lines, key=lambda row: row["number"] or len(lines) + 1)


TORQUES = "inverse dynamics"


def _causes(found: Diagnosis) -> list[Row]:
    """A row for each cause."""
    return [
        {
            "number": k,
            "share": share_text(cause),
            "cause": cause.sentence,
            "short": cause.short,
            "of": len(cause.differences),
        }
        for k, cause in enumerate(found.causes, 1)
    ]


def _scale(found: Diagnosis) -> str:
    """What shares are of."""
    if found.attribution is None or not found.attribution.seen:
        return ""
    rows = (row for row in found.rows if row.quantity == TORQUES)
    most = next((f", at most {number(row.max_abs, 3)} {unit_text(row.unit)}" for row in rows), "")
    rests = any(not math.isnan(cause.of_rest) for cause in found.causes)
    rest = "; those of the rest are of what is left when the first cause is put right" if rests else ""
    return (
        f"Shares are of the torque difference at {STATES} random states{most}, torques of each unit over the largest "
        f"of it; a negative one makes up for others{rest}."
    )


def _proof(found: Diagnosis) -> str:
    """What is left when all changes are made."""
    if found.proof is None:
        return ""
    left, where = found.proof.left, "file, read again" if found.proof.on == "file" else "reading"
    amount = f"{number(left.value, 2)} {unit_text(left.unit)}, {size(left.scaled)} of the largest"
    return f"With the changes made in a copy of B's {where}, {amount}, are left."


def _witnesses(found: Diagnosis) -> list[Row]:
    return [
        {"model": x.side, "library": x.library, "apart": x.failed or size(max(x.scaled.values())), "omits": x.omits}
        for x in found.witnesses
    ]


def _map(found: Diagnosis) -> list[Row]:
    pairing = found.pairing
    lines = [(name, other, pairing.how[name]) for name, other in pairing.joints.items()]
    lines += [(name, "", "only in A") for name in pairing.only_a] + [("", name, "only in B") for name in pairing.only_b]
    return [dict(zip("AB", line, strict=False), by=line[2]) for line in lines]


def _ignored(found: Diagnosis) -> list[str]:
    """What libraries pass over, but for what is said not to be compared."""
    whats = [(side, what) for side, model in _sides(found) for what in model.reading.ignored]
    return [f"{what} in {side}" for side, what in whats if f"{what} in {side}" not in found.not_compared]


def _sides(found: Diagnosis) -> tuple[tuple[str, Model], tuple[str, Model]]:
    return ("A", found.a), ("B", found.b)


def _about(found: Diagnosis) -> dict[str, Any]:
    return {
        side: f"{Path(m.label).name}{f' (SHA-256 {m.sha256[:8]})' if m.sha256 else ''}, read by {m.library}"
        for side, m in _sides(found)
    } | {"date": found.date}


def _file(model: Model) -> str:
    read = f"{model.label}, read by {model.library}"
    read += f", SHA-256 {model.sha256}" if model.sha256 else ""
    return f"{read}; loops of {model.loops}, SHA-256 {model.loops_sha256}" if model.loops else read


def every_difference(found: Diagnosis) -> str:
    """What is printed, and each difference."""
    said = Items(tuple(each.sentence for each in sorted_by_size(found.differences)))
    more: list[Block] = [Heading("All differences"), said] if found.differences else []
    return terminal([*PAGE.terminal(found), *more])


PAGE = Report(
    text="diagnosis",
    banner=_banners,
    data={"diagnosis.json": summary},
    values={
        "title": lambda found: " and ".join(f"{Path(m.label).name} ({m.library})" for _, m in _sides(found)),
        "about": _about,
        "differences": _differences,
        "largest": lambda found: _causes(found)[:3] if len(found.causes) > 1 else [],
        "causes": _causes,
        "scale": _scale,
        "proof": _proof,
        "growth": lambda found: (
            found.growth.sentence if found.growth and found.attribution and found.attribution.seen else ""
        ),
        "rows alone": lambda found: () if found.differences else found.rows,
        "witnesses": _witnesses,
        "map": _map,
        "permutation": lambda found: f"q_b = q_a[{[*found.order.permutation]}]" if found.order else "",
        "ignored": _ignored,
        "not compared": lambda found: found.not_compared,
        "models": lambda found: {side: _file(m) for side, m in _sides(found)},
    },
    draw=make_plots,
    plots=lambda found, pictures: [*pictures],
)
