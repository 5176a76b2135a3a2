"""What ``screwgauge run`` prints: verdict, quantities, judge. Fits 100 columns."""

from __future__ import annotations

import textwrap

import numpy as np

from screwgauge.report.formatting import Row, digits, number, rows, size, text_table, tick
from screwgauge.report.guard import guard_line
from screwgauge.report.verdict import compared, verdict
from screwgauge.study.results import Results

COLUMNS = 100


def format_terminal(results: Results) -> str:
    """The run in a few lines: the worst pair of each quantity and unit, the worst engine of each residual."""
    found = verdict(results)
    parts = [*textwrap.wrap(f"{found.word}: {found.sentence}", COLUMNS)]
    for warning in results.warnings:
        parts += ["", *textwrap.wrap(f"Warning: {warning}", COLUMNS)]
    pairs = compared(results)
    if pairs:
        parts += ["", *_pairs(pairs)]
    if len(results.judge):
        parts += ["", *_judge(rows(results.judge))]
    parts += ["", *textwrap.wrap(guard_line(results), COLUMNS)] if results.guard else []
    return "\n".join(line[:COLUMNS].rstrip() for line in parts)


def _worst(group: list[Row]) -> Row:
    """Out of tolerance first, then the largest; a missing number is worse than any."""

    def badness(row: Row) -> tuple[bool, float]:
        scaled = float(row["max_scaled"])
        return not row["ok"], np.inf if np.isnan(scaled) else scaled

    return max(group, key=badness)


def _groups(table: list[Row], *keys: str) -> list[Row]:
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in table:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return [_worst(group) for group in groups.values()]


def _pairs(table: list[Row]) -> list[str]:
    head = ("quantity", "unit", "worst pair", "scaled", "digits", "tolerance", "")
    body = [
        (
            str(row["quantity"]),
            str(row["unit"]),
            f"{row['a']} - {row['b']}",
            size(row["max_scaled"]),
            _digits(row),
            number(row["tolerance"], 2),
            tick(row["ok"]),
        )
        for row in _groups(table, "quantity", "unit")
    ]
    return text_table(head, body, right=(3, 4, 5))


def _judge(table: list[Row]) -> list[str]:
    head = ("judge: residual", "unit", "worst engine", "scaled", "digits", "tolerance", "")
    body = [
        (
            str(row["residual"]).replace("_", " "),
            str(row["unit"]),
            str(row["engine"]),
            size(row["max_scaled"]),
            _digits(row),
            number(row["tolerance"], 2),
            tick(row["ok"]),
        )
        for row in _groups(table, "residual", "unit")
    ]
    return text_table(head, body, right=(3, 4, 5))


def _digits(row: Row) -> str:
    value = digits(row["max_scaled"])
    return "-" if np.isnan(value) else f"{value:.1f}"
