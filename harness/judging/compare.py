"""Compares solutions pair by pair, quantity by quantity. Metrics only; no engine is the truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.judging.refusals import Refusal
from screwgauge.quantities import QUANTITIES, natural_scales
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.solution import Failure, Solution, Values, common_rows

#: Stands for a rule where redundant constraints leave a force open: any value balances, so none is compared.
UNDETERMINED = "undetermined"

ERROR_COLUMNS = [
    *("quantity", "component", "unit", "a", "b", "max_abs", "rms", "max_scaled", "scale", "worst_t"),
    *("rule", "unique", "tolerance", "ok"),
]
PAIR_COLUMNS = [
    *("quantity", "a", "b", "unit", "max_abs", "rms", "max_scaled", "worst_component", "worst_t"),
    *("rule", "unique", "tolerance", "ok", "reason"),
]


def compare(
    scene: Scene,
    solutions: Mapping[str, Solution],
    failures: Mapping[str, Failure],
    mobility: Mobility,
    refusals: Sequence[Refusal] = (),
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors of every pair of solutions.

    Args:
        failures: Engines that have none; their pairs are rows that say why.
        mobility: Which forces are unique, and which are determined at all.
        refusals: Samples without numbers, and why.

    Returns:
        One row per component, and one row per quantity and unit (see `Results`).
    """
    errors: list[dict[str, Any]] = []
    pairs: list[dict[str, Any]] = []
    scales = natural_scales(scene.mechanism)
    # what has radii is the reference: first of its pairs, and the measure of all others
    ordered = sorted(solutions.values(), key=lambda solution: not solution.radius)
    for quantity in QUANTITIES:
        for a, b in combinations(ordered, 2):
            if quantity not in a.values or quantity not in b.values or not _comparable(quantity, a, b):
                continue
            if a.values[quantity].components != b.values[quantity].components:
                pairs.append(_incomparable(scene, quantity, a, b))
                continue
            reference = _reference(ordered, a.values[quantity], quantity)
            for unit in dict.fromkeys(reference.units):
                scale = reference_scale(reference, unit, scales[unit])
                rows = list(_components(scene, quantity, unit, a, b, scale, mobility))
                errors += rows
                if compared := [row for row in rows if row["rule"] != UNDETERMINED]:
                    pairs.append(_explained(_pair(compared), a, b, refusals))
    pairs += _failed(scene, solutions, failures)
    return pd.DataFrame(errors, columns=ERROR_COLUMNS), pd.DataFrame(pairs, columns=PAIR_COLUMNS)


def _comparable(quantity: str, a: Solution, b: Solution) -> bool:
    """Joint forces of an open tree have a meaning only for that tree: other cuts have others."""
    names = [set(solution.values[quantity].components) for solution in (a, b)]
    return not quantity.startswith("tree_force") or not (names[0] < names[1] or names[1] < names[0])


def _reference(solutions: Sequence[Solution], like: Values, quantity: str) -> Values:
    """The values of the first engine of the run that has these components: one scale for all pairs."""
    found = (s.values[quantity] for s in solutions if quantity in s.values)
    return next(values for values in found if values.components == like.components)


def reference_scale(values: Values, unit: str, floor: float) -> float:
    """S of the scaled error: the largest magnitude of the reference in this unit, at least 1e-6 S0."""
    columns = [i for i, u in enumerate(values.units) if u == unit]
    size = np.abs(values.array[:, columns])
    return max(float(np.nanmax(size, initial=0.0)) if np.isfinite(size).any() else 0.0, 1e-6 * floor)


