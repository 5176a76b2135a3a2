"""Sections of a run's report: what differs, what agrees, judge, plots, estimated errors, scene, engines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from pathlib import PurePath
from typing import Any

import numpy as np

from screwgauge.judging.conditioning import Guarded
from screwgauge.reference.applied import Load
from screwgauge.report.blocks import (
    LONG,
    Block,
    Folded,
    Heading,
    Items,
    Paragraph,
    Picture,
    Table,
    cross_table,
    facts,
    table,
)
from screwgauge.report.formatting import (
    FORMS,
    Row,
    beyond,
    digits_text,
    grouped,
    listed,
    missing,
    number,
    rows,
    size,
    span,
    unit_text,
    vector,
    words,
)
from screwgauge.report.pages.simulation import acting, simulated
from screwgauge.report.verdict import compared
from screwgauge.solution import REFERENCE, Solution
from screwgauge.study.comparison import Comparison

PAIR = "quantity | unit | a | b | max abs | rms | max scaled | tolerance | worst at | rule | unique | within = ok"
JUDGE = "engine | residual | unit | max abs | max scaled | tolerance | worst at | within = ok"


def _with_reason(found: list[Row], columns: str) -> Table:
    return table(found, f"{columns} | reason" if any(row.get("reason") for row in found) else columns)


def _shown(found: Iterable[Row]) -> list[Row]:
    """Rows with what tables say of them: where they are worst, signs for what is out of tolerance."""
    shown = []
    for row in found:
        component, t = row.get("worst_component"), row.get("worst_t")
        nowhere = missing(component) or not component
        at = "-" if nowhere else component if missing(t) else f"{component} @ {number(t)} s"
        digits, sign = digits_text(row["max_scaled"]).replace("NaN", "no number"), "" if row["ok"] else " ✗"
        reached = {"reached": f"{digits}{sign}", "residue": f"{size(row['max_scaled'])}{sign}", "worst_at": at}
        unique = {"rule": row.get("rule") or "-", "unique": "yes" if row.get("unique") else "no"}
        shown.append({**row, **reached, **unique})
    return shown


def worst_three(results: Comparison) -> list[Block]:
    """What comes nearest to its tolerance, or goes beyond it farthest."""
    found = [{**row, "what": words(row["quantity"]), "who": row["pair"]} for row in compared(results)]
    judged = (row for row in rows(results.judge) if row["engine"] not in results.failures)
    found += [{**row, "what": f"judge: {words(row['residual'])}", "who": row["engine"]} for row in judged]
    order = sorted(found, key=lambda row: beyond(row["max_scaled"], row["tolerance"]), reverse=True)
    three = _shown(group[0] for group in list(grouped(order, "what").values())[:3])
    cells = [{**row, "off": f"{size(row['max_abs'])} {unit_text(row['unit'])}"} for row in three]
    columns = "worst numbers = what | between = who | off by = off | digits = reached | needed = tolerance:as_digits"
    return [table(cells, columns)] if cells else []


def what(results: Comparison) -> dict[str, str]:
    """What was judged, short enough for a first screen."""
    files, t, versions = short(judged(results.provenance)), results.times, dict[str, str]()
    for name in (*results.solutions, *results.failures):
        version = results.solutions[name].version or "given" if name in results.solutions else "✗ failed"
        versions[name] = ", ".join(filter(None, (version, files.pop(f"model of {name}", ""))))
    samples = f"{len(t)} sample{'s' * (len(t) != 1)}, t = {span(number(t[0]), number(t[-1]))} s"
    scene = ", ".join((files.pop("scene file", results.scene.name), samples))
    mechanism = files.pop("description", results.scene.mechanism.name)
    return {"scene": scene, "mechanism": mechanism, **versions, **files}


def short(judged: Mapping[str, str]) -> dict[str, str]:
    """What was judged, see `judged`, with names of files alone and the beginnings of their hashes."""

    def shortened(text: str) -> str:
        file, sha, digest = text.rpartition(", SHA-256 ")
        return f"{PurePath(file).name} (SHA-256 {digest[:8]})" if sha else text

    return {what: shortened(text) for what, text in judged.items() if text}


def differing(results: Comparison) -> list[Block]:
    """Pairs and residuals out of tolerance, if there are any."""
    pairs, judged = ([row for row in rows(frame) if not row["ok"]] for frame in (results.pairs, results.judge))
    told: list[Block] = []
    for found, columns, title in ((pairs, PAIR, "All pairs that differ"), (judged, JUDGE, "All residuals")):
        if found:
            told.append(_with_reason(_shown(found[:LONG]), columns))
        if found[LONG:]:
            told.append(Folded(f"{title}: {len(found)}", (_with_reason(_shown(found), columns),)))
    return [Heading("Out of tolerance"), *told] if told else []


def overview(results: Comparison) -> list[Block]:
    """Quantity by pair of engines: digits of agreement, beside those that the tolerance asks for."""
    found = []
    groups = grouped(compared(results), "quantity", "unit").values()
    for group in sorted(groups, key=lambda group: all(row["ok"] for row in group)):
        tolerances = [row["tolerance"] for row in group]
        needed = span(digits_text(max(tolerances)), digits_text(min(tolerances)))
        found += [{**row, "needed": needed} for row in _shown(group)]
    if not found:
        return [Paragraph("Fewer than two engines ran: there are no pairs, only the judge's residuals below.")]
    sign = [] if all(row["ok"] for row in found) else [Paragraph("✗ marks what is out of tolerance.")]
    return [cross_table(found, "quantity = quantity:words | unit | needed", "pair", "reached"), *sign]


def every_pair(results: Comparison) -> Block:
    """All pairs."""
    nothing = Paragraph("No pairs: one engine has nothing to be compared with.")
    return _with_reason(_shown(rows(results.pairs)), PAIR) if len(results.pairs) else nothing


def judge(results: Comparison) -> Block:
    """Residuals of each engine against the equations themselves: residual by engine."""
    across = cross_table(_shown(rows(results.judge)), "residual, scaled = residual | unit", "engine", "residue")
    return across if across.body else Paragraph("Nothing was judged: no engine gives joint positions or its assembly.")


def every_residual(results: Comparison) -> Block:
    """All of what the judge found."""
    return _with_reason(_shown(rows(results.judge)), JUDGE) if len(results.judge) else Paragraph("None.")


def plots(results: Comparison, pictures: Sequence[Picture]) -> list[Block]:
    """What differs is shown; what agrees is folded into a line with its digits."""
    from screwgauge.report.figures.selection import drawable

    if not pictures:
        return [Paragraph("Nothing to draw.")]
    pairs, told = grouped(compared(results), "quantity", "unit"), list[Block]()
    figures = drawable(tuple(results.scene.figures), results.solutions)
    for picture, figure in zip_longest(pictures, figures):
        found = pairs.get((figure.quantity, figure.unit), []) if figure else []
        if found and not all(row["ok"] for row in found):
            told.insert(sum(isinstance(block, Picture) for block in told), picture)
            continue
        note = f"agrees to {digits_text(max(row['max_scaled'] for row in found))} digits" if found else ""
        told.append(Folded(picture.title, (picture,), note))
    return told


def coverage(results: Comparison) -> list[Block]:
    """What the scene could have seen: share of the terms in each quantity."""
    found = results.coverage
    across = cross_table(found.shares, "largest term = quantity:words | unit", "term", "share:percent")
    return [Paragraph(found.sentence), *([across] if across.body else [])]


def parameters(results: Comparison) -> Block:
    """From which error on parameters show."""
    found = sorted(results.coverage.parameters, key=lambda row: -row["smallest"])
    cells = [{**row, "shows": FORMS["percent"](row["smallest"]) if row["tested"] else "not tested"} for row in found]
    return table(cells, "parameter | shows from = shows") if cells else Paragraph("None were looked at.")


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
        error = "error" if not results.scene.simulated else "effect of rounding on the motion"
        return f"nothing flagged; largest estimated {error} {_estimate(worst)} ({worst.quantity} of {worst.engine})"
    engines = listed(dict.fromkeys(row.engine for row in bad))
    return (
        f"{len(bad)} of {len(results.guard)} results flagged ({engines}); worst {worst.quantity} of {worst.engine} at "
        f"t = {number(worst.worst_t)} s: estimated error {_estimate(worst)}, condition {size(worst.condition)}"
    )


def scene(results: Comparison) -> list[Block]:
    """What was computed."""
    this, t = results.scene, results.times
    described = facts(
        {
            "scene": this.name,
            "mechanism": this.mechanism.title or this.mechanism.name,
            "source": this.mechanism.source,
            "samples": f"{len(t)}, t = {span(number(t[0]), number(t[-1]))} s",
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
