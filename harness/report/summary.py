"""``summary.json``: what a run found, for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from screwgauge.report.formatting import Row, rows
from screwgauge.report.verdict import first_difference
from screwgauge.solution import REFERENCE
from screwgauge.study.results import Results

PAIR_KEYS = ("quantity", "a", "b", "unit", "max_abs", "rms", "max_scaled")
JUDGE_KEYS = ("engine", "residual", "unit", "max_abs", "max_scaled", "tolerance", "ok")


def summary(results: Results) -> dict[str, Any]:
    """The summary as plain Python values: no NaN, no numpy."""
    found: dict[str, Any] = plain(
        {
            "scene": results.scene.name,
            "ok": results.ok,
            "engines": {name: s.version for name, s in results.solutions.items() if name != REFERENCE},
            "failures": {name: failure.reason for name, failure in results.failures.items()},
            "warnings": results.warnings,
            "first_difference": first_difference(results),
            "quantities": [_pair(row) for row in rows(results.pairs)],
            "judge": [{key: row[key] for key in JUDGE_KEYS} for row in rows(results.judge)],
            "guard": [{**asdict(row), "ok": row.ok} for row in results.guard],
            "refused": [
                {"engine": x.engine, "quantities": x.quantities, "samples": len(x.rows), "reason": x.sentence}
                for x in results.refusals
            ],
            "timings": [asdict(timing) for s in results.solutions.values() for timing in s.timings],
            "environment": results.environment,
        }
    )
    return found


def _pair(row: Row) -> Row:
    worst = {"component": row["worst_component"], "t": row["worst_t"]}
    tail = {key: row[key] for key in ("rule", "unique", "tolerance", "ok")}
    reason = {"reason": row["reason"]} if row.get("reason") else {}
    return {**{key: row[key] for key in PAIR_KEYS}, "worst": worst, **tail, **reason}


def plain(value: Any) -> Any:
    """The value as JSON knows it; what is not a finite number becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def json_text(value: Any) -> str:
    """Indented JSON that every reader takes."""
    return json.dumps(plain(value), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def summary_text(results: Results) -> str:
    """The content of ``summary.json``."""
    return json_text(summary(results))
