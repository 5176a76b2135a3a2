"""A run as plain data: scene, files, ranges of forces, ``summary.json``, and all samples for ``samples.parquet``."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict
from pathlib import PurePath
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.environment import plain
from screwgauge.quantities import QUANTITIES
from screwgauge.reference.applied import JointSpring, Load, Motor, Spring
from screwgauge.reference.courses import Course, Samples
from screwgauge.reference.rotations import Array
from screwgauge.report import reviewed
from screwgauge.report.verdict import first_difference
from screwgauge.scene.assumed import assumptions
from screwgauge.scene.observables import NOT_UNIQUE
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE, TRUTH, Solution, Timing
from screwgauge.study.comparison import Comparison
from screwgauge.study.formatting import Row, number, rows, span, vector

JUDGE_KEYS = ("engine", "residual", "unit", "max_abs", "max_scaled", "tolerance", "ok")
KINDS = {"N": "force", "N m": "moment"}
NOTHING = 1e-12  # share of the largest force or moment below which a value is rounding
EXPORTED = ("joint_position", "actuator_force", "reaction", "observable")
#: Quantities that are computed only if requested by name, and are then included in the table.
NAMED = tuple(name for name, quantity in QUANTITIES.items() if quantity.named)
FILES = ("models", "scene_file", "scene_sha256", "description", "date", "schema")


def timings(results: Comparison) -> list[Timing]:
    """Return the timed stages of all engines."""
    return [timing for solution in results.solutions.values() for timing in solution.timings]


def samples_table(results: Comparison) -> pd.DataFrame:
    """Build a table of every sample: column t and one column ``engine/quantity/component`` for each value."""
    values = {
        f"{engine}/{quantity}/{name}": column
        for engine, solution in results.solutions.items()
        for quantity, given in solution.values.items()
        for name, column in zip(given.components, given.array.T, strict=True)
    }
    return pd.DataFrame({"t": results.times, **values})


def values_table(
    solution: Solution,
    t: Array,
    quantities: Collection[str] | None = None,
    not_unique: Mapping[str, Collection[str]] | None = None,
) -> pd.DataFrame:
    """Build a table of an engine's samples in the format of a user's table; default quantities: `EXPORTED`, `NAMED`.

    Args:
        not_unique: Quantity -> components without a unique value; their headers end with `NOT_UNIQUE`.
    """
    wanted, open_ = quantities or {*solution.values} & {*EXPORTED, *NAMED} or solution.values, not_unique or {}
    columns = {
        f"{quantity}/{name} [{unit}]{NOT_UNIQUE * (name in open_.get(quantity, ()))}": column
        for quantity, given in solution.values.items()
        if quantity in wanted
        for name, unit, column in zip(given.components, given.units, given.array.T, strict=True)
    }
    table = pd.DataFrame({"t [s]": t, **columns})
    return table if solution.rows is None else table.iloc[solution.rows]


def forces(results: Comparison) -> list[Row]:
    """Return the smallest and the largest value of each force, and when they occur: actuators, then joint reactions.

    Reactions are given by the magnitudes of force and moment, computed from the components with a unique value. Rows
    have columns of, what, unit, min, t_min, max, t_max, components, engine.
    """
    sized, not_unique = list[Row](), results.not_unique
    for quantity, lead in (("actuator_force", "actuator"), ("reaction", "reaction")):
        if (solution := _measured_by(results, quantity)) is None:
            continue
        values, parts = solution.values[quantity], dict[tuple[str, str], list[int]]()
        for i, name in enumerate(values.components):
            if name not in not_unique.get(quantity, ()):
                joint = name.rpartition(".")[0] if quantity == "reaction" else name
                parts.setdefault((joint, values.units[i]), []).append(i)
        for (joint, unit), columns in parts.items():
            array = values.array[:, columns]
            sizes = array[:, 0] if quantity == "actuator_force" else np.sqrt(np.einsum("ni,ni->n", array, array))
            sizes = np.where(np.isfinite(sizes), sizes, np.nan)
            if np.isnan(sizes).all():
                continue
            low, high = int(np.nanargmin(sizes)), int(np.nanargmax(sizes))
            row: Row = {"of": joint, "what": f"{lead} {KINDS.get(unit, 'force')}", "unit": unit}
            row |= {"min": float(sizes[low]), "t_min": float(results.times[low])}
            row |= {"max": float(sizes[high]), "t_max": float(results.times[high])}
            names = [values.components[i].rpartition(".")[2] for i in columns] if quantity == "reaction" else []
            sized.append({**row, "components": " ".join(names), "engine": solution.engine})
    return _without_rounding(sized)


def _measured_by(results: Comparison, quantity: str) -> Solution | None:
    """Return the solution of `TRUTH` if it has all samples, else the solution of the first engine with the quantity."""
    known = [solution for solution in results.solutions.values() if quantity in solution.values]
    certain = (solution for solution in known if solution.engine == TRUTH and solution.rows is None)
    return next(certain, known[0] if known else None)


def _without_rounding(sized: list[Row]) -> list[Row]:
    """Replace rounding errors, i.e. values below a fraction of the largest value with the same unit, with zero."""
    largest = dict[str, float]()
    for row in sized:
        largest[row["unit"]] = max(largest.get(row["unit"], 0.0), abs(row["min"]), abs(row["max"]))
    return [
        {**row, **{key: row[key] if abs(row[key]) > NOTHING * largest[row["unit"]] else 0.0 for key in ("min", "max")}}
        for row in sized
    ]


def summary(results: Comparison) -> dict[str, Any]:
    """Build the content of ``summary.json`` as plain Python values, without NaN or numpy types."""
    cover = results.coverage
    content = {
        "scene": results.scene.name,
        "ok": results.ok,
        "outcomes": results.outcomes,
        "undecided": {"samples": results.undecided, "of": len(results.times)},
        "engines": {name: s.version for name, s in results.solutions.items() if name != REFERENCE},
        "failures": {name: failure.reason for name, failure in results.failures.items()},
        "warnings": results.warnings,
        "engine_warnings": {name: s.warnings for name, s in results.solutions.items() if s.warnings},
        "first_difference": first_difference(results),
        "tables": {name: reviewed.summary(review) for name, review in results.reviews.items()},
        "known": results.known,
        "not_unique": results.not_unique,
        "left_out": [{**asdict(term), "inertia": term.inertia} for term in results.left_out.terms],
        "left_out_contained": results.left_out.contained,
        "quantities": [_quantity(row) for row in rows(results.pairs)],
        "judge": [{key: row[key] for key in JUDGE_KEYS} for row in rows(results.judge)],
        "guard": [*_guard(results)],
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
    return dict(plain(content))


def _guard(results: Comparison) -> Iterator[Row]:
    """Yield the largest error that each engine estimates for each quantity, with its condition number and time."""
    for (engine, quantity), error in results.guard.items():
        yield {
            "engine": engine,
            "quantity": quantity,
            "condition": error.worst_condition,
            "estimate": error.largest,
            "flagged": int(error.flagged.sum()),
            "n_sample": len(error.scaled),
            "worst_t": results.times[error.worst],
            "ok": error.ok,
        }


def _quantity(row: Row) -> Row:
    worst = {"component": row["worst_component"], "t": row["worst_t"]}
    more = {key: row[key] for key in ("undecided", "reason") if row.get(key)}
    first = {key: row[key] for key in ("quantity", "a", "b", "unit", "max_abs", "rms", "max_scaled")}
    return {**first, "worst": worst, **{key: row[key] for key in ("rule", "unique", "tolerance", "ok")}, **more}


def judged_files(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Return the files of the scene, the description and the models, with hashes, and the date."""
    files = {
        "scene file": {"file": provenance.get("scene_file"), "sha256": provenance.get("scene_sha256")},
        "description": provenance.get("description", {}),
        **{f"model of {engine}": model for engine, model in provenance.get("models", {}).items()},
    }
    named = {what: f"{file['file']}, SHA-256 {file['sha256']}" for what, file in files.items() if file.get("file")}
    return {**named, "date": provenance.get("date", "")}


