"""Comparison of solutions, pair by pair and quantity by quantity; no engine is assumed correct."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd

from screwgauge.judging.allowance import Allowance, Granted
from screwgauge.judging.answer import largest, motion_task
from screwgauge.judging.assembly_modes import other_assemblies
from screwgauge.judging.residual import ERROR_COLUMNS, PAIR_COLUMNS, SizedResidual, frame
from screwgauge.judging.trust import Refusal
from screwgauge.problem import Problem
from screwgauge.quantities import FLOOR, QUANTITIES, natural_scales
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.rotations import Array
from screwgauge.solution import Failure, Solution, Values, common_rows, reference_first

#: The first component with this fraction of the largest error is named, so that rounding does not affect the choice.
ALIKE = 1.0 - 1e-9
#: Rule of a force that redundant constraints leave undetermined: any value balances, so the force is not judged.
UNDETERMINED = "undetermined"


def compare(
    mechanism: Mechanism,
    problem: Problem,
    solutions: Mapping[str, Solution],
    failures: Mapping[str, Failure],
    mobility: Mobility,
    allowance: Allowance,
    refusals: Sequence[Refusal] = (),
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Compute errors of every pair of solutions; all solutions must use the same angle chart (see `in_one_chart`).

    Args:
        failures: Engines without solutions; the rows of their pairs give the reason.
        mobility: Uniqueness of forces.
        allowance: Accepted differences.
        refusals: Samples without numbers, with reasons.

    Returns:
        One row per component, and one row per quantity and unit (see `Results`).
    """
    errors, pairs = list[SizedResidual](), list[SizedResidual]()
    t, scales = motion_task(problem).t, natural_scales(mechanism)
    # the truth is the reference: it comes first in its pairs and scales all others
    ordered, tolerance_of = reference_first(solutions.values()), allowance.tolerance_of
    apart = other_assemblies(mechanism, problem, ordered)
    for quantity in QUANTITIES:
        having = [solution for solution in ordered if quantity in solution.values]
        rules = _rules(quantity, problem.rule, mobility, mechanism)
        for a, b in combinations(having, 2):
            if not _can_compare(quantity, a, b):
                continue
            names, others = (one.values[quantity].components for one in (a, b))
            differ = "the components differ" if names != others and quantity.startswith("tree_force") else ""
            lost = apart.get(frozenset((a.engine, b.engine)), differ)
            if lost or not common_rows(len(t), a, b).size:
                row = empty_row(quantity, a.engine, b.engine, lost or "no sample in common", tolerance_of(quantity))
                pairs.append(replace(row, component=min({*names} ^ {*others}, default="")))
                continue
            # the first engine of the run that has these components provides one scale for all pairs
            reference = next(v for s in having if {*(v := s.values[quantity]).components} >= {*names} & {*others})
            for unit in dict.fromkeys(reference.units):
                scale = reference_scale(reference, unit, scales[unit])
                granted = allowance.grant(quantity, unit, (a, b), scale, scales=scales, n=len(t))
                rows = [_compare_with_tolerance(row, rules) for row in _components(quantity, unit, a, b, t, granted)]
                errors += rows
                if compared := [row for row in rows if row.ok is not None]:
                    row = _accept(_pair(compared), tolerance_of(quantity), granted)
                    pairs.append(_explain(row, a, b, refusals))
    for solution in solutions.values():
        for failure in failures.values():
            for name in solution.values:
                pairs.append(empty_row(name, solution.engine, failure.engine, failure.reason, tolerance_of(name)))
    # no verdict without a unique value
    return frame(errors, ERROR_COLUMNS).astype({"ok": "boolean", "tolerance": float}), frame(pairs, PAIR_COLUMNS)


def _can_compare(quantity: str, a: Solution, b: Solution) -> bool:
    """Return True if a quantity can be compared: components must overlap; for open-tree forces, neither tree may be
    part of the other tree."""
    names, others = ({*one.values[quantity].components} for one in (a, b))
    return not (names < others or others < names) if quantity.startswith("tree_force") else bool(names & others)


def _accept(row: SizedResidual, tolerance: float, granted: Granted) -> SizedResidual:
    """Set the reason of an accepted pair whose error exceeds the scene's own tolerance."""
    if not row.ok:
        return row
    conditioned = f"within {row.tolerance:.2g}, rounding times the sample's condition number"
    reason = row.reason or (conditioned if row.error > granted.usual else granted.why)
    return replace(row, reason=reason if row.error > tolerance else "")


def reference_scale(values: Values, unit: str, natural: float) -> float:
    """Return the scale S of errors: the reference's largest magnitude in a unit, at least 1e-6 times the natural
    scale."""
    return max(largest(values.array[:, [i for i, u in enumerate(values.units) if u == unit]]), FLOOR * natural)


def _rules(quantity: str, rule: str, mobility: Mobility, mechanism: Mechanism) -> dict[str, tuple[str, bool]]:
    """Map each component to its rule and a flag for uniqueness under any rule; "" stands for the other components."""
    if not QUANTITIES[quantity].ruled:
        return {"": ("", True)}
    driven = dict[str, str]()
    if quantity == "axis_moment":  # unique if the force of the coordinate's actuator is unique
        columns = zip(mechanism.actuator_names, mechanism.actuated_columns, strict=True)
        driven = {name: mechanism.coordinates[column] for name, column in columns}
    named = zip(mobility.names, mobility.unique, mobility.determined, strict=True)
    return {
        "": (rule, True),
        **{driven.get(name, name): (rule if fixed else UNDETERMINED, unique) for name, unique, fixed in named},
    }


