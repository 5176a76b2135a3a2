"""One cause of many differences: everything scaled, numbers printed with few digits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import combinations

import numpy as np

from screwgauge.diagnosis.causes.hypothesis import COMMON, INERTIAL, Files, Hypothesis, Value
from screwgauge.diagnosis.differences.change import Change, Difference, applied
from screwgauge.diagnosis.differences.digits import longest
from screwgauge.diagnosis.files.opened import Opened
from screwgauge.diagnosis.mechanics.matter import Matter, combined, of_body, steps_of
from screwgauge.models.readings.reading import Reading

#: A common cause has to give each difference but this share of it.
LEFT = 1e-6

#: Numbers of fewer digits are meant so, those of more are exact; and rounding is seen in several places.
FEWEST, MOST, SEVERAL = 5, 12, 4

Real = Mapping[int, tuple[Difference, Change]]


def scaled(real: Real, b: Reading, file: Opened | None) -> Iterator[Hypothesis]:
    """Masses, or masses and inertias, of several bodies are those of A times one number."""
    bodies = dict.fromkeys(change.item for d, change in real.values() if d.what == "mass")
    if len(bodies) < COMMON:
        return
    own = {name: {i: change for i, (d, change) in real.items() if _of(change, name)} for name in bodies}
    after = {name: of_body(applied(b, own[name].values()).bodies[name]) for name in bodies}
    ratio = float(np.median([b.bodies[name].mass / after[name].mass for name in bodies if after[name].mass]))
    if not ratio:  # most of them have no mass in B, which is no scale
        return
    for words, both in (("masses", False), ("masses and inertias", True)):
        fits = [name for name in bodies if _fits(b, file, name, after[name], ratio, both)]
        if len(fits) >= COMMON:
            numbers = tuple(i for name in fits for i in own[name])
            values = tuple(
                Value(name, "mass", np.asarray(after[name].mass), np.asarray(b.bodies[name].mass)) for name in fits
            )
            yield Hypothesis(
                f"{words} of {len(fits)} bodies, {ratio:.9g} times those of A",
                numbers,
                ("all scaled alike",),
                1,
                values,
            )


def _of(change: Change, body: str) -> bool:
    return change.what in INERTIAL and change.item == body


def _fits(b: Reading, file: Opened | None, name: str, after: Matter, ratio: float, both: bool) -> bool:
    """Whether a body of A is that of B, each of its links divided by the ratio."""
    before = of_body(b.bodies[name])
    parts = [*file.parts(name).values()] if file else [before]
    smaller = [replace(p, mass=p.mass / ratio, inertia=p.inertia / (ratio if both else 1.0)) for p in parts if p.mass]
    whole = reduce(combined, smaller)
    left, step = (max(steps_of(matter, after).values()) for matter in (whole, before))
    return left <= LEFT * step


def printed(differences: Sequence[Difference], files: Files) -> Iterator[Hypothesis]:
    """All that is rounding of a file."""
    numbers = tuple(i for i, d in enumerate(differences) if d.kind == "digits" and d.change is not None)
    if len(numbers) >= SEVERAL:  # zeros, too, are then where rounding puts them
        most = max(differences[i].size for i in numbers)
        zeros = (i for i, d in enumerate(differences) if d.what == "zero" and d.size <= most)
        numbers = tuple(sorted({*numbers, *zeros}))
    else:
        texts = [file.xml.text() for file in (files.a, files.b) if file]
        numbers = _rounded(differences, *map(longest, texts)) if len(texts) == 2 else ()
    if numbers:
        yield Hypothesis("digits that are printed in a file", numbers, ("digits",), 0)


def _rounded(differences: Sequence[Difference], a: int, b: int) -> tuple[int, ...]:
    """All differences, if one file has no number with more than a few digits and none of them is larger than these."""
    digits, real = min(a, b), [i for i, d in enumerate(differences) if d.change is not None]
    small = all(differences[i].size <= 5.0 * 10.0 ** (1 - digits) for i in real)
    return tuple(real) if a != b and FEWEST <= digits <= MOST and len(real) >= SEVERAL and small else ()


def swapped(found: Sequence[Hypothesis]) -> Iterator[Hypothesis]:
    """Two parts of which each has the mass of the other one."""
    masses = [h for h in found if [value.what for value in h.values] == ["mass"]]
    for one, two in combinations(masses, 2):
        (first,), (second,) = one.values, two.values
        off = max(abs(float(first.a - second.b)), abs(float(first.b - second.a)))
        if off < LEFT * abs(float(first.a - first.b)):  # of files that say the same, none is
            name = f"masses of {first.item} and {second.item}, which are swapped"
            yield Hypothesis(name, one.differences + two.differences, ("masses are swapped",), 1, (first, second))
