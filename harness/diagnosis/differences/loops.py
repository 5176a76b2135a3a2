"""What the loops of two models leave of their motion, whichever rows state them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.compare import Row, components, row_of
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import Common, states_of_b, velocity_map
from screwgauge.diagnosis.pairing.mapping import Pairing
from screwgauge.models.importing.assemble import assemble
from screwgauge.models.importing.homes import Loops as LoopEquations
from screwgauge.models.importing.homes import some
from screwgauge.models.kinematics import ReadingTree, draw, near_home, plant, rehomed, size
from screwgauge.reference.errors import ClosureError
from screwgauge.witness.constraints import admissible_projector, clear, closed, equations
from screwgauge.witness.tree import TreeStates

#: States that are drawn, and closed where they can be.
DRAWN = 12
#: Scaled motions that loops leave and that differ by no more are the same: rounding over small singular values.
ALIKE = 1e-9
#: Gaps at home up to this are closed, as those of a description are [rad or lengths of the model].
HOME = 1e-9
#: Conventions of coordinates that are put right before loops are compared: the same pose is meant.
COUNTED = ("zero", "sign", "polynomial")
_NOT_COMPARED = "what closures and couplings leave is not compared"


@dataclass(frozen=True, slots=True)
class Loops:
    """Closures and couplings of two models at closed states.

    Attributes:
        row: Difference of what they leave of unit velocities, as projectors.
        mobility: Degrees of freedom that they leave in A and in B; `freedoms` without them.
        states: At how many states.
        opened: How far B is open at poses that close A, in words; empty where they close B, too.
    """

    row: Row
    mobility: tuple[int, int]
    freedoms: int
    states: int
    opened: str = ""

    @property
    def closes_alike(self) -> bool:
        """Whether the same poses close both, and leave as many freedoms."""
        return self.mobility[0] == self.mobility[1] and not self.opened

    @property
    def alike(self) -> bool:
        """Whether they leave the same motions, at the same poses; near singular ones rounding may hide it."""
        return self.closes_alike and self.row.max_abs <= ALIKE


def at_home(models: tuple[Model, Model]) -> tuple[Model, Model]:
    """Both models, with how far their loops are open at home and whether they close at all.

    Raises:
        ClosureError: Loops of neither close from any start.
    """
    found, refused = list[Model](), list[ClosureError]()
    for model in models:
        system = LoopEquations(plant(rehomed(model.reading, model.home)[0]))
        gaps = system.gaps(system.home, HOME)
        try:
            assemble(model.reading, model.label, {}) if gaps else None
            found.append(replace(model, open_by=some(gaps)))
        except ClosureError as error:
            refused.append(error)
            found.append(replace(model, open_by=some(gaps), never_closed=error.what))
    if len(refused) == len(models):
        raise refused[0]
    return found[0], found[1]


def loops(common: Common, pairing: Pairing, seed: int, deadline: Deadline) -> tuple[Loops | None, str]:
    """What loops leave in both models, and a sentence on it; None where that is not compared.

    Where B is open at a state that closes A, which is said, the nearest is taken that closes B.
    """
    bound = any(each.closures or each.couplings for each in (common.a, common.b))
    if not bound or deadline.over("what loops leave of motion"):
        return None, ""
    if pairing.only_a or pairing.only_b:
        return None, f"{_NOT_COMPARED}: joints are in one model only"
    a, b = plant(common.a), plant(common.b)
    force, length = components(common.a), size(common.a)
    slides = np.array([unit == "N" for _, unit in force])
    why = "no random state closes both models"
    for drawn in (draw(common.a, DRAWN, seed), near_home(a, DRAWN, np.where(slides, length, 1.0), seed)):
        states, _ = closed(a, drawn)
        same_poses = states_of_b(a, b, states)
        theirs, fits = closed(b, same_poses)
        rows = equations(a, states.at(fits)).rows, equations(b, theirs).rows @ velocity_map(a, b)
        regular = clear(rows[0]) & clear(rows[1])
        if regular.any():
            break
        why = "all random states that close both models are singular" if fits.any() else why
    else:
        return None, f"{_NOT_COMPARED}: {why}"
    rows = rows[0][regular], rows[1][regular]
    ours, others = (admissible_projector(each, slides, length)[0] for each in rows)
    n, m = (round(float(np.median(np.trace(each, axis1=1, axis2=2)))) for each in (ours, others))
    row = row_of(
        "motion that loops leave", ours, others, [(x, "") for x, _ in force for _ in force], np.ones_like(ours)
    )
    said = f"closures and couplings leave {n} of {len(force)} degrees of freedom" if n == m else ""
    return Loops(row, (n, m), len(force), len(ours), _opened(b, same_poses)), said


def _opened(tree: ReadingTree, states: TreeStates) -> str:
    """How far loops are open where they are widest, in words; empty where they are closed at all states."""
    system = LoopEquations(tree)
    widest = max(states.q, key=lambda q: float(np.abs(system.system(q)[0]).max(initial=0.0)))
    return some(system.gaps(widest, ALIKE))
