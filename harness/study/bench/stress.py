"""Stress tests: the cases of ``cases.toml``, series of problems of increasing severity, each severity run as a task.

The module of a case is imported when the case is run.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.environment import environment
from screwgauge.judging.residual import frame
from screwgauge.problem import Progress, Report, silent
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.study.address import address
from screwgauge.study.bench import TABLE
from screwgauge.study.bench.question import SILENT, Finding, Question, findings
from screwgauge.study.comparison import provenance
from screwgauge.study.methods import Method, describe_import_error
from screwgauge.study.runner import Executor, InTurn, Task, run_tasks
from screwgauge.study.store import Journal, from_record, is_record

Ask = Callable[[float, bool, Path], Iterable[Question]]
"""(severity, quick, folder for model files) -> questions for it. A module-level function, which can be pickled."""


@dataclass(frozen=True, slots=True)
class StressCase:
    """A stress case: a series of problems of increasing severity. Plain data that can be pickled.

    Attributes:
        name: Name on the command line.
        title: Heading of the plot: the property that becomes extreme.
        axis: Name and unit of the severity.
        about: Text of the report on the measurement and its meaning.
        drawn: Quantity of the small plot.
        low, high: Range of the severity.
        full, quick: Severities of the full and of the quick series.
        ask: Function that yields the questions for a severity.
        falling: True if difficulty increases as the severity value decreases.
        whole: True if severities are counts.
    """

    name: str
    title: str
    axis: str
    about: str
    drawn: str
    low: float
    high: float
    full: Sequence[float]
    quick: Sequence[float]
    ask: Ask
    falling: bool = False
    whole: bool = False

    @property
    def span(self) -> str:
        """Description of the severity and its range."""
        return f"{self.axis}, {self.low:g} to {self.high:g}"

    def rungs(self, *, quick: bool = False, severities: Sequence[float] | None = None) -> list[float]:
        """Return the given severities, or the severities of a full or quick run, without duplicates.

        Raises:
            DescriptionError: A severity is outside the range of the case or not a count, or `severities` is empty.
        """
        where = f"case {self.name}"
        if severities is not None and not len(severities):
            raise DescriptionError("no severity is given", where, f"choose severities within {self.span}")
        for value in severities or ():
            if self.whole and value != int(value):
                raise DescriptionError(f"severity {value:g} is not a whole number", where, "choose a whole number")
            if not self.low <= value <= self.high:
                what = f"severity {value:g} is outside {self.low:g} to {self.high:g} ({self.axis})"
                raise DescriptionError(what, where, "choose a severity within this range")
        return list(dict.fromkeys(severities or (self.quick if quick else self.full)))


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """Return powers of ten with exponents from `first` to `last`, both included."""
    sign = 1 if last >= first else -1
    return tuple(float(f"1e{k}") for k in range(first, last + sign, sign * step))


def _questions(
    ask: str, methods: Sequence[dict[str, Any]], severity: float, quick: bool, folder: Path
) -> Iterator[Question]:
    """Yield the questions for a severity; a question without methods gets the methods of the case.

    Args:
        ask: Function of this package, ``module:name``.
    """
    module, name = ask.split(":")
    function: Ask = getattr(import_module(f"screwgauge.study.bench.{module}"), name)
    at = {"$severity": severity, "$rest": 1.0 - severity}
    for question in function(severity, quick, folder):
        if question.methods:
            yield question
            continue
        for entry in (each for each in methods if each.get("of", "") == question.of):
            settings = {key: at.get(value, value) for key, value in entry.get("settings", {}).items()}
            method = Method(entry["engine"], settings, entry["label"])
            yield replace(question, methods=(method,), cause=entry.get("cause", ""))


def _case(entry: dict[str, Any]) -> StressCase:
    """Build a case from an entry of the table."""
    rungs = {name: _rungs(entry[name]) for name in ("full", "quick")}
    fields = {name: value for name, value in entry.items() if name != "methods"}
    return StressCase(**{**fields, **rungs, "ask": partial(_questions, entry["ask"], entry.get("methods", ()))})


def _rungs(given: Any) -> tuple[float, ...]:
    """Return the severities of an entry, which is a list, or has single values and decades."""
    return (*given.get("at", ()), *decades(*given["decades"])) if isinstance(given, dict) else tuple(given)


#: Name -> case, in the order of execution.
CASES = {entry["name"]: _case(entry) for entry in TABLE["cases"]}


def choose(names: Iterable[str] | None) -> list[StressCase]:
    """Return the named cases in the order of the table; by default all.

    Raises:
        DescriptionError: A name is unknown.
    """
    wanted = list(CASES) if names is None else check_choice("case", names, CASES)
    return [case for name, case in CASES.items() if name in wanted]


#: Column of ``stress.csv`` -> attribute of a `Finding`.
COLUMNS = {
    **{name: name for name in ("case", "severity", "engine", "quantity", "digits", "condition", "time_s", "verdict")},
    "reason": "explanation",
}
#: Engine name for a severity that failed before it asked any engine.
ALL = "all"


@dataclass(frozen=True, slots=True, eq=False)
class Stress:
    """Findings of all stress cases.

    Attributes:
        cases: Cases in the order of execution.
        rows: One row for each case, severity, engine and quantity.
    """

    cases: Sequence[StressCase]
    rows: Sequence[Finding]
    environment: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """True if our own solver is never silently wrong."""
        return not any(row.own and row.verdict == SILENT for row in self.rows)

    @property
    def broken(self) -> tuple[str, ...]:
        """Reasons why severities failed without asking an engine."""
        return tuple(dict.fromkeys(row.reason for row in self.rows if row.engine == ALL))

    @property
    def table(self) -> pd.DataFrame:
        """The content of ``stress.csv``."""
        return frame(self.rows, COLUMNS)


def stress(
    cases: Iterable[str] | None = None,
    *,
    quick: bool = False,
    severities: Sequence[float] | None = None,
    progress: Report = silent,
    execute: Executor | None = None,
    place: Path | None = None,
) -> Stress:
    """Run the named stress cases, by default all.

    Args:
        quick: Use fewer severities and smaller scenes.
        severities: Severities that replace the severities of the case; only for a single case.
        execute: Executor of the severities, each a task; this process by default.
        place: Folder of the report. With a folder, finished severities are kept on disk until all are complete.

    Raises:
        ScrewgaugeError: A case is unknown, or a severity is outside its range.
    """
    chosen = choose(cases)
    if severities is not None and len(chosen) != 1:
        raise DescriptionError("severities apply to a single case", "--severity", "name that case")
    ladders = [(case, severity) for case in chosen for severity in case.rungs(quick=quick, severities=severities)]
    kept, form = Journal(place, address("stress", quick)), Sequence[Finding]
    before = {key: each["rows"] for key, each in kept.results.items() if is_record(each.get("rows"), form)}
    rungs = run_tasks(
        [Task(f"{case.name} {severity:g}", partial(_climb_rung, case, severity, quick)) for case, severity in ladders],
        execute or InTurn(),
        lost=lambda name, reason: [Finding("", a=ALL, reason=reason)],
        before={key: from_record(rows, form) for key, rows in before.items()},
        keep=lambda key, rows: kept.keep(key, {"rows": [asdict(row) for row in rows]}),
        progress=progress,
    )
    climbed = zip(ladders, rungs, strict=True)
    rows = [replace(row, case=case.name, severity=at) for (case, at), rung in climbed for row in rung]
    kept.remove()
    return Stress(chosen, rows, environment(), provenance(None, {}))


def _climb_rung(case: StressCase, severity: float, quick: bool, progress: Progress) -> list[Finding]:
    """Run one severity of a case as the work of a task."""
    return climb(case, severity, quick=quick)


def climb(case: StressCase, severity: float, *, quick: bool = False) -> list[Finding]:
    """Return the findings for one severity; an unexpected error yields one finding for all engines, `ALL`."""
    try:
        # extreme problems overflow on purpose, and their results are judged
        with np.errstate(all="ignore"), tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
            questions = case.ask(severity, quick, Path(folder))
            return [finding for question in questions for finding in findings(question)]
    except Exception as error:  # the other severities continue
        what = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return [Finding("", a=ALL, reason=describe_import_error(error) if isinstance(error, ImportError) else what)]