def shorten_hashes(judged: Mapping[str, str]) -> dict[str, str]:
    """Shorten paths to file names, and hashes to their first digits."""

    def shorten(text: str) -> str:
        file, sha, digest = text.rpartition(", SHA-256 ")
        return f"{PurePath(file).name} (SHA-256 {digest[:8]})" if sha else text

    return {what: shorten(text) for what, text in judged.items() if text}


def samples(t: Array) -> str:
    """Format a grid of times: ``101 samples, t = 0 to 1 s``."""
    return f"{len(t)} sample{'s' * (len(t) != 1)}, t = {span(number(t[0]), number(t[-1]))} s"


def describe_run(scene: Scene, t: Array) -> dict[str, Any]:
    """Describe the computation as a table of names and values."""
    described = {
        "scene": scene.name,
        "mechanism": scene.mechanism.title or scene.mechanism.name,
        "source": scene.mechanism.source,
        "samples": samples(t),
        "independent coordinates": ", ".join(f"{k} = {v}" for k, v in scene.mechanism.independent.items()),
        "gravity": f"{vector(scene.applied.g)} m/s²",
        "load": [*map(_load, scene.applied.loads)],
        "motion": [f"{label} = {_inline(table)}" for label, table in scene.text.get("motion", {}).items()],
        "undriven coordinates": [*assumptions(scene)],
        "grid": "" if scene.grid is None else scene.grid.extent,
        "cells without numbers": [] if scene.grid is None else scene.grid.told,
        "spring and damper": [*map(_spring, scene.applied.springs)],
        "motor": [*map(_motor, scene.applied.motors)],
    }
    return {**described, **(_simulation(scene) if scene.simulated else {"rule for redundant forces": scene.rule})}


