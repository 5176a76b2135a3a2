"""What a contestant is: one method with one setting, prepared outside the clock, called inside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from screwgauge.solution import Values

if TYPE_CHECKING:
    from screwgauge.study.bench.case import Case

#: What is measured, in this order; `NOTHING` for a contestant that computes none of it.
QUANTITIES = ("joint_position", "joint_velocity", "joint_acceleration", "actuator_force")
NOTHING = "none"


def count(n: int, word: str) -> str:
    """``1 pass``, ``2 passes``."""
    ending = "es" if word.endswith("s") else "s"
    return f"{n} {word}{'' if n == 1 else ending}"


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a contestant found for one quantity.

    Attributes:
        values: Shape (n_sample, n_component); components may be some of the quantity's only.
        reference: What it is measured against, if not the case's reference at the case's times.
        scales: Unit -> S of the scaled error, if not the case's.
    """

    values: Values
    reference: Values | None = None
    scales: Mapping[str, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A contestant that is loaded.

    Attributes:
        call: What the clock covers.
        read: Turns what `call` returned into outcomes, quantity -> outcome; outside the clock.
        n_sample: Samples that one call delivers.
        hint: Why it may fail, for the row that says so.
    """

    call: Callable[[], Any]
    read: Callable[[Any], Mapping[str, Outcome]]
    n_sample: int
    hint: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Contestant:
    """One method with one setting: one row for each of its quantities.

    Attributes:
        covers: What the clock covers.
        prepare: Loads and allocates everything; outside the clock.
        given: It starts from given joint motion, so that closing the loops is not in its time.
        series: Line of the family that it belongs to, such as ``1 iteration``.
        parameter: Name and value of what is varied along that line.
        label: Short name of the setting in diagrams.
        drawn: Whether it has a place in the work-precision diagram.
        family, name: As registered.
    """

    setting: str
    quantities: tuple[str, ...]
    covers: str
    prepare: Callable[[Case], Task]
    given: bool = False
    series: str = ""
    parameter: tuple[str, float] | None = None
    label: str = ""
    drawn: bool = True
    family: str = ""
    name: str = ""

    @property
    def key(self) -> str:
        """Identifies the contestant within a bench."""
        return " | ".join((self.name, self.setting, ", ".join(self.quantities)))

    @property
    def line(self) -> str:
        """Its line in a diagram: family, or family and series."""
        return f"{self.family} ({self.series})" if self.series else self.family
