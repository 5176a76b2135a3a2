"""The casebook: the table of named discrepancies, and their reproduction with the installed engines."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Set
from contextlib import ExitStack
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from screwgauge.casebook.case import Case, CaseResult
from screwgauge.reference.errors import check_choice

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
            if "mujoco" in case.engines:  # whose warnings go into a file of the working directory otherwise
                from screwgauge.models.readings.compiler import warned

                stack.enter_context(warned())
            return CaseResult(case, versions, run())
    except Exception as error:  # an engine of another version may raise anything
        return CaseResult(case, versions, failure=f"{type(error).__name__}: {error}")


def suspects(bad: Set[str], good: Set[str], packages: Set[str]) -> Iterator[CaseResult]:
    """Discrepancies that make quantities wrong, but not those that are right, and that installed packages show."""
    for case in CASES.values():
        touches, takes_part = {*case.touches}, {_PACKAGES[engine] for engine in case.engines}
        if touches & bad and not touches & good and takes_part <= packages:
            found = reproduce(case.id)
            if found.status == "shown":
                yield found


def _version(engine: str) -> str:
    try:
        return version(_PACKAGES[engine])
    except PackageNotFoundError:
        return "(not installed)"