def _simulation(scene: Scene) -> dict[str, str]:
    """Describe the start, the integration and the observables of a simulation."""
    names, start = scene.mechanism.independent, scene.start
    place, rates = (
        ", ".join(f"{name} = {number(value)}" for name, value in zip(names, values, strict=True))
        for values in (start.start, start.rates)
    )
    method = start.integration
    return {
        "start": f"t = {number(start.since)} s, {place}",
        "initial velocities": rates,
        "integrated by": f"{method.name}, rtol {number(method.rtol)}, atol {number(method.atol)}",
        "observables": ", ".join(f"{item.name} [{item.unit}]" for item in scene.observables),
        REFERENCE: "" if scene.known is None else scene.known.source,
    }


def _inline(value: Any) -> str:
    """Format a value of a scene file on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    return f"[{', '.join(map(_inline, value))}]" if isinstance(value, list) else f'"{value}"'


def _load(load: Load) -> str:
    point = "its centre of mass" if load.point is None else f"{vector(load.point)} m in its frame"
    axes = "world axes" if load.axes == "world" else "axes of the body"
    named = (("force", load.force, "N"), ("moment", load.torque, "N·m"))
    parts = [f"{name} {vector(values)} {unit}" for name, values, unit in named if np.any(values)]
    if load.courses:
        units = ["N"] * 3 + ["N·m"] * 3
        each = zip(("Fx", "Fy", "Fz", "Mx", "My", "Mz"), load.courses, units, strict=True)
        parts = [f"{name} = {_over_time(course)} {unit}" for name, course, unit in each if not course.nothing]
    return f"on {load.body} at {point}, {axes}: {', '.join(parts) or 'none'}"


def _spring(spring: Spring) -> str:
    amounts = f"k = {number(spring.stiffness)}, rest {number(spring.rest)}, c = {number(spring.damping)}"
    if isinstance(spring, JointSpring):
        return f"along {spring.coordinate}: {amounts}"
    first, second = vector(spring.first_point), vector(spring.second_point)
    return f"from {spring.first} {first} to {spring.second} {second}: {amounts}"


def _motor(motor: Motor) -> str:
    return f"along {motor.coordinate}: {_over_time(motor.course)}"


def _over_time(course: Course | Samples) -> str:
    """Format a function of time as a formula, or name the file with its samples."""
    if isinstance(course, Samples):
        return f"samples of {PurePath(course.file).name}"
    powers = ("", " t", *(f" t^{k}" for k in range(2, len(course.polynomial))))
    terms = [f"{number(c)}{power}" for c, power in zip(course.polynomial.tolist(), powers, strict=False) if c]
    for omega, cos, sin in course.harmonics.tolist():
        terms += (f"{number(c)} {name} {number(omega)} t" for c, name in ((cos, "cos"), (sin, "sin")) if c)
    return " + ".join(terms) or "0"
