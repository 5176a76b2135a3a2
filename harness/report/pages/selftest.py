"""The report of ``screwgauge diagnose --self-test``: what of changed models a diagnosis finds, and what it does not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

from screwgauge.report.blocks import Banner, Block, Heading, Marked, Paragraph, Table, facts
from screwgauge.report.formatting import grouped, rows
from screwgauge.report.write import write_table
from screwgauge.study.selftest.judged import CLOSE
from screwgauge.study.selftest.run import ALIKE, CHANGED, VISIBLE

NAME = "selftest.csv"
DATA = (NAME, "environment.json")
#: What is asked for: share detected of the changes that torques show, named right, magnitude right; time [s].
WANTED = {"detected": 0.99, "named right": 0.95, "magnitude right": 0.95}
SLOWEST = 10.0
MEANING = f"""A copy of a model file is changed in one place (`two_at_once`: in two) by a random amount and diagnosed
against the original, read by the same library or another one, from the same format or another one. **detected**: the
diagnosis says that they differ, counted where the change moves a torque by more than {VISIBLE:g} of the largest;
**named right**: what it names first, or says it cannot be told from that, is the property and the part that were
changed, and the slip of convention or unit, if it is one; **magnitude right**: within {CLOSE:.0%}. **alike**: a model
against itself, written or read otherwise; any difference is a false alarm. The figures are of all that are detected."""

Rows = Sequence[Mapping[str, Any]]


def terminal(found: pd.DataFrame) -> list[Block]:
    """What is printed: figures, and what was missed."""
    return [_banner(found), _by_kind(found), *_misses(found)]


def report(found: pd.DataFrame, record: Mapping[str, Any]) -> list[Block]:
    """The blocks of ``report.md`` and ``report.html``."""
    return [
        Heading("Self-test of the diagnosis", 1),
        _banner(found),
        Paragraph(Marked(MEANING)),
        Heading("By kind of change"),
        _by_kind(found),
        Heading("By model"),
        _by_model(found),
        Heading("By size of the change"),
        _by_size(found),
        Heading("Pairs that are alike"),
        _pairs(found),
        Heading("Misses"),
        *(_misses(found) or [Paragraph("None.")]),
        Heading("Environment"),
        facts(record),
    ]


def write(found: pd.DataFrame, out: Path) -> Path:
    """Writes ``selftest.csv``, the report and ``environment.json``."""
    return write_table(out, NAME, found, report)


def passed(found: pd.DataFrame) -> bool:
    """Whether all that is wanted is reached."""
    changed, alike = _of(found, CHANGED), _of(found, ALIKE)
    shares = {name: (good, of) for name, good, of in _figures(changed)}
    reached = all(good >= WANTED[name] * of for name, (good, of) in shares.items())
    return reached and not any(_true(row["detected"]) for row in alike) and _median(changed) < SLOWEST


def _of(found: pd.DataFrame, group: str) -> list[dict[str, Any]]:
    """Rows of a group that have a diagnosis."""
    return [row for row in rows(found) if row["group"] == group and row["cpu_s"] != ""]


def _true(value: Any) -> bool:
    return str(value) == "True"


def _figures(changed: Rows) -> list[tuple[str, int, int]]:
    """Name, how many are good, of how many."""
    visible = [row for row in changed if float(row["effect"]) > VISIBLE]
    seen = [row for row in changed if _true(row["detected"])]
    sized = [row for row in seen if row["error"] != ""]
    return [
        ("detected", sum(_true(row["detected"]) for row in visible), len(visible)),
        ("named right", sum(_true(row["right"]) for row in seen), len(seen)),
        ("magnitude right", sum(float(row["error"]) <= CLOSE for row in sized), len(sized)),
    ]


def _median(found: Rows) -> float:
    return median(float(row["cpu_s"]) for row in found) if found else 0.0


def _banner(found: pd.DataFrame) -> Banner:
    changed, alike = _of(found, CHANGED), _of(found, ALIKE)
    said = ", ".join(f"{name} {good} of {of} ({_share(good, of)})" for name, good, of in _figures(changed))
    alarms = sum(_true(row["detected"]) for row in alike)
    models, public = ({row["model"] for row in changed if _true(row["public"]) or every} for every in (True, False))
    text = (
        f"{len(changed)} changes of {len({row['kind'] for row in changed})} kinds in {len(models)} models, "
        f"{len(public)} of them public robots: {said}. {alarms} false alarms in {len(alike)} pairs that are alike. "
        f"Median processor time of a diagnosis: {_median([*changed, *alike]):.2g} s."
    )
    return Banner(text, "PASSED", "agree") if passed(found) else Banner(text, "FAILED", "differ")


def _share(good: int, of: int) -> str:
    return f"{100.0 * good / of:.1f} %" if of else "none"


def _line(label: str, group: Rows) -> tuple[str, ...]:
    cells = [f"{good}/{of}" if of else "" for _, good, of in _figures(group)]
    return (label, str(len(group)), *cells, f"{_median(group):.2f}")


_HEAD = ("diagnoses", *WANTED, "median time [s]")


def _by_kind(found: pd.DataFrame) -> Table:
    groups = grouped(_of(found, CHANGED), "kind").items()
    return Table(("kind", *_HEAD), tuple(_line(_words(kind), group) for (kind,), group in groups))


def _by_model(found: pd.DataFrame) -> Table:
    groups = sorted(grouped(_of(found, CHANGED), "model").items())
    lines = [_line(f"{model}{' (public)' if _true(group[0]['public']) else ''}", group) for (model,), group in groups]
    return Table(("model", *_HEAD), tuple(lines))


def _by_size(found: pd.DataFrame) -> Table:
    changed, lines = _of(found, CHANGED), []
    for low in range(-6, -1):
        group = [row for row in changed if 10.0**low <= float(row["size"]) < 10.0 ** (low + 1)]
        lines.append(_line(f"1e{low} to 1e{low + 1}", group))
    return Table(("relative size drawn", *_HEAD), tuple(lines))


def _pairs(found: pd.DataFrame) -> Table:
    lines = []
    for (kind,), group in grouped(_of(found, ALIKE), "kind").items():
        alarms, readers = sum(_true(row["detected"]) for row in group), {(row["a"], row["b"]) for row in group}
        worst = max(float(row["effect"]) for row in group)
        lines.append((_words(kind), str(len(group)), str(len(readers)), str(alarms), f"{worst:.1e}"))
    return Table(("written", "pairs", "pairs of readers", "false alarms", "largest torque difference"), tuple(lines))


def _misses(found: pd.DataFrame) -> list[Block]:
    """All rows that are not right, and kinds that no model has a place for."""
    missed = [row for row in rows(found) if row["verdict"] != "ok"]
    counts = Counter(row["verdict"] for row in missed)
    keys = ("number", "kind", "model", "a", "b", "size", "effect", "error", "verdict")
    lines = tuple((*(str(row[key]) for key in keys), _short(row["first"])) for row in missed)
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    return [Paragraph(f"{said}."), Table((*keys, "named first"), lines)] if missed else []


def _short(text: Any) -> str:
    return text if len(str(text)) < 90 else f"{str(text)[:87]}..."


def _words(name: Any) -> str:
    return str(name).replace("_", " ")
