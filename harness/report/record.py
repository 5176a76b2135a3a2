"""A run as plain data: ``summary.json``, and every sample for ``samples.parquet``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import pandas as pd

from screwgauge.environment import plain
from screwgauge.report.formatting import Row, rows
from screwgauge.report.verdict import first_difference
from screwgauge.solution import REFERENCE, Timing
from screwgauge.study.comparison import Comparison

JUDGE_KEYS = ("engine", "residual", "unit", "max_abs", "max_scaled", "tolerance", "ok")
FILES = ("models", "scene_file", "scene_sha256", "description", "date", "schema")


def timings(results: Comparison) -> list[Timing]:
    """Measured stages of all engines."""
    return [timing for solution in results.solutions.values() for timing in solution.timings]


def samples_table(results: Comparison) -> pd.DataFrame:
    """Every sample: column t and one column ``engine/quantity/component`` for each value."""
    values = {
        f"{engine}/{quantity}/{name}": column
        for engine, solution in results.solutions.items()
        for quantity, found in solution.values.items()
        for name, column in zip(found.components, found.array.T, strict=True)
    }
    return pd.DataFrame({"t": results.times, **values})


def summary(results: Comparison) -> dict[str, Any]:
    """What ``summary.json`` says, as plain Python values: no NaN, no numpy."""
    cover = results.coverage
    found = {
        "scene": results.scene.name,
        "ok": results.ok,
        "engines": {name: s.version for name, s in results.solutions.items() if name != REFERENCE},
        "failures": {name: failure.reason for name, failure in results.failures.items()},
        "warnings": results.warnings,
        "engine_warnings": {name: s.warnings for name, s in results.solutions.items() if s.warnings},
        "first_difference": first_difference(results),
        "known": results.known,
        "not_unique": results.not_unique,
        "quantities": [_quantity(row) for row in rows(results.pairs)],
        "judge": [{key: row[key] for key in JUDGE_KEYS} for row in rows(results.judge)],
        "guard": [{**asdict(row), "ok": row.ok} for row in results.guard],
        "refused": [
            {"engine": x.engine, "quantities": x.quantities, "samples": len(x.rows), "reason": x.sentence}
            for x in results.refusals
        ],
        "coverage": {
            "sentence": cover.sentence,
            "parameters": len(cover.parameters),
            "untested": [*cover.untested, *cover.absent],
            "terms": cover.shares,
        },
        "timings": [asdict(timing) for timing in timings(results)],
        "environment": results.environment,
        **{key: results.provenance.get(key) for key in FILES},
    }
    return dict(plain(found))


def _quantity(row: Row) -> Row:
    worst = {"component": row["worst_component"], "t": row["worst_t"]}
    reason = {"reason": row["reason"]} if row.get("reason") else {}
    first = {key: row[key] for key in ("quantity", "a", "b", "unit", "max_abs", "rms", "max_scaled")}
    return {**first, "worst": worst, **{key: row[key] for key in ("rule", "unique", "tolerance", "ok")}, **reason}
