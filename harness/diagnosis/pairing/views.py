"""Two models where B as a whole stands elsewhere, is mirrored or in other units, and what is left to say then."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.causes.edits import WHOLE, Group
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.differences.static import differences
from screwgauge.diagnosis.differences.words import Axes, turn_and_way
from screwgauge.diagnosis.machine.whole import Whole, wholes
from screwgauge.diagnosis.model import Model, cut_alike
from screwgauge.diagnosis.pairing.branches import bare, missing
from screwgauge.diagnosis.pairing.common import brought
from screwgauge.diagnosis.pairing.mapping import Pairing
from screwgauge.models.kinematics import size


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Two models as one statement on the whole pairs them.

    Attributes:
        models, pairing: A and B.
        sentence: The statement.
        left: Item of A and property of what it leaves.
    """

    models: tuple[Model, Model]
    pairing: Pairing
    sentence: str
    left: frozenset[tuple[str, str]]

    def group(self, facts: Sequence[Difference]) -> Group | None:
        """The differences that the whole explains; None where there are none."""
        numbers = tuple(
            i
            for i, each in enumerate(facts)
            if (each.item_a, each.what) not in self.left and each.change is not None and each.kind != "digits"
        )
        if not numbers:
            return None
        one = facts[numbers[0]]
        sentence = self.sentence if len(numbers) > 1 or one.what == "placement" else one.sentence
        return Group(WHOLE, sentence, numbers, sentence, WHOLE)


def views(sides: tuple[Model, Model], pairing: Pairing, given: Mapping[str, str] | None) -> Iterator[View]:
    """What wholes make of two models, where that pairs the two.

    Args:
        pairing: Of both as they are.
    """
    (a, b), sure = sides, {name: other for name, other in pairing.joints.items() if pairing.how[name] != "geometry"}
    bodies = {n: other for n, other in pairing.bodies.items() if n == other or a.reading.bodies[n].joints[-1] in sure}
    for whole in wholes(a.reading, b.reading, sure, bodies):
        righted = replace(b, reading=whole.undone(b.reading, a.reading))
        one, two, found = cut_alike(a, righted, given)
        sure_of_all = found.match is not None and found.match.whole
        if two.cut is not None or not (sure_of_all or (pairing.alike and found.alike)):
            continue
        lost = [*missing(one.reading, two.reading, found)]
        ours, theirs = bare(one.reading, two.reading, lost)
        rest = [*lost, *differences(brought(ours, theirs, found))[0]]
        seen = replace(found, placement=np.eye(4), standing=found.standing if whole.stands else {}, match=None)
        left = frozenset((each.item_a, each.what) for each in rest)
        yield View((one, b), seen, _sentence(whole, size(a.reading)), left)


def _sentence(whole: Whole, length: float) -> str:
    mirror, step = whole.step
    there = [f"in other units in B: {whole.units}"] if whole.units else []
    there += [f"mirrored in {mirror} in B"] if mirror else []
    if np.abs(step).max() > 1e-9:
        moved = turn_and_way(step, (Axes("the world", np.eye(3)),), length)
        there.append(f"{moved} in B" if there else f"elsewhere in B, {moved}")
    return f"the whole is {'; '.join(there)}"
