"""Each library's dynamics against ours for the model as that library has read it: a difference is the engine's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.compare import components
from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import weighed
from screwgauge.diagnosis.properties import PASSIVE
from screwgauge.engines.raw_queries import Answers, Ask, JointStates
from screwgauge.models.kinematics import ReadingTree, draw, not_modelled, plant, size
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import DEPENDENT, admissible_projector, clear, closed, equations
from screwgauge.witness.dynamics import dynamics, passive_parts
from screwgauge.witness.tree import TreeStates

#: Libraries that have dynamics, and what asks them.
ASKED = {"pinocchio": "screwgauge.engines.pinocchio.raw_queries", "mujoco": "screwgauge.engines.mujoco.raw_queries"}
#: Those of them that answer for loops, too.
CLOSING = ("mujoco",)
#: Content with passive forces that cannot be switched off where a library is asked without what no reading holds.
_UNKNOWN = {"flexible bodies", "plugins"}


def answers(
    path: Path, library: str, tree: ReadingTree, states: TreeStates, *, floating: bool = False, whole: bool = False
) -> Answers:
    """Answers of one library on a file, at states of the tree that it reads from it.

    Args:
        whole: With all that acts as the file is loaded, also what no reading holds.
    """
    ask: Ask = import_module(ASKED[library]).ask
    return ask(path, tuple(tree.reading.bodies), joint_states(tree, states), floating, whole)


def joint_states(tree: ReadingTree, states: TreeStates) -> Mapping[str, JointStates]:
    """States by joint."""
    numbers = {name: i for i, name in enumerate(tree.reading.joints)}
    return {
        name: JointStates(
            joint.kind,
            tree.frames.get(numbers[name], np.eye(4)),
            states.q[:, tree.places[name]],
            states.qd[:, tree.freedoms[name]],
            states.qdd[:, tree.freedoms[name]],
        )
        for name, joint in tree.reading.joints.items()
    }


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """A quantity at states, from the library and from what it has read.

    Attributes:
        least: What differences are scaled by where `ours` is smaller.
    """

    theirs: Array
    ours: Array
    least: float = 0.0

    @property
    def off(self) -> float:
        """The largest difference."""
        return float(np.abs(self.theirs - self.ours).max(initial=0.0))

    @property
    def scaled(self) -> float:
        """The largest difference over the largest magnitude."""
        scale = max(float(np.abs(self.ours).max(initial=0.0)), self.least)
        return self.off / scale if scale else self.off


def pairs(theirs: Answers, tree: ReadingTree, states: TreeStates) -> dict[str, Compared]:
    """Quantities of the open tree."""
    ours, parts = dynamics(tree, states), passive_parts(tree, states)
    force = float(np.abs(ours.tau).max())  # forces that vanish are compared with others
    expected = ours.tau - sum(force for name, force in parts.items() if name not in theirs.covers)
    by_name = {"tau": Compared(theirs.tau, expected, force)}
    for name, least in (("mass_matrix", 0.0), ("bias", force), ("gravity", force), ("velocity", 0.0)):
        by_name[name] = Compared(getattr(theirs, name), getattr(ours, name), least)
    by_name["acceleration"] = Compared(theirs.acceleration, ours.acceleration)
    if tree.reading.medium != (0.0, 0.0) and "medium" in theirs.covers:
        del by_name["tau"], by_name["bias"]  # own dynamics know no medium
    elif {each.kind for each in tree.reading.content} & _UNKNOWN:
        del by_name["tau"]
    return by_name


def loop_pairs(
    path: Path, library: str, tree: ReadingTree, states: TreeStates, *, floating: bool = False
) -> dict[str, Compared]:
    """Quantities of closures and couplings where these are closed, whichever rows state them.

    They count for less where loops are nearly singular.
    """
    soft = [each.softness for each in tree.reading.closures.values()]
    soft += [each.softness for each in tree.reading.couplings.values()]
    if library not in CLOSING or not soft or not all(soft):  # loops of another file are not the library's
        return {}
    drawn = float(np.abs(states.qdd).max())  # where loops leave no motion, it is rounding
    states, fits = closed(tree, states)
    states = states.at(clear(equations(tree, states).rows))
    if not fits.any() or not len(states.q):
        return {}
    rows, bias = import_module(ASKED[library]).closing(path, joint_states(tree, states), floating)
    own, slides = equations(tree, states), np.array([unit == "N" for _, unit in components(tree.reading)])
    if rows.shape != own.rows.shape:  # it keeps others besides, which no reading has
        return {}
    (one, _), (two, sure) = (admissible_projector(each, slides, size(tree.reading)) for each in (rows, own.rows))
    # least squares amplify rounding, of rows and of gaps, by the square of the condition number
    weight = sure[:, None, None] ** 2
    here, there = (
        weight * (np.linalg.pinv(J, rcond=DEPENDENT) @ b[..., None]) for J, b in ((rows, bias), (own.rows, own.bias))
    )
    return {
        "constraint Jacobian": Compared(sure[:, None, None] * one, sure[:, None, None] * two, 1.0),
        "Jdot v": Compared(here, there, drawn),
    }


#: Scaled differences of an engine from the dynamics of its reading beyond this are no rounding: 1e-14 is usual.
ROUNDING = 1e-11
#: States at which a library is compared.
STATES = 10


@dataclass(frozen=True, slots=True)
class LibraryCheck:
    """A library on the model that it has read.

    Attributes:
        side: ``A`` or ``B``.
        scaled: Quantity -> largest difference from the dynamics of the reading, over the largest magnitude.
        omits: What its inverse dynamics do not contain; `adds`: what they contain besides inertia and weight.
        failed: Why it has no answer; empty if it has.
    """

    side: str
    library: str
    scaled: dict[str, float]
    omits: tuple[str, ...] = ()
    adds: tuple[str, ...] = ()
    failed: str = ""

    @property
    def agrees(self) -> bool:
        """Whether the engine computes the dynamics of its reading."""
        return not self.failed and all(value <= ROUNDING for value in self.scaled.values())


def library_checks(models: Sequence[Model], seed: int, deadline: Deadline) -> Iterator[LibraryCheck]:
    """Each library that has dynamics, on what it has read."""
    for side, model in zip("AB", models, strict=False):
        if model.library not in ASKED or model.file is None or deadline.over(f"torques of {model.library} for {side}"):
            continue
        reading = model.as_read or model.reading
        tree = plant(weighed(reading))
        states = draw(reading, STATES, seed)
        try:
            theirs, by_name = _asked(model, tree, states)
        except (ScrewgaugeError, ValueError, LookupError) as error:
            yield LibraryCheck(side, model.library, {}, failed=str(error))
            continue
        scaled = {name: pair.scaled for name, pair in by_name.items()}
        acts = {entry for joint in reading.joints.values() for entry in PASSIVE if getattr(joint, entry)}
        omits = (*sorted(acts - theirs.covers), *not_modelled(reading))
        adds = tuple(sorted(acts & theirs.covers))
        yield LibraryCheck(side, model.library, scaled, omits, adds)


def _asked(model: Model, tree: ReadingTree, states: TreeStates) -> tuple[Answers, dict[str, Compared]]:
    assert model.file is not None
    theirs = answers(model.file, model.library, tree, states, floating=model.floating)
    loops = loop_pairs(model.file, model.library, tree, states, floating=model.floating)
    return theirs, {**pairs(theirs, tree, states), **loops}
