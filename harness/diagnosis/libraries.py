"""Compares each library's torques with the dynamics of its reading, and both libraries' torques for the loaded files.

Torques are compared along the motions that loops allow, where they do not depend on constraint forces and cuts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.motion import Partners, follow, namesakes, partners_of
from screwgauge.diagnosis.properties import CALLS, PASSIVE
from screwgauge.diagnosis.shares import Largest, Torques, components, with_gravity, without_forces
from screwgauge.engines.raw_queries import Answers, Ask, JointStates
from screwgauge.models.kinematics import ReadingTree, draw, size, tree_of, unmodelled_forces
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import (
    DEPENDENT,
    admissible_projector,
    close_loops,
    gap_bias,
    gaps_and_rows,
    is_rank_clear,
)
from screwgauge.witness.dynamics import dynamics, inverse_dynamics, passive_parts
from screwgauge.witness.tree import TreeStates

#: Library with dynamics -> module that queries it.
ASKED = {"pinocchio": "screwgauge.engines.pinocchio.raw_queries", "mujoco": "screwgauge.engines.mujoco.raw_queries"}
#: Libraries that also provide the equations of loops.
CLOSING = ("mujoco",)
#: Content whose passive forces no option disables.
_UNKNOWN = {"flexible bodies", "plugins"}


def ask_library(
    path: Path, library: str, tree: ReadingTree, states: TreeStates, *, floating: bool = False, whole: bool = False
) -> Answers:
    """Query one library for the dynamics of a file, at states of its tree.

    Args:
        whole: Include all forces of the file as loaded, including those that readings cannot represent.
    """
    ask: Ask = import_module(ASKED[library]).ask
    return ask(path, tuple(tree.reading.bodies), joint_states(tree, states), floating, whole)


def joint_states(tree: ReadingTree, states: TreeStates) -> Mapping[str, JointStates]:
    """Split states by joint."""
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


def _scaled_difference(theirs: Array, ours: Array, least: float = 0.0) -> float:
    """Return the largest difference, divided by the largest magnitude or by `least`, whichever is larger."""
    scale = max(float(np.abs(ours).max(initial=0.0)), least)
    return float(np.abs(theirs - ours).max(initial=0.0)) / (scale or 1.0)


def compare_tree(theirs: Answers, tree: ReadingTree, states: TreeStates) -> dict[str, float]:
    """Compute the scaled differences in quantities of the open tree."""
    ours, parts = dynamics(tree, states), passive_parts(tree, states)
    force = float(np.abs(ours.tau).max())  # scales forces that vanish
    expected = ours.tau - sum(force for name, force in parts.items() if name not in theirs.covers)
    by_name = {"tau": _scaled_difference(theirs.tau, expected, force)}
    for name, least in (("mass_matrix", 0.0), ("bias", force), ("gravity", force), ("velocity", 0.0)):
        by_name[name] = _scaled_difference(getattr(theirs, name), getattr(ours, name), least)
    by_name["acceleration"] = _scaled_difference(theirs.acceleration, ours.acceleration)
    if tree.reading.medium != (0.0, 0.0) and "medium" in theirs.covers:
        del by_name["tau"], by_name["bias"]  # the reading's own dynamics have no medium
    elif {each.kind for each in tree.reading.content} & _UNKNOWN:
        del by_name["tau"]
    return by_name


def compare_loops(
    path: Path, library: str, tree: ReadingTree, states: TreeStates, *, floating: bool = False
) -> dict[str, float]:
    """Compare closed-loop quantities, regardless of how each library formulates its loop equations.

    States near singular poses get a lower weight.
    """
    soft = [each.softness for each in tree.reading.closures.values()]
    soft += [each.softness for each in tree.reading.couplings.values()]
    if library not in CLOSING or not soft or not all(soft):  # the library ignores loops defined in a separate file
        return {}
    drawn = float(np.abs(states.qdd).max())  # admissible accelerations may be only rounding errors
    states, fits = close_loops(tree, states)
    states = states.at(is_rank_clear(gaps_and_rows(tree, states)[1]))
    if not fits.any() or not len(states.q):
        return {}
    rows, bias = import_module(ASKED[library]).closing_rows(path, joint_states(tree, states), floating)
    (_, own), slides = gaps_and_rows(tree, states), np.array([unit == "N" for _, unit in components(tree.reading)])
    if rows.shape != own.shape:  # the library has constraints that readings cannot represent
        return {}
    (one, _), (two, sure) = (admissible_projector(each, slides, size(tree.reading)) for each in (rows, own))
    # least squares amplify rounding errors of rows and gaps by the square of the condition number
    weight = sure[:, None, None] ** 2
    systems = (rows, bias), (own, gap_bias(tree, states))
    here, there = (weight * (np.linalg.pinv(J, rcond=DEPENDENT) @ b[..., None]) for J, b in systems)
    return {
        "constraint Jacobian": _scaled_difference(sure[:, None, None] * one, sure[:, None, None] * two, 1.0),
        "Jdot v": _scaled_difference(here, there, drawn),
    }


#: Largest scaled rounding error of an engine relative to the dynamics of its reading; 1e-14 is usual.
ROUNDING = 1e-11
#: Number of states at which libraries are compared.
STATES = 10


@dataclass(frozen=True, slots=True)
class LibraryCheck:
    """Result of checking a library against its own reading of a model.

    Attributes:
        side: ``A`` or ``B``.
        scaled: Quantity -> largest difference from the dynamics of the reading, divided by the largest magnitude.
        omits: Forces that the library's inverse dynamics omit.
        adds: Forces that the inverse dynamics contain in addition to inertial forces and weight.
        failed: Error message; empty if the library succeeded.
    """

    side: str
    library: str
    scaled: dict[str, float]
    omits: tuple[str, ...] = ()
    adds: tuple[str, ...] = ()
    failed: str = ""

    @property
    def agrees(self) -> bool:
        """True if the library computes the dynamics of its reading."""
        return not self.failed and all(value <= ROUNDING for value in self.scaled.values())


def check_libraries(models: Sequence[Model], seed: int, deadline: Deadline) -> Iterator[LibraryCheck]:
    """Check each library that has dynamics against its own reading."""
    for side, model in zip("AB", models, strict=False):
        if (
            model.library not in ASKED
            or model.file is None
            or deadline.is_over(f"torques of {model.library} for {side}")
        ):
            continue
        reading = model.as_read or model.reading
        tree = tree_of(with_gravity(reading))
        states = draw(reading, STATES, seed)
        try:
            theirs, scaled = _ask(model, tree, states)
        except (ScrewgaugeError, ValueError, LookupError) as error:
            yield LibraryCheck(side, model.library, {}, failed=str(error))
            continue
        acts = {entry for joint in reading.joints.values() for entry in PASSIVE if getattr(joint, entry)}
        omits = (*sorted(acts - theirs.covers), *unmodelled_forces(reading))
        adds = tuple(sorted(acts & theirs.covers))
        yield LibraryCheck(side, model.library, scaled, omits, adds)


def _ask(model: Model, tree: ReadingTree, states: TreeStates) -> tuple[Answers, dict[str, float]]:
    assert model.file is not None
    theirs = ask_library(model.file, model.library, tree, states, floating=model.floating)
    loops = compare_loops(model.file, model.library, tree, states, floating=model.floating)
    return theirs, {**compare_tree(theirs, tree, states), **loops}


#: Torques get less weight if the conditioning of loops is worse than this, see `admissible_projector`.
SURE = 0.01
#: Function that computes the torques of a tree at given states. Shape (n, n_freedom).
_Dynamics = Callable[[ReadingTree, TreeStates], Array]


@dataclass(frozen=True, slots=True)
class Together:
    """Torques of both models, computed by the libraries from the loaded files and including all forces.

    Attributes:
        row: Largest difference, projected onto the motions that loops allow.
        largest: Largest torque with the same unit.
        calls: Library functions called for A and B; empty for a description or a reader without dynamics.
        states: Number of compared states.
    """

    row: Largest
    largest: float
    calls: tuple[str, str]
    states: int

    @property
    def agrees(self) -> bool:
        """True if the torques differ only by rounding."""
        return self.row.scaled <= ROUNDING


def compare_libraries(models: tuple[Model, Model], pair: Pair, seed: int) -> tuple[Together | None, str]:
    """Compare the libraries' own torques, or return None and the reason why they cannot be compared."""
    try:
        found = _largest_difference(pair, seed, models)
    except (ScrewgaugeError, ValueError, LookupError) as error:
        return None, str(error)
    if found is None:
        return None, "B cannot follow A's motion at any of the sampled states"
    row, largest, n = found
    calls = ["" if model.retyped else CALLS.get(model.library, "") for model in models]
    return Together(row, largest, (calls[0], calls[1]), n), ""


