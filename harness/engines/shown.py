"""What the reproduction of a discrepancy measures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Evidence:
    """One number, got in three ways.

    Attributes:
        symptom: As users get it; NaN where there is none.
        expected: As it should be, from a formula, from equations solved here, or from the other engine.
        mended: As users get it after the remedy.
        unit: Of all three; empty of a plain number.
        said: What the engine says where it refuses or warns.
    """

    symptom: float
    expected: float
    mended: float
    unit: str
    said: str = ""
