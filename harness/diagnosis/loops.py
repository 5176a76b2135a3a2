"""What the loops of two models leave of their motion, whichever rows state them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.closed import closed, equations, left
from screwgauge.diagnosis.common import Common, states_of_b, velocity_map
from screwgauge.diagnosis.compare import Row, components, row_of
from screwgauge.diagnosis.lines import size
from screwgauge.diagnosis.tree import draw, plant

#: States that are drawn, and closed where they can be.
DRAWN = 20
#: Scaled motions that loops leave and that differ by no more are the same: rounding over small singular values.
ALIKE = 1e-9


@dataclass(frozen=True, slots=True)
class Loops:
    """Closures and couplings of two models at closed states.

    Attributes:
        row: Difference of what they leave of unit velocities, as projectors.
        mobility: Degrees of freedom that they leave in A and in B; `freedoms` without them.
        states: At how many states.
    """

    row: Row
    mobility: tuple[int, int]
    freedoms: int
    states: int

    @property
    def alike(self) -> bool:
        """Whether they leave the same motions."""
        return self.mobility[0] == self.mobility[1] and self.row.max_abs <= ALIKE


def loops(common: Common, seed: int) -> Loops | None:
    """Of two models that say their loops; None where neither has any, or no drawn state of A and B closes.

    Where B is open at a state that closes A, the nearest is taken that closes B.
    """
    a, b = plant(common.a), plant(common.b)
    states = closed(a, draw(common.a, DRAWN, seed))
    if not any(each.closures or each.couplings for each in (common.a, common.b)) or not len(states.q):
        return None
    pairs = [(k, each) for k in range(len(states.q)) if len((each := closed(b, states_of_b(a, b, states.at(k)))).q)]
    if not pairs:
        return None
    force = components(common.a)
    slides, length, C = np.array([unit == "N" for _, unit in force]), size(common.a), velocity_map(a, b)
    rows = [(equations(a, states.at(k)).rows, equations(b, theirs).rows @ C) for k, theirs in pairs]
    ours, others = (np.concatenate([left(each[i], slides, length)[0] for each in rows]) for i in (0, 1))
    mobility = [round(float(np.median(np.trace(each, axis1=1, axis2=2)))) for each in (ours, others)]
    names = [(x, "") for x, _ in force for _ in force]
    row = row_of("motion that loops leave", ours, others, names, np.ones_like(ours))
    return Loops(row, (mobility[0], mobility[1]), len(force), len(pairs))
