"""Whether a diagnosis says what was changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from campaigns.mutant import EVERYWHERE, Expected

from screwgauge.diagnosis.causes.attribution import Step
from screwgauge.diagnosis.causes.hypothesis import Hypothesis, Value
from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.reference.rotations import rotation_vector

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


def judged(found: Diagnosis, expected: Sequence[Expected]) -> Judged:
    """Compares a diagnosis with what was changed."""
    steps = found.attribution.steps if found.attribution else ()
    first = steps[0].hypothesis.name if steps else found.differences[0].sentence if found.differences else ""
    if found.same or not found.differences:
        return Judged(not (found.same or found.undecided), first, False)
    if expected[0].what == ("digits",):
        printed = all(difference.kind == "digits" for difference in found.differences)
        return Judged(True, first, printed or any("digits" in step.hypothesis.slips for step in steps[:1]))
    told = _told(found, steps, len(expected))
    carriers = {link: name for name, body in found.b.reading.bodies.items() for link in body.fixed}
    fits = [[value for value in told if _fits(value, each, carriers)] for each in expected]
    thought = found.attribution.ranking if found.attribution and not steps else ()
    named_first = [*_hypotheses(steps, len(expected)), *(hypothesis for hypothesis, _ in thought)]
    slips = {slip for hypothesis in named_first for slip in hypothesis.slips}
    named = all(not each.slip or any(each.slip in slip for slip in slips) for each in expected)
    errors = [
        min(_error(value, each.magnitude, found) for value in values)
        for each, values in zip(expected, fits, strict=True)
        if values and np.isfinite(each.magnitude)
    ]
    return Judged(True, first, all(fits) and named, max(errors, default=np.nan))


def _hypotheses(steps: Sequence[Step], count: int) -> list[Hypothesis]:
    """Those named first, as many as there are changes, with all that cannot be told from them."""
    return [hypothesis for step in steps[:count] for hypothesis in (step.hypothesis, *step.alike)]


def _told(found: Diagnosis, steps: Sequence[Step], count: int) -> list[Value]:
    """Values that are named first: by the steps, or, of what no torque shows, by the differences."""
    told = [value for hypothesis in _hypotheses(steps, count) for value in hypothesis.values]
    unseen = found.attribution.unseen if found.attribution else found.differences
    static = [*(d for d in found.differences if d.what == "branch"), *unseen[: max(count - len(steps), 0)]]
    nothing = np.array(np.nan)
    for d in static:
        a, b = (nothing if side is None else side for side in (d.a, d.b))
        told.append(Value(d.item_b or d.item_a, d.what, a, b))
    return told


def _fits(value: Value, expected: Expected, carriers: Mapping[str, str]) -> bool:
    """Whether it is of the property and the part that was changed."""
    if value.what not in expected.what:
        return False
    return expected.item in (EVERYWHERE, value.item) or carriers.get(expected.item) == value.item


def _error(value: Value, magnitude: float, found: Diagnosis) -> float:
    """Of a magnitude, relative to it."""
    if value.what == "placement":
        R, p, c = value.a[:3, :3], value.a[:3, 3], found.b.reading.joints[value.item].centre
        sizes = [float(np.linalg.norm(rotation_vector(R))), float(np.linalg.norm(R @ c + p - c))]
    else:
        sizes = [float(np.linalg.norm(value.a - value.b))]
    return min(abs(size - abs(magnitude)) / abs(magnitude) for size in sizes)
