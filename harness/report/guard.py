"""How far the numbers can be trusted, engine by engine: a line for the terminal, a table for the report."""

from __future__ import annotations

import math

from screwgauge.judging.conditioning import LIMIT, Guarded
from screwgauge.report.formatting import listed, markdown_table, number, size
from screwgauge.study.results import Results

ABOUT = (
    "Estimated relative error of each quantity, from the conditioning of what it was solved from: over the "
    "quantity's largest magnitude, at its worst sample. Poses close to rounding; how much of that reaches a rate, an "
    "acceleration or a force is extrapolated where a sample is well-conditioned and computed by solving it again at "
    f"a moved pose where it is not. Above {LIMIT:.0e} a sample is flagged; *no digit* means that none is right."
)

INTEGRATED = (
    "What rounding may have made of the motion, from the worst conditioned pose that it went through: next to a "
    "singular pose accelerations are off by about eps times the square of the condition, and every later sample has "
    "that behind it. The error of the integration itself is bounded by its tolerances and shown by the energy and the "
    "reference. "
    f"Above {LIMIT:.0e} a sample is flagged; *no digit* means that none may be right."
)


def guard_line(results: Results) -> str:
    """One sentence: nothing flagged, or the worst of it."""
    bad = [row for row in results.guard if not row.ok]
    if not bad:
        worst = max(results.guard, key=lambda row: row.estimate)
        what = "error" if results.scene.forward is None else "effect of rounding on the motion"
        return (
            f"guard: nothing flagged; largest estimated {what} {estimate_text(worst)} ({worst.quantity} of "
            f"{worst.engine})"
        )
    engines = list(dict.fromkeys(row.engine for row in bad))
    worst = max(bad, key=lambda row: (row.estimate, row.flagged))
    return (
        f"guard: {len(bad)} of {len(results.guard)} results flagged ({listed(engines)}); worst {worst.quantity} of "
        f"{worst.engine} at t = {number(worst.worst_t)} s: estimated error {estimate_text(worst)}, "
        f"condition {size(worst.condition)}"
    )


def estimate_text(row: Guarded) -> str:
    """The estimate, or that it leaves nothing."""
    return size(row.estimate) if math.isfinite(row.estimate) else "no digit"


def guard_section(results: Results) -> str:
    """The table of the report."""
    if not results.guard:
        return "No engine estimated its errors."
    engines = list(dict.fromkeys(row.engine for row in results.guard))
    cells: dict[str, dict[str, str]] = {}
    for row in results.guard:
        mark = "" if row.ok else f" ✗ ({row.flagged} of {row.n_sample}, t = {number(row.worst_t)} s)"
        text = f"{estimate_text(row)}, condition {size(row.condition)}{mark}"
        cells.setdefault(row.quantity, {})[row.engine] = text
    body = [
        [quantity.replace("_", " "), *(found.get(engine, "") for engine in engines)]
        for quantity, found in cells.items()
    ]
    head = ["estimated error", *engines]
    about = ABOUT if results.scene.forward is None else INTEGRATED
    return f"{about}\n\n{markdown_table(head, body)}\n\n✗ marks what has flagged samples."
