"""Rows of a bench: one for each contestant, setting and quantity; and the times to reach an error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from screwgauge.judging.residual import Deviation, frame
from screwgauge.solution import Cost
from screwgauge.study.bench.contestant import NOTHING, Contestant

#: Columns of ``bench.csv`` and ``timings.csv``, and where a row has those that it calls otherwise.
COLUMNS = [
    *("family", "contestant", "setting", "quantity", "max_scaled", "rms_scaled", "digits", "time_s", "n_sample"),
    *("covers", "status", "reason"),
]
TIMING = ["contestant", "setting", "quantity", "rounds", "n_sample", "min_s", "median_s", "covers"]
_ELSEWHERE = {"contestant": "contestant.name", "min_s": "time_s", "max_scaled": "error", "rms_scaled": "rms"} | {
    name: f"contestant.{name}" for name in ("family", "setting", "covers")
}
ABSOLUTE = [
    *("family", "contestant", "setting", "unit", "max_abs", "energy_J", "wall_s", "cpu_s"),
    *("steps", "evaluations", "status", "reason"),
]
REACH_COLUMNS = ["quantity", "error", "family", "seconds_per_sample", "contestant", "setting", "given"]
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)
OK, FAILED, CUT = "ok", "failed", "cut short"


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchRow(Deviation):
    """One quantity of one contestant; its RMS error is scaled.

    Attributes:
        seconds: Every measurement, in the order made.
        largest: Largest error by unit, of a simulation.
        cost: What a simulation took.
    """

    contestant: Contestant
    status: str
    n_sample: int = 0
    seconds: tuple[float, ...] = ()
    largest: Mapping[str, float] = field(default_factory=dict)
    cost: Cost = field(default_factory=lambda: Cost(float("nan")))

    @property
    def rounds(self) -> int:
        """How often it was measured."""
        return len(self.seconds)

    @property
    def time_s(self) -> float:
        """Shortest measurement: disturbances only ever add."""
        return min(self.seconds, default=float("nan"))

    @property
    def median_s(self) -> float:
        """Median measurement."""
        return float(np.median(self.seconds)) if self.seconds else float("nan")

    @property
    def work_s(self) -> float:
        """Processor time of a simulation, or wall time where an engine does not measure it [s]."""
        return self.cost.cpu_s if np.isfinite(self.cost.cpu_s) else self.cost.wall_s

    @property
    def per_sample(self) -> float:
        """Run time for each sample delivered [s]."""
        return self.time_s / self.n_sample if self.n_sample else float("nan")


def bench_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """The rows of ``bench.csv``."""
    return frame(rows, {name: _ELSEWHERE.get(name, name) for name in COLUMNS})


def timing_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """The rows of ``timings.csv``: shortest and median measurement."""
    timed = [row for row in rows if row.seconds]
    return frame(timed, {name: _ELSEWHERE.get(name, name) for name in TIMING})


def reach(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """Quickest setting of each family for each quantity and error; families that never get there are left out."""
    body = []
    for quantity in dict.fromkeys(row.quantity for row in rows if row.quantity != NOTHING):
        timed = [r for r in rows if r.quantity == quantity and r.contestant.drawn and r.per_sample > 0]
        for level in LEVELS:
            best: dict[str, BenchRow] = {}
            for row in sorted((r for r in timed if r.error <= level), key=lambda row: row.per_sample):
                best.setdefault(row.contestant.family, row)
            for family, row in best.items():
                c = row.contestant
                body.append((quantity, level, family, row.per_sample, c.name, c.setting, c.given))
    return pd.DataFrame(body, columns=REACH_COLUMNS)


def pairs(rows: Sequence[BenchRow]) -> list[tuple[BenchRow, BenchRow]]:
    """Rows of the observables and of the energy, contestant by contestant."""
    return list(zip(rows[::2], rows[1::2], strict=True))


def absolute_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """The rows of ``forward.csv``: absolute errors by unit, energy, both times, and the work that was done."""
    body = []
    for row, energy in pairs(rows):
        who, cost = (row.contestant.family, row.contestant.name, row.contestant.setting), row.cost
        rest = (cost.wall_s, cost.cpu_s, cost.steps, cost.evaluations, row.status, row.reason)
        for unit, largest in (row.largest or {"": float("nan")}).items():
            body.append((*who, unit, largest, energy.largest.get("J", float("nan")), *rest))
    return pd.DataFrame(body, columns=ABSOLUTE)
