"""Simulated motions: compared quantities, their reference, and additional runs that estimate the integration error."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from screwgauge.judging.trust import LOOSER, examine_path
from screwgauge.quantities import SIMULATED
from screwgauge.reference.graph import Layout
from screwgauge.scene.observables import Recorded, known_values, observe
from screwgauge.scene.preflight import beyond_limits
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE, Error, Failure, Solution

MOTION = SIMULATED[:3]
#: Loosest tolerance of an additional run, above which errors are not proportional to the tolerance.
COARSEST = 0.1


def add_observables(
    scene: Scene, lay: Layout, answers: Mapping[str, Solution], wanted: Sequence[str]
) -> dict[str, Solution]:
    """Add the compared quantities to simulated motions, and the scene's reference if available."""
    solutions = {
        name: _add_observables(scene, lay, answer, wanted)
        for name, answer in answers.items()
        if "joint_position" in answer.values
    }
    if scene.known is not None and "observable" in wanted:
        solutions[REFERENCE] = _reference(scene, scene.known)
    return solutions


def loosen(scene: Scene) -> list[Scene]:
    """Return copies of the scene with looser tolerances, for runs that estimate the integration error."""
    steps = scene.start.integration
    looser = [replace(steps, rtol=min(x * steps.rtol, COARSEST), atol=x * steps.atol) for x in LOOSER]
    return [replace(scene, task=replace(scene.start, integration=each)) for each in looser]


def engines_in_doubt(pairs: pd.DataFrame, judged: Iterable[pd.DataFrame]) -> set[str]:
    """Return the engines with a value out of tolerance, whose integration error must be estimated."""
    bad = pairs[~pairs["ok"].astype(bool) & np.isfinite(pairs["max_scaled"].astype(float))]
    energy = [one[(one["residual"] == "energy_balance") & ~one["ok"].astype(bool)] for one in judged if len(one)]
    return {*bad["a"], *bad["b"], *(name for one in energy for name in one["engine"])}


def _add_observables(scene: Scene, lay: Layout, answer: Solution, wanted: Sequence[str]) -> Solution:
    """Add the observables to a simulated motion, with condition numbers and error estimates of its poses."""
    n, m = len(scene.t), answer.n_solved
    values = {name: answer.values[name] for name in MOTION if name in wanted and name in answer.values}
    q = answer.values["joint_position"].array[:m]
    if "observable" in wanted:
        has = observe(lay, scene.observables, q)
        array = np.pad(has.array, ((0, n - m), (0, 0)), constant_values=np.nan)
        values = {"observable": replace(has, array=array), **values}
    met, estimate, note = examine_path(lay, q, scene.t[:m], scene.start.integration.near)
    estimate = np.pad(estimate, (0, n - m), constant_values=np.inf)  # mark missing samples
    met = np.pad(met, (0, n - m), mode="edge")
    cost, beyond = answer.cost, beyond_limits(scene.mechanism, q)
    doubts = [f"{beyond[1]} at t = {scene.t[beyond[0]]:g} s; limits do not act as stops here"] if beyond else []
    notes = (
        f"stopped: {answer.stopped}" if answer.stopped else "",
        f"{answer.setting}: {cost.steps} steps, {cost.evaluations} evaluations of the accelerations" if cost else "",
        *answer.notes,
        note,
        *doubts,
    )
    return replace(
        answer,
        values=values,
        errors=dict.fromkeys(values, Error(estimate, condition=met)),
        notes=tuple(filter(None, notes)),
        warnings=(*answer.warnings, *doubts),
    )


def _reference(scene: Scene, known: Recorded) -> Solution:
    """Return the known values as a solution of the scene, at the times that both have in common."""
    values, rows = known_values(known, scene.observables, scene.t, scene.name)
    n = len(scene.t)
    solved = None if len(rows) == n else rows
    return Solution(REFERENCE, "", {"observable": values}, np.full(n, np.nan), notes=(known.source,), rows=solved)


def early_ends(
    scene: Scene, wanted: Sequence[str], answers: Mapping[str, Solution], failures: Mapping[str, Failure]
) -> Iterator[tuple[str, str, str]]:
    """Yield quantity, engine and reason for each engine that failed or stopped before the end of a simulation."""
    quantity = "observable" if "observable" in wanted else wanted[0]
    for failure in failures.values():
        yield quantity, failure.engine, failure.reason
    for name, answer in answers.items():
        if answer.n_solved < len(scene.t):
            t = scene.t[answer.n_solved - 1]
            yield quantity, name, f"{name} has no values after t = {t:g} s: {answer.stopped}"
