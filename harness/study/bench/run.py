"""Runs a bench of a given motion: the error of each contestant, then times in rounds; a journal keeps every row."""

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
from screwgauge.solution import Solution
from screwgauge.study.address import address
from screwgauge.study.bench import timing
from screwgauge.study.bench.contestants import LEAVING_OUT, NOTHING, Contestant, choose
from screwgauge.study.bench.given import Trial
from screwgauge.study.bench.tables import CUT, FAILED, OK, BenchRow, SlopeFit, leaving_out_table
from screwgauge.study.bench.tables import fits as slope_fits
from screwgauge.study.comparison import provenance
from screwgauge.study.methods import check_whole, failure
from screwgauge.study.reference_values import QUANTITIES, PreparedScene, pose_scene
from screwgauge.study.runner import Executor, Task, run_tasks
from screwgauge.study.store import Journal, is_record


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is measured.

    Attributes:
        samples: Times compared, at most.
        rounds: Measurements of a contestant, at most.
        budget: Seconds after which nothing further begins; in a simulation, nothing goes on either.
        quick: Settings that take longest are left out.
        each: Seconds after which a contestant of a simulation is stopped.
        share: Share of a simulation that is integrated.
    """

    samples: int
    rounds: int
    budget: float
    quick: bool
    each: float = np.inf
    share: float = 1.0


Measurements = tuple[dict[str, Any], dict[str, list[float]]]
"""Contestant -> result of its first call, and -> its times [s]."""

FULL = Plan(samples=201, rounds=12, budget=480.0, quick=False)
#: Note on times that were measured at the same time.
BESIDE = "Contestants were measured beside each other, in processes or on workers of their own, which disturbs times."
QUICK = Plan(samples=41, rounds=3, budget=48.0, quick=True)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bench:
    """What was measured.

    Attributes:
        rows: One for each contestant, setting and quantity; of a simulation those of the observables and the energy.
        fits: Fitted slopes.
        leaving_out: Rows of ``leaving_out.csv``.
        reference: What errors are measured against, in words.
        notes: Sentences for the report.
        provenance: Files that were judged, and the date.
        rounding: Quantity -> scaled error that float32 may make of it, see `screwgauge.engines.rounding`.
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
        """Nothing was cut short."""
        return CUT not in {*self.leaving_out["status"], *(row.status for row in self.rows)}


def check_budget(seconds: float) -> float:
    """The budget that a user gives [s].

    Raises:
        DescriptionError: It is no positive number of seconds.
    """
    if not 0.0 < seconds < np.inf:
        raise DescriptionError(f"a limit of {seconds:g} s", "--limit", "give a positive number of seconds")
    return seconds


def check_generated(scene: Scene) -> None:
    """Refuses model files and numbers of the user's own: a bench measures methods.

    Raises:
        DescriptionError: The scene names some.
    """
    for entry, names in (("models", scene.models), ("tables", scene.tables)):
        if names:
            raise DescriptionError(
                "the bench measures methods on models made from the description and reads none of your own",
                f"{scene.file or scene.name}, {entry}",
                f"remove [{entry}], or compare {', '.join(names)} by `screwgauge run`",
            )


def bench(
    scene: Scene,
    *,
    plan: Plan = FULL,
    contestants: Iterable[str] | None = None,
    place: Path | None = None,
    progress: Report = silent,
    clock: Callable[[], int] = perf_counter_ns,
    execute: Executor | None = None,
) -> Bench:
    """Measures errors and run times of contestants on a scene.

    Args:
        contestants: Families, contestants, ``leaving-out``; all by default.
        place: Folder of the report, of which finished pieces are kept until all are there; by default none are.
        progress: Called as work goes on.
        clock: Nanoseconds; another one in tests.
        execute: Where contestants are measured, each with all of its settings; by default in this process, where the
            rounds of all follow each other, so that what slows the machine for a while slows all alike.

    Raises:
        ScrewgaugeError: Bad input. A contestant that fails is a row.
    """
    check_generated(scene)
    chosen, record = choose(contestants, quick=plan.quick), {**environment(), "one_thread": one_thread()}
    if scene.applied.springs or scene.applied.motors:
        raise DescriptionError(
            "the bench of a given motion knows no springs and no motors", scene.name, "remove them, or add [forward]"
        )
    if any(load.courses or load.axes == "body" for load in scene.applied.loads):
        what = "the bench of a given motion knows loads that are constant in world axes only"
        raise DescriptionError(what, scene.name, "remove the others, or add [forward]")
    chosen = [contestant for _, group in groupby(chosen, key=_group) for contestant in _present(list(group))]
    protocol = timing.Protocol(plan.rounds, clock() + plan.budget * 1e9, clock)
    kept = Journal(place, address_of(scene, plan), fits)
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        progress("reference", 0.0)
        posed = pose_scene(scene, Path(folder), samples=plan.samples)
        if execute is None:
            _Measurements(posed, kept, protocol, progress).all(chosen)
        else:
            _elsewhere(posed, kept, protocol, chosen, execute, progress)
        judged = provenance(posed.scene, models_of(chosen, posed))
    narrow = any(contestant.kind is FLOAT32 for contestant in chosen)
    rows = [row for contestant in chosen for row in _rows(contestant, kept)]
    less = [row for row in rows if row.contestant.family == LEAVING_OUT]
    rows = [row for row in rows if row.contestant.family != LEAVING_OUT]
    outcome = Bench(
        scene=posed.scene,
        plan=plan,
        rows=rows,
        fits=slope_fits(rows),
        leaving_out=leaving_out_table(less),
        reference=posed.reference.engine,
        notes=tuple(filter(None, (posed.reference.note, kept.note, "" if execute is None else BESIDE))),
        environment=record,
        provenance=judged,
        rounding=_rounding(posed) if narrow else {},
    )
    if outcome.complete:
        kept.remove()
    return outcome


