"""Judges one engine's answer without any other engine: do loops close, do forces balance, is energy accounted for?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from screwgauge.judging import balance
from screwgauge.judging.answer import COLUMNS, Answer, Row, answer_at, largest, timed
from screwgauge.judging.energy import energy_balance
from screwgauge.judging.refusals import Refusal
from screwgauge.problem import GivenMotion, Problem
from screwgauge.quantities import SOLVED, arm, integrated_tolerance
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values

MOST = 201  # samples at which virtual work is asked for: it takes a walk for every joint coordinate
#: Residual, quantity that it judges, and units of its angular and linear part, by order of the derivative.
_CLOSURE = (
    ("loop_closure", "joint_position", ("rad", "m")),
    ("loop_rate", "joint_velocity", ("rad/s", "m/s")),
    ("loop_acceleration", "joint_acceleration", ("rad/s^2", "m/s^2")),
)


def judge(
    mechanism: Mechanism,
    problem: Problem,
    solution: Solution,
    tolerance: float = SOLVED,
    *,
    refused: Sequence[Refusal] = (),
) -> pd.DataFrame:
    """All residuals that the answered quantities allow. One row per residual and unit.

    Args:
        problem: What was asked; its gravity is what counts, whatever a model file says.
        refused: Samples without numbers: what an engine does not say cannot be judged.
    """
    task = timed(problem)
    rows = np.arange(len(task)) if solution.rows is None else solution.rows
    for one in refused:
        if one.engine == solution.engine:
            rows = np.setdiff1d(rows, one.rows)
    if not rows.size or "joint_position" not in solution.values:
        return pd.DataFrame(columns=COLUMNS)
    few = np.unique(np.linspace(0, len(rows) - 1, MOST).astype(np.intp))
    answer, some = (answer_at(mechanism, problem, solution, part, tolerance) for part in (rows, rows[few]))
    if isinstance(task, GivenMotion):
        table = [*closure(answer, (task.y[rows], task.yd[rows], task.ydd[rows])), *body_motions(answer)]
        if balance.judgeable(answer):
            required, sizes = balance.required_wrenches(answer)
            table += balance.newton_euler(answer, required, sizes)
            table += balance.power_balance(answer, required)
            table += balance.virtual_work(some, required[few], sizes)
        admitted = max((largest(estimate) for estimate in solution.estimate.values()), default=0.0)
        for row in table:
            if not row["ok"] and not row["reason"] and admitted >= row["max_scaled"]:
                row["reason"] = f"within the error that {solution.engine} admits by its conditioning"
    else:  # what a simulation has passed on its way excuses no sample
        table = [*closure(answer)]
        if answer.has("joint_velocity", "joint_acceleration"):
            table += balance.virtual_work(some, *balance.required_wrenches(some))
        grown = integrated_tolerance(task.integration.rtol, task.integration.atol)
        table += energy_balance(replace(answer, tolerance=grown))
    return pd.DataFrame(table, columns=COLUMNS)


def closure(answer: Answer, asked: Sequence[Array] = ()) -> Iterator[Row]:
    """Closure of every loop in position, velocity and acceleration, and whether y follows what was asked for.

    Args:
        asked: Independent coordinates and derivatives, if they were given. Shape (n, k) each.
    """
    names = [f"{joint.name}.{axis}" for joint in answer.tree.cuts for axis in "xyz"]
    for order, (name, quantity, units) in enumerate(_CLOSURE):
        if not answer.has(quantity):
            continue
        values, missing = answer.values[quantity], answer.motions.closure_residual(order)
        for part, unit in enumerate(units):
            components, columns = [*names], [missing[:, :, part].reshape(len(missing), -1)]
            for k, (label, coordinate) in enumerate(answer.mechanism.independent.items()):
                column = values.components.index(coordinate)
                if asked and values.units[column] == unit:
                    components.append(f"{label} as asked")
                    columns.append(values.array[:, [column]] - asked[order][:, [k]])
            if components:
                # velocities and accelerations are measured against the largest of the motion
                size = _largest(values, unit, answer.scales["m"]) if order else answer.scales[unit]
                yield answer.residual(name, unit, components, np.concatenate(columns, axis=1), size, quantity)


def _largest(values: Values, unit: str, L: float) -> float:
    """Largest derivative in a unit, one of the other kind being turned into it by the length L [m]."""
    return largest(values.array * [arm(unit, L) / arm(has, L) for has in values.units])


def body_motions(answer: Answer) -> Iterator[Row]:
    """Reported motions of the bodies less those that follow from the reported joint coordinates."""
    for quantity, (_, needs) in balance.BODY_MOTION.items():
        if answer.has(quantity, *needs):
            values = answer.values[quantity]
            missing, size = values.array - balance.walked(answer, quantity), largest(values.array)
            yield answer.residual("body_motion", values.units[0], values.components, missing, size, quantity)
