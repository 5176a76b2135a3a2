"""Judges one engine's answer without any other engine: do loops close, do forces balance, is energy accounted for?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from screwgauge.judging.answer import BODY_MOTION, FLOOR, Answer, answer_at, timed
from screwgauge.judging.balance import newton_euler, power_balance, required_wrenches, spread, virtual_work
from screwgauge.judging.energy import energy_balance
from screwgauge.judging.refusals import Refusal
from screwgauge.judging.residual import COLUMNS, Residual, largest
from screwgauge.problem import GivenMotion, Problem, Rows
from screwgauge.quantities import SOLVED, integrated_tolerance
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution, Values

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

    Raises:
        TypeError: The task is no motion over time.
    """
    rows = np.arange(len(timed(problem))) if solution.rows is None else solution.rows
    for one in refused:
        if one.engine == solution.engine:
            rows = np.setdiff1d(rows, one.rows)
    table = [residual.row(solution.engine, tolerance) for residual in residuals(mechanism, problem, solution, rows)]
    if isinstance(problem.task, GivenMotion):  # what a simulation has passed excuses no sample that it reached
        admitted = max((float(np.max(e, initial=0.0)) for e in solution.estimate.values()), default=0.0)
        for row in table:
            if not row["ok"] and not row["reason"] and admitted >= float(str(row["max_scaled"])):
                row["reason"] = f"within the error that {solution.engine} admits by its conditioning"
    return pd.DataFrame(table, columns=COLUMNS)


def residuals(mechanism: Mechanism, problem: Problem, solution: Solution, rows: Rows) -> Iterator[Residual]:
    """Residuals of every equation that the answered quantities allow, at some samples."""
    if not rows.size or "joint_position" not in solution.values:
        return
    task, answer = timed(problem), answer_at(mechanism, problem, solution, rows)
    if isinstance(task, GivenMotion):
        yield from closure(answer, (task.y[rows], task.yd[rows], task.ydd[rows]))
        yield from body_motions(answer)
        yield from _given_forces(answer)
        return
    yield from closure(answer)
    if answer.has("joint_velocity", "joint_acceleration"):
        some = answer_at(mechanism, problem, solution, rows[spread(len(rows))])
        yield from virtual_work(some, *required_wrenches(some))
    if answer.has("joint_velocity"):
        tolerance = integrated_tolerance(task.integration.rtol, task.integration.atol)
        balance = energy_balance(answer, tolerance)
        if balance is not None:
            yield balance


def closure(answer: Answer, asked: Sequence[Array] | None = None) -> Iterator[Residual]:
    """Closure of every loop in position, velocity and acceleration, and whether y follows what was asked for.

    Args:
        asked: Independent coordinates and derivatives, if they were given. Shape (n, k) each.
    """
    names = [f"{joint.name}.{axis}" for joint in answer.tree.cuts for axis in "xyz"]
    for order, (name, quantity, units) in enumerate(_CLOSURE):
        if not answer.has(quantity):
            continue
        values, apart = answer.values[quantity], answer.motions.closure(order)
        for part, unit in enumerate(units):
            components, columns = [*names], [apart[:, :, 3 * part : 3 * part + 3].reshape(len(apart), -1)]
            for k, (label, coordinate) in enumerate(answer.mechanism.independent.items()):
                column = values.components.index(coordinate)
                if asked is not None and values.units[column] == unit:
                    components.append(f"{label} as asked")
                    columns.append(values.array[:, [column]] - asked[order][:, [k]])
            if components:
                scale = answer.scales[unit]
                if order:  # velocities and accelerations are measured against the largest of the motion
                    scale = max(_largest(values, unit, answer.scales["m"]), FLOOR * scale)
                yield Residual(name, unit, components, answer.t, np.concatenate(columns, axis=1), scale)


def _largest(values: Values, unit: str, L: float) -> float:
    """Largest derivative in a unit, one of the other kind being turned into it by the length L [m]."""
    linear = unit.startswith("m")
    factor = np.array([1.0 if has == unit else L if linear else 1.0 / L for has in values.units])
    return largest(values.array * factor)


def body_motions(answer: Answer) -> Iterator[Residual]:
    """Reported motions of the bodies less those that follow from the reported joint coordinates."""
    for quantity, (_, needs) in BODY_MOTION.items():
        if answer.has(quantity, *needs):
            values = answer.values[quantity]
            unit = values.units[0]
            scale = max(largest(values.array), FLOOR * answer.scales[unit])
            difference = values.array - answer.walked(quantity)
            yield Residual("body_motion", unit, values.components, answer.t, difference, scale)


def _given_forces(answer: Answer) -> Iterator[Residual]:
    """Balance of the forces of a given motion, as far as they were answered."""
    sprung = bool(answer.applied.springs or answer.applied.motors)  # what they exert depends on velocities
    if not answer.has(*BODY_MOTION, "actuator_force", *(["joint_velocity"] if sprung else [])):
        return
    required, sizes = required_wrenches(answer)
    if answer.has("reaction"):
        yield from newton_euler(answer, required, sizes)
    if answer.has("joint_velocity"):
        yield power_balance(answer, required)
    yield from virtual_work(answer, required, sizes)
