"""The libraries' own torques of both models, as loaded, beside each other: what no reading holds is in them, too.

Inverse dynamics of each library with its passive forces, at states that close the loops; contacts and limits off;
constraints projected out, so that it does not matter which torques hold the loops. A description has the dynamics of
its reading in place of a library.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.asked import ASKED, answers
from screwgauge.diagnosis.compare import Row, components, row_of
from screwgauge.diagnosis.mechanics.closed import DEPENDENT, closed, left
from screwgauge.diagnosis.mechanics.dynamics import dynamics, passive_parts
from screwgauge.diagnosis.mechanics.lines import size
from screwgauge.diagnosis.mechanics.reshape import ordered
from screwgauge.diagnosis.model import Model
from screwgauge.diagnosis.pairing.common import Common, states_of_b, velocity_map, weighed
from screwgauge.models.kinematics.closing import equations
from screwgauge.models.kinematics.tree import States, Tree, draw, home, plant
from screwgauge.models.placement import adjoint, quaternion, quaternion_rotation
from screwgauge.models.readings.assemble import matrix
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.rotations import Array

#: States at which libraries are asked.
STATES = 12
#: Scaled differences beyond this are no rounding: libraries leave 1e-14, MuJoCo's principal axes 5e-14.
ROUNDING = 1e-11
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
            then those that lead to copies of bodies.
        turned: Velocities in common terms -> own ones. Shape (n_freedom, n_freedom).
        placed: Coordinates of each ball or free joint, and what stands before and after a placement of it in common
            terms to make an own one: the frames that the two carry, and where they are at home, differ. Shapes (4, 4).
    """

    model: Model
    common: Tree
    own: Tree
    turned: Array
    placed: tuple[tuple[slice, Array, Array], ...]

    @property
    def looped(self) -> bool:
        """Whether it says what closes loops, or couples joints."""
        return bool(self.common.reading.closures or self.common.reading.couplings)


def together(models: tuple[Model, Model], common: Common, seed: int) -> tuple[Together | None, str]:
    """Compares them, or says why not.

    Args:
        common: Both with all of their joints.
    """
    a, b = (_side(model, common, side) for side, model in zip("AB", models, strict=True))
    if models[0].parts and models[1].parts:
        return None, "both models close loops by copies of bodies"
    # one that says the loops leads, and one with copies of bodies, which stand where closed loops put them
    first, second = (b, a) if models[1].parts or (b.looped and not a.looped) else (a, b)
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


def _side(model: Model, common: Common, side: str) -> _Side:
    reading = common.a if side == "A" else common.b
    whole = weighed(model.reading if model.retyped else model.as_read or model.reading)
    first = [common.own["joints"].get(name, name) if side == "B" else name for name in reading.joints]
    tree = plant(reading)
    own = plant(ordered(whole, [*first, *(name for name in whole.joints if name not in first)]))
    turned, places = np.eye(len(tree.before)), list[tuple[slice, Array, Array]]()
    for i, frame in tree.frames.items():
        name = list(reading.joints)[i]
        before, behind = np.eye(4), np.eye(4)  # from the model's own home to the common one
        if side == "B":
            free = reading.joints[name].kind == "free"
            before, behind = before if free else common.before[name], common.behind[reading.moved_by(name)]
        after: Array = np.asarray(np.linalg.inv(frame) @ behind @ own.frames[i])
        ahead: Array = np.asarray(np.linalg.inv(own.frames[i]) @ np.linalg.inv(before) @ frame)
        if reading.joints[name].kind == "ball":
            ahead[:3, 3] = after[:3, 3] = 0.0
        part = tree.freedoms[name]
        wide = part.stop - part.start
        turned[part, part] = adjoint(np.asarray(np.linalg.inv(after)))[:wide, :wide]
        places.append((tree.places[name], ahead, after))
    return _Side(model, tree, own, turned, tuple(places))


def _torques(first: _Side, second: _Side, seed: int) -> tuple[Array, Array, Array] | None:
    """Of both, along the velocities that loops leave, and of the first one's open tree, in its terms. (n, n_freedom).

    Where loops are nearly singular both count for less; where they are locked, the open tree is compared.
    """
    drawn, C = draw(first.own.reading, STATES, seed), velocity_map(first.common, second.common)
    states, _ = closed(first.own, drawn)
    here = _common_part(first, states)
    there, fits = closed(second.common, states_of_b(first.common, second.common, here))
    if not fits.any() and not first.model.parts:  # locked: nothing is left of motion, and the open tree is compared
        there = states_of_b(first.common, second.common, _common_part(first, drawn))
        tau = _tau(first, drawn)
        return tau, _tau(second, _own_part(second, there)) @ C, tau
    if not fits.any():
        return None
    states, here = states.at(fits), here.at(fits)
    rows = equations(first.common, here).rows, equations(second.common, there).rows @ C
    slides = np.array([unit == "N" for _, unit in components(first.common.reading)])
    length = np.where(slides, size(first.common.reading), 1.0)
    P, sure = left(np.concatenate(rows, axis=1), slides, size(first.common.reading))
    taus = _tau(first, states), _tau(second, _own_part(second, there)) @ C
    mine, other = (sure[:, None] * (P @ (length * tau)[..., None])[..., 0] / length for tau in taus)
    return mine, other, taus[0]


def _tau(side: _Side, states: States) -> Array:
    """All that motors have to give, along the velocities of the common joints. Shape (n, n_freedom)."""
    tree, model = side.own, side.model
    if model.library in ASKED and model.file is not None and not model.retyped:
        said = answers(model.file, model.library, tree, states, floating=model.floating, whole=True)
        left_out = [part for name, part in passive_parts(tree, states).items() if name not in said.covers]
        tau = said.tau + sum(left_out, np.zeros_like(said.tau))
    else:
        tau = dynamics(tree, states).tau
    n = len(side.common.before)
    if tau.shape[1] == n:
        return np.asarray(tau @ side.turned)
    rows = equations(tree, states).rows  # copies move as loops make them
    follow = -np.linalg.pinv(rows[..., n:], rcond=DEPENDENT) @ rows[..., :n]
    return np.asarray((tau[:, :n] + (np.swapaxes(follow, 1, 2) @ tau[:, n:, None])[..., 0]) @ side.turned)


def _common_part(side: _Side, states: States) -> States:
    """Of the common joints, in common terms."""
    n, wide = len(side.common.before), home(side.common.reading).q.shape[1]
    back, q = np.linalg.inv(side.turned), states.q[:, :wide].copy()
    for place, before, after in side.placed:
        q[:, place] = _replaced(q[:, place], *(np.asarray(np.linalg.inv(T)) for T in (before, after)))
    return States(q, states.qd[:, :n] @ back.T, states.qdd[:, :n] @ back.T)


def _own_part(side: _Side, states: States) -> States:
    """As the model counts and turns; it has no joints beside the common ones."""
    q = states.q.copy()
    for place, before, after in side.placed:
        q[:, place] = _replaced(q[:, place], before, after)
    return States(q, states.qd @ side.turned.T, states.qdd @ side.turned.T)


def _replaced(q: Array, before: Array, after: Array) -> Array:
    """``before X after`` of placements in coordinates of ball or free joints. Shape (n, 4 or 7)."""
    out = q.copy()
    for k, (X, R) in enumerate(zip(q, quaternion_rotation(q[:, -4:]), strict=True)):
        T = before @ matrix(X[:-4] if len(X) > 4 else np.zeros(3), R) @ after
        out[k, -4:] = quaternion(T[:3, :3])
        out[k, :-4] = T[:3, 3][: len(X) - 4]
    return out
