"""Runs stress cases, rung by rung; whatever goes wrong on a rung is a row."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.environment import environment
from screwgauge.reference.errors import DescriptionError
from screwgauge.study.cases.case import SILENT, Case, Finding
from screwgauge.study.cases.question import findings
from screwgauge.study.cases.registry import choose
from screwgauge.study.methods import missing
from screwgauge.study.provenance import provenance
from screwgauge.study.runner import Report, silent
from screwgauge.study.table import frame

#: Column of ``stress.csv`` -> attribute of a `Finding`.
COLUMNS = {
    **{name: name for name in ("case", "severity", "engine", "quantity", "digits", "condition", "time_s", "verdict")},
    "reason": "told",
}
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

    cases: tuple[Case, ...]
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
) -> Stress:
    """Climbs the ladders of the named cases, all by default.

    Args:
        quick: Fewer rungs and smaller scenes.
        severities: Rungs in place of the case's own; for one case only.

    Raises:
        ScrewgaugeError: An unknown case, or a severity outside its range.
    """
    chosen = choose(cases)
    if severities is not None and len(chosen) != 1:
        raise DescriptionError("severities are given", "--severity", "name the one case that they are of")
    ladders = [(case, case.rungs(quick=quick, severities=severities)) for case in chosen]
    rows: list[Finding] = []
    seconds: dict[str, float] = {}
    for case, rungs in ladders:
        start = perf_counter()
        for i, severity in enumerate(rungs):
            progress(case.name, i / len(rungs))
            rows += [replace(found, case=case.name, severity=severity) for found in climb(case, severity, quick=quick)]
        seconds[case.name] = perf_counter() - start
    return Stress(tuple(chosen), tuple(rows), seconds, quick, environment(), provenance(None, {}))


def climb(case: Case, severity: float, *, quick: bool = False) -> list[Finding]:
    """What is found on one rung; a rung that breaks is one finding of `ALL`."""
    try:
        # extremes are the point; what comes of them is judged
        with np.errstate(all="ignore"), tempfile.TemporaryDirectory(prefix="screwgauge-") as folder:
            questions = case.ask(severity, quick, Path(folder))
            return [finding for question in questions for finding in findings(question)]
    except Exception as error:  # the other rungs go on
        what = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return [Finding(ALL, "", reason=missing(error) if isinstance(error, ImportError) else what)]
