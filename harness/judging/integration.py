"""What integration leaves in a simulated motion: the same motion integrated less exactly shows how large that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from screwgauge.reference.rotations import Array, within_half_turn
from screwgauge.solution import Solution, Values

#: Tolerances of further runs over that of the first. Steps that truncation decides leave an error in proportion to
#: them: the largest difference of two of the runs is nine times the error.
LOOSER = (3.0, 10.0)
#: Where rounding decides, all runs are off by as much, each by chance: of 40 light cart-poles, whose motion is known,
#: the largest difference of three runs was 0.31 of the error of the first at least, that of two runs 0.05.
SAFETY = 4.0
#: Largest scaled error that is put down to integration: behind more, a mistake of a thousandth could hide.
MOST = 1e-4
#: How the reason of a pair begins that agrees by what integration leaves.
WITHIN = "within the error of integration"


def with_estimate(solution: Solution, looser: Sequence[Solution]) -> Solution:
    """A simulation with the estimated error of its integration, as runs with looser tolerances show it.

    Args:
        looser: The same quantities from those runs; none where they failed.
    """
    found = estimated(solution, looser)
    if not found:
        return replace(solution, notes=(*solution.notes, "the error of its integration is not known"))
    sizes = found.get("joint_position") or next(iter(found.values()))
    said = ", ".join(f"{np.nanmax(error):.1e} {unit}" for unit, error in sizes.items())
    times = " and ".join(f"{factor:g}" for factor in LOOSER)
    note = f"error that integration leaves, from further runs with {times} times the tolerances: at most {said}"
    return replace(solution, integration=found, notes=(*solution.notes, note))


def estimated(solution: Solution, looser: Sequence[Solution]) -> dict[str, dict[str, Array]]:
    """Estimated error of what all runs reached, never less than at an earlier sample; NaN where one has no number."""
    found: dict[str, dict[str, Array]] = {}
    for name, has in solution.values.items() if looser else ():
        runs = [has, *(one.values[name] for one in looser)]
        apart = {unit: [_apart(*pair, unit) for pair in combinations(runs, 2)] for unit in dict.fromkeys(has.units)}
        found[name] = {unit: SAFETY * np.max(each, axis=0) for unit, each in apart.items()}
    return found


def _apart(a: Values, b: Values, unit: str) -> Array:
    """Largest difference of the components of a unit up to each sample. Shape (n,)."""
    columns = [i for i, has in enumerate(a.units) if has == unit]
    difference = a.array[:, columns] - b.array[:, columns]
    if unit == "rad":
        difference = within_half_turn(difference)
    return np.asarray(np.maximum.accumulate(np.abs(difference).max(axis=1)))  # what is NaN stays so


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """What integration leaves in the difference of two motions, in one quantity and unit.

    Attributes:
        scale: Of the scaled errors.
        errors: Engine -> its estimated error, scaled. Shape (n,).
        binding: The scene says how large the difference may be, whatever integration leaves.
    """

    scale: float
    errors: Mapping[str, Array] = field(default_factory=dict)
    binding: bool = False

    def admitted(self, n: int) -> Array:
        """Scaled error that is admitted besides the tolerance of the scene. Shape (n,)."""
        if self.binding or not self.errors:
            return np.zeros(n)
        whole = np.sum([np.nan_to_num(error) for error in self.errors.values()], axis=0)
        return np.asarray(np.minimum(whole, MOST))

    def reason(self, size: float, row: int, *, ok: bool, usual: float) -> str:
        """What part of a scaled difference at a sample is integration, and which is not; "" where nothing is known."""
        sizes = {engine: float(error[row]) for engine, error in self.errors.items() if np.isfinite(error[row])}
        if not sizes or (ok and size <= usual):
            return ""
        said = " and ".join(f"{error:.1g} by {engine}" for engine, error in sizes.items())
        whole = sum(sizes.values())
        if ok:
            return f"{WITHIN}: at most {said}"
        if size > usual + whole:
            return f"integration makes at most {said}; at least {size - whole:.2g} of it is none"
        why = "the tolerance is that of the scene" if self.binding else f"more than {MOST:g} is not put down to it"
        return f"{WITHIN} that its engines admit: at most {said}; {why}"


def left(quantity: str, unit: str, pair: tuple[Solution, Solution], scale: float, *, binding: bool) -> Left:
    """What integration leaves in the difference of two solutions."""
    errors = {one.engine: one.integration.get(quantity, {}).get(unit) for one in pair}
    return Left(scale, {name: error / scale for name, error in errors.items() if error is not None}, binding)
