"""The report of ``screwgauge diagnose --self-test``: what of changed models a diagnosis finds, and what it does not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Paragraph, Table, folded, table
from screwgauge.report.formatting import Row, grouped, rows, words
from screwgauge.report.study import Study, counted, said
from screwgauge.study.selftest.judged import CLOSE
from screwgauge.study.selftest.run import ALIKE, CHANGED, VISIBLE

#: What is asked for: share detected of the changes that torques show, named right, magnitude right; time [s].
WANTED = {"detected": 0.99, "named right": 0.95, "magnitude right": 0.95}
SLOWEST = 10.0
FIGURES = f"diagnoses | {' | '.join(WANTED)} | median time [s] = time"
PAIRS = "written | pairs | pairs of readers = readers | false alarms = alarms | largest torque difference = worst"
MISSES = "number | kind | model | a | b | size | effect | error = off | verdict | named first = short"


def passed(found: pd.DataFrame) -> bool:
    """Whether all that is wanted is reached."""
    changed, alike = _of(found, CHANGED), _of(found, ALIKE)
    reached = all(good >= WANTED[name] * of for name, (good, of) in _figures(changed).items())
    return reached and not any(_true(row["detected"]) for row in alike) and _median(changed) < SLOWEST


def _of(found: pd.DataFrame, group: str) -> list[Row]:
    """Rows of a group that have a diagnosis."""
    return [row for row in rows(found) if row["group"] == group and row["cpu_s"] != ""]


def _true(value: Any) -> bool:
    return str(value) == "True"


def _figures(changed: Sequence[Row]) -> dict[str, tuple[int, int]]:
    """How many are good, of how many."""
    visible = [row for row in changed if float(row["effect"]) > VISIBLE]
    seen = [row for row in changed if _true(row["detected"])]
    sized = [row for row in seen if row["error"] != ""]
    good = (
        [_true(row["detected"]) for row in visible],
        [_true(row["right"]) for row in seen],
        [float(row["error"]) <= CLOSE for row in sized],
    )
    return {name: (sum(each), len(each)) for name, each in zip(WANTED, good, strict=True)}


def _median(found: Sequence[Row]) -> float:
    return median(float(row["cpu_s"]) for row in found) if found else 0.0


def _banner(found: pd.DataFrame) -> Banner:
    changed, alike = _of(found, CHANGED), _of(found, ALIKE)
    shares = {
        k: (good, of, f"{100.0 * good / of:.1f} %" if of else "none") for k, (good, of) in _figures(changed).items()
    }
    figures = ", ".join(f"{name} {good} of {of} ({share})" for name, (good, of, share) in shares.items())
    alarms = sum(_true(row["detected"]) for row in alike)
    models, public = ({row["model"] for row in changed if _true(row["public"]) or every} for every in (True, False))
    text = (
        f"{len(changed)} changes of {len({row['kind'] for row in changed})} kinds in {len(models)} models, "
        f"{len(public)} of them public robots: {figures}. {alarms} false alarms in {len(alike)} pairs that are alike. "
        f"Median processor time of a diagnosis: {_median([*changed, *alike]):.2g} s."
    )
    return Banner(text, "✓ PASSED", "agree") if passed(found) else Banner(text, "✗ FAILED", "differ")


def _by(groups: Iterable[tuple[str, Sequence[Row]]], head: str) -> Table:
    """A line of figures for each group of changes."""
    lines = [
        {
            **{name: f"{good}/{of}" if of else "" for name, (good, of) in _figures(group).items()},
            "label": label,
            "diagnoses": len(group),
            "time": f"{_median(group):.2f}",
        }
        for label, group in groups
    ]
    spelled = [{key.replace(" ", "_"): value for key, value in line.items()} for line in lines]
    return table(spelled, f"{head} = label | {FIGURES}")


def _by_kind(found: pd.DataFrame) -> Table:
    return _by(((words(kind), of) for (kind,), of in grouped(_of(found, CHANGED), "kind").items()), "kind")


def _body(found: pd.DataFrame) -> list[Block]:
    changed = _of(found, CHANGED)
    models = sorted(grouped(changed, "model").items())
    named = ((f"{model}{' (public)' if _true(of[0]['public']) else ''}", of) for (model,), of in models)
    sizes = (
        (f"1e{low} to 1e{low + 1}", [row for row in changed if 10.0**low <= float(row["size"]) < 10.0 ** (low + 1)])
        for low in range(-6, -1)
    )
    alike = [
        {
            "written": words(kind),
            "pairs": len(group),
            "readers": len({(row["a"], row["b"]) for row in group}),
            "alarms": sum(_true(row["detected"]) for row in group),
            "worst": f"{max(float(row['effect']) for row in group):.1e}",
        }
        for (kind,), group in grouped(_of(found, ALIKE), "kind").items()
    ]
    return [
        *said("Misses", *(_misses(found) or [Paragraph("None.")])),
        *said("By kind of change", folded("All kinds", _by_kind(found)), visible=VISIBLE, close=CLOSE),
        *said("By model", folded("All models", _by(named, "model"))),
        *said("By size of the change", _by(sizes, "relative size drawn")),
        *said("Pairs that are alike", table(alike, PAIRS)),
    ]


def _misses(found: pd.DataFrame) -> list[Block]:
    """All rows that are not right, and kinds that no model has a place for."""
    missed = [row for row in rows(found) if row["verdict"] != "ok"]
    cut = [
        {**row, "short": t if len(t := str(row["first"])) < 90 else f"{t[:87]}...", "off": str(row["error"])}
        for row in missed
    ]
    counts = Paragraph(f"{counted(row['verdict'] for row in missed)}.")
    return [counts, folded(f"All {len(cut)}", table(cut, MISSES))] if missed else []


def _terminal(found: pd.DataFrame) -> list[Block]:
    return [_banner(found), _by_kind(found), *_misses(found)]


PAGE = Study("selftest.csv", "Self-test of the diagnosis", _banner, _body, _terminal)
NAME, write = PAGE.NAME, PAGE.write
