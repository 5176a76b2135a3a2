"""What a gate finds of one scene, or of one pair of models: plain data, which pickles and goes through JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

#: Stands for the second engine where equations judge one alone.
JUDGE = "judge"
Status = Literal["agree", "differ", "failed", "refused"]
#: Exit status of the command by what became of a row; the highest of all rows counts.
EXIT: dict[Status, int] = {"agree": 0, "differ": 1, "refused": 2, "failed": 3}


@dataclass(frozen=True, slots=True)
class Error:
    """The worst difference of two engines, or of two models, in one quantity and unit; or a residual of the judge.

    Attributes:
        quantity: Or the name of a residual, of which `b` is ``judge``.
        error: Largest scaled difference; NaN where there is no number.
        tolerance: Up to which it counts as agreement, and `reason`: where that comes from.
        component, t: Where and when [s] it is largest; NaN of what is no motion over time.
        values: Of `a` and of `b` there [unit].
    """

    quantity: str
    unit: str
    a: str
    b: str
    error: float
    tolerance: float
    reason: str
    ok: bool
    component: str = ""
    t: float = math.nan
    values: tuple[float, float] = (math.nan, math.nan)

    @property
    def key(self) -> str:
        """What a baseline knows it by."""
        return f"{self.quantity} [{self.unit}] {self.a} - {self.b}"

    @property
    def share(self) -> float:
        """Of its tolerance; infinite where there is no number, or no tolerance."""
        size = self.error / self.tolerance if self.tolerance else math.inf
        return size if math.isfinite(size) else math.inf


@dataclass(frozen=True, slots=True)
class Row:
    """A scene or a pair of models.

    Attributes:
        scene: Its name; of a pair, ``A.urdf - B.xml``.
        status: ``agree``, ``differ``, ``failed`` (an engine, or its process) or ``refused`` (bad input).
        sentence: What was found, with the cause where one is known.
        errors: One for each quantity, pair and unit.
        coverage: What the motion tests, in a sentence.
        versions: Of engines, by name; `files`: file -> SHA-256.
        doubts: Sentences on numbers that no machine has, whatever the status.
        file, line: Where to look for the cause; 0 if no line is known.
    """

    scene: str
    status: Status
    sentence: str
    errors: Sequence[Error] = ()
    coverage: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    file: str = ""
    line: int = 0
    seconds: float = 0.0
    doubts: Sequence[str] = ()

    @property
    def ok(self) -> bool:
        """Whether it passes."""
        return EXIT[self.status] == 0

    @property
    def worst(self) -> Error | None:
        """The largest error by its tolerance; those that are out of it first, and those of two engines."""
        return max(self.errors, key=lambda one: (not one.ok, one.b != JUDGE, one.share), default=None)


def row_from(record: Mapping[str, Any]) -> Row:
    """A row from what `dataclasses.asdict` made of it."""
    errors = [Error(**{**one, "values": tuple(one["values"])}) for one in record["errors"]]
    return Row(**{**record, "errors": tuple(errors)})
