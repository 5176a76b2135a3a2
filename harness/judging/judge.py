"""Judges a single engine's answer by loop closure, balance of forces, and energy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from screwgauge.judging import residuals
from screwgauge.judging.answer import Answer, answer_at, largest, motion_task
from screwgauge.judging.idle import accelerations_from_bodies, idle_residuals, least_inertia
from screwgauge.judging.residual import JUDGE_COLUMNS, Residuals, frame
from screwgauge.judging.trust import Refusal
from screwgauge.problem import GivenMotion, Problem, Rows
from screwgauge.quantities import BODY_MOTION, QUANTITIES, SOLVED, arm, integrated_tolerance
from screwgauge.reference.couplings import component_name
from screwgauge.reference.mechanism import Mechanism
from screwgauge.solution import Solution, common_rows
from screwgauge.witness.constraints import AdmissibleMotion, admissible_motion, residual

MOST = 201  # largest number of samples for residuals that need a pass over the tree per coordinate, or a solve
_MOTION = ("joint_velocity", "joint_acceleration")
_FORCES = (*residuals.WORKING, "reaction")
_PER = ("", "/s", "/s^2")
#: Residual, quantity that it judges, and suffix that the derivative adds to a coordinate's unit.
_CLOSURE = (
    ("loop_closure", "joint_position", _PER[0]),
    ("loop_rate", "joint_velocity", _PER[1]),
    ("loop_acceleration", "joint_acceleration", _PER[2]),
)


def judge(
    mechanism: Mechanism,
    problem: Problem,
    solution: Solution,
    tolerance: float = SOLVED,
    *,
    refused: Sequence[Refusal] = (),
    tolerance_of: Callable[[str], float] = lambda quantity: 0.0,
    again: Sequence[Solution] = (),
) -> pd.DataFrame:
    """Compute residuals of the solved quantities, one row per residual and unit.

    For a given motion, missing rates, accelerations and forces are computed where possible.

    Args:
        problem: The problem; its gravity overrides the gravity of a model file.
        refused: Samples without values, which cannot be judged.
        tolerance_of: Quantity -> scaled error that the scene allows for a given motion. If larger than `tolerance`, it
            limits the residuals of that quantity.
        again: Solutions of the same simulation with looser tolerances.
    """
    task = motion_task(problem)
    rows: Rows = np.arange(len(task)) if solution.rows is None else solution.rows
    for one in refused:
        if one.engine == solution.engine:
            rows = np.setdiff1d(rows, one.rows)
    if not rows.size or not _knows_joints(solution):
        return frame((), JUDGE_COLUMNS)
    few = _thin_out(rows)
    if isinstance(task, GivenMotion):
        looser = {name: tolerance_of(name) for name in QUANTITIES if tolerance_of(name) > tolerance}
        whole, some = (answer_at(mechanism, problem, solution, part, tolerance, looser) for part in (rows, rows[few]))
        # closure of accelerations needs velocities: missing velocities are computed at a few samples
        table = [*closure(whole, task.part(rows), range(3 if whole.has("joint_velocity") else 1))]
        if not {*whole.values} <= {"joint_position", "joint_velocity"}:
            table += _judge_bodies(whole, some, task.part(rows[few]))
    else:  # singular poses that a simulation has passed do not relax tolerances
        parts = (answer_at(mechanism, problem, solution, part, tolerance) for part in (rows, rows[few]))
        whole, some = (replace(part, admitted=0.0) for part in parts)
        table = [*closure(whole)]
        if whole.has(*_MOTION):
            table += residuals.virtual_work(some, admissible_motion(some.motion), *residuals.required_wrenches(some))
        grown = integrated_tolerance(task.integration.rtol, task.integration.atol)
        as_far = [one for one in again if np.isin(rows, common_rows(len(task), one)).all()]
        others = [answer_at(mechanism, problem, one, rows, tolerance) for one in as_far]
        table += residuals.energy_balance(replace(whole, tolerance=grown), others)
    return frame(table, JUDGE_COLUMNS)


def _knows_joints(solution: Solution) -> bool:
    """Return True if the positions of the joints are known."""
    return "joint_position" in solution.values or solution.assembly is not None


def _thin_out(rows: Rows) -> Rows:
    """Choose at most `MOST` evenly spaced samples."""
    return np.unique(np.linspace(0, len(rows) - 1, MOST).astype(np.intp))


def _judge_bodies(whole: Answer, some: Answer, motion: GivenMotion) -> Residuals:
    """Yield residuals of body motions and forces, and of accelerations if velocities are missing.

    Args:
        whole, some: The answer at all samples and at a few samples; all samples are judged if no quantity is missing.
        motion: The given motion at the few samples.
    """
    tree, forces = (any(some.has(name) for name in names) for names in (residuals.TREE_FORCES, _FORCES))
    lacking = not some.has(*_MOTION)
    if lacking or forces:
        admissible = admissible_motion(some.motion)
    if lacking:
        whole = some = complete_motion(some, admissible, motion)
        if not some.has("joint_velocity"):
            yield from closure(some, motion, [2])
    yield from body_motions(whole)
    yield from idle_residuals(some, motion)
    if forces:
        yield from _forces(whole, some, admissible)
    if whole.has("resistance"):
        yield from residuals.resistance(whole)
    if some.has("mass_matrix"):
        yield from residuals.mass_matrix(some, admissible_motion(some.motion))
    if some.has("jacobian"):
        yield from residuals.jacobian(some, admissible_motion(some.motion), motion.idle)
    if tree:
        yield from residuals.tree_forces(some)


def _forces(whole: Answer, some: Answer, admissible: AdmissibleMotion) -> Residuals:
    """Yield residuals of forces of the closed mechanism, at a few samples if some forces were not requested."""
    required = residuals.required_wrenches(some)
    full = residuals.complete_forces(some, required[0])
    every, needed = (whole, residuals.required_wrenches(whole)) if some.has("actuator_force") else (full, required)
    if some.has("reaction"):
        yield from residuals.newton_euler(every, *needed)
    if some.has("actuator_force"):
        yield from residuals.power_balance(every, *needed)
    if full.has("actuator_force"):
        yield from residuals.force_rule(full, admissible, required[1])
    if any(some.has(name) for name in residuals.WORKING):
        yield from residuals.virtual_work(some, admissible, *required)


def closure(answer: Answer, given: GivenMotion | None = None, orders: Sequence[int] = range(3)) -> Residuals:
    """Yield closure residuals of loops and couplings in position, velocity and acceleration, and deviations from the
    given y.

    Args:
        given: The given motion, if any; accelerations of its idle coordinates are not compared, because forces
            determine them.
        orders: Orders of the derivatives; orders missing from the answer are skipped.
    """
    mechanism = answer.mechanism
    names = [f"{joint}.{axis}" for joint in answer.tree.closures for axis in "xyz"]
    tied = [column for column, *_ in answer.tree.couplings.values()]
    y = () if given is None else (given.y, given.yd, given.ydd)
    for order in orders:
        name, quantity, per = _CLOSURE[order]
        if order and not answer.has(quantity):
            continue
        values, gaps = answer.joints[order], residual(answer.motion, order)
        loops, coupled = np.split(gaps, [6 * len(answer.tree.closures)], axis=1)
        missing = loops.reshape(len(loops), -1, 2, 3)
        for part, unit in enumerate((f"rad{per}", f"m{per}")):
            components, columns = [*names], [missing[:, :, part].reshape(len(missing), -1)]
            for k, (coupling, column) in enumerate(zip(mechanism.couplings, tied, strict=True)):
                if f"{mechanism.units[column]}{per}" == unit:
                    components.append(component_name(coupling))
                    columns.append(coupled[:, [k]])
            for k, (label, column) in enumerate(zip(mechanism.independent, mechanism.independent_columns, strict=True)):
                asked = given is not None and not (order == 2 and k in given.idle)
                if asked and f"{mechanism.units[column]}{per}" == unit:
                    components.append(f"{label} as prescribed")
                    columns.append(values[:, [column]] - y[order][:, [k]])
            if components:
                # velocities and accelerations are scaled by the largest value of the motion
                size = answer.fastest(order, unit)
                yield answer.residual(name, unit, components, np.concatenate(columns, axis=1), size, (quantity,))


def body_motions(answer: Answer) -> Residuals:
    """Yield differences between reported body motions and body motions computed from the joint coordinates."""
    for what, quantity in BODY_MOTION.items():
        if answer.has(quantity):
            values = answer.values[quantity]
            walked = residuals.body_motion(answer, what).reshape(values.array.shape)
            order, unit = "qva".index(QUANTITIES[quantity].needs), values.units[0]
            missing, size = values.array - walked, max(largest(values.array), answer.fastest(order, unit))
            about = (quantity, *_MOTION)
            yield answer.residual("body_motion", unit, values.components, missing, size, about)


def summands(mechanism: Mechanism, problem: Problem, solutions: Iterable[Solution]) -> dict[str, float]:
    """Return unit -> magnitude of the terms of rates, accelerations and forces at the states of a motion.

    The smallest magnitude over all answers is returned, so that no engine can make its own errors look small.
    """
    found = list[dict[str, float]]()
    for solution in solutions:
        rows: Rows = np.arange(len(motion_task(problem))) if solution.rows is None else solution.rows
        if rows.size and _knows_joints(solution):
            answer, admissible = answer_in_motion(mechanism, problem, solution, rows[_thin_out(rows)])
            sizes = _summands(answer)
            if isinstance(problem.task, GivenMotion) and problem.task.idle:
                push = sizes["N m"] / least_inertia(answer, admissible, problem.task.idle)
                pushed = {"rad/s^2": push, "m/s^2": push * answer.scales["m"]}
                sizes |= {unit: max(size, sizes[unit]) for unit, size in pushed.items()}
            found.append(sizes)
    return {unit: min(one[unit] for one in found) for unit in found[0]} if found else {}


def _summands(answer: Answer) -> dict[str, float]:
    L = answer.scales["m"]
    given = [answer.values[name] for name in _FORCES if answer.has(name)]
    forces = [values.array / [arm(unit, L) for unit in values.units] for values in given]
    load = largest(residuals.level_sizes(residuals.required_wrenches(answer)[1], L)[:, 0], *forces)
    moved = {f"{unit}{per}": answer.fastest(k, f"{unit}{per}") for unit in ("rad", "m") for k, per in enumerate(_PER)}
    return {**moved, "N": load, "N m": load * L}


def answer_in_motion(
    mechanism: Mechanism, problem: Problem, solution: Solution, rows: Rows
) -> tuple[Answer, AdmissibleMotion]:
    """Return the answer at some samples, completed if the motion is given, and the motions that the loops allow."""
    answer = answer_at(mechanism, problem, solution, rows)
    admissible = admissible_motion(answer.motion)
    if isinstance(problem.task, GivenMotion):
        answer = complete_motion(answer, admissible, problem.task.part(rows))
    return answer, admissible


def complete_motion(answer: Answer, admissible: AdmissibleMotion, given: GivenMotion) -> Answer:
    """Complete an answer with joint velocities and accelerations computed from its poses and the motion."""
    joints = np.array(answer.joints)
    if not answer.has("joint_velocity"):
        joints[1] = admissible.joints(given.yd)
    if not answer.has("joint_acceleration"):
        joints[2] = 0.0
        joints[2] = admissible.joints(given.ydd, residual(answer.with_joints(joints).motion, 2))
        if given.idle:
            joints[2] += accelerations_from_bodies(answer.with_joints(joints), admissible, given.idle)
    return answer.with_joints(joints)
