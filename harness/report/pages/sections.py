"""Sections of a run's report: pairs, judge, estimated errors, scene, engines, run times, facts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from screwgauge.judging.conditioning import Guarded
from screwgauge.quantities import digits
from screwgauge.reference.applied import Load
from screwgauge.report.blocks import Block, Column, Items, Numbers, Paragraph, Table, cross_table, folded, pairs, table
from screwgauge.report.formatting import Row, digits_text, listed, missing, number, rows, size, tick, unit_text, words
from screwgauge.report.pages.prose import ESTIMATES, SIMULATED_ESTIMATES
from screwgauge.report.pages.simulation import acting, simulated
from screwgauge.report.verdict import compared
from screwgauge.solution import REFERENCE, Solution
from screwgauge.study.comparison import Comparison


def _worst(row: Row) -> str:
    component = row.get("worst_component")
    if missing(component) or not component:
        return "-"
    return str(component) if missing(row["worst_t"]) else f"{component} @ {number(row['worst_t'])} s"


def _tolerance(value: float) -> str:
    return number(value, 2)


UNIT = Column("unit", "unit", unit_text)
SIZES = (Numbers("max abs", "max_abs", size), Numbers("max scaled", "max_scaled", size))
TOLERANCE = Numbers("tolerance", "tolerance", _tolerance)
WORST, WITHIN, REASON = Column("worst at", _worst), Column("within", "ok", tick), Column("reason", "reason")
PAIR = (
    *(Column("quantity", "quantity"), UNIT, Column("a", "a"), Column("b", "b")),
    *(SIZES[0], Numbers("rms", "rms", size), SIZES[1], TOLERANCE, WORST),
    *(Column("rule", lambda row: row["rule"] or "-"), Column("unique", lambda row: "yes" if row["unique"] else "no")),
    WITHIN,
)
JUDGE = (Column("engine", "engine"), Column("residual", "residual", words), UNIT, *SIZES, TOLERANCE, WORST, WITHIN)
TIMING = (
    *(Column("engine", "engine"), Column("setting", "setting"), Column("stage", "stage")),
    Numbers("samples", "n_sample"),
    *(Numbers(f"{name} [s]", f"{name}_s", lambda value: number(value, 3)) for name in ("min", "median")),
    Numbers("median per sample [µs]", lambda row: number(1e6 * row.median_s / max(row.n_sample, 1), 3)),
    Column("covers", "covers"),
)


def overview(results: Comparison) -> list[Block]:
    """Quantity by pair of engines: digits of agreement, beside those that the tolerance asks for."""
    found = compared(results)
    if not found:
        return [Paragraph("Fewer than two engines ran: there are no pairs, only the judge's residuals below.")]
    tolerances: dict[tuple[str, str], list[float]] = {}
    for row in found:
        tolerances.setdefault((row["quantity"], row["unit"]), []).append(digits(row["tolerance"]))

    def needed(row: Row) -> str:
        ends = {f"{end(tolerances[row['quantity'], row['unit']]):.1f}": 0 for end in (min, max)}
        return " to ".join(ends)

    def reached(row: Row) -> str:
        text = "no number" if missing(row["max_scaled"]) else digits_text(row["max_scaled"])
        return text + ("" if row["ok"] else " ✗")

    columns = (Column("digits of agreement", "quantity", words), UNIT, Numbers("needed", needed))
    shown = cross_table(found, columns, lambda row: f"{row['a']} - {row['b']}", reached)
    return [shown, Paragraph("✗ marks what is out of tolerance.")]


def every_pair(results: Comparison) -> list[Block]:
    """All pairs; those out of tolerance apart and first."""
    found = rows(results.pairs)
    if not found:
        return [Paragraph("No pairs: one engine has nothing to be compared with.")]
    bad = [row for row in found if not row["ok"]]
    every = folded(f"All {len(found)} pairs", table(found, PAIR))
    return [Paragraph("**Out of tolerance**"), table(bad, (*PAIR, *_reason(bad))), every] if bad else [every]


def judge(results: Comparison) -> list[Block]:
    """Residuals of each engine against the equations themselves: residual by engine, then all of it."""
    found = rows(results.judge)
    if not found:
        return [Paragraph("Nothing was judged: the quantities asked for do not suffice.")]
    columns = (Column("residual, scaled", "residual", words), UNIT)
    shown = cross_table(found, columns, "engine", lambda row: size(row["max_scaled"]) + ("" if row["ok"] else " ✗"))
    return [shown, folded(f"All {len(found)} residuals", table(found, (*JUDGE, *_reason(found))))]


def _reason(found: Iterable[Row]) -> tuple[Column, ...]:
    """The column of reasons, if there is any reason."""
    return (REASON,) if any(row.get("reason") for row in found) else ()


def estimates(results: Comparison) -> list[Block]:
    """Estimated error of each quantity of each engine."""
    if not results.guard:
        return [Paragraph("No engine estimated its errors.")]

    def cell(row: Guarded) -> str:
        mark = "" if row.ok else f" ✗ ({row.flagged} of {row.n_sample}, t = {number(row.worst_t)} s)"
        return f"{estimate(row)}, condition {size(row.condition)}{mark}"

    about = ESTIMATES if results.scene.forward is None else SIMULATED_ESTIMATES
    shown = cross_table(results.guard, [Column("estimated error", "quantity", words)], "engine", cell)
    return [Paragraph(about), Table(shown.head, shown.body), Paragraph("✗ marks what has flagged samples.")]


def estimate(row: Guarded) -> str:
    """An estimated error, or that it leaves nothing."""
    return size(row.estimate) if math.isfinite(row.estimate) else "no digit"


def estimates_line(results: Comparison) -> str:
    """In a few words: no sample flagged, or the worst of them."""
    bad = [row for row in results.guard if not row.ok]
    if not bad:
        worst = max(results.guard, key=lambda row: row.estimate)
        what = "error" if results.scene.forward is None else "effect of rounding on the motion"
        return f"nothing flagged; largest estimated {what} {estimate(worst)} ({worst.quantity} of {worst.engine})"
    worst = max(bad, key=lambda row: (row.estimate, row.flagged))
    engines = listed(dict.fromkeys(row.engine for row in bad))
    return (
        f"{len(bad)} of {len(results.guard)} results flagged ({engines}); worst {worst.quantity} of "
        f"{worst.engine} at t = {number(worst.worst_t)} s: estimated error {estimate(worst)}, "
        f"condition {size(worst.condition)}"
    )


def scene(results: Comparison) -> list[Block]:
    """What was computed."""
    this, t = results.scene, results.times
    span = f"{number(t[0])} s" if len(t) == 1 else f"{number(t[0])} to {number(t[-1])} s"
    described = [
        ("scene", this.name),
        ("mechanism", this.mechanism.title or this.mechanism.name),
        ("source", this.mechanism.source),
        ("samples", f"{len(t)}, t = {span}"),
        ("independent coordinates", ", ".join(f"{k} = {v}" for k, v in this.mechanism.independent.items())),
        ("gravity", f"{vector(this.gravity)} m/s²"),
        *(("load", _load(load)) for load in this.loads),
        *acting(this),
        *([("rule for redundant forces", this.rule)] if this.forward is None else simulated(this, this.forward)),
        *judged(results.provenance),
    ]
    lead: list[Block] = [Paragraph(this.description)] if this.description else []
    return [*lead, pairs(fact for fact in described if fact[1])]


def judged(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Files of scene, description and models, and the date."""
    files = {
        "scene file": {"file": provenance.get("scene_file"), "sha256": provenance.get("scene_sha256")},
        "description": provenance.get("description", {}),
        **{f"model of {engine}": model for engine, model in provenance.get("models", {}).items()},
    }
    found = [(what, f"{x['file']}, SHA-256 {x['sha256']}") for what, x in files.items() if x.get("file")]
    return [*found, *([("date", provenance["date"])] if "date" in provenance else [])]