def compare_dynamics(pair: Pair, seed: int, only: str = "") -> Largest | None:
    """Compare the torques of both readings; return None if B cannot follow A at any of the states.

    Args:
        only: The only group of properties to compare; empty for all.
    """
    if only:
        a, b = (replace(machine, reading=without_forces(machine.reading)) for machine in (pair.a, pair.b))
        pair = replace(pair, a=a, b=b)
    found = _largest_difference(pair, seed)
    return found and found[0]


def _largest_difference(
    pair: Pair, seed: int, models: tuple[Model, Model] | None = None
) -> tuple[Largest, float, int] | None:
    """Return the largest difference in torque, the largest torque with the same unit, and the number of states.

    Args:
        models: Models whose libraries compute the torques; by default, torques are computed from the readings.
    """
    torques = Torques(with_gravity(pair.a.reading), seed)
    sides = (pair.a.reading, namesakes(pair.a.reading)), (pair.b.reading, partners_of(pair))
    if models is None:
        (ours, one), (theirs, two) = (_torques_along(torques, *side, inverse_dynamics) for side in sides)
    else:
        (ours, one), (theirs, two) = (
            _torques_along(torques, model.reading, partners, _library_torques(model))
            for model, (_, partners) in zip(models, sides, strict=True)
        )
    fits = one & two
    if not fits.any():
        return None
    row = torques.largest(_project(torques, theirs - ours)[fits])
    units = np.array([unit == row.unit for _, unit in components(torques.reading)], dtype=bool)
    return row, float(torques.scale[units].max(initial=0.0)), int(fits.sum())


