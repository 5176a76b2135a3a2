"""Sections of a run's report: pairs, judge, estimated errors, scene, engines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from screwgauge.judging.conditioning import Guarded
from screwgauge.reference.applied import Load
from screwgauge.report.blocks import Block, Folded, Items, Paragraph, Table, cross_table, facts, folded, table
from screwgauge.report.formatting import Row, digits_text, grouped, listed, missing, number, rows, size, vector, words
from screwgauge.report.pages.simulation import acting, simulated
from screwgauge.report.verdict import compared
from screwgauge.solution import REFERENCE, Solution
from screwgauge.study.comparison import Comparison

PAIR = "quantity | unit | a | b | max abs | rms | max scaled | tolerance | worst at | rule | unique | within = ok"
JUDGE = "engine | residual | unit | max abs | max scaled | tolerance | worst at | within = ok"


def _with_reason(found: list[Row], columns: str) -> Table:
    return table(found, f"{columns} | reason" if any(row.get("reason") for row in found) else columns)


def _worst_at(row: Row) -> str:
    component = row.get("worst_component")
    if missing(component) or not component:
        return "-"
    return str(component) if missing(row["worst_t"]) else f"{component} @ {number(row['worst_t'])} s"


def _marked(text: str, row: Row) -> str:
    return text if row["ok"] else f"{text} ✗"


def overview(results: Comparison) -> list[Block]:
    """Quantity by pair of engines: digits of agreement, beside those that the tolerance asks for."""
    found = []
    for (quantity, _), group in grouped(compared(results), "quantity", "unit").items():
        tolerances = [row["tolerance"] for row in group]
        needed = " to ".join(dict.fromkeys(digits_text(end(tolerances)) for end in (max, min)))
        for row in group:
            reached = _marked(digits_text(row["max_scaled"]).replace("NaN", "no number"), row)
            found.append({**row, "quantity": words(quantity), "needed": needed, "reached": reached})
    if not found:
        return [Paragraph("Fewer than two engines ran: there are no pairs, only the judge's residuals below.")]
    across = cross_table(found, "digits of agreement = quantity | unit | needed", "pair", "reached")
    return [across, Paragraph("✗ marks what is out of tolerance.")]


def every_pair(results: Comparison) -> list[Block]:
    """All pairs; those out of tolerance apart and first."""
    found = [
        {**row, "worst_at": _worst_at(row), "rule": row["rule"] or "-", "unique": "yes" if row["unique"] else "no"}
        for row in rows(results.pairs)
    ]
    if not found:
        return [Paragraph("No pairs: one engine has nothing to be compared with.")]
    bad, every = [row for row in found if not row["ok"]], folded(f"All {len(found)} pairs", _with_reason(found, PAIR))
    return [Paragraph("**Out of tolerance**"), _with_reason(bad, PAIR), every] if bad else [every]


def judge(results: Comparison) -> list[Block]:
    """Residuals of each engine against the equations themselves: residual by engine, then all of it."""
    found = [
        {**row, "worst_at": _worst_at(row), "cell": _marked(size(row["max_scaled"]), row)}
        for row in rows(results.judge)
    ]
    if not found:
        return [Paragraph("Nothing was judged: no engine gives joint positions or its assembly.")]
    across = cross_table(found, "residual, scaled = residual | unit", "engine", "cell")
    return [across, folded(f"All {len(found)} residuals", _with_reason(found, JUDGE))]


def coverage(results: Comparison) -> list[Block]:
    """What the scene could have seen: share of the terms in each quantity, and from which error on parameters show."""
    found = results.coverage
    blocks: list[Block] = [Paragraph(found.sentence)]
    if found.shares:
        cells = [{**row, "quantity": words(row["quantity"]), "cell": _percent(row["share"])} for row in found.shares]
        blocks.append(cross_table(cells, "largest term = quantity | unit", "term", "cell"))
    if found.parameters:
        listed_rows = [
            {**row, "shows": _percent(row["smallest"]) if row["tested"] else "not tested"} for row in found.parameters
        ]
        ordered = sorted(listed_rows, key=lambda row: -row["smallest"])
        blocks.append(Folded(f"All {len(ordered)} parameters", (table(ordered, "parameter | shows from = shows"),)))
    return blocks


def _percent(share: float) -> str:
    return f"{number(100.0 * share, 3)} %"


def estimates(results: Comparison) -> list[Block]:
    """Estimated error of each quantity of each engine."""

    def cell(row: Guarded) -> str:
        mark = "" if row.ok else f" ✗ ({row.flagged} of {row.n_sample}, t = {number(row.worst_t)} s)"
        return f"{_estimate(row)}, condition {size(row.condition)}{mark}"

    found = [{"quantity": words(row.quantity), "engine": row.engine, "cell": cell(row)} for row in results.guard]
    if not found:
        return [Paragraph("No engine estimated its errors.")]
    across = cross_table(found, "estimated error = quantity", "engine", "cell")
    return [across, Paragraph("✗ marks what has flagged samples.")]


def _estimate(row: Guarded) -> str:
    return size(row.estimate) if math.isfinite(row.estimate) else "no digit"


def conditioning(results: Comparison) -> str:
    """In a few words: no sample flagged, or the worst of them."""
    bad = [row for row in results.guard if not row.ok]
    worst = max(bad or results.guard, key=lambda row: (row.estimate, row.flagged))
    if not bad:
        what = "error" if not results.scene.simulated else "effect of rounding on the motion"
        return f"nothing flagged; largest estimated {what} {_estimate(worst)} ({worst.quantity} of {worst.engine})"
    engines = listed(dict.fromkeys(row.engine for row in bad))
    return (
        f"{len(bad)} of {len(results.guard)} results flagged ({engines}); worst {worst.quantity} of {worst.engine} at "
        f"t = {number(worst.worst_t)} s: estimated error {_estimate(worst)}, condition {size(worst.condition)}"
    )


def scene(results: Comparison) -> list[Block]:
    """What was computed."""
    this, t = results.scene, results.times
    span = f"{number(t[0])} s" if len(t) == 1 else f"{number(t[0])} to {number(t[-1])} s"
    described = facts(
        {
            "scene": this.name,
            "mechanism": this.mechanism.title or this.mechanism.name,
            "source": this.mechanism.source,
            "samples": f"{len(t)}, t = {span}",
            "independent coordinates": ", ".join(f"{k} = {v}" for k, v in this.mechanism.independent.items()),
            "gravity": f"{vector(this.applied.g)} m/s²",
            "load": [_load(load) for load in this.applied.loads],
            "motion": [f"{label} = {_inline(table)}" for label, table in this.text.get("motion", {}).items()],
            **acting(this),
            **({"rule for redundant forces": this.rule} if not this.simulated else simulated(this, this.start)),
            **judged(results.provenance),
        }
    )
    return [Paragraph(this.description), described] if this.description else [described]


def _inline(value: Any) -> str:
    """A value of a scene file on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    return f"[{', '.join(map(_inline, value))}]" if isinstance(value, list) else f'"{value}"'


