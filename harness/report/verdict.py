"""The verdict of a run in one sentence, and the first difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from screwgauge.report.formatting import Row, digits, listed, missing, number, rows, size, unit_text
from screwgauge.study.results import Results


@dataclass(frozen=True, slots=True)
class Verdict:
    """`status` decides the colour, `word` says the same without it."""

    status: Literal["agree", "differ", "failed"]
    word: str
    sentence: str


def compared(results: Results) -> list[Row]:
    """Rows of pairs of which both engines ran."""
    return [row for row in rows(results.pairs) if not {row["a"], row["b"]} & set(results.failures)]


def first_difference(results: Results) -> Row | None:
    """The first row out of tolerance: quantity, component, a, b, size (scaled error); None if all agree."""
    for row in compared(results):
        if not row["ok"]:
            return {
                "quantity": row["quantity"],
                "component": row["worst_component"],
                "a": row["a"],
                "b": row["b"],
                "size": row["max_scaled"],
            }
    return None


def verdict(results: Results) -> Verdict:
    """What a run found, worst news first."""
    refused = _refused(results)
    difference, fault = _difference(results, beside=bool(refused)), _fault(results)
    rest = " ".join(part for part in (refused, difference, fault) if part)
    if results.failures:
        failed = [f"{name}: {f.reason.rstrip('.')}" for name, f in results.failures.items()]
        head = "An engine failed" if len(failed) == 1 else f"{len(failed)} engines failed"
        return Verdict("failed", "✗ FAILED", f"{head}: {'; '.join(failed)}. {rest or _agreement(results)}")
    if rest:
        word = "✗ DIFFER" if difference else "✗ NO NUMBER" if refused else "✗ OUT OF TOLERANCE"
        return Verdict("differ", word, rest)
    if not results.ok:
        return Verdict("differ", "✗ NOTHING COMPARED", _agreement(results))
    return Verdict("agree", "✓ AGREE" if compared(results) else "✓ WITHIN TOLERANCE", _agreement(results))


def _refused(results: Results) -> str:
    """Samples without numbers, those of the same kind named once."""
    said: dict[str, list[str]] = {}
    for one in results.refusals:
        said.setdefault(one.sentence, []).append(one.engine)
    return " ".join(f"{listed(names)}: {sentence}." for sentence, names in said.items())


def _difference(results: Results, *, beside: bool = False) -> str:
    """The first difference; `beside`: other than by missing numbers, which are explained already."""
    bad = [row for row in compared(results) if not row["ok"]]
    if beside:
        bad = [row for row in bad if not missing(row["max_scaled"])]
    if not bad:
        return ""
    row = bad[0]
    more = f" {len(bad)} of {len(compared(results))} comparisons are out of tolerance." if len(bad) > 1 else ""
    where = f"{row['quantity']}" + (f" at {row['worst_component']}" if row["worst_component"] else "")
    if missing(row["max_scaled"]):
        reason = str(row["reason"]).rstrip(".") if row.get("reason") else "not a number"
        if not row["b"]:  # an engine that stopped, and nobody beside it
            return f"{reason}.{more}"
        return f"{row['a']} and {row['b']} cannot be compared: first in {where} ({reason}).{more}"
    return (
        f"{row['a']} and {row['b']} differ: first in {where}, "
        f"by {size(row['max_abs'])} {unit_text(row['unit'])} ({size(row['max_scaled'])} scaled, "
        f"tolerance {number(row['tolerance'], 2)}) at t = {number(row['worst_t'])} s{_because(row)}.{more}"
    )


def _fault(results: Results) -> str:
    """The first judge residual out of tolerance."""
    bad = [r for r in rows(results.judge) if not r["ok"] and r["engine"] not in results.failures]
    if not bad:
        return ""
    row = bad[0]
    named = bool(row.get("worst_component"))
    where = f" at {row['worst_component']}, t = {number(row['worst_t'])} s" if named else ""
    residual = str(row["residual"]).replace("_", " ")
    return (
        f"The judge faults {row['engine']}: {residual} residual "
        f"{size(row['max_abs'])} {unit_text(row['unit'])} ({size(row['max_scaled'])} scaled, "
        f"tolerance {number(row['tolerance'], 2)}){where}{_because(row)}."
    )


def _because(row: Row) -> str:
    return f", {row['reason']}" if row.get("reason") else ""


def _agreement(results: Results) -> str:
    engines, pairs = list(results.solutions), compared(results)
    if not engines:
        return "No engine ran."
    if not pairs:
        judged = "its residuals are" if len(engines) == 1 else "their residuals are"
        judged = f"{judged} within tolerance" if len(results.judge) else "nothing was judged"
        if len(engines) == 1:
            return f"Only {engines[0]} ran, so there is nothing to compare it with; {judged}."
        return f"{listed(engines)} ran, but have no quantity in common: nothing was compared; {judged}."
    least = min(pairs, key=lambda row: digits(row["max_scaled"]))
    return (
        f"{listed(engines)} agree: all {len(pairs)} comparisons are within tolerance, "
        f"to {digits(least['max_scaled']):.1f} digits or more (fewest in {least['quantity']})."
    )
