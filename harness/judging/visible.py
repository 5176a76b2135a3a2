"""How the forces that engines are compared in follow from what every body needs: one linear map, on the description."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from screwgauge.models.layout import open_tree
from screwgauge.problem import Problem
from screwgauge.quantities import FORCE, QUANTITIES
from screwgauge.reference import linear
from screwgauge.reference.closed_motion import ClosedMotion
from screwgauge.reference.equations.kinematics import forces_along
from screwgauge.reference.equations.newton_euler import NewtonEuler, balances
from screwgauge.reference.equations.screws import transpose
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.rotations import Array

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