def _compare_with_tolerance(row: SizedResidual, rules: Mapping[str, tuple[str, bool]]) -> SizedResidual:
    """Add the rule that fixes a component, and compare its errors with the tolerance.

    A component without a unique value has no tolerance, and is neither right nor wrong unless its error is NaN.
    """
    rule, unique = rules.get(row.component, rules[""])
    if rule == UNDETERMINED and np.isfinite(row.error):
        return replace(row, rule=rule, unique=unique, tolerance=float("nan"), ok=None)
    return replace(row, rule=rule, unique=unique)


def _components(
    quantity: str, unit: str, a: Solution, b: Solution, t: Array, granted: Granted
) -> Iterator[SizedResidual]:
    """Yield errors of each common component of a unit at samples that both engines solved.

    Yields the error that most exceeds its limit, or the largest error if all are within their limits. Limits vary from
    sample to sample with conditioning and integration error. The reason states the share of integration error.
    """
    first, second, rows = a.values[quantity], b.values[quantity], common_rows(len(t), a, b)
    columns, some = {x: k for k, x in enumerate(second.components)}, rows if len(rows) < len(t) else slice(None)
    chosen = [k for k, x in enumerate(first.components) if first.units[k] == unit and x in columns]
    names = [first.components[k] for k in chosen]
    difference = np.abs(first.array[some][:, chosen] - second.array[some][:, [columns[x] for x in names]])
    known = np.isfinite(difference)  # NaN counts as worse than any number
    scale, limits, admitted = granted.scale, granted.limits, granted.admitted[some]
    scaled, most = difference / scale, (limits[some] + admitted)[:, None]
    beyond = np.where(known, scaled - most, np.inf)
    open_at = known & (beyond > 0.0) & (scaled <= granted.doubts[some][:, None])
    undecided, lost = int(open_at.any(axis=1).sum()), (beyond > 0.0) & ~open_at
    # errors that are out of tolerance precede undecided ones
    beyond = np.where(open_at & lost.any(axis=0), 0.0, beyond)
    at = np.argmax(np.where(known, difference, np.inf), axis=0)
    at = np.where(beyond.max(axis=0) > 0.0, np.argmax(beyond, axis=0), at)
    rms, usual = np.sqrt(np.mean(difference**2, axis=0)), float(limits.min())
    for k, (component, i) in enumerate(zip(names, at.tolist(), strict=True)):
        worst = float(difference[i, k]) if known[i, k] else float("nan")
        # the limit by conditioning is the tolerance only if it is needed and all samples satisfy their limits
        enough = worst / scale <= usual + admitted[i] or beyond[:, k].max() > 0.0
        limit = usual if enough else float(limits[rows[i]])
        tolerance = float(limit + admitted[i])
        ok = worst / scale <= tolerance
        yield SizedResidual(
            quantity=quantity,
            unit=unit,
            a=a.engine,
            b=b.engine,
            error=worst / scale,
            tolerance=tolerance,
            reason=granted.reason(worst / scale, int(rows[i]), ok=ok, usual=limit),
            ok=ok,
            undecided=0 if ok or lost[:, k].any() else undecided,
            component=component,
            t=float(t[rows[i]]),
            max_abs=worst,
            rms=float(rms[k]),
            scale=scale,
        )


def _pair(rows: Sequence[SizedResidual]) -> SizedResidual:
    """Represent a quantity and unit by the worst component; components out of tolerance take precedence."""
    every, rows = rows, [row for row in rows if not row.ok] or rows
    rows = [row for row in rows if not row.undecided] or rows
    sizes = np.array([row.error for row in rows])
    lost = ~np.isfinite(sizes)
    return replace(
        rows[int(np.argmax(lost if lost.any() else sizes >= ALIKE * sizes.max()))],
        rms=float(np.sqrt(np.mean([row.rms**2 for row in every]))),
        unique=all(row.unique for row in every),
        ok=all(row.ok for row in every),
    )


def _explain(row: SizedResidual, a: Solution, b: Solution, refusals: Sequence[Refusal]) -> SizedResidual:
    """Add the engines' own reason, if any, to a pair out of tolerance."""
    if row.ok:
        return row
    for one in refusals:
        if one.engine in (a.engine, b.engine) and row.quantity in one.quantities:
            return replace(row, reason=f"{one.engine}: {one.sentence}")
    if row.reason:  # the reason concerns integration
        return row
    admitted = {s.engine: s.errors[row.quantity].largest if row.quantity in s.errors else 0.0 for s in (a, b)}
    engine = max(admitted, key=lambda name: admitted[name])
    if row.undecided:
        size = f"{admitted[engine]:.1g}" if np.isfinite(admitted[engine]) else "no correct digit"
        return replace(row, reason=f"within the error that {engine} estimates ({size})")
    return row if np.isfinite(row.error) else replace(row, reason=f"not a number at t = {row.t:g} s")


def empty_row(quantity: str, a: str, b: str, reason: str, tolerance: float) -> SizedResidual:
    """Build the row of a pair that has no values, stating the reason."""
    return SizedResidual(quantity, a=a, b=b, reason=reason, tolerance=tolerance)
