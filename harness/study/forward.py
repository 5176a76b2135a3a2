"""Runs a forward scene: every engine integrates from its own model file, then comparison and judgement."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.engines.integrators import check_integrators, load_integrator
from screwgauge.environment import environment
from screwgauge.judging.compare import compare, nothing
from screwgauge.judging.energy import judge_motion
from screwgauge.judging.judge import COLUMNS
from screwgauge.judging.passed import passed
from screwgauge.models.generate import write_models
from screwgauge.quantities import FORWARD, check_quantities
from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.mobility import mobility
from screwgauge.reference.pose import Layout, pose
from screwgauge.reference.rotations import Array
from screwgauge.scene.observe import known_values, observe
from screwgauge.scene.scene import Scene
from screwgauge.scene.setting import Forward
from screwgauge.scene.start import check_start, make_problem
from screwgauge.solution import REFERENCE, Failure, ForwardSolution, Solution, Timing, Values
from screwgauge.study.comparison import Comparison
from screwgauge.study.provenance import provenance
from screwgauge.study.run import Report, facts, failed, model_files

_COVERS = "integration from start to end, once; loading and output outside"


def run_forward(
    scene: Scene,
    engines: Iterable[str] | None = None,
    quantities: Iterable[str] | None = None,
    *,
    progress: Report = lambda step, share: None,
    warn: Callable[[str], None] = lambda sentence: None,
    date: datetime | None = None,
) -> Comparison:
    """Integrates a forward scene with the engines, compares all pairs and the reference, and judges each.

    Args:
        warn: Called with what may make the integration long or wrong, before it begins.
        date: That the report bears; now by default.

    Raises:
        ScrewgaugeError: Bad input. An engine that fails or stops early is no error but a row of the results.
    """
    start = started(scene)
    names = check_integrators(scene.engines if engines is None else engines)
    wanted = _wanted(scene, quantities)
    progress("preflight", 0.0)
    lay, warnings = check_start(scene, start)
    for sentence in warnings:
        warn(sentence)
    found: dict[str, ForwardSolution] = {}
    failures: dict[str, Failure] = {}
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(scene.mechanism, Path(folder), gravity=scene.gravity)
        for name in names:
            outcome = _integrate(scene, start, name, Path(folder), progress)
            if isinstance(outcome, ForwardSolution):
                found[name] = outcome
            else:
                failures[name] = outcome
        files = provenance(scene, {name: model_files(scene, name, Path(folder))[0] for name in names}, date=date)
    progress("comparison", 0.0)
    solutions = {name: _solution(scene, start, lay, one, wanted) for name, one in found.items()}
    if scene.known is not None and "observable" in wanted:
        solutions[REFERENCE] = _known(scene)
    counts = mobility(lay, pose(lay, scene.mechanism.home[None]))
    errors, pairs = compare(scene, solutions, {}, counts)
    lost = pd.DataFrame(_lost(scene, wanted, found, failures, list(solutions)), columns=pairs.columns)
    judged = [judge_motion(scene, one, scene.motion.t[: len(one.q)], start.method) for one in found.values()]
    return Comparison(
        scene=scene,
        solutions=solutions,
        failures=failures,
        errors=errors,
        pairs=pd.concat([pairs, lost], ignore_index=True) if len(lost) else pairs,
        judge=pd.concat(judged, ignore_index=True) if judged else pd.DataFrame(columns=COLUMNS),
        mobility=facts(counts),
        environment=environment(),
        warnings=warnings,
        provenance=files,
    )


def started(scene: Scene) -> Forward:
    """The start of a forward scene.

    Raises:
        DescriptionError: It is not one.
    """
    if scene.forward is None:
        raise DescriptionError("its motion is given, not integrated", scene.name, "add [forward]")
    return scene.forward


def _wanted(scene: Scene, quantities: Iterable[str] | None) -> tuple[str, ...]:
    wanted = check_quantities(scene.quantities if quantities is None else quantities, known=FORWARD)
    if scene.observables:
        return wanted
    if quantities is not None and "observable" in wanted:
        raise DescriptionError("there is no observable", scene.name, "add [[observables]]")
    return tuple(name for name in wanted if name != "observable")


def _integrate(scene: Scene, start: Forward, name: str, folder: Path, progress: Report) -> ForwardSolution | Failure:
    """One engine, on the scene's times as far as it came. Whatever it raises becomes a row."""
    progress(name, 0.0)
    try:
        integrate = load_integrator(name)
        problem = make_problem(scene, start, *model_files(scene, name, folder), lambda share: progress(name, share))
        found = trimmed(integrate(problem), len(problem.times) - len(scene.motion))
    except Exception as error:
        return failed(scene, name, error, folder)
    n_q = len(scene.mechanism.coordinates)
    if found.q.shape[1] != n_q:
        return Failure(name, f"{found.q.shape[1]} joint coordinates for the {n_q} of the description")
    if not len(found.q):
        return Failure(name, f"it stopped before the first sample: {found.stopped}")
    return replace(found, engine=name)


