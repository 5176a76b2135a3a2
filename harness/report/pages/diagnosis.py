"""The report of ``screwgauge diagnose``: what differs, what that explains, and the proof."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from screwgauge.diagnosis.causes.attribution import Attribution
from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.diagnosis.differences.change import Difference
from screwgauge.diagnosis.differences.static import sorted_by_size
from screwgauge.diagnosis.matrix import Matrix
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.record import summary
from screwgauge.environment import environment
from screwgauge.report.blocks import Banner, Block, Folded, Heading, Items, Paragraph, Picture, Table, facts, folded
from screwgauge.report.formatting import number, size, unit_text
from screwgauge.report.layout import laid_out
from screwgauge.report.write import write_report

DATA = ("diagnosis.json", "environment.json")
_RANKED = 12  # hypotheses that are shown
_SHORT = 3  # columns of the table of differences for which a terminal has room

__all__ = ["DATA", "report", "summary", "terminal", "write"]


def terminal(found: Diagnosis) -> list[Block]:
    """What is printed."""
    blocks: list[Block] = [_banner(found)]
    if found.differences:
        blocks.append(_differences(sorted_by_size(found.differences)[:_RANKED], _SHORT))
    blocks += [_rows(found)] if found.rows else []
    blocks += [Items(found.matrix.sentences)] if found.matrix else []
    return [*blocks, *([Items(found.notes)] if found.notes else [])]


def report(found: Diagnosis, pictures: Iterable[Picture], record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    largest = sorted_by_size(found.differences)
    body: list[Block] = [Paragraph("There was no time for:"), Items(found.left_out)] if found.left_out else []
    if largest:
        body += [Heading("What they say otherwise"), folded(f"All {len(largest)}", _differences(largest))]
    if found.attribution and found.attribution.ranking:
        body += [Heading("What explains the torque difference"), *_explained(found, found.attribution)]
        body += [Paragraph(f"Of the torque difference, {found.growth.sentence}.")] if found.growth else []
    if found.rows:
        lead = f"The largest differences at random states (seed {found.seed}), in the terms of A."
        plots = (Folded(picture.title, (picture,)) for picture in pictures)
        body += [Heading("How they move"), Paragraph(lead), _rows(found), *plots]
    body += [Heading("What the libraries compute"), *_witnesses(found)]
    body += [Heading("All readings"), *_matrix(found.matrix)] if found.matrix else []
    appendix: list[Block] = [
        *((Heading("Notes"), Items(found.notes)) if found.notes else ()),
        *(Heading("Which joint is which"), _map(found)),
        *(Heading("What was not read"), _ignored(found)),
        *(Heading("Files"), facts({"A": _file(found.a), "B": _file(found.b)})),
        *(Heading("Environment"), facts(record)),
    ]
    packages = record.get("packages", {})
    judged = {
        side: f"{Path(m.label).name}{f' (SHA-256 {m.sha256[:8]})' if m.sha256 else ''}, read by {m.library}"
        for side, m in (("A", found.a), ("B", found.b))
    } | {"versions": ", ".join(f"{name} {packages[name]}" for name in ("pin", "mujoco") if name in packages)}
    first = [_differences(largest[:3], _SHORT)] if largest else [_rows(found)] if found.rows else []
    title = " and ".join(f"{Path(m.label).name} ({m.library})" for m in (found.a, found.b))
    return laid_out(title, [_banner(found)], body, appendix, first=[*first, facts(judged)])


def write(found: Diagnosis, out: Path) -> Path:
    """Writes ``diagnosis.json``, the report with its plots, and ``environment.json``."""
    from screwgauge.report.figures.diagnosis import make_plots

    record = environment()
    data = dict(zip(DATA, (summary(found), record), strict=True))
    return write_report(out, lambda: report(found, make_plots(found), record), data)


def _banner(found: Diagnosis) -> Banner:
    if found.left_out:
        return Banner(found.verdict, "✗ STOPPED", "failed")
    if found.exit_status == 3:
        return Banner(found.verdict, "✗ FAILED", "failed")
    return Banner(found.verdict, "✓ SAME", "agree") if found.same else Banner(found.verdict, "✗ DIFFER", "differ")


def _differences(found: Sequence[Difference], columns: int = 5) -> Table:
    head = ("what", "of", "difference", "relative", "kind")[:columns]
    lines = (
        (each.what, item, each.sentence.removeprefix(f"{item}: "), size(each.size), each.kind)
        for each in found
        for item in (each.item_a or each.item_b,)
    )
    return Table(head, tuple(line[:columns] for line in lines))


def _rows(found: Diagnosis) -> Table:
    lines = ((x.quantity, x.worst, size(x.max_abs), unit_text(x.unit), size(x.scaled)) for x in found.rows)
    return Table(("quantity", "worst in", "difference", "unit", "scaled"), tuple(lines))


def _explained(found: Diagnosis, why: Attribution) -> list[Block]:
    """What each change explains, alone and after others, and what is left when all are made."""
    proof = found.proof
    ranking = tuple((hypothesis.name, f"{100.0 * share:.4f} %") for hypothesis, share in why.ranking[:_RANKED])
    taken = tuple(f"{step.hypothesis.name}: {100.0 * step.share:.4f} % with all before it" for step in why.steps)
    lead = Paragraph("Each change alone, by the share of the torque difference that goes when B has it:")
    told: list[Block] = [lead, Table(("change", "share"), ranking)]
    told += [Folded("Taken one after the other", (Items(taken),))] if taken else []
    if proof is not None:
        where = "file, read again" if proof.on == "file" else "reading"
        left = f"{number(proof.left.value, 2)} {unit_text(proof.left.unit)}, {size(proof.left.scaled)} of the largest"
        told.append(Paragraph(f"With the changes made in a copy of B's {where}, {left}, are left."))
        told += [Items(proof.why_not)] if proof.why_not else []
    return told


def _witnesses(found: Diagnosis) -> list[Block]:
    if not found.witnesses:
        return [Paragraph("No library with dynamics reads these.")]
    lines = tuple(
        (x.side, x.library, x.failed or size(max(x.scaled.values())), ", ".join(x.omits) or "nothing")
        for x in found.witnesses
    )
    lead = "How far each library's own dynamics are from those that follow from what it has read."
    return [Paragraph(lead), Table(("model", "library", "scaled difference", "leaves out"), lines)]


def _matrix(matrix: Matrix) -> list[Block]:
    cells = tuple(
        (c.side, c.library, c.refused or str(c.freedoms), str(c.bodies), number(c.mass)) for c in matrix.cells
    )
    pairs = tuple(
        (" ".join(p.first), " ".join(p.second), p.kind, "; ".join(p.differences) or "none") for p in matrix.pairs
    )
    return [
        Items(matrix.sentences),
        Table(("model", "library", "degrees of freedom", "bodies", "mass [kg]"), cells),
        Table(("one", "other", "what differs is", "differences"), pairs),
    ]


def _map(found: Diagnosis) -> Table:
    pairing = found.pairing
    lines = [(name, other, pairing.how[name]) for name, other in pairing.joints.items()]
    lines += [(name, "", "only in A") for name in pairing.only_a] + [("", name, "only in B") for name in pairing.only_b]
    return Table(("A", "B", "by"), tuple(lines))


def _ignored(found: Diagnosis) -> Block:
    said = [f"{side}: {what}" for side, m in (("A", found.a), ("B", found.b)) for what in m.reading.ignored]
    return Items(tuple(said)) if said else Paragraph("Nothing that the libraries or this comparison would pass over.")


def _file(model: Model) -> str:
    read = f"{model.label}, read by {model.library}"
    return f"{read}, SHA-256 {model.sha256}" if model.sha256 else read
