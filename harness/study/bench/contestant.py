"""What a bench measures: a method with a question, and its place in tables and diagrams. Data only; it pickles."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from screwgauge.solution import Solution
from screwgauge.study.bench.questions import Asked, Question
from screwgauge.study.methods import Method
from screwgauge.study.reference import PreparedScene, joined

TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("contestants.toml").read_text(encoding="utf-8"))
#: The quantity of a contestant that computes none.
NOTHING = "none"


def count(n: int, word: str) -> str:
    """``1 pass``, ``2 passes``."""
    ending = "es" if word.endswith("s") else "s"
    return f"{n} {word}{'' if n == 1 else ending}"


@dataclass(frozen=True, slots=True, eq=False)
class Contestant:
    """One method with one setting: one row for each of its quantities.

    Attributes:
        setting: In words.
        covers: What the clock covers.
        series: Line of the family that it belongs to, such as ``1 iteration``.
        parameter: Name and value of what is varied along that line.
        label: Short name of the setting in diagrams.
        drawn: Whether it has a place in the work-precision diagram.
        given: It starts from given joint motion, so that closing the loops is not in its time.
        hint: Why it may fail, for the row that says so.
    """

    family: str
    name: str
    setting: str
    method: Method
    question: Question
    quantities: tuple[str, ...]
    covers: str
    series: str = ""
    parameter: tuple[str, float] | None = None
    label: str = ""
    drawn: bool = True
    given: bool = False
    hint: str = ""

    @property
    def key(self) -> str:
        """Identifies the contestant within a bench."""
        return " | ".join((self.name, self.method.engine, self.series, self.setting, ", ".join(self.quantities)))

    @property
    def line(self) -> str:
        """Its line in a diagram: family, or family and series."""
        return f"{self.family} ({self.series})" if self.series else self.family

    def ask(self, posed: PreparedScene) -> Asked:
        """Its question on a scene."""
        return self.question(posed, self.method.engine, self.quantities)

    def scores(self, asked: Asked, solutions: Sequence[Solution]) -> dict[str, tuple[float, float, str]]:
        """Quantity -> largest and RMS scaled error, and why there is none."""
        scores = {}
        for quantity in self.quantities if self.quantities != (NOTHING,) else ():
            found = joined(solution.values[quantity] for solution in solutions)
            score = asked.reference.score(quantity, found if asked.rows is None else found.at(asked.rows))
            reason = f"{score.reason}: {self.hint}" if score.reason and self.hint else score.reason
            scores[quantity] = score.error, score.rms, reason
        return scores