def trimmed(found: ForwardSolution, extra: int) -> ForwardSolution:
    """A solution without its first samples, which nobody asked for."""
    if not extra:
        return found
    fields = {key: getattr(found, key)[extra:] for key in ("q", "v", "a", "work", "condition")}
    return replace(found, **fields)


def _solution(scene: Scene, start: Forward, lay: Layout, found: ForwardSolution, wanted: Sequence[str]) -> Solution:
    """The integrated motion in the terms of a comparison; NaN where it was not reached."""
    mechanism, n, m = scene.mechanism, len(scene.motion), len(found.q)
    names, units = tuple(mechanism.coordinates), tuple(mechanism.units)
    values = {}
    for name, array, per in zip(FORWARD, (found.q, found.v, found.a), ("", "/s", "/s^2"), strict=False):
        if name in wanted:
            values[name] = Values(names, tuple(f"{unit}{per}" for unit in units), _filled(array, n))
    if "observable" in wanted:
        has = observe(lay, scene.observables, found.q)
        values = {"observable": Values(has.components, has.units, _filled(has.array, n)), **values}
    stopped = (f"stopped: {found.stopped}",) if found.stopped else ()
    way = passed(lay, found.q, scene.motion.t[:m], start.method.near)
    estimate = np.pad(way.estimate, (0, n - m), constant_values=np.inf)  # there is no number
    met = np.pad(way.condition, (0, n - m), mode="edge")
    counts = f"{found.setting}: {found.steps} steps, {found.evaluations} evaluations of the accelerations"
    stages = {"integration": found.seconds, "integration, processor time": found.cpu}
    return Solution(
        engine=found.engine,
        version=found.version,
        values=values,
        condition=_filled(found.condition[:, None], n)[:, 0],
        estimate=dict.fromkeys(values, estimate),
        conditions=dict.fromkeys(values, met),
        timings=tuple(
            Timing(found.engine, found.setting, stage, m, seconds, seconds, _COVERS)
            for stage, seconds in stages.items()
            if np.isfinite(seconds)
        ),
        notes=(*stopped, counts, *found.notes, *filter(None, [way.note]), *_beyond(scene, found)),
        rows=None if m == n else np.arange(m),
    )


def _beyond(scene: Scene, found: ForwardSolution) -> tuple[str, ...]:
    """A sentence if the motion leaves the limits of a joint, which are no stops."""
    low, high = scene.mechanism.limits.T
    beyond = (found.q < low) | (found.q > high)
    if not beyond.any():
        return ()
    i, k = np.argwhere(beyond)[0]
    name, t = scene.mechanism.coordinates[k], scene.motion.t[i]
    return (f"'{name}' = {found.q[i, k]:.6g} is beyond its limits [{low[k]:g}, {high[k]:g}] at t = {t:g} s",)


def _filled(array: Array, n: int) -> Array:
    """The rows of an array, and NaN up to n of them."""
    out = np.full((n, array.shape[1]), np.nan)
    out[: len(array)] = array
    return out


def _known(scene: Scene) -> Solution:
    """The reference of the scene, at those of its times that the scene has."""
    values, rows = known_values(scene)
    source = scene.known.source if scene.known is not None else ""
    return Solution(
        engine=REFERENCE,
        version="",
        values={"observable": values},
        condition=np.full(len(scene.motion), np.nan),
        notes=(source,),
        rows=None if len(rows) == len(scene.motion) else rows,
    )


def _lost(
    scene: Scene,
    wanted: Sequence[str],
    found: Mapping[str, ForwardSolution],
    failures: Mapping[str, Failure],
    compared: Sequence[str],
) -> Iterator[dict[str, Any]]:
    """Rows without numbers: pairs with an engine that failed, or that stopped before the end."""
    reasons = {name: failure.reason for name, failure in failures.items()}
    for name, one in found.items():
        if len(one.q) < len(scene.motion):
            t = scene.motion.t[len(one.q) - 1]
            reasons[name] = f"{name} has nothing after t = {t:g} s: {one.stopped}"
    for name, reason in reasons.items():
        for other in [each for each in compared if each != name] or [""]:
            a, b = (other, name) if other not in ("", REFERENCE) else (name, other)
            yield nothing(scene, "observable" if "observable" in wanted else wanted[0], a, b, reason)
