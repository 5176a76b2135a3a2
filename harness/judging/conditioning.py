"""How far numbers can be trusted: what engines estimate of their errors, and the poses that a motion passes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.rotations import Array
from screwgauge.solution import Solution

#: Relative error from which a result is flagged: half of the digits of a double, and a thousand times the tolerance
#: of the comparison, so that what is flagged cannot be mistaken for a modelling error of interest, nor the reverse.
LIMIT = 1e-8


def flagged(solution: Solution) -> dict[str, NDArray[np.bool_]]:
    """Samples of each quantity whose estimated error is above `LIMIT`. Quantity -> booleans of shape (n,)."""
    return {name: ~(estimate <= LIMIT) for name, estimate in solution.estimate.items()}


@dataclass(frozen=True, slots=True)
class Guarded:
    """How far one quantity of one engine can be trusted over all samples that the engine solved.

    Attributes:
        condition: Largest condition number of what it was solved from.
        estimate: Largest estimated error, infinite where not one digit is right or there is no number.
        flagged: Number of samples above `LIMIT`, those without a number among them.
        worst_t: Time of the largest estimate [s].
    """

    engine: str
    quantity: str
    condition: float
    estimate: float
    flagged: int
    n_sample: int
    worst_t: float

    @property
    def ok(self) -> bool:
        return not self.flagged


def guarded(solution: Solution, t: Array) -> list[Guarded]:
    """One row for each quantity with an estimate. `t`: times [s], shape (n,)."""
    found = []
    for name, flags in flagged(solution).items():
        worst = int(np.argmax(solution.estimate[name]))
        found.append(
            Guarded(
                engine=solution.engine,
                quantity=name,
                condition=float(np.max(solution.conditions[name])),
                estimate=float(solution.estimate[name][worst]),
                flagged=int(flags.sum()),
                n_sample=len(t),
                worst_t=float(t[worst]),
            )
        )
    return found
