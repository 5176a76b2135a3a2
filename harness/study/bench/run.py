"""Benches: compute the error of each contestant, then measure times in rounds. `forward_run` measures simulations."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from itertools import count, groupby, zip_longest
from pathlib import Path
from time import perf_counter_ns, time
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.engines.registry import EngineModel, get_engine
from screwgauge.engines.rounding import rounding_errors
from screwgauge.environment import environment, plain
from screwgauge.models.catalog import mechanism_tables
from screwgauge.models.generate import model_texts
from screwgauge.problem import ModelFiles, Progress, Report, silent
from screwgauge.processes import one_thread
from screwgauge.quantities import FLOAT32
from screwgauge.reference.errors import DescriptionError
from screwgauge.scene.scene import Scene
from screwgauge.solution import Cost, Solution
from screwgauge.study.address import address
from screwgauge.study.bench import forward_run, timing
from screwgauge.study.bench.contestants import LEAVING_OUT, NOTHING, Contestant, choose
from screwgauge.study.bench.given import Trial
from screwgauge.study.bench.tables import CUT, FAILED, OK, BenchRow, SlopeFit, leaving_out_table
from screwgauge.study.bench.tables import fits as slope_fits
from screwgauge.study.bench.timing import Plan
from screwgauge.study.comparison import provenance
from screwgauge.study.methods import check_whole, failure
from screwgauge.study.reference_values import QUANTITIES, PreparedScene, pose_scene
from screwgauge.study.runner import Executor, Task, run_tasks
from screwgauge.study.store import Journal, is_record

Measurements = tuple[dict[str, Any], dict[str, list[float]]]
"""Contestant -> result of its first call, and contestant -> its measured times [s]."""

#: Note on the times of contestants that ran simultaneously.
BESIDE = "Contestants were measured concurrently in several processes or on several workers, which affects the times."


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bench:
    """Measurements on a scene.

    Attributes:
        rows: One row for each contestant, setting and quantity; for simulations, the observables and the energy.
        fits: Fitted slopes.
        leaving_out: Rows of ``leaving_out.csv``.
        reference: Name of the source of the reference values.
        notes: Sentences for the report.
        provenance: Model files that were measured, and the date.
        rounding: Quantity -> scaled error that float32 may cause, see `screwgauge.engines.rounding`.
    """

    scene: Scene
    plan: Plan
    rows: Sequence[BenchRow]
    fits: Sequence[SlopeFit]
    leaving_out: pd.DataFrame
    reference: str
    notes: tuple[str, ...]
    environment: Mapping[str, Any]
    provenance: Mapping[str, Any]
    rounding: Mapping[str, float] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """True if no contestant was cut short."""
        return CUT not in {*self.leaving_out["status"], *(row.status for row in self.rows)}


def plan_of(scene: Scene, *, quick: bool = False, limit: float | None = None) -> Plan:
    """Return the extent of a bench for a scene.

    Args:
        limit: Budget [s], which replaces the default.

    Raises:
        DescriptionError: The limit is not a positive number of seconds.
    """
    full, short = (forward_run.FULL, forward_run.QUICK) if scene.simulated else (timing.FULL, timing.QUICK)
    plan = short if quick else full
    if limit is None:
        return plan
    if not 0.0 < limit < np.inf:
        raise DescriptionError(f"a limit of {limit:g} s", "--limit", "use a positive number of seconds")
    return replace(plan, budget=limit)


def bench(
    scene: Scene,
    *,
    plan: Plan | None = None,
    contestants: Iterable[str] | None = None,
    place: Path | None = None,
    progress: Report = silent,
    clock: Callable[[], int] = perf_counter_ns,
    execute: Executor | None = None,
) -> Bench:
    """Measure errors and run times of contestants on a scene, and the energy of a simulation.

    Args:
        plan: See `plan_of`.
        contestants: Names of families, contestants, ``leaving-out``, or engines of a simulation; all by default.
        place: Folder of the report. Results for a given motion are kept on disk until all are complete.
        progress: Called during the work.
        clock: Function that returns nanoseconds; tests pass their own.
        execute: Executor that measures each contestant with all of its settings; by default in this process, where
            the rounds of all contestants alternate, so that a temporary slowdown of the machine affects all alike.

    Raises:
        ScrewgaugeError: The input is invalid. A contestant that fails becomes a row, not an error.
    """
    check_given(scene)
    plan = plan or plan_of(scene)
    started = plan.start(plan.budget, clock)
    record = {**environment(), "one_thread": one_thread()}
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        if scene.simulated:
            scene, notes = forward_run.shorten_motion(scene, plan)
            chosen, kept = forward_run.choose(scene, contestants, quick=plan.quick), Journal(None, "")
            progress("reference", 0.0)
            posed = forward_run.pose_simulation(scene, Path(folder))
        else:
            chosen, kept = choose(contestants, quick=plan.quick), Journal(place, address_of(scene, plan), fits)
            chosen = [
                contestant
                for _, group in groupby(chosen, key=_group)
                for contestant in _installed_settings(list(group))
            ]
            progress("reference", 0.0)
            posed = pose_scene(scene, Path(folder), samples=plan.samples)
            notes = posed.reference.note, kept.note
        if execute is None:
            _measure(posed, started, chosen, kept, progress)
        else:
            _measure_as_tasks(posed, started, chosen, kept, partial(run_tasks, execute=execute, progress=progress))
            notes = *notes, BESIDE
        judged = provenance(posed.scene, {one.method.engine: posed.files(one.method.engine).model for one in chosen})
    narrow = any(contestant.kind is FLOAT32 for contestant in chosen)
    rows = [row for contestant in chosen for row in _rows(contestant, kept)]
    less = [row for row in rows if row.contestant.family == LEAVING_OUT]
    rows = [row for row in rows if row.contestant.family != LEAVING_OUT]
    outcome = Bench(
        scene=posed.scene,
        plan=plan,
        rows=rows,
        # whether a simulation has three points between saturation and rounding depends on the scene
        fits=[fit for fit in slope_fits(rows) if not scene.simulated or np.isfinite(fit.slope)],
        leaving_out=leaving_out_table(less),
        reference=posed.reference.engine,
        notes=tuple(filter(None, notes)),
        environment=record,
        provenance=judged,
        rounding=_rounding(posed) if narrow else {},
    )
    if outcome.complete:
        kept.remove()
    return outcome


def check_given(scene: Scene) -> None:
    """Reject scenes for which a bench cannot measure methods.

    Raises:
        DescriptionError: The scene uses the user's own model files or tables, or has a given motion with springs,
            motors, or loads that vary or turn with a body.
    """
    for entry, names in (("models", scene.models), ("tables", scene.tables)):
        if names:
            raise DescriptionError(
                "the bench measures methods on models generated from the description, not on your own models",
                f"{scene.file or scene.name}, {entry}",
                f"remove [{entry}], or compare {', '.join(names)} with `screwgauge run`",
            )
    if scene.simulated:
        return
    if scene.applied.springs or scene.applied.motors:
        raise DescriptionError(
            "the bench of a given motion does not support springs or motors",
            scene.name,
            "remove them, or add [forward]",
        )
    if any(load.courses or load.axes == "body" for load in scene.applied.loads):
        what = "the bench of a given motion supports only loads that are constant in world axes"
        raise DescriptionError(what, scene.name, "remove all other loads, or add [forward]")


def _rounding(posed: PreparedScene) -> dict[str, float]:
    """Return quantity -> largest error due to float32 relative to its scale, for the worst unit."""
    errors = rounding_errors(posed.scene.mechanism, posed.problem(*QUANTITIES), FLOAT32)
    scales = posed.reference.scales
    return {name: max(size / scales[name][unit] for unit, size in one.absolute.items()) for name, one in errors.items()}


def _measure(
    posed: PreparedScene,
    plan: Plan,
    chosen: Sequence[Contestant],
    kept: Journal,
    progress: Report = silent,
) -> None:
    """Measure contestants in this process."""
    if posed.scene.simulated:
        forward_run.measure(posed, plan, chosen, kept, progress)
    else:
        _Measurements(posed, kept, plan, progress).all(chosen)


def _measure_as_tasks(
    posed: PreparedScene,
    plan: Plan,
    chosen: Sequence[Contestant],
    kept: Journal,
    run: Callable[..., object],
) -> None:
    """Measure contestants as tasks, and store new results and times."""
    end, plan = time() + plan.left, replace(plan, clock=perf_counter_ns)  # clocks of tests cannot be pickled
    groups = {" ".join(key): list(group) for key, group in groupby(chosen, key=_group)}
    known = dict(kept.results), {key: [*times] for key, times in kept.times.items()}
    works = {name: partial(_measure_group, posed, plan, group, known, end) for name, group in groups.items()}
    tasks = [Task(name, work, files=posed.list_files()) for name, work in works.items()]

    def fail(name: str, reason: str) -> Measurements:
        return {one.key: {"status": FAILED, "reason": reason} for one in groups[name]}, {}

    def keep(name: str, measured: Measurements) -> None:
        for key in measured[0].keys() - kept.results.keys():
            kept.keep(key, measured[0][key])
        for key, times in measured[1].items():
            for seconds in times[len(kept.times.get(key, [])) :]:
                kept.time(key, seconds)

    run(tasks, lost=fail, keep=keep)


def _measure_group(
    posed: PreparedScene,
    plan: Plan,
    group: Sequence[Contestant],
    known: Measurements,
    end: float,
    progress: Progress,
) -> Measurements:
    """Measure the settings of a contestant; return the known and the new results and times.

    Args:
        end: Time after which no further measurement begins [s since 1970].
    """
    kept = Journal(None, "")
    kept.results, kept.times = dict(known[0]), {key: [*times] for key, times in known[1].items()}
    _measure(posed, plan.start(end - time()), group, kept)
    return kept.results, kept.times


def _installed_settings(group: list[Contestant]) -> list[Contestant]:
    """Return all settings of a contestant, or a single placeholder if its engine is not installed."""
    try:
        import_module(get_engine(group[0].method.engine).source.partition(":")[0])
    except ImportError:
        return [replace(group[0], setting="all settings", quantities=(NOTHING,), covers="nothing")]
    return group


class _Measurements:
    """Measurements of all contestants. A model loaded for the first measurement is kept for later rounds."""

    def __init__(self, posed: PreparedScene, kept: Journal, plan: Plan, progress: Report) -> None:
        self.posed, self.kept, self.plan, self.progress = posed, kept, plan, progress
        self.calls: dict[str, Callable[[], Any]] = {}
        self.models: dict[tuple[str, ModelFiles], EngineModel] = {}

    def all(self, chosen: Sequence[Contestant]) -> None:
        """Measure the first settings of all contestants, then the second settings, and so on.

        Thus a short budget omits no contestant."""
        groups = [list(group) for _, group in groupby(chosen, key=_group)]
        turns = (contestant for turn in zip_longest(*groups) for contestant in turn if contestant is not None)
        for i, contestant in enumerate(turns):
            if self.plan.over:
                return
            self.progress("errors", i / len(chosen))
            done = self.kept.results.get(contestant.key, {"status": OK, "first": 0.0})
            times = self.kept.times.get(contestant.key, [])
            # an earlier bench may have measured the contestant often enough
            if done["status"] == OK and len(times) < timing.rounds_needed(
                min([done["first"], *times]), self.plan.rounds
            ):
                self._first(contestant)
        self._measure(self.calls, self.plan)

    def _first(self, contestant: Contestant) -> None:
        """Compute the error of a contestant, unless an earlier bench computed it, and measure one time."""
        try:
            trial, method = contestant.ask(self.posed), contestant.method
            loaded = repr(method), trial.files  # contestants with the same method and files share a model
            model = self.models[loaded] = self.models.get(loaded) or method.load(trial.files)

            def call() -> list[Solution]:
                return [model.solve(problem) for problem in trial.problems]

            if contestant.key not in self.kept.results:
                self.kept.keep(contestant.key, self._score(contestant, trial, call))
            self._measure({contestant.key: call}, replace(self.plan, rounds=1))
            self.calls[contestant.key] = call
        except (Exception, SystemExit) as error:  # a contestant that fails becomes a row
            method = contestant.method
            reason = failure(error, method.name, self.posed.folder, get_engine(method.engine)).reason
            self.kept.keep(contestant.key, {"status": FAILED, "reason": reason})

    def _score(self, contestant: Contestant, trial: Trial, call: Callable[[], list[Solution]]) -> dict[str, Any]:
        with np.errstate(all="ignore"):
            seconds, solutions = timing.time_call(call, self.plan.clock)
        for problem, solution in zip(trial.problems, solutions, strict=True):
            check_whole(problem, solution)
        scores = contestant.scores(trial, solutions)
        return {"status": OK, "n_sample": trial.n_sample, "first": seconds, "scores": scores}

    def _measure(self, calls: Mapping[str, Callable[[], Any]], plan: Plan) -> None:
        first = {key: self.kept.results[key]["first"] for key in calls}
        left, made = sum(timing.rounds_needed(first[key], plan.rounds) for key in calls), count(1)

        def record(key: str, seconds: float) -> None:
            if len(calls) > 1:
                self.progress("times", min(1.0, next(made) / left))
            self.kept.time(key, seconds)

        with np.errstate(all="ignore"):
            timing.measure(calls, plan, record, self.kept.times, first)


def _group(contestant: Contestant) -> tuple[str, str]:
    return contestant.name, contestant.method.engine


def fits(result: Mapping[str, Any]) -> bool:
    """Return True if a result from a journal is complete: a failure with its reason, or numbers."""
    if result.get("status") == FAILED:
        return isinstance(result.get("reason"), str)
    first, scores = result.get("first"), Mapping[str, tuple[float, float, str]]  # largest and RMS errors, reason
    numbers = isinstance(result.get("n_sample"), int) and isinstance(first, float) and 0.0 <= first < np.inf
    return result.get("status") == OK and numbers and is_record(result.get("scores"), scores)


def _rows(contestant: Contestant, kept: Journal) -> Iterator[BenchRow]:
    """Yield the rows of one contestant, whether measured, failed or cut short."""
    result = kept.results.get(contestant.key, {"status": CUT, "reason": "the budget ran out before its turn"})
    seconds, cost = tuple(kept.times.get(contestant.key, ())), result.get("cost")
    for quantity in contestant.quantities:
        status, reason = result["status"], result.get("reason", "")
        largest, rms, lost = result.get("scores", {}).get(quantity, (np.nan, np.nan, ""))
        if lost:
            status, reason = FAILED, lost
        elif status == OK and not seconds and cost is None:
            status, reason = CUT, "the budget ran out before it could be timed"
        yield BenchRow(
            quantity,
            error=float(largest),
            rms=float(rms),
            reason=reason,
            contestant=contestant,
            status=status,
            n_sample=int(result.get("n_sample", 0)),
            seconds=seconds,
            largest=result.get("largest", {}).get(quantity, {}),
            cost=cost or Cost(np.nan),
        )


def address_of(scene: Scene, plan: Plan) -> str:
    """Return the address of a bench: a digest of mechanism and its source text, motion, gravity, loads and extent."""
    motion, applied = scene.motion, scene.applied
    return address(
        "bench",
        model_texts(scene.mechanism),
        [mechanism_tables(scene.mechanism_file), scene.text],  # the truth reads the unrounded strings
        [array.tobytes().hex() for array in (motion.t, motion.y, motion.yd, motion.ydd)],
        plain([applied.g, *(load.numbers() for load in applied.loads)]),
        [plan.quick, plan.samples, one_thread()],
    )
