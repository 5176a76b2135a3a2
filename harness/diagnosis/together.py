"""The libraries' own torques of both models, as loaded, compared: they contain also what no reading holds.

Inverse dynamics of each library with its passive forces, at states that close the loops; contacts and limits off;
constraints projected out, so that it does not matter which torques hold the loops. A description has the dynamics of
its reading in place of a library.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from screwgauge.diagnosis.compare import Row, components, row_of
from screwgauge.diagnosis.library_dynamics import ASKED, answers
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import Common, states_of_b, velocity_map, weighed
from screwgauge.diagnosis.transformations import ordered
from screwgauge.models.formats import adjoint, quaternion
from screwgauge.models.kinematics import ReadingTree, draw, home, near_home, plant, size
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import FREEDOMS
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array, quaternion_rotation
from screwgauge.witness.constraints import (
    CLOSED,
    DEPENDENT,
    FAR,
    STEPS,
    admissible_projector,
    closed,
    equations,
    stepped,
)
from screwgauge.witness.dynamics import dynamics, passive_parts
from screwgauge.witness.tree import TreeStates

#: States at which libraries are compared.
STATES = 12
#: Scaled differences beyond this are no rounding: libraries leave 1e-14, MuJoCo's principal axes 5e-14.
ROUNDING = 1e-11
#: Where a library has another tree than what is compared, or counts a ball from another pose.
ELSEWHERE = "The libraries' own torques are not compared: a loop is cut elsewhere than in the file. The readings are."
#: Library -> its call for inverse dynamics.
CALLS = {"mujoco": "mj_inverse", "pinocchio": "rnea"}


@dataclass(frozen=True, slots=True)
class Together:
    """The libraries' own torques of both models.

    Attributes:
        row: Their largest difference, projected on the motions that loops leave, scaled by the torques of the open
            tree, of which `largest` is the largest of the same unit.
        calls: Of A and of B; empty of a description or a reader without dynamics.
        states: How many were compared.
    """

    row: Row
    largest: float
    calls: tuple[str, str]
    states: int

    @property
    def agrees(self) -> bool:
        """Whether rounding is all that is between them."""
        return self.row.scaled <= ROUNDING


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """A model.

    Attributes:
        common: Tree in common terms; `own` as its library reads it, by its own names, the joints of `common` first,
            then those at which the tree in common terms is cut.
        turned: Velocities in common terms -> own ones that are in both. Shape (n_shared, n_freedom).
        placed: Coordinates of each shared joint in common terms and own ones; and what stands before and after a
            placement of a ball or free one in common terms to make an own one: the frames that the two carry, and where
            they are at home, differ. Shapes (4, 4).
    """

    model: Model
    common: ReadingTree
    own: ReadingTree
    turned: Array
    placed: tuple[tuple[slice, slice, Array, Array], ...]

    @property
    def looped(self) -> bool:
        """Whether it has closures or couplings."""
        return bool(self.common.reading.closures or self.common.reading.couplings)


def together(models: tuple[Model, Model], common: Common, seed: int) -> tuple[Together | None, str]:
    """Compares them, or gives the reason why not.

    Args:
        common: Both with all of their joints.
    """
    if any(map(elsewhere, models)):
        return None, ""
    a, b = (_side(model, common, side) for side, model in zip("AB", models, strict=True))
    # one that has the loops leads
    first, second = (b, a) if b.looped and not a.looped else (a, b)
    try:
        found = _torques(first, second, seed)
    except (ScrewgaugeError, ValueError, LookupError) as error:
        return None, str(error)
    if found is None:
        return None, "no random state closes both models"
    *both, whole = found
    ours, theirs = both if first is a else both[::-1]
    row = row_of("torques of the libraries", ours, theirs, components(common.a), whole)
    units = np.array([unit == row.unit for _, unit in components(common.a)])
    calls = ["" if model.retyped else CALLS.get(model.library, "") for model in models]
    return Together(row, float(np.abs(whole[:, units]).max(initial=0.0)), (calls[0], calls[1]), len(ours)), ""


def elsewhere(model: Model) -> bool:
    """Whether the library has another tree than what is compared, or counts a ball from another pose."""
    whole = model.as_read or model.reading
    balls = any(FREEDOMS[joint.kind] > 1 for joint in whole.joints.values())
    return model.cut is not None and (model.retyped or (bool(model.open_by) and balls))


def _side(model: Model, common: Common, side: str) -> _Side:
    reading = common.a if side == "A" else common.b
    whole = weighed(model.reading if model.retyped else model.as_read or model.reading)
    named = {common.own["joints"].get(name, name) if side == "B" else name: name for name in reading.joints}
    shared = [name for name in named if name in whole.joints]
    tree = plant(reading)
    own = plant(ordered(whole, [*shared, *(name for name in whole.joints if name not in shared)]))
    wide = sum(FREEDOMS[whole.joints[name].kind] for name in shared)
    turned, places = np.zeros((wide, len(tree.before))), list[tuple[slice, slice, Array, Array]]()
    numbers, own_numbers = list(reading.joints), list(own.reading.joints)
    for other in shared:
        name, part = named[other], own.freedoms[other]
        turned[part, tree.freedoms[name]] = np.eye(part.stop - part.start)
        i, k = numbers.index(name), own_numbers.index(other)
        if i not in tree.frames:
            places.append((tree.places[name], own.places[other], np.eye(4), np.eye(4)))
            continue
        frame, before, behind = tree.frames[i], np.eye(4), np.eye(4)  # from the model's own home to the common one
        if side == "B":
            free = reading.joints[name].kind == "free"
            before, behind = before if free else common.before[name], common.behind[reading.moved_by(name)]
        after: Array = np.asarray(np.linalg.inv(frame) @ behind @ own.frames[k])
        ahead: Array = np.asarray(np.linalg.inv(own.frames[k]) @ np.linalg.inv(before) @ frame)
        if reading.joints[name].kind == "ball":
            ahead[:3, 3] = after[:3, 3] = 0.0
        size_ = part.stop - part.start
        turned[part, tree.freedoms[name]] = adjoint(np.asarray(np.linalg.inv(after)))[:size_, :size_]
        places.append((tree.places[name], own.places[other], ahead, after))
    return _Side(model, tree, own, turned, tuple(places))


def _torques(first: _Side, second: _Side, seed: int) -> tuple[Array, Array, Array] | None:
    """Torques of both along velocities that loops leave, and of the first one's open tree, in its terms (n, n_freedom).

    Where loops are nearly singular both count for less; where they are locked, the open tree is compared.
    """
    C, cut = velocity_map(first.common, second.common), bool(first.model.cut or second.model.cut)
    slides = np.array([unit == "N" for _, unit in components(first.common.reading)])
    length = np.where(slides, size(first.common.reading), 1.0)
    # joints that are cut are found from home: they follow where it is near
    drawn = near_home(first.common, STATES, length, seed) if cut else draw(first.own.reading, STATES, seed)
    states, _ = closed(first.common if cut else first.own, drawn)
    here = states if cut else _common_part(first, states)
    there, fits = closed(second.common, states_of_b(first.common, second.common, here))
    if not fits.any() and not cut:  # locked: nothing is left of motion
        there = states_of_b(first.common, second.common, _common_part(first, drawn))
        tau = _tau(first, drawn)
        return tau, _tau(second, _own_part(second, there)[0]) @ C, tau
    here = here.at(fits)
    ours, found = _own_part(first, here) if cut else (states.at(fits), np.ones(len(here.q), dtype=bool))
    theirs, known = _own_part(second, there)
    found &= known
    if not found.any():
        return None
    here, there, ours, theirs = (each.at(found) for each in (here, there, ours, theirs))
    rows = equations(first.common, here).rows, equations(second.common, there).rows @ C
    P, sure = admissible_projector(np.concatenate(rows, axis=1), slides, size(first.common.reading))
    taus = _tau(first, ours), _tau(second, theirs) @ C
    mine, other = (sure[:, None] * (P @ (length * tau)[..., None])[..., 0] / length for tau in taus)
    return mine, other, taus[0]


def _tau(side: _Side, states: TreeStates) -> Array:
    """All that motors have to give, along the velocities of the common joints. Shape (n, n_freedom)."""
    tree, model = side.own, side.model
    if model.library in ASKED and model.file is not None and not model.retyped:
        said = answers(model.file, model.library, tree, states, floating=model.floating, whole=True)
        left_out = [part for name, part in passive_parts(tree, states).items() if name not in said.covers]
        tau = said.tau + sum(left_out, np.zeros_like(said.tau))
    else:
        tau = dynamics(tree, states).tau
    n = len(side.turned)
    if tau.shape[1] > n:
        rows = equations(tree, states).rows  # joints that are cut in common terms move as loops make them
        follow = -np.linalg.pinv(rows[..., n:], rcond=DEPENDENT) @ rows[..., :n]
        tau = tau[:, :n] + (np.swapaxes(follow, 1, 2) @ tau[:, n:, None])[..., 0]
    return np.asarray(tau @ side.turned)


def _common_part(side: _Side, states: TreeStates) -> TreeStates:
    """States of a model in common terms, without joints that the other one lacks."""
    back, q = np.linalg.inv(side.turned), home(side.common.reading).q.repeat(len(states.q), axis=0)
    for there, own, before, after in side.placed:
        inverse = (np.asarray(np.linalg.inv(T)) for T in (before, after))
        q[:, there] = _replaced(states.q[:, own], *inverse)
    return TreeStates(q, states.qd @ back.T, states.qdd @ back.T)


def _own_part(side: _Side, states: TreeStates) -> tuple[TreeStates, NDArray[np.bool_]]:
    """States as the model counts and turns, and at which its loops close: joints that are cut follow the others."""
    tree, n = side.own, len(side.turned)
    q = home(tree.reading).q.repeat(len(states.q), axis=0)
    for there, own, before, after in side.placed:
        q[:, own] = _replaced(states.q[:, there], before, after)
    qd, qdd = (np.zeros((len(q), len(tree.before))) for _ in range(2))
    qd[:, :n], qdd[:, :n] = states.qd @ side.turned.T, states.qdd @ side.turned.T
    out = TreeStates(q, qd, qdd)
    if len(tree.before) == n:
        return out, np.ones(len(q), dtype=bool)
    for _ in range(STEPS):
        at = equations(tree, out)
        back = np.linalg.pinv(at.rows[..., n:], rcond=DEPENDENT)
        step = np.zeros_like(qd)
        step[:, n:] = -(back @ at.gap[..., None])[..., 0]
        step *= np.minimum(1.0, FAR / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
        out = replace(out, q=stepped(tree, out.q, step))
    at = equations(tree, out)
    qd[:, n:] = -(back @ at.rows[..., :n] @ qd[:, :n, None])[..., 0]
    rest = at.rows[..., :n] @ qdd[:, :n, None] + equations(tree, out).bias[..., None]
    qdd[:, n:] = -(back @ rest)[..., 0]
    sound = np.linalg.matrix_rank(at.rows[..., n:], tol=DEPENDENT) == len(tree.before) - n
    return out, (np.abs(at.gap).max(axis=1, initial=0.0) <= CLOSED * max(size(tree.reading), 1.0)) & sound


def _replaced(q: Array, before: Array, after: Array) -> Array:
    """``before X after`` of placements in coordinates of ball or free joints, shape (n, 4 or 7); others as they are."""
    out = q.copy()
    if q.shape[1] == 1:
        return out
    for k, (X, R) in enumerate(zip(q, quaternion_rotation(q[:, -4:]), strict=True)):
        T = before @ matrix(X[:-4] if len(X) > 4 else np.zeros(3), R) @ after
        out[k, -4:] = quaternion(T[:3, :3])
        out[k, :-4] = T[:3, 3][: len(X) - 4]
    return out
