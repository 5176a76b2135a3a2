"""A run as plain data: ``summary.json``, the size of forces, and every sample for ``samples.parquet``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.environment import plain
from screwgauge.report.formatting import Row, rows
from screwgauge.report.verdict import first_difference
from screwgauge.solution import REFERENCE, Solution, Timing
from screwgauge.study.comparison import Comparison
from screwgauge.study.reference_values import TRUTH

JUDGE_KEYS = ("engine", "residual", "unit", "max_abs", "max_scaled", "tolerance", "ok")
KINDS = {"N": "force", "N m": "moment"}
NOTHING = 1e-12  # share of the largest force, or moment, below which one is rounding
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


def forces(results: Comparison) -> list[Row]:
    """Smallest and largest force over the motion with their times: of actuators, then of the reactions in joints.

    Of a reaction it is the magnitude of the force, and of the moment, from those components that have a unique value.
    Rows of, what, unit, min, t_min, max, t_max, components, engine.
    """
    found = list[Row]()
    for quantity, lead in (("actuator_force", "actuator"), ("reaction", "reaction")):
        if (solution := _measured_by(results, quantity)) is None:
            continue
        values, parts = solution.values[quantity], dict[tuple[str, str], list[int]]()
        for i, name in enumerate(values.components):
            if name not in results.not_unique.get(quantity, ()):
                joint = name.rpartition(".")[0] if quantity == "reaction" else name
                parts.setdefault((joint, values.units[i]), []).append(i)
        for (joint, unit), columns in parts.items():
            array = values.array[:, columns]
            sizes = array[:, 0] if quantity == "actuator_force" else np.linalg.norm(array, axis=1)
            if not np.isfinite(sizes).any():
                continue
            low, high = int(np.nanargmin(sizes)), int(np.nanargmax(sizes))
            row = {"of": joint, "what": f"{lead} {KINDS[unit]}", "unit": unit}
            row |= {"min": float(sizes[low]), "t_min": float(results.times[low])}
            row |= {"max": float(sizes[high]), "t_max": float(results.times[high])}
            names = [values.components[i].rpartition(".")[2] for i in columns] if quantity == "reaction" else []
            found.append({**row, "components": " ".join(names), "engine": solution.engine})
    return _without_rounding(found)


def _measured_by(results: Comparison, quantity: str) -> Solution | None:
    """The truth where it knows all samples, else the first engine that has the quantity."""
    known = [solution for solution in results.solutions.values() if quantity in solution.values]
    certain = (solution for solution in known if solution.engine == TRUTH and solution.rows is None)
    return next(certain, known[0] if known else None)


def _without_rounding(found: list[Row]) -> list[Row]:
    """What is zero but for rounding beside the largest of its unit is zero."""
    largest = dict[str, float]()
    for row in found:
        largest[row["unit"]] = max(largest.get(row["unit"], 0.0), abs(row["min"]), abs(row["max"]))
    return [
        {**row, **{key: row[key] if abs(row[key]) > NOTHING * largest[row["unit"]] else 0.0 for key in ("min", "max")}}
        for row in found
    ]


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
        "forces": forces(results),
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
