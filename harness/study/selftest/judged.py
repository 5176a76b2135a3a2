"""Whether a diagnosis says what was changed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.attribution import Step
from screwgauge.diagnosis.change import Difference
from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.diagnosis.hypothesis import Hypothesis, Value
from screwgauge.reference.rotations import Array
from screwgauge.study.selftest.mutant import Expected

#: A magnitude that is told is right within so much of it.
CLOSE = 0.01


@dataclass(frozen=True, slots=True)
class Judged:
    """What a diagnosis is worth.

    Attributes:
        detected: Whether it says that something differs.
        first: What it names first.
        right: Whether that, or something that it says cannot be told from it, is what was changed.
        error: Of the magnitude, relative; NaN where there is none.
    """

    detected: bool
    first: str
    right: bool
    error: float = np.nan


def judged(found: Diagnosis, expected: tuple[Expected, ...]) -> Judged:
    """Compares a diagnosis with what was changed."""
    steps = found.attribution.steps if found.attribution else ()
    first = steps[0].hypothesis.name if steps else found.differences[0].sentence if found.differences else ""
    if not found.differences:
        return Judged(not found.same, first, False)
    (one, *others) = expected
    if one.what == ("digits",):
        right = any("digits" in slip for step in steps[:1] for slip in step.hypothesis.slips)
        return Judged(True, first, right or (not steps and all(d.kind == "digits" for d in found.differences)))
    places = _places(found)
    told = [*_told(steps, len(expected)), *_unseen(found, steps)]
    right = all(any(_fits(values, slips, each, places) for values, slips in told) for each in expected)
    errors = [_error(value, each, found) for each in expected for values, _ in told for value in values if _same(value, each, places)]
    return Judged(True, first, right, min(errors, default=np.nan) if not others else max(errors, default=np.nan))
