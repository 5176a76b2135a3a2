"""Runs stress cases, rung by rung; whatever goes wrong on a rung is a row."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.environment import environment, json_text
from screwgauge.judging.residual import columns_of, frame
from screwgauge.problem import Progress, Report, silent
from screwgauge.reference.errors import DescriptionError
from screwgauge.study.cases.case import SILENT, Finding, StressCase
from screwgauge.study.cases.question import findings
from screwgauge.study.cases.registry import choose
from screwgauge.study.comparison import provenance
from screwgauge.study.methods import missing
from screwgauge.study.runner import Executor, InTurn, Task, run_tasks
from screwgauge.study.store import Journal

#: Column of ``stress.csv`` -> attribute of a `Finding`.
COLUMNS = {
    **{name: name for name in ("case", "severity", "engine", "quantity", "digits", "condition", "time_s", "verdict")},
    "reason": "told",
}
#: File of rungs that interrupted stress goes on from.
NAME = "stress.partial.jsonl"
#: Stands for the engines of a rung that broke before it could ask them one by one.
ALL = "all"


@dataclass(frozen=True, slots=True, eq=False)
class Stress:
    """What the ladders found.

    Attributes:
        cases: In the order run.
        rows: One for each rung, engine and quantity.
        seconds: Case -> how long it took.
    """

    cases: tuple[StressCase, ...]
    rows: tuple[Finding, ...]
    seconds: Mapping[str, float]
    quick: bool
    environment: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Our own solver is nowhere silently wrong."""
        return not any(row.own and row.verdict == SILENT for row in self.rows)

    @property
    def broken(self) -> tuple[str, ...]:
        """Why rungs have no rows of their own."""
        return tuple(dict.fromkeys(row.reason for row in self.rows if row.engine == ALL))

    @property
    def table(self) -> pd.DataFrame:
        """The rows of ``stress.csv``."""
        return frame(self.rows, COLUMNS)


def stress(
    cases: Iterable[str] | None = None,
    *,
    quick: bool = False,
    severities: Sequence[float] | None = None,
    progress: Report = silent,
    execute: Executor | None = None,
    journal: Path | None = None,
) -> Stress:
    """Climbs the ladders of the named cases, all by default.

    Args:
        quick: Fewer rungs and smaller scenes.
        severities: Rungs in place of the case's own; for one case only.
        execute: Where rungs are climbed; in this process by default.
        journal: File of rungs that interrupted stress goes on from; it goes away when all are there.

    Raises:
        ScrewgaugeError: An unknown case, or a severity outside its range.
    """
    chosen = choose(cases)
    if severities is not None and len(chosen) != 1:
        raise DescriptionError("severities are given", "--severity", "name the one case that they are of")
    ladders = [(case, severity) for case in chosen for severity in case.rungs(quick=quick, severities=severities)]
    kept = Journal(journal, json_text([environment(), quick]), _is_rung)
    rungs: list[dict[str, Any]] = run_tasks(
        [Task(f"{case.name} {severity:g}", partial(_rung, case, severity, quick)) for case, severity in ladders],
        execute or InTurn(),
        kept,
        lost=_broken,
        progress=progress,
    )
    rows, seconds = list[Finding](), dict.fromkeys((case.name for case in chosen), 0.0)
    for (case, severity), rung in zip(ladders, rungs, strict=True):
        rows += [Finding(**{**row, "case": case.name, "severity": severity}) for row in rung["rows"]]
        seconds[case.name] += rung["seconds"]
    kept.remove()
    return Stress(tuple(chosen), tuple(rows), seconds, quick, environment(), provenance(None, {}))


def _rung(case: StressCase, severity: float, quick: bool, progress: Progress) -> dict[str, Any]:
    """What is found on a rung, as plain data, and how long it took."""
    begin = perf_counter()
    rows = [asdict(finding) for finding in climb(case, severity, quick=quick)]
    return {"rows": rows, "seconds": perf_counter() - begin}


def _broken(name: str, reason: str) -> dict[str, Any]:
    """A rung that its process did not survive, as plain data."""
    return {"rows": [asdict(Finding("", a=ALL, reason=reason))], "seconds": 0.0}


def _is_rung(record: Mapping[str, Any]) -> bool:
    """Whether a record is what `_rung` makes."""
    known = columns_of(Finding)
    rows, seconds = record.get("rows"), record.get("seconds")
    sound = isinstance(rows, list) and all(isinstance(row, dict) and row.keys() == known.keys() for row in rows)
    return sound and isinstance(seconds, float)


def climb(case: StressCase, severity: float, *, quick: bool = False) -> list[Finding]:
    """What is found on one rung; a rung that breaks is one finding of `ALL`."""
    try:
        # extremes are the point; what comes of them is judged
        with np.errstate(all="ignore"), tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
            questions = case.ask(severity, quick, Path(folder))
            return [finding for question in questions for finding in findings(question)]
    except Exception as error:  # the other rungs go on
        what = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return [Finding("", a=ALL, reason=missing(error) if isinstance(error, ImportError) else what)]