def _states(torques: Torques) -> TreeStates:
    """Select the first states: a few suffice because forces that a library adds to a reading appear at all states."""
    return torques.states.at(slice(STATES))


def _torques_along(
    torques: Torques, reading: Reading, partners: Partners, of: _Dynamics
) -> tuple[Array, NDArray[np.bool_]]:
    """Return torques conjugate to A's velocities for a reading that follows A, (n, n_freedom), and success flags."""
    tree = tree_of(with_gravity(reading))
    states, velocities, fits = follow(tree_of(torques.reading), _states(torques), tree, partners)
    return (np.swapaxes(velocities, 1, 2) @ of(tree, states)[..., None])[..., 0], fits


def _library_torques(model: Model) -> _Dynamics:
    """Build a function that computes all joint torques with the model's library, including all forces in the file."""

    def tau(tree: ReadingTree, states: TreeStates) -> Array:
        if model.library not in ASKED or model.file is None or model.retyped:
            return inverse_dynamics(tree, states)
        said = ask_library(model.file, model.library, tree, states, floating=model.floating, whole=True)
        left_out = [part for name, part in passive_parts(tree, states).items() if name not in said.covers]
        return said.tau + sum(left_out, np.zeros_like(said.tau))

    return tau


def _project(torques: Torques, tau: Array) -> Array:
    """Project torques onto the motions that loops allow, with less weight near singular poses. Shape (n, n_freedom)."""
    reading, slides = torques.reading, np.array([unit == "N" for _, unit in components(torques.reading)], dtype=bool)
    P, sure = admissible_projector(gaps_and_rows(tree_of(reading), _states(torques))[1], slides, size(reading))
    units = np.where(slides, size(reading), 1.0)
    return np.asarray(np.minimum(1.0, sure / SURE)[:, None] * (P @ (units * tau)[..., None])[..., 0] / units)