def judged(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Files of scene, description and models, and the date."""
    files = {
        "scene file": {"file": provenance.get("scene_file"), "sha256": provenance.get("scene_sha256")},
        "description": provenance.get("description", {}),
        **{f"model of {engine}": model for engine, model in provenance.get("models", {}).items()},
    }
    found = {what: f"{file['file']}, SHA-256 {file['sha256']}" for what, file in files.items() if file.get("file")}
    return {**found, "date": provenance.get("date", "")}


def _load(load: Load) -> str:
    point = "its centre of mass" if load.point is None else f"{vector(load.point)} m in its frame"
    named = (("force", load.force, "N"), ("moment", load.torque, "N·m"))
    parts = [f"{name} {vector(values)} {unit}" for name, values, unit in named if np.any(values)]
    return f"on {load.body} at {point}, world axes: {', '.join(parts) or 'none'}"


def engines(results: Comparison) -> list[Block]:
    """Who ran, and what they had to say."""
    ran = [(name, s.version, _status(s, results)) for name, s in results.solutions.items()]
    lost = [(name, "", f"✗ {failure.reason}") for name, failure in results.failures.items()]
    notes = tuple(f"{name}: {note}" for name, s in results.solutions.items() for note in s.notes)
    return [Table(("engine", "version", "status"), (*ran, *lost)), *([Items(notes)] if notes else [])]


def _status(solution: Solution, results: Comparison) -> str:
    """Ran to the end, or how far."""
    if not solution.stopped:
        return "given" if solution.engine == REFERENCE else "ran"
    n = solution.n_solved
    return f"✗ stopped after t = {number(results.times[n - 1])} s" if n else "✗ stopped"
