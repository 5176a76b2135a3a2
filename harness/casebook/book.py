"""The casebook: named discrepancies, with the versions of the engines that showed them.

``casebook.toml`` contains their texts; ``shown.toml`` records, for each version, whether the project's tests reproduced
them. This module runs no engine: it infers the behaviour of the installed versions from these records.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import check_choice

Versions = tuple[str, ...]
"""One version of each engine of a case, in the order of `Case.engines`."""


@dataclass(frozen=True, slots=True)
class Case:
    """A named discrepancy.

    Attributes:
        id: Name of the case.
        title: The symptom, without numbers.
        engines: Engines involved.
        symptom, cause, remedy: The three parts of `sentence`; `{symptom}`, `{expected}`, `{mended}`, `{said}` stand for
            measured values.
        versions: Versions with which users encountered the discrepancy, as far as known.
        last: Last affected version of the only engine involved; empty if the newest version is affected.
        links: Reports by users.
        touches: All quantities that the discrepancy makes wrong for correct model files.
        shown, not_shown: Versions whose tests reproduced the discrepancy, or did not.
        numbers: Placeholder -> string of the value measured for the newest tested versions; lacks `symptom` if these
            did not show the discrepancy.
    """

    id: str
    title: str
    engines: tuple[str, ...]
    symptom: str
    cause: str
    remedy: str
    versions: str
    last: str = ""
    links: tuple[str, ...] = ()
    touches: tuple[str, ...] = ()
    shown: tuple[Versions, ...] = ()
    not_shown: tuple[Versions, ...] = ()
    numbers: Mapping[str, str] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """Symptom, cause and remedy in one sentence, with measured numbers."""
        numbers = self.numbers
        symptom = self.symptom.format(**numbers) if "symptom" in numbers else self.title
        cause, remedy = self.cause.format(**numbers), self.remedy.format(**numbers)
        return f"{symptom[0].upper()}{symptom[1:]}, because {cause}; {remedy}."

    def shows(self, versions: Sequence[str]) -> bool:
        """True if the case was shown by the newest measured versions that are not newer than the given versions."""
        if self.last and version_key(versions) > version_key([self.last]):
            return False
        measured = [*self.shown, *self.not_shown]
        older = [tried for tried in measured if _is_no_newer(tried, versions)]
        return bool(older) and max(older, key=version_key) in self.shown

    def engines_text(self, versions: Sequence[str]) -> str:
        """Join the names of the engines and their versions: ``pinocchio 4.1.0 and mujoco 4.0.0``."""
        return " and ".join(map(" ".join, zip(self.engines, versions, strict=True)))


def version_key(versions: Sequence[str]) -> list[list[int]]:
    """Return a sort key for versions."""
    return [[int(part) for part in re.findall(r"\d+", each)] for each in versions]


def _is_no_newer(tried: Sequence[str], versions: Sequence[str]) -> bool:
    pairs = zip(version_key(tried), version_key(versions), strict=True)
    return all(first <= second for first, second in pairs)


#: Engine -> name of its distribution.
_PACKAGES = {
    "mujoco": "mujoco",
    "pinocchio": "pin",
    "exudyn": "exudyn",
    "drake": "drake",
    "mjx": "mujoco-mjx",
    "mjwarp": "mujoco-warp",
}
TEXTS, SHOWN = (Path(__file__).with_name(name) for name in ("casebook.toml", "shown.toml"))


def _read(file: Path) -> dict[str, Any]:
    return tomllib.loads(file.read_text(encoding="utf-8"))


def _case(entry: Mapping[str, Any]) -> Case:
    lists = {key: tuple(value) for key, value in entry.items() if isinstance(value, list)}
    measured = {key: tuple(map(tuple, entry[key])) for key in ("shown", "not_shown") if key in entry}
    return Case(**{**entry, **lists, **measured})


_MEASURED = _read(SHOWN)
#: Name -> case, in the order of the file.
CASES = {entry["id"]: _case({**entry, **_MEASURED.get(entry["id"], {})}) for entry in _read(TEXTS)["cases"]}


def find_case(id: str) -> Case:
    """Return the case with a given name.

    Raises:
        ScrewgaugeError: No case has this name.
    """
    return CASES[check_choice("discrepancy", [id], CASES, "casebook")[0]]


def installed_versions(case: Case) -> Versions | None:
    """Return the installed versions of a case's engines; None if one is missing."""
    try:
        return tuple(version(_PACKAGES[engine]) for engine in case.engines)
    except PackageNotFoundError:
        return None


def is_shown_here(case: Case) -> bool:
    """True if the installed versions show a case."""
    versions = installed_versions(case)
    return versions is not None and case.shows(versions)


def suspects(bad: Set[str], good: Set[str], packages: Set[str]) -> Iterator[Case]:
    """Yield cases that explain wrong quantities, affect no correct quantity, and occur in the installed `packages`."""
    for case in CASES.values():
        touches, takes_part = {*case.touches}, {_PACKAGES[engine] for engine in case.engines}
        if touches & bad and not touches & good and takes_part <= packages and is_shown_here(case):
            yield case
