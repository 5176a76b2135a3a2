"""Estimate the rounding errors of any engine in a low-precision number type from eps, conditioning and operation count.

Each operation rounds by at most eps/2; with random signs, n operations accumulate about sqrt(n) times this error.
Loops close only up to rounding; perturbing the poses by this amount shows the effect on other quantities, as in
`error_estimate`. The estimate uses only the description and the array solver in float64, and ignores the engine's own
error estimates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from screwgauge.engines.chunks import PART
from screwgauge.engines.error_estimate import ACCELERATED, SAFETY, Trust, by_powers, by_unit, perturbations
from screwgauge.engines.screw.inverse import Work
from screwgauge.problem import GivenMotion, Problem, spread
from screwgauge.quantities import OF_JOINTS, NumberType, arm
from screwgauge.reference import linear
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.solution import Error

#: Operations per joint coordinate, for the poses in two steps of Newton's method, rates, accelerations and forces.
#: No traced program of a built-in mechanism exceeds the total of `operations`.
PER_COORDINATE = 450
#: Number of samples at which idle coordinates are examined.
MOST = 64


def operations(mechanism: Mechanism) -> float:
    """Return the number of operations per sample that forces require, at all joints and for the linear system."""
    n = len(mechanism.coordinates)
    return PER_COORDINATE * n + n**3 / 3


def rounding_errors(mechanism: Mechanism, problem: Problem, kind: NumberType) -> dict[str, Error]:
    """Estimate the rounding error of each quantity; empty unless the task is a given motion.

    `Error.scaled` is relative to the largest term or, for positions, to 1 rad or the mechanism's length.

    Raises:
        ScrewgaugeError: The motion cannot be followed.
    """
    task = problem.task
    if not isinstance(task, GivenMotion):
        return {}
    work = Work(layout(mechanism), problem)
    parts = [_part(work, task.part(slice(i, i + PART)), kind) for i in range(0, len(task), PART)]
    return {name: _join([part[name] for part in parts], kind) for name in parts[0]}


def idle_errors(mechanism: Mechanism, problem: Problem) -> dict[str, dict[str, float]]:
    """Estimate the rounding errors of accelerations that depend on idle coordinates, for any solver.

    A freely spinning rod loads its bearings a thousand times more than its axis. These large terms cancel, but leave
    large rounding errors, regardless of the rest of the motion.

    Returns:
        Quantity -> unit -> absolute error.

    Raises:
        ScrewgaugeError: The motion cannot be followed.
    """
    task = problem.task
    if not isinstance(task, GivenMotion) or not task.idle or not problem.wanted & {*ACCELERATED}:
        return {}
    work, some = Work(layout(mechanism), problem), task.part(spread(len(task), MOST))
    with np.errstate(all="ignore"):
        trust = work.evaluate(work.close(some, work.predict(some)), some)[1]
        errors = {name: SAFETY * float(np.nanmax(by_powers(name, trust) * rush)) for name, rush in trust.rushes.items()}
    units = {name: work.names()[name][1] for name in errors.keys() & problem.wanted}
    return {name: {unit: errors[name] * arm(unit, work.loops.length) for unit in units[name]} for name in units}


#: Condition number, shape (n,); unit -> error and largest term [unit], both of shape (n,).
Sizes = tuple[Array, Mapping[str, tuple[Array, Array]]]


def _part(work: Work, motion: GivenMotion, kind: NumberType) -> dict[str, Sizes]:
    """Return the errors of each quantity at some samples."""
    closed = work.close(motion, work.predict(motion))
    with np.errstate(all="ignore"):  # near a singular pose the error is unknown
        values, trust, A = work.evaluate(closed, motion)
        noises = [noise * (kind.eps / linear.EPS) for noise in perturbations(A, motion.y.shape[1])]
        shaken = [work.perturbed_values(closed, motion, noise) for noise in noises]
        rounded = 0.5 * kind.eps * operations(work.lay.mechanism) ** 0.5
        return {name: _sizes(work, name, trust, values[name], [x[name] for x in shaken], rounded) for name in values}


def _sizes(work: Work, name: str, trust: Trust, values: Array, shaken: Iterable[Array], rounded: float) -> Sizes:
    moved = np.max([np.abs(other - values) for other in shaken], axis=0)
    found, charts = {}, trust.charts if name in OF_JOINTS else 1.0
    for unit, columns, _, _, most in by_unit(name, values, work.names()[name][1], trust, work.loops.length):
        error = rounded * charts * most + SAFETY * moved[:, columns].max(axis=1, initial=0.0)
        if unit in ("rad", "m"):  # closure errors are relative to 1 rad or L, however far a joint has turned
            most = np.full_like(error, arm(unit, work.loops.length))
        found[unit] = np.nan_to_num(error, nan=np.inf), np.nan_to_num(most)
    return trust.of(name), found


def _join(parts: list[Sizes], kind: NumberType) -> Error:
    condition = np.concatenate([part[0] for part in parts])
    scaled, absolute = [np.zeros(len(condition))], dict[str, float]()
    for unit in parts[0][1]:
        error, most = (np.concatenate([part[1][unit][i] for part in parts]) for i in (0, 1))
        absolute[unit] = float(error.max())
        scaled.append(error / max(float(most.max()), np.finfo(float).tiny))
    return Error(np.max(scaled, axis=0), absolute, condition, f"rounding of {kind.name}", precision=kind.name)
