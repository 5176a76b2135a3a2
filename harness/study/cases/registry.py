"""The cases, as ``cases.toml`` has them; none of them loads an engine."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from screwgauge.reference.errors import check_choice
from screwgauge.study.cases.case import StressCase


def decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    """Powers of ten with exponents from `first` to `last`, both included."""
    sign = 1 if last >= first else -1
    return tuple(float(f"1e{k}") for k in range(first, last + sign, sign * step))


def _case(ask: str, full: Any, quick: Any, **rest: Any) -> StressCase:
    """An entry of the file."""
    module, name = ask.split(":")
    found = getattr(import_module(f"{__package__}.{module}"), name)
    return StressCase(**rest, full=_rungs(full), quick=_rungs(quick), ask=found)


def _rungs(given: Sequence[float] | dict[str, Any]) -> tuple[float, ...]:
    return (*given.get("at", ()), *decades(*given["decades"])) if isinstance(given, dict) else tuple(given)


_FILE = Path(__file__).with_name("cases.toml")
#: Name -> case, in the order in which they are run.
CASES = {entry["name"]: _case(**entry) for entry in tomllib.loads(_FILE.read_text(encoding="utf-8"))["cases"]}


def choose(names: Iterable[str] | None) -> list[StressCase]:
    """The named cases in the order of the table, all by default.

    Raises:
        DescriptionError: A name is not known.
    """
    wanted = list(CASES) if names is None else check_choice("case", names, CASES)
    return [case for name, case in CASES.items() if name in wanted]
