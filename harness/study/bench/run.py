"""Runs a bench: error pass, then time pass; every finished piece is kept."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.engines.registry import GENERATED
from screwgauge.environment import environment
from screwgauge.quantities import SOLVED
from screwgauge.reference.errors import DescriptionError
from screwgauge.scene.scene import Scene
from screwgauge.study.bench import leaving_out, slopes, timing
from screwgauge.study.bench.case import Case, make_case
from screwgauge.study.bench.contestant import NOTHING, Contestant, Task
from screwgauge.study.bench.journal import Journal, stamp
from screwgauge.study.bench.registry import LEAVING_OUT, Entry, choose, load
from screwgauge.study.bench.rows import CUT, FAILED, OK, Row
from screwgauge.study.bench.score import score
from screwgauge.study.bench.threads import one_thread
from screwgauge.study.provenance import provenance
from screwgauge.study.run import Report


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is measured. `budget`: seconds after which nothing further begins."""

    samples: int
    rounds: int
    budget: float
    quick: bool


FULL = Plan(samples=201, rounds=12, budget=480.0, quick=False)
QUICK = Plan(samples=41, rounds=3, budget=48.0, quick=True)


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """What a bench found.

    Attributes:
        rows: One for each contestant, setting and quantity.
        fits: Fitted slopes.
        leaving_out: Rows of ``leaving_out.csv``.
        reference: Engine that errors are measured against.
        notes: Sentences for the report.
        provenance: Files that were judged, and the date.
    """

    scene: Scene
    plan: Plan
    n_compared: int
    rows: tuple[Row, ...]
    fits: tuple[slopes.Fit, ...]
    leaving_out: pd.DataFrame
    reference: str
    notes: tuple[str, ...]
    environment: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Nothing was cut short."""
        return all(row.status != CUT for row in self.rows) and not (self.leaving_out["status"] == CUT).any()


def check_budget(seconds: float) -> float:
    """A budget as given by a user.

    Raises:
        DescriptionError: It is no positive number of seconds.
    """
    if not 0.0 < seconds < np.inf:
        raise DescriptionError(f"a budget of {seconds:g} s", "--budget", "give a positive number of seconds")
    return seconds


def bench(
    scene: Scene,
    *,
    plan: Plan = FULL,
    contestants: Iterable[str] | None = None,
    journal: Path | None = None,
    progress: Report = lambda step, share: None,
    clock: Callable[[], int] = perf_counter_ns,
) -> Bench:
    """Measures errors and run times of contestants on a scene.

    Args:
        contestants: Families, contestants, ``leaving-out``; all by default.
        journal: File that keeps finished pieces; a bench that is complete removes it.
        progress: Called as work goes on.
        clock: Nanoseconds; another one in tests.

    Raises:
        ScrewgaugeError: Bad input. A contestant that fails is a row.
    """
    wanted = None if contestants is None else list(contestants)
    entries, here = choose(wanted), environment()
    here = {**here, "one_thread": one_thread()}
    protocol = timing.Protocol(plan.rounds, clock() + plan.budget * 1e9, clock)
    kept = Journal(journal, stamp(scene, here, plan.quick))
    trials = leaving_out.trials(leaving_out.ENGINES) if wanted is None or LEAVING_OUT in wanted else []
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
        progress("reference", 0.0)
        case = make_case(scene, Path(folder), samples=plan.samples, quick=plan.quick)
        chosen = [c for entry in entries for c in _load(entry, plan.quick)]
        work = _Work(case, kept, protocol, progress)
        work.errors(chosen)
        work.differences(trials)
        work.time_all()
        models = {name: Path(case.problem(name, ()).model) for name in GENERATED}
        files = provenance(case.scene, models)
    rows = tuple(row for contestant in chosen for row in _rows(contestant, kept))
    found = Bench(
        scene=case.scene,
        plan=plan,
        n_compared=len(case.times),
        rows=rows,
        fits=tuple(slopes.fits(rows)),
        leaving_out=leaving_out.table(trials, kept.results, kept.times),
        reference=case.reference.engine,
        notes=tuple(note for note in (case.reference.note, kept.note) if note),
        environment=here,
        provenance=files,
    )
    if found.complete:
        kept.remove()
    return found


def _load(entry: Entry, quick: bool) -> list[Contestant]:
    try:
        return load(entry, quick=quick)
    except ImportError as error:
        reason = f"not installed ({error})"

        def prepare(case: Case) -> Task:
            raise ImportError(reason)

        return [Contestant("all settings", (NOTHING,), "nothing", prepare, family=entry.family, name=entry.name)]


class _Work:
    """Both passes. Tasks that the error pass loaded wait for the time pass."""

    def __init__(self, case: Case, kept: Journal, protocol: timing.Protocol, progress: Report) -> None:
        self.case, self.kept, self.protocol, self.progress = case, kept, protocol, progress
        self.calls: dict[str, Callable[[], Any]] = {}

    def errors(self, chosen: Sequence[Contestant]) -> None:
        for contestant in self._within("errors", chosen):
            result: dict[str, Any]
            done = self.kept.results.get(contestant.key)
            if done is not None and not self._wanting(contestant.key, done):
                continue
            try:
                task = contestant.prepare(self.case)
                if done is None:
                    result = self._scores(contestant, task)
                    self.kept.keep(contestant.key, result)
                self.calls[contestant.key] = task.call
            except Exception as error:  # a contestant that fails is a row
                self.kept.keep(contestant.key, _failure(error))

    def _scores(self, contestant: Contestant, task: Task) -> dict[str, Any]:
        with np.errstate(all="ignore"):
            seconds, raw = timing.once(task.call, self.protocol.clock)
        scores = {}
        for quantity, outcome in task.read(raw).items():
            reference = outcome.reference or self.case.reference.values[quantity]
            found = score(outcome, reference, outcome.scales or self.case.scales[quantity])
            reason = f"{found.reason}: {task.hint}" if found.reason and task.hint else found.reason
            scores[quantity] = [found.max_scaled, found.rms_scaled, reason]
        return {"status": OK, "n_sample": task.n_sample, "first": seconds, "scores": scores}

    def differences(self, trials: Sequence[leaving_out.Trial]) -> None:
        """The error pass of what leaving out buys."""
        whole: dict[str, Any] = {}
        for trial in self._within("leaving out", trials):
            try:
                call = leaving_out.load(trial.problem(self.case), trial.engine, self.case)
                seconds, solution = timing.once(call, self.protocol.clock)
                everything = whole.setdefault(trial.engine, solution.values)
                gap, worst = leaving_out.difference(solution.values, everything, trial.compared)
                reason = f"changes {worst}" if gap > SOLVED else ""
                result = {"status": OK, "n_sample": len(self.case.times), "first": seconds, "difference": gap}
                result["reason"] = reason
                self.calls[trial.key] = call
            except Exception as error:
                result = _failure(error)
            self.kept.keep(trial.key, result)

    def _within(self, step: str, items: Sequence[Any]) -> Iterator[Any]:
        """The items, until the budget is spent."""
        for i, item in enumerate(items):
            if self.protocol.over:
                return
            self.progress(step, i / len(items))
            yield item

    def _wanting(self, key: str, done: Mapping[str, Any]) -> bool:
        """Whether a result taken over still lacks measurements."""
        if done["status"] != OK:
            return False
        have = self.kept.times.get(key, [])
        return len(have) < timing.enough(min([done["first"], *have]), self.protocol.rounds)

    def time_all(self) -> None:
        first = {key: self.kept.results[key]["first"] for key in self.calls}
        left = sum(timing.enough(first[key], self.protocol.rounds) for key in self.calls)
        made = 0

        def record(key: str, seconds: float) -> None:
            nonlocal made
            made += 1
            self.progress("times", min(1.0, made / left))
            self.kept.time(key, seconds)

        with np.errstate(all="ignore"):
            timing.measure(self.calls, self.protocol, record, self.kept.times, first)


def _failure(error: Exception) -> dict[str, Any]:
    return {"status": FAILED, "reason": f"{type(error).__name__}: {' '.join(str(error).split())}"}


def _rows(contestant: Contestant, kept: Journal) -> Iterator[Row]:
    """The rows of one contestant, whatever has become of it."""
    result = kept.results.get(contestant.key, {"status": CUT, "reason": "the budget was spent before its turn"})
    seconds, n = tuple(kept.times.get(contestant.key, ())), int(result.get("n_sample", 0))
    nan = float("nan")
    for quantity in contestant.quantities:
        status, reason = result["status"], result.get("reason", "")
        largest, rms, lost = result.get("scores", {}).get(quantity, (nan, nan, ""))
        if lost:
            status, reason = FAILED, lost
        elif status == OK and not seconds:
            status, reason = CUT, "the budget was spent before it could be timed"
        yield Row(contestant, quantity, float(largest), float(rms), n, seconds, status, reason)
