"""Rows and tables of a bench: errors and times, times to reach an error, savings from omissions, fitted slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from screwgauge.judging.residual import SizedResidual, frame
from screwgauge.quantities import SOLVED
from screwgauge.reference.rotations import Array
from screwgauge.solution import Cost
from screwgauge.study.bench import TABLE
from screwgauge.study.bench.contestants import EVERYTHING, NOTHING, Contestant

#: Columns of ``bench.csv`` and ``timings.csv``, and the attributes of rows with different names.
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
LEAVING_OUT_COLUMNS = [
    *("engine", "group", "setting", "n_sample", "time_s", "median_s", "ratio", "max_difference", "unchanged"),
    *("status", "reason"),
]
REACH_COLUMNS = ["quantity", "error", "family", "seconds_per_sample", "contestant", "setting", "given"]
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)
OK, FAILED, CUT = "ok", "failed", "cut short"


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchRow(SizedResidual):
    """Error and times of a contestant for one quantity; the RMS error is scaled.

    Attributes:
        seconds: Measured times [s], in order.
        largest: Unit -> largest error of a simulation.
        cost: Cost of a simulation.
    """

    contestant: Contestant
    status: str
    n_sample: int = 0
    seconds: tuple[float, ...] = ()
    largest: Mapping[str, float] = field(default_factory=dict)
    cost: Cost = field(default_factory=lambda: Cost(float("nan")))

    @property
    def rounds(self) -> int:
        """Number of measurements."""
        return len(self.seconds)

    @property
    def time_s(self) -> float:
        """Shortest measured time [s], because disturbances only add to times."""
        return min(self.seconds, default=float("nan"))

    @property
    def median_s(self) -> float:
        """Median of the measured times [s]."""
        return float(np.median(self.seconds)) if self.seconds else float("nan")

    @property
    def work_s(self) -> float:
        """Processor time of a simulation [s], or wall time if the engine does not measure it."""
        return self.cost.cpu_s if np.isfinite(self.cost.cpu_s) else self.cost.wall_s

    @property
    def price(self) -> float:
        """Processor time of a simulation, or else run time per sample [s]."""
        if np.isfinite(self.work_s):
            return self.work_s
        return self.time_s / self.n_sample if self.n_sample else float("nan")


def bench_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """Return the rows of ``bench.csv``."""
    return frame(rows, {name: _ELSEWHERE.get(name, name) for name in COLUMNS})


def timing_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """Return the rows of ``timings.csv``, with shortest and median times."""
    timed = [row for row in rows if row.seconds]
    return frame(timed, {name: _ELSEWHERE.get(name, name) for name in TIMING})


def reach(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """Return the fastest setting of each family for each quantity and error level."""
    body = []
    for quantity in dict.fromkeys(row.quantity for row in rows if row.quantity != NOTHING):
        timed = [r for r in rows if r.quantity == quantity and r.contestant.drawn and r.status == OK and r.price > 0]
        for level in LEVELS:
            best: dict[str, BenchRow] = {}
            for row in sorted((r for r in timed if r.error <= level), key=lambda row: row.price):
                best.setdefault(row.contestant.family, row)
            for family, row in best.items():
                c = row.contestant
                body.append((quantity, level, family, row.price, c.name, c.setting, c.given))
    return pd.DataFrame(body, columns=REACH_COLUMNS)


def pairs(rows: Sequence[BenchRow]) -> list[tuple[BenchRow, BenchRow]]:
    """Return pairs of rows, for observables and energy, by contestant."""
    return list(zip(rows[::2], rows[1::2], strict=True))


def absolute_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """Return the rows of ``forward.csv``: absolute errors by unit, energy, both times, and numbers of steps."""
    body = []
    for row, energy in pairs(rows):
        who, cost = (row.contestant.family, row.contestant.name, row.contestant.setting), row.cost
        rest = (cost.wall_s, cost.cpu_s, cost.steps, cost.evaluations, row.status, row.reason)
        for unit, largest in (row.largest or {"": float("nan")}).items():
            body.append((*who, unit, largest, energy.largest.get("J", float("nan")), *rest))
    return pd.DataFrame(body, columns=ABSOLUTE)


def leaving_out_table(rows: Sequence[BenchRow]) -> pd.DataFrame:
    """Return the rows of ``leaving_out.csv``, given one row for each quantity that must not change."""
    groups: dict[Contestant, list[BenchRow]] = {}
    for row in rows:
        groups.setdefault(row.contestant, []).append(row)
    whole = {c.method.engine: same[0].time_s for c, same in groups.items() if c.setting == EVERYTHING}
    body = []
    for contestant, same in groups.items():
        engine = contestant.method.engine.removesuffix("-full")
        worst = max(same, key=lambda row: np.nan_to_num(row.error, nan=np.inf))
        unchanged, reason = worst.error <= SOLVED, worst.reason if worst.status == FAILED else ""
        if np.isfinite(worst.error) and not unchanged:
            reason = f"changes {worst.quantity}"
        times = (worst.time_s, worst.median_s, worst.time_s / whole.get(engine, np.nan))
        rest = (worst.error, unchanged, worst.status, reason)
        body.append((engine, contestant.series, contestant.setting, worst.n_sample, *times, *rest))
    return pd.DataFrame(body, columns=LEAVING_OUT_COLUMNS)


Mask = NDArray[np.bool_]

SLOPE_COLUMNS = {
    "family": "line",
    "parameter": "name",
    "quantity": "quantity",
    "expected": "expected",
    "fitted": "slope",
    "ok": "ok",
}
WITHIN = 0.1  # admitted relative deviation from the expected slope
#: Range of scaled errors that follow the power law: errors saturate above, and rounding dominates below.
LARGE, SMALL = 0.1, 1e-10
FLOOR = 30.0  # factor above a floor beyond which the floor has no effect


#: Rules of the table: `line` (family with its series, see `Contestant.line`), `quantity`, `expected` slope, and limits
#: of the window of a fit, see `_window`.
RULES: Sequence[Mapping[str, Any]] = TABLE["slopes"]


@dataclass(frozen=True, slots=True, eq=False)
class SlopeFit:
    """Fit of a rule to points: parameter `name`, error, and True for points used in the fit. Shape (n,) each."""

    line: str
    quantity: str
    expected: float
    name: str
    x: Array
    error: Array
    used: Mask

    @property
    def slope(self) -> float:
        """Slope of a least-squares fit in logarithms; NaN for fewer than three points."""
        if self.used.sum() < 3:
            return float("nan")
        return float(np.polyfit(np.log10(self.x[self.used]), np.log10(self.error[self.used]), 1)[0])

    @property
    def ok(self) -> bool:
        return bool(abs(self.slope / self.expected - 1.0) <= WITHIN)


def fits(rows: Sequence[BenchRow], rules: Sequence[Mapping[str, Any]] = RULES) -> list[SlopeFit]:
    """Fit the rules for which rows exist, except if these were cut short before three points were measured."""
    fitted = []
    for rule in rules:
        line, quantity, window = rule["line"], rule["quantity"], {**rule}
        del window["line"], window["quantity"]
        of_rule = [row for row in rows if row.contestant.line == line and row.quantity == quantity]
        varied = [(row.contestant.parameter, row.error) for row in of_rule if row.error > 0]
        points = sorted((*parameter, error) for parameter, error in varied if parameter)
        if points:
            x, error = np.array([point[1:] for point in points]).T
            used = _window(x, error, **window)
            fit = SlopeFit(line, quantity, rule["expected"], points[0][0], x, error, used)
            if np.isfinite(fit.slope) or all(row.status != CUT for row in of_rule):
                fitted.append(fit)
    return fitted


def _window(x: Array, error: Array, expected: float, most: float = np.inf, by_error: bool = True) -> Mask:
    """Select the points to fit.

    Args:
        most: Largest value of the parameter.
        by_error: Also require errors between floor and saturation.
    """
    if not by_error:
        return np.asarray(x <= most)
    low = SMALL
    flat = len(x) > 1 and np.log(error[1] / error[0]) < 0.5 * expected * np.log(x[1] / x[0])
    if flat:  # errors at the small end do not follow a power law, but have a floor
        low = max(low, FLOOR * float(error.min()))
    return np.asarray((error <= LARGE) & (error >= low) & (x <= most))


def slopes_table(fitted: Sequence[SlopeFit]) -> pd.DataFrame:
    """Return the rows of ``slopes.csv``."""
    return frame(fitted, SLOPE_COLUMNS)
