"""What integration leaves in a simulated motion: the same motion integrated less exactly shows how large that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from screwgauge.reference.rotations import Array, within_half_turn
from screwgauge.solution import Solution, Values

#: Tolerance of the second run over that of the first. Steps that truncation decides leave an error in proportion to it,
#: so that the difference is nine times the error; it costs 3/4 of the first run with DOP853, half of it with Radau.
LOOSER = 10.0
#: Where rounding decides, both runs are off by as much, and their difference may be a third of that by chance.
SAFETY = 4.0
#: Largest scaled error that is put down to integration: behind more, a mistake of a thousandth could hide.
MOST = 1e-4
#: How the reason of a pair begins that agrees by what integration leaves.
WITHIN = "within the error of integration"

Integrated = Mapping[str, Mapping[str, Array]]
"""Quantity -> unit -> estimated error up to each sample [unit]. Shape (n,)."""


def with_estimate(solution: Solution, looser: Solution | None) -> Solution:
    """A simulation with the estimated error of its integration, as a second run with looser tolerances shows it.

    Args:
        looser: The same quantities from that run; None if it failed.
    """
    found = {} if looser is None else estimated(solution, looser)
    if not found:
        return replace(solution, notes=(*solution.notes, "the error of its integration is not known"))
    sizes = found.get("joint_position") or next(iter(found.values()))
    said = ", ".join(f"{np.nanmax(error):.1e} {unit}" for unit, error in sizes.items())
    note = f"error that integration leaves, from a second run with {LOOSER:g} times the tolerances: at most {said}"
    return replace(solution, integration=found, notes=(*solution.notes, note))


def estimated(solution: Solution, looser: Solution) -> dict[str, dict[str, Array]]:
    """Estimated error of what both runs reached, never less than at an earlier sample; NaN where one has no number."""
    found: dict[str, dict[str, Array]] = {}
    for name in (name for name in solution.values if name in looser.values):
        has, other = solution.values[name], looser.values[name]
        found[name] = {unit: SAFETY * _apart(has, other, unit) for unit in dict.fromkeys(has.units)}
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
