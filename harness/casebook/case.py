"""A named discrepancy, and what its reproduction found with the installed engines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from screwgauge.engines.shown import Evidence

Status = Literal["shown", "not shown", "cannot be shown", "failed"]


@dataclass(frozen=True, slots=True)
class Case:
    """A discrepancy that has a name.

    Attributes:
        id: Its name.
        title: What users see, without numbers.
        engines: Those that take part.
        run: Function that shows it, as module:name below the package; empty where none can.
        symptom, cause, remedy: A sentence in three parts; `{symptom}`, `{expected}`, `{mended}`, `{said}` stand for
            what is measured.
        differs: Symptom and expected value are further apart than this where it is shown [unit of the numbers].
        within: The remedy brings the number this close to the expected one.
        versions: Those that show it, as far as tried.
        links: Reports of users.
        why_not: Why it cannot be shown.
        touches: Quantities that it makes wrong, all of them, on model files that are right.
    """

    id: str
    title: str
    engines: tuple[str, ...]
    symptom: str
    cause: str
    remedy: str
    versions: str
    run: str = ""
    differs: float = math.nan
    within: float = math.nan
    links: tuple[str, ...] = ()
    why_not: str = ""
    touches: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CaseResult:
    """What a case showed.

    Attributes:
        versions: Engine -> installed version.
        shown: What was measured; None where nothing could be.
        failure: Why the reproduction failed.
    """

    case: Case
    versions: Mapping[str, str]
    shown: Evidence | None = None
    failure: str = ""

    @property
    def status(self) -> Status:
        if self.shown is None:
            return "failed" if self.failure else "cannot be shown"
        apart = abs(self.shown.symptom - self.shown.expected)
        return "not shown" if apart <= self.case.differs else "shown"  # NaN is a symptom

    @property
    def works(self) -> bool:
        """Whether the remedy brings the expected number."""
        return self.shown is not None and abs(self.shown.mended - self.shown.expected) <= self.case.within

    @property
    def ok(self) -> bool:
        """Whether the reproduction did what it is for; one that cannot be made does."""
        return self.status == "cannot be shown" or self.works

    @property
    def installed(self) -> str:
        """The engines that take part, with their versions."""
        return " and ".join(f"{name} {version}" for name, version in self.versions.items())

    @property
    def sentence(self) -> str:
        """Symptom, cause and remedy in one sentence, with the numbers that were measured."""
        case, engines = self.case, self.installed
        if self.status == "failed":
            return f"The reproduction failed with {engines}: {self.failure}."
        if self.status == "cannot be shown":
            why = f"It cannot be shown with {engines}, as {case.why_not}"
            return f"{why}: {case.symptom} ({case.versions}), because {case.cause}; {case.remedy}."
        numbers = self.numbers
        cause, remedy = case.cause.format(**numbers), case.remedy.format(**numbers)
        if self.status == "not shown":
            right = f"Not with {engines}, where it is {numbers['symptom']} as it should be"
            return f"{right}; with {case.versions} {case.title}, because {cause}; {remedy}."
        symptom = case.symptom.format(**numbers)
        failed = "" if self.works else ", and is no remedy here"
        return f"{symptom[0].upper()}{symptom[1:]}, because {cause}; {remedy}{failed}."

    @property
    def numbers(self) -> dict[str, str]:
        """What was measured as text with its unit, in as few digits as tell symptom and expected value apart."""
        if self.shown is None:
            return {}
        found = self.shown
        values = (found.symptom, found.expected, found.mended)
        for digits in range(4, 18 if self.status == "shown" else 5):
            texts = [_text(value, digits, found) for value in values]
            if texts[0] != texts[1]:
                break
        return dict(zip(("symptom", "expected", "mended"), texts, strict=True)) | {"said": found.said.rstrip(".")}


def _text(value: float, digits: int, found: Evidence) -> str:
    if not math.isfinite(value):
        return "nothing" if found.said else str(value).replace("nan", "NaN")
    space = "" if found.unit in ("", "%") else " "
    return f"{value + 0.0:.{digits}g}{space}{found.unit}"
