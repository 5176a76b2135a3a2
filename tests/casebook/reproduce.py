"""Reproductions of the casebook: run with the engines of this Python, and what they measured as `shown.toml` has it.

As a program it runs the cases that are named and prints a line of JSON for each: name, result, numbers.
"""

import json
import math
import sys
import tomllib
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal

from casebook.toy_models import Evidence
from screwgauge.casebook.book import CASES, Case
from screwgauge.models.readings.compiled import collect_warnings

Status = Literal["shown", "not shown", "failed"]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """The way to show a case.

    Attributes:
        run: Function that returns `Evidence`, as module:name; empty where the case cannot be shown.
        number: Quantity that it measures, without the remedy and with it.
        differs: Symptom and expected value are further apart than this where it is shown [unit of the numbers].
        within: The remedy brings the number this close to the expected one.
        why_not: Why it cannot be shown.
    """

    run: str = ""
    number: str = ""
    differs: float = math.nan
    within: float = math.nan
    why_not: str = ""


@dataclass(frozen=True, slots=True)
class Result:
    """The measurements of a reproduction, with the engines of this Python.

    Attributes:
        evidence: None where it failed, and `failure` says why.
    """

    how: Reproduction
    evidence: Evidence | None = None
    failure: str = ""

    @property
    def status(self) -> Status:
        if self.evidence is None:
            return "failed"
        apart = abs(self.evidence.symptom - self.evidence.expected)
        return "not shown" if apart <= self.how.differs else "shown"  # NaN is a symptom

    @property
    def works(self) -> bool:
        """True if the remedy works."""
        return self.evidence is not None and abs(self.evidence.mended - self.evidence.expected) <= self.how.within

    @property
    def numbers(self) -> dict[str, str]:
        seen = self.evidence
        if seen is None:
            return {}
        values = {"symptom": seen.symptom, "expected": seen.expected, "mended": seen.mended}
        for digits in range(4, 18 if self.status == "shown" else 5):
            texts = {name: _text(value, digits, seen) for name, value in values.items()}
            if texts["symptom"] != texts["expected"]:
                break
        if self.status == "not shown":
            del texts["symptom"]
        return {**texts, "said": seen.said.rstrip(".")}


def _text(value: float, digits: int, seen: Evidence) -> str:
    if not math.isfinite(value):
        return "nothing" if seen.said else str(value).replace("nan", "NaN")
    space = "" if seen.unit in ("", "%") else " "
    return f"{value + 0.0:.{digits}g}{space}{seen.unit}"


_FILE = Path(__file__).with_name("reproductions.toml")
#: Name -> how it is shown.
REPRODUCTIONS = {name: Reproduction(**e) for name, e in tomllib.loads(_FILE.read_text(encoding="utf-8")).items()}
#: Names of cases that can be shown.
RUN = [name for name, how in REPRODUCTIONS.items() if how.run]


def reproduce(case: Case, how: Reproduction) -> Result:
    module, name = how.run.split(":")
    try:
        run = getattr(import_module(f"casebook.{module}"), name)
        with ExitStack() as stack:
            if "mujoco" in case.engines:  # whose warnings would go into a file in the working directory
                stack.enter_context(collect_warnings())
            return Result(how, run())
    except Exception as error:  # an engine of another version may raise anything
        return Result(how, failure=f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    for id in sys.argv[1:]:
        result = reproduce(CASES[id], REPRODUCTIONS[id])
        print(json.dumps([id, result.status, result.numbers]), flush=True)
