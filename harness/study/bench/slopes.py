"""Fitted slopes of error against parameter, beside the expected ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from screwgauge.judging.residual import frame
from screwgauge.reference.rotations import Array
from screwgauge.study.bench.contestant import TABLE
from screwgauge.study.bench.rows import CUT, BenchRow

Mask = NDArray[np.bool_]

COLUMNS = {
    "family": "rule.line",
    "parameter": "name",
    "quantity": "rule.quantity",
    "expected": "rule.expected",
    "fitted": "slope",
    "ok": "ok",
}
WITHIN = 0.1  # of the expected slope
#: Scaled errors between these follow the power law: above, it saturates; below, rounding takes over.
LARGE, SMALL = 0.1, 1e-10
FLOOR = 30.0  # a point has to be so far above a floor not to feel it


@dataclass(frozen=True, slots=True)
class Rule:
    """An expected slope.

    Attributes:
        line: Family with its series, see `Contestant.line`.
        most: Largest parameter of the window; infinite where the errors decide.
        by_error: The window is where errors are between floor and saturation; otherwise all of it.
    """

    line: str
    quantity: str
    expected: float
    most: float = np.inf
    by_error: bool = True


RULES = tuple(Rule(**entry) for entry in TABLE["slopes"])


@dataclass(frozen=True, slots=True, eq=False)
class SlopeFit:
    """One rule with its points: parameter `name` and error, shape (n,), and which of them were fitted, shape (n,)."""

    rule: Rule
    name: str
    x: Array
    error: Array
    used: Mask

    @property
    def slope(self) -> float:
        """Least squares in logarithms; NaN for fewer than three points."""
        if self.used.sum() < 3:
            return float("nan")
        return float(np.polyfit(np.log10(self.x[self.used]), np.log10(self.error[self.used]), 1)[0])

    @property
    def ok(self) -> bool:
        return bool(abs(self.slope / self.rule.expected - 1.0) <= WITHIN)


def fits(rows: Sequence[BenchRow], rules: Sequence[Rule] = RULES) -> list[SlopeFit]:
    """The rules for which there are rows; what was cut short before it had three points is left out."""
    fitted = []
    for rule in rules:
        of_rule = [row for row in rows if row.contestant.line == rule.line and row.quantity == rule.quantity]
        varied = [(row.contestant.parameter, row.error) for row in of_rule if row.error > 0]
        points = sorted((*parameter, error) for parameter, error in varied if parameter)
        if points:
            x, error = np.array([point[1:] for point in points]).T
            fit = SlopeFit(rule, points[0][0], x, error, _window(rule, x, error))
            if np.isfinite(fit.slope) or all(row.status != CUT for row in of_rule):
                fitted.append(fit)
    return fitted


def _window(rule: Rule, x: Array, error: Array) -> Mask:
    if not rule.by_error:
        return np.asarray(x <= rule.most)
    low = SMALL
    flat = len(x) > 1 and np.log(error[1] / error[0]) < 0.5 * rule.expected * np.log(x[1] / x[0])
    if flat:  # at its small end the line follows no power law: there is a floor
        low = max(low, FLOOR * float(error.min()))
    return np.asarray((error <= LARGE) & (error >= low) & (x <= rule.most))


def table(fitted: Sequence[SlopeFit]) -> pd.DataFrame:
    """The rows of ``slopes.csv``."""
    return frame(fitted, COLUMNS)