def _components(
    scene: Scene, quantity: str, unit: str, a: Solution, b: Solution, scale: float, mobility: Mobility
) -> Iterator[dict[str, Any]]:
    first, second = a.values[quantity], b.values[quantity]
    rows = common_rows(len(scene.motion), a, b)
    t = scene.motion.t[rows]
    derived = max(a.tolerances.get(quantity, 0.0), b.tolerances.get(quantity, 0.0)) / scale
    tolerance = scene.tolerance(quantity) + derived
    ruled = QUANTITIES[quantity].ruled
    unique = dict(zip(mobility.names, mobility.unique, strict=True))
    determined = dict(zip(mobility.names, mobility.determined, strict=True))
    for k, component in enumerate(first.components):
        if first.units[k] != unit:
            continue
        difference = np.abs(first.array[rows, k] - second.array[rows, k])
        i, worst = _worst(difference)
        open_ = ruled and not determined.get(component, True)
        yield {
            "quantity": quantity,
            "component": component,
            "unit": unit,
            "a": a.engine,
            "b": b.engine,
            "max_abs": worst,
            "rms": float(np.sqrt(np.mean(difference**2))),
            "max_scaled": worst / scale,
            "scale": scale,
            "worst_t": float(t[i]),
            "rule": UNDETERMINED if open_ else scene.rule if ruled else "",
            "unique": unique.get(component, True) if ruled else True,
            "tolerance": tolerance,
            "ok": open_ or bool(worst / scale <= tolerance),
        }


def _worst(difference: Array) -> tuple[int, float]:
    """Sample and size of the largest difference; what is not a number is worse than anything."""
    i = int(np.argmax(np.where(np.isfinite(difference), difference, np.inf)))
    return i, float(difference[i]) if np.isfinite(difference[i]) else float("nan")


def _pair(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Sums up the components of one quantity and unit."""
    sizes = np.array([row["max_scaled"] for row in rows])
    worst = rows[int(np.argmax(np.where(np.isfinite(sizes), sizes, np.inf)))]
    lost = not np.isfinite(worst["max_scaled"])
    return {
        **{key: worst[key] for key in ("quantity", "a", "b", "unit", "max_abs", "max_scaled", "worst_t", "rule")},
        "rms": float(np.sqrt(np.mean([row["rms"] ** 2 for row in rows]))),
        "worst_component": worst["component"],
        "unique": all(row["unique"] for row in rows),
        "tolerance": worst["tolerance"],
        "ok": all(row["ok"] for row in rows),
        "reason": f"not a number at t = {worst['worst_t']:g} s" if lost else "",
    }


def _explained(row: dict[str, Any], a: Solution, b: Solution, refusals: Sequence[Refusal]) -> dict[str, Any]:
    """The row with the reason of a pair out of tolerance, where the engines themselves know one."""
    if row["ok"]:
        return row
    for one in refusals:
        if one.engine in (a.engine, b.engine) and row["quantity"] in one.quantities:
            return {**row, "reason": f"{one.engine}: {one.sentence}"}
    admitted = {s.engine: _admitted(s, row["quantity"]) for s in (a, b)}
    engine = max(admitted, key=lambda name: admitted[name])
    if row["reason"] or not admitted[engine] >= row["max_scaled"]:
        return row
    size = f"{admitted[engine]:.1g}" if np.isfinite(admitted[engine]) else "no digit"
    return {**row, "reason": f"within the error that {engine} admits by its conditioning ({size})"}


def _admitted(solution: Solution, quantity: str) -> float:
    return float(np.max(solution.estimate.get(quantity, np.zeros(1)), initial=0.0))


def _incomparable(scene: Scene, quantity: str, a: Solution, b: Solution) -> dict[str, Any]:
    names = [set(solution.values[quantity].components) for solution in (a, b)]
    odd = sorted(names[0] ^ names[1])
    row = nothing(scene, quantity, a.engine, b.engine, "the components differ")
    return {**row, "worst_component": odd[0] if odd else ""}


def _failed(
    scene: Scene, solutions: Mapping[str, Solution], failures: Mapping[str, Failure]
) -> Iterator[dict[str, Any]]:
    """Rows of the pairs in which one engine failed: no numbers, but the reason."""
    for solution in solutions.values():
        for failure in failures.values():
            for quantity in solution.values:
                yield nothing(scene, quantity, solution.engine, failure.engine, failure.reason)


def nothing(scene: Scene, quantity: str, a: str, b: str, reason: str) -> dict[str, Any]:
    """The row of a pair that has no numbers, with the reason."""
    lost = dict.fromkeys(("max_abs", "rms", "max_scaled", "worst_t"), float("nan"))
    empty = {"unit": "", "worst_component": "", "rule": "", "unique": True}
    tolerance = scene.tolerance(quantity)
    return {
        **lost,
        **empty,
        "quantity": quantity,
        "a": a,
        "b": b,
        "tolerance": tolerance,
        "ok": False,
        "reason": reason,
    }
