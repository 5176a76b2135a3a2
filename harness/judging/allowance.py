"""Tolerances: the largest accepted difference between two values, and the reason for it. No other module sets
tolerances.

A scene may allow errors of any size by setting a tolerance or stating a table's error. A judged engine may estimate its
own errors, but this estimate explains a difference only up to `LIMIT`; beyond that the difference is undecided. If
a scene or command names a method with a number type, such as ``mjwarp@float32``, errors of that type are estimated from
the description, and at most half of its digits may be lost. Integration error is measured with additional runs, and
explains a difference of at most `MOST`.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field

import numpy as np

from screwgauge.quantities import FLOAT64, QUANTITIES, NumberType
from screwgauge.reference.linear import DIGIT
from screwgauge.reference.rotations import Array
from screwgauge.solution import SOFTNESS, Error, Solution

#: Relative error above which a result is flagged: half of the digits of a double, and a thousand times the tolerance
#: of the comparison.
LIMIT = FLOAT64.limit
#: Largest scaled error attributed to integration: a larger limit could hide a relative error of 1e-3.
MOST = 1e-4
#: Start of the reason of a pair that agrees within integration error.
WITHIN = "within the integration error"
#: Start of the reason of a pair that agrees in the digits of a number type narrower than float64.
NARROW = "compared as"


Integrated = Mapping[str, Mapping[str, Array]]
"""Estimated integration error of a simulation up to each sample: quantity -> unit -> error [unit]. Shape (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Granted:
    """Accepted scaled difference between two solutions in one quantity and unit.

    Attributes:
        usual: Limit at any sample.
        limits: Limit at each sample for its condition number, not including integration error. Shape (n,).
        doubts: Limit from the engines' own error estimates; a difference between `limits` and `doubts` is undecided.
            Shape (n,).
        why: Reason why `usual` exceeds the scene's tolerance; empty if the reason is soft constraints.
        scale: Scale of the errors.
        integration: Engine -> its estimated integration error, scaled. Shape (n,).
        binding: True if the scene sets the accepted difference and no integration error is added.
    """

    usual: float
    limits: Array
    doubts: Array
    why: str
    scale: float
    integration: Mapping[str, Array]
    binding: bool

    @property
    def admitted(self) -> Array:
        """Return the extra scaled error allowed on top of the scene's tolerance. Shape (n,)."""
        if self.binding or not self.integration:
            return np.zeros(len(self.limits))
        whole = np.sum([np.nan_to_num(error) for error in self.integration.values()], axis=0)
        return np.asarray(np.minimum(whole, MOST))

    def reason(self, size: float, row: int, *, ok: bool, usual: float) -> str:
        """Describe which part of a scaled difference at a sample is integration error; "" without an estimate."""
        sizes = {engine: float(error[row]) for engine, error in self.integration.items() if np.isfinite(error[row])}
        if not sizes or (ok and size <= usual):
            return ""
        shares = " and ".join(f"{error:.1g} from {engine}" for engine, error in sizes.items())
        whole = sum(sizes.values())
        if ok:
            return f"{WITHIN}: at most {shares}"
        if size > usual + whole:
            return f"integration explains at most {shares}; at least {size - whole:.2g} remains unexplained"
        why = "the scene sets the tolerance" if self.binding else f"at most {MOST:g} is attributed to integration"
        return f"{WITHIN} that was estimated: at most {shares}; {why}"


@dataclass(frozen=True, slots=True, eq=False)
class Allowance:
    """Accepted errors, grouped by source.

    Attributes:
        tolerance_of: Quantity -> scaled error up to which two engines agree, as given by the scene.
        binding: Quantities whose tolerance the scene itself sets: no integration error is allowed in addition.
        stated: Table -> quantity -> error that the scene states for the table's values [in their units].
        integration: Engine -> integration error measured with additional runs.
        summands: Returns unit -> magnitude of the terms at the states of the scene; a value below the rounding error of
            its terms counts as zero.
    """

    tolerance_of: Callable[[str], float]
    binding: Container[str] = ()
    stated: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    integration: Mapping[str, Integrated] = field(default_factory=dict)
    summands: Callable[[], Mapping[str, float]] = dict

    def grant(
        self,
        quantity: str,
        unit: str,
        pair: tuple[Solution, Solution],
        scale: float,
        *,
        scales: Mapping[str, float],
        n: int,
    ) -> Granted:
        """Compute the accepted difference between two solutions.

        Args:
            scale: Scale of the errors [unit].
            scales: Natural scales of the machine by unit.
            n: Number of samples.
        """
        tolerance, usual = self.tolerance_of(quantity), QUANTITIES[quantity].tolerance
        errors = [one.errors.get(quantity, Error(np.zeros(n))) for one in pair]
        # a scene that requires less than the usual tolerance also requires less rounding
        strict = min(1.0, tolerance / usual)
        source = max(errors, key=lambda error: error.absolute.get(unit, 0.0))
        zero = strict * source.absolute.get(unit, 0.0)
        stated = sum(self.stated.get(one.engine, {}).get(quantity, 0.0) for one in pair)
        # only engines of this package report errors of soft constraints, derived as closure error times stiffness
        derived, kind = source.source == SOFTNESS, source.kind
        decided = derived or zero <= kind.limit * scale or self._is_zero(zero, scale, kind, unit, scales[unit])
        limit = max(tolerance, stated / scale, zero / scale if decided else kind.sure)
        why = "" if derived else f"zero within {zero:.1g} {unit}, the {source.source}"  # soft forces have digits
        if kind is not FLOAT64 and limit < DIGIT:  # otherwise no digit is correct
            why = f"{NARROW} {kind.name}, whose rounding error is up to {zero:.1g} {unit}"
        if stated > zero:
            why = f"within {stated:.3g} {unit}, the stated error of {pair[1].engine}"
        scaled = [error.scaled for error in errors]
        known = np.all([error.scaled <= error.kind.limit for error in errors], axis=0)
        explained = np.sum(scaled, axis=0) * tolerance / usual
        limits = np.maximum(limit, np.where(known & (tolerance <= usual), explained, 0.0))
        doubts = np.where(known, 0.0, np.sum([np.nan_to_num(each, posinf=np.inf) for each in scaled], axis=0))
        doubts = np.maximum(doubts, 0.0 if decided else zero / scale)
        found = {one.engine: self.integration.get(one.engine, {}).get(quantity, {}).get(unit) for one in pair}
        grown = {engine: error / scale for engine, error in found.items() if error is not None}
        return Granted(limit, limits, doubts, why, scale, grown, quantity in self.binding)

    def _is_zero(self, absolute: float, scale: float, kind: NumberType, unit: str, natural: float) -> bool:
        """Return True if an absolute error is within the rounding error of the machine's natural scale or terms."""
        if kind is not FLOAT64 and absolute < DIGIT * scale:  # at least one digit is correct
            return False
        return absolute <= kind.zero * max(natural, self.summands().get(unit, 0.0))
