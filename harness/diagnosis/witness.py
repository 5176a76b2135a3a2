"""Whether a library's own dynamics are those of what it has read, or an engine differs and not a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.asked import ASKED, Pair, answers, loop_pairs, pairs
from screwgauge.diagnosis.causes.fitting import PASSIVE, fitted
from screwgauge.diagnosis.causes.growth import SPEEDS, Growth, growth
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import weighed
from screwgauge.engines.plain import Answers
from screwgauge.models.kinematics import ReadingTree, draw, not_modelled, plant
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.witness.dynamics import passive_parts
from screwgauge.witness.tree import TreeStates

#: Scaled differences of an engine from the dynamics of its reading beyond this are no rounding: 1e-14 is usual.
ROUNDING = 1e-11
#: States at which a library is asked.
STATES = 10


@dataclass(frozen=True, slots=True)
class Witness:
    """A library on the model that it has read.

    Attributes:
        side: ``A`` or ``B``.
        scaled: Quantity -> largest difference from the dynamics of the reading, over the largest magnitude.
        omits: What its inverse dynamics do not contain; `adds`: what they do beside inertia and weight.
        failed: Why it could not say; empty if it did.
        fits: What the model would have to say otherwise for torques like the library's, and the share of their
            difference that this explains; the best, and those that cannot be told from it.
        growth: Of the largest difference with speed; None where there is none, or not at speed alone.
    """

    side: str
    library: str
    scaled: dict[str, float]
    omits: tuple[str, ...] = ()
    adds: tuple[str, ...] = ()
    failed: str = ""
    fits: tuple[tuple[str, float], ...] = ()
    growth: Growth | None = None

    @property
    def agrees(self) -> bool:
        """Whether the engine computes what its reading says."""
        return not self.failed and all(value <= ROUNDING for value in self.scaled.values())


def witnesses(models: Sequence[Model], seed: int, deadline: Deadline) -> Iterator[Witness]:
    """Each library that has dynamics, on what it has read."""
    for side, model in zip("AB", models, strict=False):
        if model.library not in ASKED or model.file is None or deadline.over(f"torques of {model.library} for {side}"):
            continue
        reading = model.as_read or model.reading
        tree = plant(weighed(reading))
        states = draw(reading, STATES, seed)
        try:
            said, found = _asked(model, tree, states)
        except (ScrewgaugeError, ValueError, LookupError) as error:
            yield Witness(side, model.library, {}, failed=str(error))
            continue
        scaled = {name: pair.scaled for name, pair in found.items()}
        acts = {entry for joint in reading.joints.values() for entry in PASSIVE if getattr(joint, entry)}
        omits = (*sorted(acts - said.covers), *not_modelled(reading))
        adds = tuple(sorted(acts & said.covers))
        worst = max(scaled, key=lambda name: scaled[name])
        differs = ROUNDING < scaled[worst] < np.inf and not deadline.over(f"fits to the torques of {model.library}")
        grown = _grown(model, tree, states, worst) if differs else None
        fits = _fits(tree, states, said, scaled.get("tau", 0.0)) if differs and not (grown and grown.products) else ()
        yield Witness(side, model.library, scaled, omits, adds, fits=fits, growth=grown)


def _asked(model: Model, tree: ReadingTree, states: TreeStates) -> tuple[Answers, dict[str, Pair]]:
    assert model.file is not None
    said = answers(model.file, model.library, tree, states, floating=model.floating)
    loops = loop_pairs(model.file, model.library, tree, states, floating=model.floating)
    return said, {**pairs(said, tree, states), **loops}


def _grown(model: Model, tree: ReadingTree, states: TreeStates, name: str) -> Growth | None:
    """How the difference of a quantity grows with speed."""
    found = [_asked(model, tree, replace(states, qd=times * states.qd))[1][name] for times in SPEEDS]
    return growth([each.said for each in found], [each.ours for each in found])


def _fits(tree: ReadingTree, states: TreeStates, said: Answers, off: float) -> tuple[tuple[str, float], ...]:
    """Single causes that a library's torques look like."""
    if not ROUNDING < off < np.inf:
        return ()
    left_out = [force for name, force in passive_parts(tree, states).items() if name not in said.covers]
    best = fitted(tree.reading, states, said.tau + sum(left_out, np.zeros_like(said.tau)))[:1]
    return tuple((name, fit.share) for fit in best for name in (fit.name, *fit.alike))
