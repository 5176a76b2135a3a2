"""What a stress case is: a ladder of one severity, every rung of it questions to engines; and what is found there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from screwgauge.judging.residual import Residual
from screwgauge.reference.errors import DescriptionError

if TYPE_CHECKING:
    from screwgauge.study.cases.question import Question

#: A scaled error below this needs no warning: the loosest tolerance at which a scene is called in agreement.
GOOD = 1e-9
OK, DEGRADED, REFUSED, SILENT = "ok", "degraded", "refused", "silently-wrong"
VERDICTS = (OK, DEGRADED, REFUSED, SILENT)


@dataclass(frozen=True, slots=True)
class Finding(Residual):
    """What one engine made of one quantity on one rung, a row of a stress table; its error is against the truth.

    Attributes:
        a: Name of the engine; a setting may follow, as in ``mujoco RK4``.
        tolerance: Largest scaled error that a warning of the engine, or an estimate of its error, admits.
        reason: Why it was refused, what the warning says, or the cause of the error.
        condition: Condition number of what was solved; NaN where nothing was.
        time_s: Run time [s].
        own: Whether it is our own solver.
        case, severity: Where on which ladder.
    """

    tolerance: float = GOOD
    condition: float = math.nan
    time_s: float = math.nan
    own: bool = False
    case: str = ""
    severity: float = math.nan

    @property
    def engine(self) -> str:
        """The first of what a residual is between."""
        return self.a

    @property
    def told(self) -> str:
        """The reason, or that there is none where one is needed."""
        silent = not self.reason and not math.isfinite(self.error)
        return "not a number, and nothing says so" if silent else self.reason

    @property
    def verdict(self) -> str:
        """``ok``, ``degraded`` (less than nine digits, and it says so), ``refused`` (no number, and it says why),
        ``silently-wrong`` (anything else)."""
        if not math.isfinite(self.error):
            return REFUSED if self.reason and math.isnan(self.error) else SILENT
        if self.error <= GOOD:
            return OK
        return DEGRADED if self.error <= self.tolerance else SILENT


Ask = Callable[[float, bool, Path], "Iterable[Question]"]
"""(severity, quick, folder for model files) -> the questions of a rung. A function of a module, so that it pickles."""


@dataclass(frozen=True, slots=True)
class Case:
    """A ladder. Data only; it pickles.

    Attributes:
        name: As on the command line.
        title: What is made extreme, for the heading of its plot.
        axis: What the severity is, with its unit.
        about: What is measured and what is to be seen, for the report.
        drawn: Quantity of the small plot.
        low, high: Range of the severity.
        full, quick: Severities of its rungs.
        ask: Makes the questions of a rung.
        falling: Whether small severities are the severe ones.
        whole: Whether severities are counts.
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
        """What its severity may be, in words."""
        return f"{self.axis}, {self.low:g} to {self.high:g}"

    def rungs(self, *, quick: bool = False, severities: Sequence[float] | None = None) -> list[float]:
        """The given severities, or those of a full or quick run, once each.

        Raises:
            DescriptionError: A severity is outside the case's range, or there is none.
        """
        where = f"case {self.name}"
        if severities is not None and not len(severities):
            raise DescriptionError("there is no severity", where, f"give some within {self.span}")
        for value in severities or ():
            if self.whole and value != int(value):
                raise DescriptionError(f"severity {value:g} is no count", where, "give whole numbers")
            if not self.low <= value <= self.high:
                raise DescriptionError(
                    f"severity {value:g} is outside {self.low:g} to {self.high:g} ({self.axis})",
                    where,
                    "give one within",
                )
        return list(dict.fromkeys(severities or (self.quick if quick else self.full)))