def _rounding(posed: PreparedScene) -> dict[str, float]:
    """Quantity -> largest error by float32 over its scale, of the worst unit."""
    errors = rounding_errors(posed.scene.mechanism, posed.problem(*QUANTITIES), FLOAT32)
    scales = posed.reference.scales
    return {name: max(size / scales[name][unit] for unit, size in one.absolute.items()) for name, one in errors.items()}


def _elsewhere(
    posed: PreparedScene,
    kept: Journal,
    protocol: timing.Protocol,
    chosen: Sequence[Contestant],
    execute: Executor,
    progress: Report,
) -> None:
    """Measures contestants as tasks of an executor, and keeps new results and times."""
    end = time() + (protocol.deadline - protocol.clock()) * 1e-9
    groups = {" ".join(key): list(group) for key, group in groupby(chosen, key=_group)}
    tasks = []
    for name, group in groups.items():
        known = {c.key: (kept.results.get(c.key), kept.times.get(c.key, [])) for c in group}
        work = partial(_measured, posed, group, known, protocol.rounds, end)
        tasks.append(Task(name, work, files=posed.written()))

    def lost(name: str, reason: str) -> Measurements:
        return {c.key: {"status": FAILED, "reason": reason} for c in groups[name]}, {}

    def keep(name: str, measured: Measurements) -> None:
        for key, result in measured[0].items():
            if key not in kept.results:
                kept.keep(key, result)
        for key, times in measured[1].items():
            for seconds in times[len(kept.times.get(key, [])) :]:
                kept.time(key, seconds)

    run_tasks(tasks, execute, lost=lost, keep=keep, progress=progress)


def _measured(
    posed: PreparedScene,
    group: Sequence[Contestant],
    known: Mapping[str, tuple[dict[str, Any] | None, list[float]]],
    rounds: int,
    end: float,
    progress: Progress,
) -> Measurements:
    """Results and times of the settings of a contestant, including those that are known.

    Args:
        end: When nothing further begins [s since 1970].
    """
    kept = Journal(None, "")
    kept.results = {key: result for key, (result, _) in known.items() if result is not None}
    kept.times = {key: [*times] for key, (_, times) in known.items() if times}
    deadline = perf_counter_ns() + (end - time()) * 1e9
    _Measurements(posed, kept, timing.Protocol(rounds, deadline), silent).all(group)
    return kept.results, kept.times


def models_of(contestants: Iterable[Contestant], posed: PreparedScene) -> dict[str, Path]:
    """Engine -> the model file that it reads."""
    engines = dict.fromkeys(contestant.method.engine for contestant in contestants)
    return {name: posed.files(name).model for name in engines}


def _present(group: list[Contestant]) -> list[Contestant]:
    """All settings of a contestant, or one for all of them where its engine is missing."""
    try:
        import_module(get_engine(group[0].method.engine).source.partition(":")[0])
    except ImportError:
        return [replace(group[0], setting="all settings", quantities=(NOTHING,), covers="nothing")]
    return group


