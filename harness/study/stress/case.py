"""What a stress case is: a ladder of one severity; every rung finds out what each engine makes of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from screwgauge.reference.errors import DescriptionError

#: A scaled error below this needs no warning: the loosest tolerance at which a scene is called in agreement.
GOOD = 1e-9
OK, DEGRADED, REFUSED, SILENT = "ok", "degraded", "refused", "silently-wrong"
VERDICTS = (OK, DEGRADED, REFUSED, SILENT)


@dataclass(frozen=True, slots=True)
class Finding:
    """What one engine made of one quantity on one rung.

    Attributes:
        engine: Its name; a setting may follow, as in ``mujoco RK4``.
        quantity: What was measured.
        error: Scaled error against the truth; NaN where there is no number.
        admitted: Largest scaled error that a warning of the engine, or our guard, admits.
        condition: Condition number of what was solved; NaN where nothing was.
        time_s: Run time [s].
        reason: Why it was refused, what the warning says, or the cause of the error.
    """

    engine: str
    quantity: str
    error: float = math.nan
    admitted: float = GOOD
    condition: float = math.nan
    time_s: float = math.nan
    reason: str = ""

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
        return DEGRADED if self.error <= self.admitted else SILENT


@dataclass(frozen=True, slots=True)
class Rung:
    """One severity of a case. `measure` returns at least one finding for every engine of the case."""

    severity: float
    measure: Callable[[], Iterable[Finding]]


@dataclass(frozen=True, slots=True)
class Case:
    """A ladder.

    Attributes:
        name: As on the command line.
        title: What is made extreme, for the heading of its plot.
        axis: What the severity is, with its unit.
        about: What is measured and what is to be seen, for the report.
        drawn: Quantity of the small plot.
        low, high: Range of the severity.
        full, quick: Its rungs.
        rung: Makes the rung of a severity.
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
    rung: Callable[[float, bool], Rung]
    falling: bool = False
    whole: bool = False

    @property
    def span(self) -> str:
        """What its severity may be, in words."""
        return f"{self.axis}, {self.low:g} to {self.high:g}"

    def rungs(self, *, quick: bool = False, severities: Sequence[float] | None = None) -> list[Rung]:
        """The rungs of the given severities, or of a full or quick run.

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
                    f"case {self.name}",
                    "give one within",
                )
        chosen = severities or (self.quick if quick else self.full)
        return [self.rung(value, quick) for value in dict.fromkeys(chosen)]
