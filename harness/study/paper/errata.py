"""The table of the paper's errata, and how the numbers of one of them are recorded."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

KINDS = {"E": "error", "A": "ambiguity", "N": "numbering"}
TABLE: dict[str, Any] = tomllib.loads((Path(__file__).parent / "errata.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True, slots=True)
class Erratum:
    """One measured erratum; a number may have several.

    Attributes:
        number: Number in the list of errata.
        kind: E error, A ambiguity, N numbering.
        equation: Where it stands.
        measure: What was measured.
        printed_form, right_form: The two forms that were run, in words.
        printed, right: What they gave, in `unit`.
        effect: Size of the erratum, in `unit`.
    """

    number: int
    kind: str
    equation: str
    measure: str
    printed_form: str
    right_form: str
    printed: float
    right: float
    effect: float
    unit: str


@dataclass(frozen=True, slots=True)
class Values:
    """What a measurement gives for one row of the table.

    Attributes:
        printed, right: The results of the two forms, in the row's unit.
        effect: Size of the erratum; by default the difference of the two.
        words: What fills the braces of the row.
    """

    printed: float
    right: float
    effect: float | None = field(default=None, kw_only=True)
    words: Mapping[str, float] = field(default_factory=dict, kw_only=True)


def tabulated(measured: Mapping[int, Iterable[Values]]) -> tuple[Erratum, ...]:
    """The rows of the table with their numbers; `measured` has the values of each erratum, row by row."""
    found = [(number, values) for number in sorted(measured) for values in measured[number]]
    if [number for number, *_ in TABLE["rows"]] != [number for number, _ in found]:
        raise ValueError("the measurements are not those of the table of the errata")
    errata = []
    for (number, kind, equation, *texts, unit), (_, values) in zip(TABLE["rows"], found, strict=True):
        measure, printed_form, right_form = (text.format(**values.words) for text in texts)
        printed, right = float(values.printed), float(values.right)
        effect = abs(printed - right) if values.effect is None else float(values.effect)
        errata.append(Erratum(number, kind, equation, measure, printed_form, right_form, printed, right, effect, unit))
    return tuple(errata)