class _Measurements:
    """All measurements. What is loaded for the first of a contestant waits for the rounds that follow."""

    def __init__(self, posed: PreparedScene, kept: Journal, protocol: timing.Protocol, progress: Report) -> None:
        self.posed, self.kept, self.protocol, self.progress = posed, kept, protocol, progress
        self.calls: dict[str, Callable[[], Any]] = {}
        self.models: dict[tuple[str, str, ModelFiles], EngineModel] = {}

    def all(self, chosen: Sequence[Contestant]) -> None:
        """The first setting of every contestant, then the second ones and so on, so that no budget leaves any out."""
        groups = [list(group) for _, group in groupby(chosen, key=_group)]
        turns = (contestant for turn in zip_longest(*groups) for contestant in turn if contestant is not None)
        for i, contestant in enumerate(turns):
            if self.protocol.over:
                return
            self.progress("errors", i / len(chosen))
            done = self.kept.results.get(contestant.key, {"status": OK, "first": 0.0})
            times = self.kept.times.get(contestant.key, [])
            # what an earlier bench has measured enough is not even loaded
            if done["status"] == OK and len(times) < timing.enough(min([done["first"], *times]), self.protocol.rounds):
                self._first(contestant)
        self._measure(self.calls, self.protocol)

    def _first(self, contestant: Contestant) -> None:
        """The error of a contestant, unless an earlier bench has it, and one measured time."""
        try:
            trial, method = contestant.ask(self.posed), contestant.method
            loaded = method.engine, repr(method.settings), trial.files  # once for all contestants that ask it
            model = self.models[loaded] = self.models.get(loaded) or method.load(trial.files)

            def call() -> list[Solution]:
                return [model.solve(problem) for problem in trial.problems]

            if contestant.key not in self.kept.results:
                self.kept.keep(contestant.key, self._scored(contestant, trial, call))
            self._measure({contestant.key: call}, replace(self.protocol, rounds=1))
            self.calls[contestant.key] = call
        except (Exception, SystemExit) as error:  # a contestant that fails is a row
            method = contestant.method
            reason = failure(error, method.name, self.posed.folder, get_engine(method.engine)).reason
            self.kept.keep(contestant.key, {"status": FAILED, "reason": reason})

    def _scored(self, contestant: Contestant, trial: Trial, call: Callable[[], list[Solution]]) -> dict[str, Any]:
        with np.errstate(all="ignore"):
            seconds, solutions = timing.once(call, self.protocol.clock)
        for problem, solution in zip(trial.problems, solutions, strict=True):
            check_whole(problem, solution)
        scores = contestant.scores(trial, solutions)
        return {"status": OK, "n_sample": trial.n_sample, "first": seconds, "scores": scores}

    def _measure(self, calls: Mapping[str, Callable[[], Any]], protocol: timing.Protocol) -> None:
        first = {key: self.kept.results[key]["first"] for key in calls}
        left, made = sum(timing.enough(first[key], protocol.rounds) for key in calls), count(1)

        def record(key: str, seconds: float) -> None:
            if len(calls) > 1:
                self.progress("times", min(1.0, next(made) / left))
            self.kept.time(key, seconds)

        with np.errstate(all="ignore"):
            timing.measure(calls, protocol, record, self.kept.times, first)


def _group(contestant: Contestant) -> tuple[str, str]:
    return contestant.name, contestant.method.engine


def fits(result: Mapping[str, Any]) -> bool:
    """Whether a result from a journal is whole: a failure with its reason, or numbers."""
    if result.get("status") == FAILED:
        return isinstance(result.get("reason"), str)
    first, scores = result.get("first"), Mapping[str, tuple[float, float, str]]  # largest and RMS, why there is none
    numbers = isinstance(result.get("n_sample"), int) and isinstance(first, float) and 0.0 <= first < np.inf
    return result.get("status") == OK and numbers and is_record(result.get("scores"), scores)


def _rows(contestant: Contestant, kept: Journal) -> Iterator[BenchRow]:
    """The rows of one contestant, measured, failed or cut short."""
    result = kept.results.get(contestant.key, {"status": CUT, "reason": "the budget was spent before its turn"})
    seconds, n = tuple(kept.times.get(contestant.key, ())), int(result.get("n_sample", 0))
    for quantity in contestant.quantities:
        status, reason = result["status"], result.get("reason", "")
        largest, rms, lost = result.get("scores", {}).get(quantity, (float("nan"), float("nan"), ""))
        if lost:
            status, reason = FAILED, lost
        elif status == OK and not seconds:
            status, reason = CUT, "the budget was spent before it could be timed"
        yield BenchRow(
            quantity,
            error=float(largest),
            rms=float(rms),
            reason=reason,
            contestant=contestant,
            status=status,
            n_sample=n,
            seconds=seconds,
        )


def address_of(scene: Scene, plan: Plan) -> str:
    """Address of a bench: mechanism and its text, motion, gravity and loads, and extent; it reads no other files."""
    motion, applied = scene.motion, scene.applied
    return address(
        "bench",
        model_texts(scene.mechanism),
        [mechanism_tables(scene.mechanism_file), scene.text],  # which the truth reads unrounded
        [array.tobytes().hex() for array in (motion.t, motion.y, motion.yd, motion.ydd)],
        plain([applied.g, *(load.numbers() for load in applied.loads)]),
        [plan.quick, plan.samples, one_thread()],
    )
