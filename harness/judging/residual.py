"""`Residual`, the row type of all errors, and tables of such rows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import Any

import pandas as pd

from screwgauge.quantities import digits

#: Replaces the second engine where equations judge a single engine.
JUDGE = "judge"


@dataclass(frozen=True, slots=True)
class Residual:
    """Error of a quantity between two answers or against the correct value, or residual of an equation.

    Attributes:
        quantity: Quantity, or the name of an equation; for equations, `b` is ``judge``.
        a, b: Engines, models or methods.
        error: Largest scaled error; NaN if a value is missing.
        tolerance: Limit of agreement; `reason` explains the limit, or why it is exceeded.
        ok: Whether the error is within tolerance; None if the quantity has no unique value.
        component, t: Component and time [s] of the maximum; the time may be NaN.
        values: Values of `a` and `b` at the maximum [unit].
    """

    quantity: str
    unit: str = ""
    a: str = ""
    b: str = ""
    error: float = math.nan
    tolerance: float = math.nan
    reason: str = ""
    ok: bool | None = False
    component: str = ""
    t: float = math.nan
    values: tuple[float, float] = (math.nan, math.nan)

    @property
    def key(self) -> str:
        """Key of the row in a baseline."""
        return f"{self.quantity} [{self.unit}] {self.a} - {self.b}"

    @property
    def share(self) -> float:
        """Error divided by its tolerance; infinite if the error or the tolerance is missing."""
        size = self.error / self.tolerance if self.tolerance else math.inf
        return size if math.isfinite(size) else math.inf

    @property
    def digits(self) -> float:
        """Digits of agreement; NaN if the error is NaN."""
        return digits(self.error)


@dataclass(frozen=True, slots=True)
class SizedResidual(Residual):
    """A residual with absolute errors and scale.

    Attributes:
        max_abs, rms: Largest and root mean square error [unit]; scaled errors if there are several units.
        scale: Divisor of the errors [unit].
        rule: Rule that fixes the quantity if it is redundant.
        unique: Whether the quantity's value is the same under any rule.
        undecided: Number of samples out of tolerance but within the engines' own error estimates; 0 if the error
            exceeds these estimates at any sample.
    """

    max_abs: float = math.nan
    rms: float = math.nan
    scale: float = math.nan
    rule: str = ""
    unique: bool = True
    undecided: int = 0


Residuals = Iterator[SizedResidual]


def _columns(names: str, **elsewhere: str) -> dict[str, str]:
    return {name: elsewhere.get(name, name) for name in names.split()}


#: Column -> attribute of a `SizedResidual`, for the tables of components, pairs and equations.
ERROR_COLUMNS = _columns(
    "quantity component unit a b max_abs rms max_scaled scale worst_t rule unique tolerance ok",
    max_scaled="error",
    worst_t="t",
)
PAIR_COLUMNS = _columns(
    "quantity a b unit max_abs rms max_scaled worst_component worst_t rule unique tolerance ok undecided reason",
    max_scaled="error",
    worst_component="component",
    worst_t="t",
)
JUDGE_COLUMNS = _columns(
    "engine residual unit max_abs max_scaled worst_component worst_t tolerance ok undecided reason",
    engine="a",
    residual="quantity",
    max_scaled="error",
    worst_component="component",
    worst_t="t",
)


def frame(items: Iterable[Any], columns: Mapping[str, str]) -> pd.DataFrame:
    """Build a table with a row for each item.

    Args:
        columns: Column -> attribute of an item, dotted if nested.
    """
    return pd.DataFrame(
        [[attrgetter(name)(item) for name in columns.values()] for item in items], columns=list(columns)
    )


def columns_of(row: type[Any]) -> dict[str, str]:
    """Map the name of each field of a dataclass to itself, as columns for `frame`."""
    return {field.name: field.name for field in fields(row)}
