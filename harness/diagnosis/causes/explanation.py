"""Why torques of two models differ: from their differences to causes and proof; soft equalities for themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.causes.attribution import Attribution, Torques, attribute, changes_of
from screwgauge.diagnosis.causes.backfill import Backfill, backfill, reread
from screwgauge.diagnosis.causes.edits import Files, edits
from screwgauge.diagnosis.causes.fitting import Growth
from screwgauge.diagnosis.causes.grouping import Group, Grouping
from screwgauge.diagnosis.compare import components
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.files.layout import UnpatchableError
from screwgauge.diagnosis.files.patch import Opened, opened, patched
from screwgauge.diagnosis.library_dynamics import ASKED, CLOSING, joint_states
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import counterpart, states_of_b, velocity_map
from screwgauge.diagnosis.pairing.mapping import Pairing
from screwgauge.diagnosis.properties import Change
from screwgauge.models.kinematics import ReadingTree, draw, plant
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.files import read_file
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import closed, stepped
from screwgauge.witness.tree import TreeStates

PROOF = "proof by backfill"


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Why the torques of two models differ.

    Attributes:
        proof: Of all changes; None where torques do not differ, no change of B is known, or there was no time for it.
        fix: The same, where torques agree, too; None where there are no changes.
        growth: Of the torque difference with speed; None where it does not vanish at rest.
        soft: Attribution of forces of soft equalities to their softness; None where that does not differ.
    """

    attribution: Attribution
    proof: Backfill | None = None
    fix: Backfill | None = None
    growth: Growth | None = None
    soft: Attribution | None = None


def explained(
    torques: Torques,
    readings: tuple[Reading, Reading],
    paths: tuple[Path | None, Path | None],
    differences: Sequence[Difference],
    read: Callable[[Path], Reading],
    deadline: Deadline,
    written: Reading | None = None,
) -> Explanation:
    """Attributes the torque difference of B to its static differences and proves it.

    Args:
        readings, paths: Of A and B, as they were read.
        differences: Of B to A, in the order in which their changes are to be made.
        read: Reads a copy of B's file by B's library.
        written: Reading of B's file, where its loops are cut elsewhere to be compared.
    """
    a, b = readings
    files = Files(_opened(paths[0], a), _opened(paths[1], b))
    made = edits(differences, b, files)
    attribution = attribute(
        torques, b, differences, lambda weight: Grouping(differences, b, files, weight, made).groups(), made, deadline
    )
    changes, seen = changes_of(differences), changes_of(differences[i] for i in attribution.seen)
    if not changes or deadline.over(PROOF):
        return Explanation(attribution)
    whole = _proved(torques, b, changes, paths, read, written)
    if not whole.agrees and 0 < len(seen) < len(changes):  # what no torque shows may stand in the way
        alone = _proved(torques, b, seen, paths, read, written)
        whole = alone if alone.agrees else whole
    return Explanation(attribution, whole if seen else None, whole)


def _proved(
    torques: Torques,
    b: Reading,
    changes: Sequence[Change],
    paths: tuple[Path | None, Path | None],
    read: Callable[[Path], Reading],
    written: Reading | None,
) -> Backfill:
    """Proof by backfill, in the reading where both are of one file: no change of it makes two loaders agree."""
    if paths[0] is None or paths[0] != paths[1]:
        return backfill(torques, b, changes, paths[1], read, written, read_file(paths[0]) if paths[0] else "")
    proof = backfill(torques, b, changes, None, read)
    return replace(proof, why_not=("A and B are one file, which two libraries read differently",))


def _opened(path: Path | None, reading: Reading) -> Opened | None:
    """A model file with its reading; None where the two do not match, or there is none."""
    try:
        return opened(read_file(path), reading) if path else None
    except (ScrewgaugeError, UnpatchableError):
        return None


#: States that are drawn, and how far they then are from closed [rad or m]: impedances change within a millimetre.
DRAWN, OPEN = 10, 1e-3
_REFUSED = (ScrewgaugeError, ValueError, LookupError)


def softness(
    models: tuple[Model, Model], pairing: Pairing, differences: Sequence[Difference], seed: int, deadline: Deadline
) -> Attribution | None:
    """Attributes the difference of soft forces to softness, all other differences that B's file can hold corrected.

    MuJoCo keeps equalities by springs. It is asked near closed states: where loops are closed, these exert nothing.

    None where softness does not differ, no library answers for both, or there was no time.
    """
    numbers = [i for i, each in enumerate(differences) if each.what == "softness"]
    a, b = models
    apart = pairing.only_a or pairing.only_b or not {a.library, b.library} <= {*CLOSING}
    if not numbers or apart or a.file is None or b.file is None or deadline.over("forces of soft equalities"):
        return None
    one, file = plant(a.reading), b.file
    two, own = (plant(each) for each in counterpart(a.reading, b.reading, pairing.joints))
    states = _near(one, seed)
    theirs, C, text = states_of_b(one, two, states), velocity_map(one, two), read_file(file)
    rest = changes_of(each for each in differences if each.what != "softness")

    def of(reading: Reading) -> Array:
        soft = _softness(b.reading)
        changes = [
            Change(name, "softness", np.array(to)) for name, to in _softness(reading).items() if to != soft[name]
        ]
        try:
            there = patched(text, b.reading, [*rest, *changes]).text
            return reread(file, there, lambda copy: _force(copy, b, own, theirs)) @ C
        except _REFUSED:
            return np.full((len(states.q), len(one.before)), np.nan)

    try:
        force = _force(a.file, a, one, states)
    except _REFUSED:  # which is sentence where it is asked for torques
        return None
    names, units = zip(*components(a.reading), strict=True)
    soft = [differences[i] for i in numbers]
    named = [(f"softness of {each.item_b}", each.sentence) for each in soft]
    groups = [Group(name, sentence, (i,), sentence, "softness") for i, (name, sentence) in enumerate(named)]
    return attribute(Torques(force, of, names, units), b.reading, soft, lambda _: groups, deadline=deadline)


def _softness(reading: Reading) -> dict[str, tuple[float, ...]]:
    return {name: each.softness for part in (reading.closures, reading.couplings) for name, each in part.items()}


def _near(tree: ReadingTree, seed: int) -> TreeStates:
    """Random states, near closed ones where there are such."""
    drawn = draw(tree.reading, DRAWN, seed)
    there, fits = closed(tree, drawn)
    drawn, q = (drawn.at(fits), there.q) if fits.any() else (drawn, drawn.q)
    return replace(drawn, q=stepped(tree, q, OPEN * np.random.default_rng(seed).normal(size=drawn.qd.shape)))


def _force(file: Path, model: Model, tree: ReadingTree, states: TreeStates) -> Array:
    force: Array = import_module(ASKED[model.library]).closing(file, joint_states(tree, states), model.floating).force
    return force
