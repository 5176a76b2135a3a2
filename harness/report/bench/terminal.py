"""What ``screwgauge bench`` prints. Fits 100 columns."""

from __future__ import annotations

import textwrap

from screwgauge.report.bench.report import duration, headline
from screwgauge.report.formatting import number, rows, text_table, tick
from screwgauge.study.bench.rows import LEVELS, reach
from screwgauge.study.bench.run import Bench
from screwgauge.study.bench.slopes import table

COLUMNS = 100


def format_terminal(bench: Bench) -> str:
    """Headline, time to reach nine digits, slopes."""
    parts = textwrap.wrap(headline(bench), COLUMNS)
    if bench.reference != "truth":
        parts += ["", *textwrap.wrap(f"Errors are against {bench.reference}, not against a truth.", COLUMNS)]
    found = [row for row in rows(reach(bench.rows)) if row["error"] == LEVELS[2]]
    head = (f"to {LEVELS[2]:.0e}", "family", "a sample", "contestant, setting")
    body = [
        (
            row["quantity"],
            row["family"] + (" †" if row["given"] else ""),
            duration(row["seconds_per_sample"]),
            f"{row['contestant']}: {row['setting']}"[:42],
        )
        for row in found
        if row["quantity"] in ("joint_acceleration", "actuator_force")
    ]
    if body:
        parts += ["", *text_table(head, body, right=(2,)), "† starts from given joint motion"]
    if bench.fits:
        lines = [
            (r["family"], r["quantity"], number(r["expected"]), number(r["fitted"], 4), tick(r["ok"]))
            for r in rows(table(bench.fits))
        ]
        parts += ["", *text_table(("slope", "quantity", "expected", "fitted", ""), lines, right=(2, 3))]
    return "\n".join(line[:COLUMNS].rstrip() for line in parts)