def vector(values: Iterable[float]) -> str:
    """``(0, 0, -9.81)``."""
    return "(" + ", ".join(map(number, values)) + ")"


def _load(load: Load) -> str:
    point = "its centre of mass" if load.point is None else f"{vector(load.point)} m in its frame"
    parts = [f"force {vector(load.force)} N"] if np.any(load.force) else []
    parts += [f"moment {vector(load.torque)} N·m"] if np.any(load.torque) else []
    return f"on {load.body} at {point}, world axes: {', '.join(parts) or 'none'}"


def engines(results: Comparison) -> list[Block]:
    """Who ran, and what they had to say."""
    ran = [(name, s.version, _status(s, results)) for name, s in results.solutions.items()]
    lost = [(name, "", f"✗ {failure.reason}") for name, failure in results.failures.items()]
    notes = tuple(f"{name}: {note}" for name, s in results.solutions.items() for note in s.notes)
    return [Table(("engine", "version", "status"), (*ran, *lost)), *([Items(notes)] if notes else [])]


def _status(solution: Solution, results: Comparison) -> str:
    """Ran to the end, or how far."""
    if solution.engine == REFERENCE:
        return "given"
    stopped = any(note.startswith("stopped: ") for note in solution.notes)
    if not stopped or solution.rows is None:
        return "ran"
    return f"✗ stopped after t = {number(results.times[solution.rows[-1]])} s" if len(solution.rows) else "✗ stopped"


def timings(results: Comparison) -> Block:
    """Measured stages with what the clock covers."""
    found = [timing for solution in results.solutions.values() for timing in solution.timings]
    return table(found, TIMING) if found else Paragraph("Nothing was timed.")


def facts(mapping: Mapping[str, Any], empty: str = "Not recorded.") -> Block:
    """A table of names and values, one level of nesting spread out."""
    body: list[tuple[str, str]] = []
    for name, value in mapping.items():
        if isinstance(value, Mapping) and not _flags(value):
            body += [(f"{words(name)}: {key}", _text(item)) for key, item in value.items()]
        else:
            body.append((words(name), _text(value)))
    return pairs(body) if body else Paragraph(empty)


def _flags(value: Mapping[str, Any]) -> bool:
    return bool(value) and all(isinstance(item, (bool, np.bool_)) for item in value.values())


def _text(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, Mapping) and _flags(value):
        sides = ((word, [str(k) for k, v in value.items() if bool(v) is side]) for word, side in _SIDES)
        return "; ".join(f"{word}: {', '.join(names)}" for word, names in sides if names)
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(map(_text, value))
    return number(value) if isinstance(value, (float, np.floating)) else str(value)


_SIDES = (("yes", True), ("no", False))
