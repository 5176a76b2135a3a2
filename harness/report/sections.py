"""The sections of the report, each a piece of Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwgauge.reference.applied import Load
from screwgauge.reference.rotations import Array
from screwgauge.report.formatting import Row, cell, digits, markdown_table, missing, number, rows, size, tick, unit_text
from screwgauge.report.forward import acting, integrated
from screwgauge.report.verdict import compared
from screwgauge.solution import REFERENCE, Solution
from screwgauge.study.results import Results

LONG = 12  # rows from which a table is folded


def overview(results: Results) -> str:
    """Quantity by pair of engines: digits of agreement, beside those that the tolerance asks for."""
    table = compared(results)
    if not table:
        return "Fewer than two engines ran: there are no pairs, only the judge's residuals below."
    pairs = list(dict.fromkeys((row["a"], row["b"]) for row in table))
    body: dict[tuple[str, str], dict[tuple[str, str], str]] = {}
    needed: dict[tuple[str, str], set[str]] = {}
    for row in table:
        key = row["quantity"], row["unit"]
        needed.setdefault(key, set()).add(f"{digits(row['tolerance']):.1f}")
        value = digits(row["max_scaled"])
        text = "no number" if np.isnan(value) else f"{value:.1f}"
        mark = "" if row["ok"] else " ✗"
        body.setdefault(key, {})[row["a"], row["b"]] = text + mark
    lines = [
        [
            key[0].replace("_", " "),
            unit_text(key[1]),
            " to ".join(sorted(needed[key], key=float)[:: max(1, len(needed[key]) - 1)]),
            *(cells.get(pair, "") for pair in pairs),
        ]
        for key, cells in body.items()
    ]
    head = ["digits of agreement", "unit", "needed", *(f"{a} - {b}" for a, b in pairs)]
    return markdown_table(head, lines, range(2, len(head))) + "\n\n✗ marks what is out of tolerance."


def pairs(results: Results) -> str:
    """All pairs; those out of tolerance apart and first."""
    table = rows(results.pairs)
    if not table:
        return "No pairs: one engine has nothing to be compared with."
    bad = [row for row in table if not row["ok"]]
    parts = []
    if bad:
        reasons = any(row.get("reason") for row in bad)
        parts += ["**Out of tolerance**", _pair_table(bad, reason=reasons)]
    return "\n\n".join([*parts, folded(f"All {len(table)} pairs", _pair_table(table), len(table))])


def _pair_table(table: Sequence[Row], *, reason: bool = False) -> str:
    head = [
        "quantity",
        "unit",
        "a",
        "b",
        "max abs",
        "rms",
        "max scaled",
        "tolerance",
        "worst at",
        "rule",
        "unique",
        "within",
    ]
    body = []
    for row in table:
        line = [
            row["quantity"],
            unit_text(row["unit"]),
            row["a"],
            row["b"],
            size(row["max_abs"]),
            size(row["rms"]),
            size(row["max_scaled"]),
            number(row["tolerance"], 2),
            _worst(row),
            row["rule"] or "-",
            "yes" if row["unique"] else "no",
            tick(row["ok"]),
        ]
        body.append([*line, row["reason"]] if reason else line)
    return markdown_table([*head, "reason"] if reason else head, body, (4, 5, 6, 7))


def _worst(row: Row) -> str:
    component = row.get("worst_component")
    if missing(component) or not component:
        return "-"
    return str(component) if missing(row["worst_t"]) else f"{component} @ {number(row['worst_t'])} s"


def judge(results: Results) -> str:
    """Residuals of each engine against the equations themselves: residual by engine, then all of it."""
    table = rows(results.judge)
    if not table:
        return "Nothing was judged: the quantities asked for do not suffice."
    names = list(dict.fromkeys(row["engine"] for row in table))
    body: dict[tuple[str, str], dict[str, str]] = {}
    for row in table:
        text = size(row["max_scaled"]) + ("" if row["ok"] else " ✗")
        body.setdefault((row["residual"], row["unit"]), {})[row["engine"]] = text
    lines = [
        [residual.replace("_", " "), unit_text(unit), *(cells.get(name, "") for name in names)]
        for (residual, unit), cells in body.items()
    ]
    head = ["residual, scaled", "unit", *names]
    details = folded(f"All {len(table)} residuals", _judge_table(table), len(table))
    return markdown_table(head, lines, range(2, len(head))) + "\n\n" + details


def _judge_table(table: Sequence[Row]) -> str:
    reason = any(row.get("reason") for row in table)
    head = ["engine", "residual", "unit", "max abs", "max scaled", "tolerance", "worst at", "within"]
    body = []
    for row in table:
        line = [
            row["engine"],
            str(row["residual"]).replace("_", " "),
            unit_text(row["unit"]),
            size(row["max_abs"]),
            size(row["max_scaled"]),
            number(row["tolerance"], 2),
            _worst(row),
            tick(row["ok"]),
        ]
        body.append([*line, row["reason"]] if reason else line)
    return markdown_table([*head, "reason"] if reason else head, body, (3, 4, 5))


def scene(results: Results) -> str:
    """What was computed."""
    here, t = results.scene, results.times
    span = f"{number(t[0])} s" if len(t) == 1 else f"{number(t[0])} to {number(t[-1])} s"
    facts = [
        ("scene", here.name),
        ("mechanism", here.mechanism.title or here.mechanism.name),
        ("source", here.mechanism.source),
        ("samples", f"{len(t)}, t = {span}"),
        ("independent coordinates", ", ".join(f"{k} = {v}" for k, v in here.mechanism.independent.items())),
        ("gravity", f"{_vector(here.gravity)} m/s²"),
        *(("load", _load(load)) for load in here.loads),
        *acting(here),
        *([("rule for redundant forces", here.rule)] if here.forward is None else integrated(here, here.forward)),
    ]
    table = markdown_table(["", ""], [fact for fact in facts if fact[1]])
    return f"{cell(here.description)}\n\n{table}" if here.description else table


def _vector(vector: Any) -> str:
    return "(" + ", ".join(number(x) for x in vector) + ")"


def _load(load: Load) -> str:
    point = "its centre of mass" if load.point is None else f"{_vector(load.point)} m in its frame"
    parts = [f"force {_vector(load.force)} N"] if np.any(load.force) else []
    parts += [f"moment {_vector(load.torque)} N·m"] if np.any(load.torque) else []
    return f"on {load.body} at {point}, world axes: {', '.join(parts) or 'none'}"


def engines(results: Results) -> str:
    """Who ran, and what they had to say."""
    body = [
        [name, s.version, "given" if name == REFERENCE else _status(s, results.times)]
        for name, s in results.solutions.items()
    ]
    body += [[name, "", f"✗ {failure.reason}"] for name, failure in results.failures.items()]
    notes = [f"- {name}: {cell(note)}" for name, s in results.solutions.items() for note in s.notes]
    return "\n\n".join([markdown_table(["engine", "version", "status"], body), *(["\n".join(notes)] if notes else [])])


def _status(solution: Solution, t: Array) -> str:
    """Ran to the end, or how far."""
    stopped = any(note.startswith("stopped: ") for note in solution.notes)
    if not stopped or solution.rows is None:
        return "ran"
    return f"✗ stopped after t = {number(t[solution.rows[-1]])} s" if len(solution.rows) else "✗ stopped"


def facts(mapping: Mapping[str, Any], empty: str) -> str:
    """A table of names and values, one level of nesting spread out."""
    body = []
    for name, value in mapping.items():
        if isinstance(value, Mapping) and not _flags(value):
            body += [[f"{_words(name)}: {key}", _text(item)] for key, item in value.items()]
        else:
            body.append([_words(name), _text(value)])
    return markdown_table(["", ""], body) if body else empty


def _words(name: str) -> str:
    return str(name).replace("_", " ")


def _flags(value: Mapping[str, Any]) -> bool:
    return bool(value) and all(isinstance(item, (bool, np.bool_)) for item in value.values())


def _text(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, Mapping) and _flags(value):
        sides = ((word, [str(k) for k, v in value.items() if bool(v) is side]) for word, side in _SIDES)
        return "; ".join(f"{word}: {', '.join(names)}" for word, names in sides if names)
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(_text(item) for item in value)
    if isinstance(value, (float, np.floating)):
        return number(value)
    return str(value)


_SIDES = (("yes", True), ("no", False))


def timings(results: Results) -> str:
    """Measured stages with what the clock covers."""
    found = [timing for solution in results.solutions.values() for timing in solution.timings]
    head = [
        "engine",
        "setting",
        "stage",
        "samples",
        "min [s]",
        "median [s]",
        "median per sample [µs]",
        "covers",
    ]
    body = [
        [
            x.engine,
            x.setting,
            x.stage,
            x.n_sample,
            number(x.min_s, 3),
            number(x.median_s, 3),
            number(1e6 * x.median_s / max(x.n_sample, 1), 3),
            x.covers,
        ]
        for x in found
    ]
    return markdown_table(head, body, (3, 4, 5, 6)) if body else "Nothing was timed."


def folded(title: str, text: str, n_rows: int) -> str:
    """A long table behind a fold; GitHub and the HTML page both understand it."""
    if n_rows <= LONG:
        return text
    return f'<details markdown="1">\n<summary>{title}</summary>\n\n{text}\n\n</details>'
