"""The report of ``screwgauge diagnose``: what differs, what that explains, and the proof."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from screwgauge.diagnosis.attribution import Attribution
from screwgauge.diagnosis.change import Difference
from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.diagnosis.matrix import Matrix
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.static import sorted_by_size
from screwgauge.environment import environment
from screwgauge.report.blocks import Banner, Block, Heading, Items, Paragraph, Picture, Table, facts, folded
from screwgauge.report.formatting import number, size
from screwgauge.report.write import write_report

DATA = ("diagnosis.json", "environment.json")
SCHEMA = 1
_RANKED = 12  # hypotheses that are shown
_SHORT = 3  # columns of the table of differences for which a terminal has room


def terminal(found: Diagnosis) -> list[Block]:
    """What is printed."""
    blocks: list[Block] = [_banner(found)]
    if found.differences:
        whole = _differences(sorted_by_size(found.differences)[:_RANKED])
        blocks.append(Table(whole.head[:_SHORT], tuple(line[:_SHORT] for line in whole.body)))
    if found.rows:
        blocks.append(_rows(found))
    if found.matrix:
        blocks.append(Items(found.matrix.sentences))
    return [*blocks, *([Items(found.notes)] if found.notes else [])]


def report(found: Diagnosis, pictures: Iterable[Picture], record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    blocks: list[Block] = [Heading(f"{_name(found.a)} and {_name(found.b)}", 1), _banner(found)]
    if found.notes:
        blocks.append(Items(found.notes))
    if found.left_out:
        blocks += [Paragraph("There was no time for:"), Items(found.left_out)]
    if found.differences:
        blocks += [Heading("What they say otherwise"), folded("All", _differences(sorted_by_size(found.differences)))]
    if found.rows:
        lead = f"The largest differences at random states (seed {found.seed}), in the terms of A."
        blocks += [Heading("How they move"), Paragraph(lead), _rows(found), *pictures]
    if found.attribution and found.attribution.ranking:
        blocks += [Heading("What explains the torque difference"), *_explained(found.attribution), *_proof(found)]
        blocks += [Paragraph(f"Of the torque difference, {found.growth.sentence}.")] if found.growth else []
    blocks += [Heading("What the libraries compute"), *_witnesses(found)]
    if found.matrix:
        blocks += [Heading("All readings"), *_matrix(found.matrix)]
    return [
        *blocks,
        Heading("Which joint is which"),
        folded("All joints", _map(found)),
        Heading("What was not read"),
        _ignored(found),
        Heading("Files"),
        facts({"A": _file(found.a), "B": _file(found.b)}),
        Heading("Environment"),
        facts(record),
    ]


def summary(found: Diagnosis) -> dict[str, Any]:
    """What ``diagnosis.json`` has."""
    why, proof = found.attribution, found.proof
    return {
        "schema": SCHEMA,
        "verdict": found.verdict,
        "same": found.same,
        "seed": found.seed,
        "models": {side: _facts(model) for side, model in (("A", found.a), ("B", found.b))},
        "map": {"joints": found.pairing.joints, "how": found.pairing.how, "bodies": found.pairing.bodies},
        "missing": {"in_b": found.pairing.only_a, "in_a": found.pairing.only_b},
        "differences": [_difference(each) for each in found.differences],
        "dynamics": [asdict(row) for row in found.rows],
        "loops": found.loops and asdict(found.loops),
        "growth": found.growth and asdict(found.growth),
        "attribution": why and _attribution(why),
        "soft_equalities": found.soft and _attribution(found.soft),
        "backfill": proof and {"on": proof.on, "left": asdict(proof.left), "why_not": proof.why_not},
        "libraries": [asdict(witness) for witness in found.witnesses],
        "matrix": found.matrix and asdict(found.matrix),
        "notes": found.notes,
        "left_out": found.left_out,
    }


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


def _name(model: Model) -> str:
    return f"{Path(model.label).name} ({model.library})"


def _differences(found: Sequence[Difference]) -> Table:
    lines = [
        (each.what, item, each.sentence.removeprefix(f"{item}: "), size(each.size), each.kind)
        for each in found
        for item in (each.item_a or each.item_b,)
    ]
    return Table(("what", "of", "difference", "relative", "kind"), tuple(lines))


def _rows(found: Diagnosis) -> Table:
    lines = ((row.quantity, row.worst, size(row.max_abs), row.unit, size(row.scaled)) for row in found.rows)
    return Table(("quantity", "worst in", "difference", "unit", "scaled"), tuple(lines))


def _explained(why: Attribution) -> list[Block]:
    ranking = tuple((hypothesis.name, f"{100.0 * share:.4f} %") for hypothesis, share in why.ranking[:_RANKED])
    taken = [f"{step.hypothesis.name}: {100.0 * step.share:.4f} % with all before it" for step in why.steps]
    lead = Paragraph("Each change alone, by the share of the torque difference that goes when B has it:")
    table = Table(("change", "share"), ranking)
    blocks: list[Block] = [lead, table]
    return [*blocks, Paragraph("Taken one after the other:"), Items(tuple(taken))] if taken else blocks


def _proof(found: Diagnosis) -> list[Block]:
    proof = found.proof
    if proof is None:
        return []
    where = "file, read again" if proof.on == "file" else "reading"
    left = f"{number(proof.left.value, 2)} {proof.left.unit}, {size(proof.left.scaled)} of the largest"
    said = Paragraph(f"With the changes made in a copy of B's {where}, {left}, are left.")
    more: list[Block] = [Items(proof.why_not)] if proof.why_not else []
    return [said, *more]


def _witnesses(found: Diagnosis) -> list[Block]:
    if not found.witnesses:
        return [Paragraph("No library with dynamics reads these.")]
    lines = [
        (
            witness.side,
            witness.library,
            witness.failed or size(max(witness.scaled.values())),
            ", ".join(witness.omits) or "nothing",
        )
        for witness in found.witnesses
    ]
    lead = "How far each library's own dynamics are from those that follow from what it has read."
    return [Paragraph(lead), Table(("model", "library", "scaled difference", "leaves out"), tuple(lines))]


def _matrix(matrix: Matrix) -> list[Block]:
    cells = tuple(
        (c.side, c.library, c.refused or str(c.freedoms), str(c.bodies), number(c.mass)) for c in matrix.cells
    )
    pairs = tuple(
        (f"{p.first[0]} {p.first[1]}", f"{p.second[0]} {p.second[1]}", p.kind, "; ".join(p.differences) or "none")
        for p in matrix.pairs
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


def _facts(model: Model) -> dict[str, Any]:
    return {
        "file": model.label,
        "library": model.library,
        "sha256": model.sha256,
        "digits": model.digits,
        "joints": len(model.reading.joints),
        "bodies": len(model.reading.bodies),
        "mass": model.reading.mass,
        "ignored": model.reading.ignored,
    }


def _attribution(why: Attribution) -> dict[str, Any]:
    return {
        "before": asdict(why.before),
        "left": asdict(why.left),
        "share": why.share,
        "steps": [
            {"hypothesis": step.hypothesis.name, "share": step.share, "alike": [h.name for h in step.alike]}
            for step in why.steps
        ],
        "ranking": [{"hypothesis": hypothesis.name, "share": share} for hypothesis, share in why.ranking],
    }


def _difference(each: Difference) -> dict[str, Any]:
    plain = {key: getattr(each, key) for key in ("item_a", "item_b", "what", "unit", "size", "kind", "sentence")}
    return {**plain, "a": each.a, "b": each.b}
