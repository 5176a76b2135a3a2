"""The casebook: the table of named discrepancies, and their reproduction with the installed engines."""

from __future__ import annotations

import tomllib
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


def _case(engines: list[str], links: tuple[str, ...] = (), **rest: Any) -> Case:
    return Case(engines=tuple(engines), links=tuple(links), **rest)


#: Name -> case, in the order of the file.
CASES = {entry["id"]: _case(**entry) for entry in tomllib.loads(_FILE.read_text(encoding="utf-8"))["cases"]}


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
                from screwgauge.engines.mujoco.settings import heard

                stack.enter_context(heard())
            return CaseResult(case, versions, run())
    except Exception as error:  # an engine of another version may raise anything
        return CaseResult(case, versions, failure=f"{type(error).__name__}: {error}")


def _version(engine: str) -> str:
    try:
        return version(_PACKAGES[engine])
    except PackageNotFoundError:
        return "(not installed)"
