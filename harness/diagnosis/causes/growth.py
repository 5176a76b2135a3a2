"""With which power of speed a difference grows: 2 is that of velocity products, 1 that of damping."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.reference.rotations import Array

#: Times the speeds at which a difference is measured, accelerations being the same.
SPEEDS = (0.0, 1.0, 2.0)
#: Share of a difference that may be there at rest as well, and how far a power may be from a whole one.
RESTS, WHOLE = 1e-3, 0.01
#: Power of speed -> what goes with it.
MEANING = {0: "dry friction", 1: "damping"}


@dataclass(frozen=True, slots=True)
class Growth:
    """Of a difference that vanishes at rest.

    Attributes:
        power: Of speed.
        share: How much of the velocity products (Coriolis and centrifugal terms, Jdot v) is there: 0 if they are
            missing; NaN where the difference is none of a share of them.
    """

    power: float
    share: float = math.nan

    @property
    def products(self) -> bool:
        """Whether it grows as velocity products do."""
        return abs(self.power - 2.0) < WHOLE

    @property
    def sentence(self) -> str:
        """In words."""
        said = f"it vanishes at rest and grows with speed to the power {self.power:.3f}"
        if not self.products:
            meaning = MEANING.get(round(self.power)) if abs(self.power - round(self.power)) < WHOLE else None
            return f"{said}, as {meaning} does" if meaning else said
        if math.isnan(self.share):
            return f"{said}: velocity products (Coriolis and centrifugal terms, Jdot v of loops) are wrong"
        fate = f"are {self.share:.6g} times what they should be" if abs(self.share) > RESTS else "are missing"
        return f"{said}: velocity products (Coriolis and centrifugal terms, Jdot v of loops) {fate}"


def growth(said: Sequence[Array], ours: Sequence[Array]) -> Growth | None:
    """Of the difference of two quantities, each at `SPEEDS`; None where it does not vanish at rest."""
    rest, once, twice = (float(np.abs(x - y).max(initial=0.0)) for x, y in zip(said, ours, strict=True))
    if not (0.0 < once < math.inf and 0.0 < twice < math.inf and rest <= RESTS * once):
        return None
    one, two = (each[2] - 2.0 * each[1] + each[0] for each in (said, ours))  # what is of second order in speed
    share = float(np.vdot(one, two) / max(float(np.vdot(two, two)), 1e-300))
    fits = float(np.abs(one - share * two).max()) <= RESTS * float(np.abs(one - two).max())
    return Growth(math.log2(twice / once), share if fits else math.nan)
