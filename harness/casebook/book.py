"""The casebook: a table of named discrepancies, and their reproduction with the installed engines.

The discrepancies are in ``casebook.toml``; the functions that reproduce them are in the folders of the engines
(`discrepancies`) and, where one needs both, in `both_engines`.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Set
from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

from screwgauge.engines.toy_models import Evidence
from screwgauge.reference.errors import check_choice

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
    """Result of a reproduction.

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
        """Measured values as text with units, in as few digits as distinguish symptom and expected value."""
        if self.shown is None:
            return {}
        shown = self.shown
        values = (shown.symptom, shown.expected, shown.mended)
        for digits in range(4, 18 if self.status == "shown" else 5):
            texts = [_text(value, digits, shown) for value in values]
            if texts[0] != texts[1]:
                break
        return dict(zip(("symptom", "expected", "mended"), texts, strict=True)) | {"said": shown.said.rstrip(".")}


def _text(value: float, digits: int, shown: Evidence) -> str:
    if not math.isfinite(value):
        return "nothing" if shown.said else str(value).replace("nan", "NaN")
    space = "" if shown.unit in ("", "%") else " "
    return f"{value + 0.0:.{digits}g}{space}{shown.unit}"


#: Engine -> distribution.
_PACKAGES = {"mujoco": "mujoco", "pinocchio": "pin"}
_FILE = Path(__file__).with_name("casebook.toml")


def _case(entry: dict[str, Any]) -> Case:
    lists = {key: tuple(value) for key, value in entry.items() if isinstance(value, list)}
    return Case(**entry | lists)


#: Name -> case, in the order of the file.
CASES = {entry["id"]: _case(entry) for entry in tomllib.loads(_FILE.read_text(encoding="utf-8"))["cases"]}


def reproduce(id: str) -> CaseResult:
    """Shows a discrepancy with the installed engines; what they raise is a failure of that case.

    Raises:
        ScrewgaugeError: There is no such case.
    """
    case = CASES[check_choice("discrepancy", [id], CASES, "casebook")[0]]
    versions = {name: _version(name) for name in case.engines}
    if not case.run:
        return CaseResult(case, versions)
    try:
        module, name = case.run.split(":")
        run = getattr(import_module(f"screwgauge.{module}"), name)
        with ExitStack() as stack:
            if "mujoco" in case.engines:  # whose warnings would go into a file in the working directory
                from screwgauge.models.readings.compiled import warned

                stack.enter_context(warned())
            return CaseResult(case, versions, run())
    except Exception as error:  # an engine of another version may raise anything
        return CaseResult(case, versions, failure=f"{type(error).__name__}: {error}")


def suspects(bad: Set[str], good: Set[str], packages: Set[str]) -> Iterator[CaseResult]:
    """Discrepancies that make quantities wrong, but not those that are right, and that installed packages show."""
    for case in CASES.values():
        touches, takes_part = {*case.touches}, {_PACKAGES[engine] for engine in case.engines}
        if touches & bad and not touches & good and takes_part <= packages:
            result = reproduce(case.id)
            if result.status == "shown":
                yield result


def _version(engine: str) -> str:
    try:
        return version(_PACKAGES[engine])
    except PackageNotFoundError:
        return "(not installed)"
