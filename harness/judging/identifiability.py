"""Identifiability: wrenches that each term and parameter requires on the bodies, and the resulting compared forces.

The compared forces are linear in these wrenches and are computed with the witness's mechanics. For p cases and n
samples, the wrenches have shape (p, n, n_body, 6): force, then moment about the body's centre of mass.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from screwgauge.models.layout import open_tree as minimal_tree
from screwgauge.problem import GivenMotion, Problem
from screwgauge.quantities import FORCE, QUANTITIES, natural_scales
from screwgauge.reference import linear
from screwgauge.reference.applied import Applied
from screwgauge.reference.graph import layout, spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.resistance import RESISTS, Resistance
from screwgauge.reference.rotations import Array, across_direction, cross, times
from screwgauge.witness.constraints import AdmissibleMotion, admissible_motion, residual
from screwgauge.witness.dynamics import momentum, newton_euler, project_forces
from screwgauge.witness.joints import MechanismTree, mechanism_tree, open_tree
from screwgauge.witness.kinematics import TreeMotion, move, unit_twists, velocity_products
from screwgauge.witness.tree import TreeStates
from screwgauge.witness.wrenches import (
    balance_amounts,
    exerted_on_bodies,
    load_in_world,
    unit_wrenches,
    wrench_columns,
)

_SOLVED = frozenset(name for name, quantity in QUANTITIES.items() if quantity.needs == "f")
#: Terms of the Lie bracket: the whole bracket, and each of its products.
BRACKET = ("bracket", "w1 x w2", "w1 x v2", "w2 x v1")
_Table = dict[str, tuple[tuple[str, ...], Array]]
"""Quantity -> units and values of its components, shape (n, m, p)."""


@dataclass(frozen=True, eq=False)
class CoveredMotion:
    """A given motion at n closed poses."""

    mechanism: Mechanism
    problem: Problem
    t: Array
    motion: TreeMotion[MechanismTree]
    admissible: AdmissibleMotion

    @property
    def accelerations(self) -> tuple[Array, Array, Array]:
        """Accelerations of joints, angular accelerations of bodies, and accelerations of centres of mass."""
        return self.motion.states.qdd, self.motion.com.b, self.motion.com.a

    @property
    def axial(self) -> tuple[str, Array] | None:
        """Joint and direction of eq. (56), if redundant actuators follow this rule."""
        return self.mechanism.axial if self.problem.rule == "spherical_axial" else None

    @cached_property
    def lost(self) -> dict[str, tuple[Array, Array, Array]]:
        """Change in the accelerations of joints and bodies due to each term of the Lie bracket."""
        products = velocity_products(self.motion)
        products["bracket"] = np.sum([*products.values()], axis=0)
        return {term: self._loss(products[term]) for term in BRACKET}

    def _loss(self, products: Array) -> tuple[Array, Array, Array]:
        """Return the accelerations due to some of the `velocity_products`, of shape (n, n_freedom, 6)."""
        tree, motion, m = self.motion.tree, self.motion, len(self.motion.tree.closures)
        first, second = tree.carries[tree.ends.link[:m]], tree.carries[tree.ends.link[m:]]
        open_by = (second - first) @ products
        open_by[..., 3:] += cross(open_by[..., :3], motion.closures.p[:, m:])
        none = np.zeros((len(self.t), len(tree.couplings)))
        gaps = np.concatenate([open_by.reshape(len(self.t), -1), none], axis=1)
        joints = self.admissible.joints(np.zeros((len(self.t), len(self.admissible.columns))), gaps)
        bodies = tree.moves @ (products + unit_twists(motion) * joints[..., None])
        angular = bodies[..., :3]
        return joints, angular, bodies[..., 3:] + cross(angular, motion.com.p)


def covered_motion(mechanism: Mechanism, problem: Problem, motion: GivenMotion, q: Array) -> CoveredMotion:
    """Compute the mechanism's motion from closed poses and given rates.

    Args:
        motion: The given motion at these poses.
        q: Joint coordinates of closed poses. Shape (n, n_q).
    """
    tree = mechanism_tree(mechanism, spanning_tree(mechanism), natural_scales(mechanism)["m"])
    none = np.zeros_like(q)
    admissible = admissible_motion(move(tree, TreeStates(q, none, none)))
    qd = admissible.joints(motion.yd)
    gaps = residual(move(tree, TreeStates(q, qd, none)), 2)
    moved = move(tree, TreeStates(q, qd, admissible.joints(motion.ydd, gaps)))
    return CoveredMotion(mechanism, problem, motion.t, moved, admissible)


def compared_forces(at: CoveredMotion, needed: Array, counted: Mobility) -> Iterator[tuple[str, str, Array]]:
    """Yield (quantity, unit, components) of every compared force. Shape (n, m, p).

    Args:
        needed: Wrenches that joints and actuators must exert on each body: first due to gravity and inertia, then due
            to applied forces, rotors and friction, which open-tree forces omit. Shape (2, p, n, n_body, 6).
        counted: Uniqueness of forces; only determined reactions are compared.
    """
    wanted, table, (own, applied) = at.problem.wanted, _Table(), needed
    if trees := [name for name in ("tree_force", "tree_force_soft") if name in wanted]:
        table[trees[0]] = _tree_forces(at, own)  # both quantities test the same parameters
    if wanted & _SOLVED:
        table |= _solve(at, own + applied, counted)
    for name, (units, array) in table.items():
        for unit in dict.fromkeys(units if name in wanted else ()):
            yield name, unit, array[:, [i for i, has in enumerate(units) if has == unit]]


def _tree_forces(at: CoveredMotion, own: Array) -> tuple[tuple[str, ...], Array]:
    """Return forces along the tree coordinates of the minimal model files."""
    mechanism, (_, columns) = at.mechanism, minimal_tree(layout(at.mechanism))
    joints = {joint.name for joint in mechanism.joints if {*mechanism.columns(joint.coordinates)} & {*columns}}
    tree, bodies, shares = open_tree(mechanism, spanning_tree(mechanism), joints)
    still = np.zeros_like(q := at.motion.states.q)
    forces = project_forces(move(tree, TreeStates(q, still, still)), own[:, :, bodies] * shares[:, None])
    return _units(mechanism, columns), np.moveaxis(forces[..., columns], 0, 2)


def _solve(at: CoveredMotion, whole: Array, counted: Mobility) -> _Table:
    """Solve for generalised forces, actuator forces and the determined reactions."""
    mechanism, wanted, partial = at.mechanism, at.problem.wanted, at.admissible.partial
    Q = np.einsum("pnbx,nbxk->nkp", whole, at.admissible.bodies, optimize=True)
    table = {"generalized_force": (_units(mechanism, mechanism.independent_columns), Q)}
    if not wanted & {"actuator_force", "reaction"}:
        return table
    f = linear.solve(partial[:, mechanism.actuated_columns].swapaxes(1, 2), Q)
    if "reaction" in wanted or at.axial:
        units, amounts = _balance(at, whole)
        m = len(units) - len(mechanism.actuator_names)
        determined = dict(zip(counted.names, counted.determined, strict=True))
        known = [i for i, name in enumerate([*units][:m]) if determined[name]]
        table["reaction"], f = (tuple([*units.values()][i] for i in known), amounts[:, known]), amounts[:, m:]
    return {**table, "actuator_force": (mechanism.actuator_units, f)}


def _balance(at: CoveredMotion, whole: Array) -> tuple[dict[str, str], Array]:
    """Solve for reactions, then actuator forces, from the balance of every body and the redundancy rule."""
    parts = [part for name in ("reaction", "actuator_force") for part in unit_wrenches(at.motion, name)]
    units, columns_of = wrench_columns(parts, at.motion)
    if at.axial:  # eq. (56)
        name, direction = at.axial
        body = at.mechanism.body_index[at.mechanism.joint(name).child] - 1
        columns = [[*units].index(f"{name}.f{axis}") for axis in "xyz"]
        nothing = across_direction(at.motion.com.R[:, body], direction)
    else:  # no preload
        columns = [*range(len(units) - len(at.mechanism.actuator_names), len(units))]
        U = np.linalg.svd(at.admissible.partial[:, at.mechanism.actuated_columns], full_matrices=True)[0]
        nothing = U[..., len(at.mechanism.independent) :].swapaxes(1, 2)
    rules = np.zeros((len(whole[0]), nothing.shape[1], len(units)))
    rules[:, :, columns] = nothing
    return units, balance_amounts(units.values(), columns_of, np.moveaxis(whole, 0, 3), at.motion.tree.length, rules)


def _units(mechanism: Mechanism, columns: Collection[int]) -> tuple[str, ...]:
    return tuple(FORCE[mechanism.units[i]] for i in columns)


def terms(now: CoveredMotion) -> tuple[tuple[str, ...], Array]:
    """Return the kinds of terms and the required wrenches due to each kind; `inertial` includes the Lie bracket."""
    applied, tree, com = now.problem.applied, now.motion.tree, now.motion.com
    split = newton_euler(tree, com.R, com.w, com.b, com.a, applied.g)
    nothing = np.zeros((*com.p.shape[:2], 6))

    def inertial(angular: Array, linear: Array) -> Array:
        return np.concatenate([tree.mass[:, None] * linear, momentum(tree, com.R, angular)], axis=2)

    own = {"gravity": nothing.copy(), "inertial": split.inertial, "gyroscopic": nothing.copy()}
    own["gravity"][..., :3], own["gyroscopic"][..., 3:] = split.gravity, split.gyroscopic
    own |= {term: inertial(*lost[1:]) for term, lost in now.lost.items()}
    outside = dict[str, Array]()
    if applied.loads:
        outside["loads"] = _needs_of_applied(now, Applied(loads=applied.loads))
    if applied.springs or applied.motors:
        outside["springs and motors"] = _needs_of_applied(now, Applied(springs=applied.springs, motors=applied.motors))
    for what in RESISTS:
        if resist := [one for one in now.mechanism.resistances if one.what == what]:
            outside[what] = _needs_of_applied(now, Applied(), resist)
    names = tuple(dict.fromkeys([*own, *outside]))
    return names, np.array([[part.get(name, nothing) for name in names] for part in (own, outside)])


def _needs_of_applied(now: CoveredMotion, applied: Applied, resist: Sequence[Resistance] = ()) -> Array:
    """Return the required wrenches on bodies due to applied forces. Shape (n, n_body, 6)."""
    return -exerted_on_bodies(now.motion, now.t, applied, resist)


_AXES = "xyz"
_Wrench = tuple[Array | float, Array | float]
_NONE: _Wrench = (0.0, 0.0)
_Column = tuple[str, int, _Wrench, _Wrench]
"""Name, body, and the parameter's effect on the required wrench, first without loads, then due to loads; each effect is
a force and a moment about the centre of mass."""


def parameters(now: CoveredMotion) -> tuple[tuple[str, ...], Array]:
    """Return names of inertial parameters, load points, rotors and friction, and derivatives of the required wrenches.

    Each derivative is multiplied by the scale of its parameter: the body's mass (or the mechanism's, for a massless
    body), the mechanism's length for a centre of mass or load point, and the body's largest moment of inertia about its
    centre of mass. Centre of mass and inertia of massless bodies are not parameters.
    """
    columns, resist = [*_of_bodies(now), *_of_loads(now)], now.mechanism.resistances
    parts = np.zeros((2, len(columns) + len(resist), *now.motion.com.p.shape[:2], 6))
    for column, one in enumerate(resist, len(columns)):
        parts[1, column] = _needs_of_applied(now, Applied(), [one])
    for column, (_, body, *wrenches) in enumerate(columns):
        for part, (force, moment) in zip(parts, wrenches, strict=True):
            part[column, :, body, :3], part[column, :, body, 3:] = force, moment
    names = (*(name for name, *_ in columns), *(f"{one.what} of {one.coordinate}" for one in resist))
    return names, parts


def _of_bodies(now: CoveredMotion) -> Iterator[_Column]:
    applied, L, mechanism, com = now.problem.applied, now.motion.tree.length, now.mechanism, now.motion.com
    for i, body in enumerate(mechanism.bodies):
        R, w, b = com.R[:, i], com.w[:, i], com.b[:, i]
        weight = (body.mass or mechanism.mass) * (com.a[:, i] - applied.g)
        yield f"mass of {body.name}", i, (weight, 0.0), _NONE
        if not body.mass:
            continue
        # loads at the centre of mass move with it
        own = [load for load in applied.loads if load.body == body.name and load.point is None]
        carried = sum((load_in_world(load, now.t, R)[0] for load in own), 0.0 * w)
        for axis, r in zip(_AXES, np.moveaxis(L * R, 2, 0), strict=True):
            force = body.mass * (cross(b, r) + cross(w, cross(w, r)))
            yield f"com {axis} of {body.name}", i, (force, cross(r, weight)), (0.0, -cross(r, carried))
        size = float(np.abs(body.inertia).max()) or body.mass * L**2
        for pair in ("xx", "yy", "zz", "xy", "xz", "yz"):
            j, k = (_AXES.index(axis) for axis in pair)
            unit = np.zeros((3, 3))
            unit[j, k] = unit[k, j] = size
            J = R @ unit @ R.swapaxes(-1, -2)
            Jb, Jw = times(J, b), times(J, w)
            yield f"inertia {pair} of {body.name}", i, (0.0, Jb + cross(w, Jw)), _NONE


def _of_loads(now: CoveredMotion) -> Iterator[_Column]:
    loads = now.problem.applied.loads
    for number, load in enumerate(loads, 1):
        i, which = now.mechanism.body_index[load.body] - 1, f" {number}" if len(loads) > 1 else ""
        R = now.motion.com.R[:, i]
        if np.any(force := load_in_world(load, now.t, R)[0]):
            for axis, r in zip(_AXES, np.moveaxis(now.motion.tree.length * R, 2, 0), strict=True):
                moment = -cross(r, np.broadcast_to(force, r.shape))
                yield f"point {axis} of load{which} on {load.body}", i, _NONE, (0.0, moment)
