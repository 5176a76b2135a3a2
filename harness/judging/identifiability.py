"""What the compared forces can identify: what every body needs, term by term and parameter by parameter, and the forces
that follow from it by one linear map, on the description.

Terms are those of the solver's equations, with parts of its Lie bracket left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from screwgauge.models.layout import open_tree
from screwgauge.problem import GivenMotion, Problem
from screwgauge.quantities import FORCE, QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.applied import Applied
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.equations.forward import NewtonEuler, balances, exerted_wrenches
from screwgauge.reference.equations.kinematics import Bracket, forces_along
from screwgauge.reference.equations.screws import Array, cross, prismatic, revolute, times, transpose
from screwgauge.reference.graph import Layout
from screwgauge.reference.mobility import Mobility

_SOLVED = frozenset(name for name, quantity in QUANTITIES.items() if quantity.needs == "f")
_Table = dict[str, tuple[tuple[str, ...], Array]]
"""Quantity -> units and values of its components, shape (n, m, p)."""


@dataclass(frozen=True, slots=True, eq=False)
class Needed:
    """Wrenches that joints and actuators must exert on each body, in p cases.

    Attributes:
        own: What the bodies themselves need. Shape (p, n, b, 6).
        applied: What loads, springs and motors make of it, which the forces of an open tree leave out. The same shape.
    """

    own: Array
    applied: Array


@dataclass(frozen=True, slots=True, eq=False)
class Visible:
    """The compared forces at n closed poses.

    Attributes:
        counted: Which reactions are determined; the others are not compared.
    """

    at: ClosedMotion
    problem: Problem
    counted: Mobility

    def forces(self, needed: Needed) -> Iterator[tuple[str, str, Array]]:
        """(quantity, unit, its components) of every compared force. Shape (n, m, p)."""
        wanted, found = self.problem.wanted, _Table()
        if trees := [name for name in ("tree_force", "tree_force_soft") if name in wanted]:
            path, columns = open_tree(self.at.loops.lay)
            forces = self.at.open_tree_force(path, needed.own)[..., columns]
            found[trees[0]] = self._units(columns), np.moveaxis(forces, 0, 2)  # the second says no more
        if wanted & _SOLVED:
            found |= self._solved(needed.own + needed.applied)
        for name, (units, array) in found.items():
            for unit in dict.fromkeys(units if name in wanted else ()):
                yield name, unit, array[:, [i for i, has in enumerate(units) if has == unit]]

    def _solved(self, whole: Array) -> _Table:
        """Generalised and actuator forces, and the reactions that are determined."""
        at, mechanism, wanted = self.at, self.at.mechanism, self.problem.wanted
        along = forces_along(at.pose, whole)[..., at.loops.columns]
        Q = np.moveaxis(at.virtual_power(along), 0, 2)
        found = {"generalized_force": (self._units(mechanism.independent_columns), Q)}
        if not wanted & {"actuator_force", "reaction"}:
            return found
        at.axial = self.problem.rule == "spherical_axial"
        f = linear.solve(transpose(at.B), Q)
        if at.axial or "reaction" in wanted:
            system = NewtonEuler(at)
            unknown, m = system.solve(np.moveaxis(balances(at.com, whole), 0, 2)), len(system.names)
            determined = dict(zip(self.counted.names, self.counted.determined, strict=True))
            known = [i for i, name in enumerate(system.names) if determined[name]]
            found["reaction"] = tuple(system.units[i] for i in known), unknown[:, known]
            f = unknown[:, m:] if at.axial else f
        return {**found, "actuator_force": (mechanism.actuator_units, f)}

    def _units(self, columns: list[int]) -> tuple[str, ...]:
        return tuple(FORCE[self.at.mechanism.units[i]] for i in columns)


_AXES = "xyz"
_Wrench = tuple[Array | float, Array | float]
_NONE: _Wrench = (0.0, 0.0)
_Column = tuple[str, int, _Wrench, _Wrench]
"""Name, body, and what it needs by the parameter: force and moment about its centre of mass, own and applied."""


def _products(first: Array, second: Array) -> dict[str, Array]:
    """The terms of the Lie bracket of two twists, eq. (36)."""
    w1, v1, w2, v2 = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
    return {
        "w1 x w2": revolute(cross(w1, w2), np.zeros(3)),
        "w1 x v2": prismatic(cross(w1, v2)),
        "w2 x v1": prismatic(-cross(w2, v1)),
    }


#: The bracket, and each of its products.
BRACKET = ("bracket", "w1 x w2", "w1 x v2", "w2 x v1")


def _without(term: str) -> Bracket:
    """The Lie bracket, one of its products or all of them left out."""

    def bracket(first: Array, second: Array) -> Array:
        parts = _products(first, second)
        return sum((part for name, part in parts.items() if term not in (name, "bracket")), np.zeros_like(first))

    return bracket


def moved(lay: Layout, q: Array, motion: GivenMotion, applied: Applied) -> dict[str, ClosedMotion]:
    """The mechanism in motion, and the same with each part of the Lie bracket left out; the first has no name.

    Args:
        q: Joint coordinates of closed poses. Shape (n, n_q).
    """
    found = {name: motion_at(lay, q, motion.yd, motion.ydd, applied, motion.t) for name in ("", *BRACKET)}
    for term in BRACKET:
        found[term].bracket = _without(term)
    found[""].check_springs()
    return found


def terms(versions: Mapping[str, ClosedMotion]) -> tuple[tuple[str, ...], Needed]:
    """Names of the kinds of terms, and what bodies need by each. The parts of the bracket are parts of `inertial`."""
    now = versions[""]
    applied, nothing, none = now.applied, np.zeros_like(now.V), np.zeros(3)

    def exerted(**what: Any) -> Array:
        return exerted_wrenches(motion_at(now.loops.lay, now.q, now.yd, None, Applied(**what), now.t))

    own, outside = {"gravity": now.inertia(nothing, nothing)}, dict[str, Array]()
    if applied.loads:
        outside["loads"] = -exerted(loads=applied.loads)
    if applied.springs or applied.motors:
        outside["springs and motors"] = -exerted(springs=applied.springs, motors=applied.motors)
    whole, turning = now.inertia(now.V, now.A, none), _gyroscopic(now)
    own |= {"inertial": whole - turning, "gyroscopic": turning}
    own |= {term: whole - now.inertia(now.V, versions[term].A, none) for term in BRACKET}
    names = tuple(dict.fromkeys([*own, *outside]))
    return names, Needed(*(np.stack([part.get(name, nothing) for name in names]) for part in (own, outside)))


def _gyroscopic(at: ClosedMotion) -> Array:
    """Moments ``w x J w`` of the bodies. Shape (n, b, 6)."""
    R, found = at.pose.R[:, 1:], np.zeros_like(at.V)
    w = times(transpose(R), at.V[:, 1:, :3])
    found[:, 1:, 3:] = times(R, cross(w, times(np.array([body.inertia for body in at.mechanism.bodies]), w)))
    return found


def parameters(now: ClosedMotion) -> tuple[tuple[str, ...], Needed]:
    """Names of the inertial parameters and load points, and the derivatives of what bodies need by each.

    By mass, centre of mass and inertia about it, all else that the description says being kept, each as large as the
    body's own: its mass (that of the mechanism where it has none), the length of the mechanism, its largest moment of
    inertia. A body without mass has neither centre nor inertia.
    """
    found = [*_of_bodies(now), *_of_loads(now)]
    parts = np.zeros((2, len(found), *now.V.shape))
    for column, (_, body, *wrenches) in enumerate(found):
        for part, (force, moment) in zip(parts, wrenches, strict=True):
            part[column, :, body, :3], part[column, :, body, 3:] = force, moment
            part[column, :, body, 3:] += cross(now.com[:, body - 1], part[column, :, body, :3])
    return tuple(name for name, *_ in found), Needed(*parts)


def _of_bodies(now: ClosedMotion) -> Iterator[_Column]:
    applied, L, mechanism = now.applied, now.loops.length, now.mechanism
    for i, body in enumerate(mechanism.bodies, 1):
        R, w, b = now.pose.R[:, i], now.V[:, i, :3], now.A[:, i, :3]
        weight = (body.mass or mechanism.mass) * (now.com_acceleration[:, i - 1] - applied.g)
        yield f"mass of {body.name}", i, (weight, 0.0), _NONE
        if not body.mass:
            continue
        # what acts at the centre of mass goes with it
        carried = sum((load.force for load in applied.loads if load.body == body.name and load.point is None), 0.0 * w)
        for axis, r in zip(_AXES, np.moveaxis(L * R, 2, 0), strict=True):
            force = body.mass * (cross(b, r) + cross(w, cross(w, r)))
            yield f"com {axis} of {body.name}", i, (force, cross(r, weight)), (0.0, -cross(r, carried))
        size = float(np.abs(body.inertia).max()) or body.mass * L**2
        for pair in ("xx", "yy", "zz", "xy", "xz", "yz"):
            j, k = (_AXES.index(axis) for axis in pair)
            unit = np.zeros((3, 3))
            unit[j, k] = unit[k, j] = size
            J = R @ unit @ transpose(R)
            Jb, Jw = times(J, b), times(J, w)
            yield f"inertia {pair} of {body.name}", i, (0.0, Jb + cross(w, Jw)), _NONE


def _of_loads(now: ClosedMotion) -> Iterator[_Column]:
    loads = now.applied.loads
    for number, load in enumerate(loads, 1):
        i, which = now.mechanism.body_index[load.body], f" {number}" if len(loads) > 1 else ""
        if np.any(load.force):
            for axis, r in zip(_AXES, np.moveaxis(now.loops.length * now.pose.R[:, i], 2, 0), strict=True):
                moment = -cross(r, np.broadcast_to(load.force, r.shape))
                yield f"point {axis} of load{which} on {load.body}", i, _NONE, (0.0, moment)
