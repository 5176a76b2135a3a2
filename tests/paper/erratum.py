"""What an erratum of the paper is: one quantity by the form as printed and by the right one."""

from dataclasses import dataclass
from typing import NamedTuple

import pytest

KINDS = {"E": "error", "A": "ambiguity", "N": "numbering"}


class Form(NamedTuple):
    words: str
    value: float


@dataclass(frozen=True, slots=True)
class Erratum:
    """One measurement of an erratum; a number may have several.

    Attributes:
        number: Number in the list of errata, 1 to 18.
        kind: One of `KINDS`.
        equation: Where it stands.
        measure: What was measured.
        printed, right: The two forms.
        unit: Of what both give.
        size: Size of the erratum, in `unit`; by default the difference of the two.
    """

    number: int
    kind: str
    equation: str
    measure: str
    printed: Form
    right: Form
    unit: str
    size: float | None = None

    @property
    def effect(self) -> float:
        return abs(self.printed.value - self.right.value) if self.size is None else self.size


def about(size: float) -> object:
    return pytest.approx(size, rel=0.03, abs=0)
