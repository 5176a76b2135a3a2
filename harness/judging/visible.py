"""How the forces that engines are compared in follow from what every body needs: one linear map, on the description."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from screwgauge.models.layout import open_tree
from screwgauge.problem import Problem
from screwgauge.quantities import FORCE, QUANTITIES
from screwgauge.reference import dynamics, linear
from screwgauge.reference.kinematics import Velocities
from screwgauge.reference.layout import Layout
from screwgauge.reference.mobility import Mobility
from screwgauge.reference.rotations import Array, cross

_SOLVED = frozenset(name for name, quantity in QUANTITIES.items() if quantity.needs == "f")
_Table = dict[str, tuple[tuple[str, ...], Array]]
"""Quantity -> units and values of its components, shape (n, m, p)."""


@dataclass(frozen=True, slots=True, eq=False)
class Needed:
    """What joints and actuators must exert on each body, in p columns: force over moment about its centre of mass.

    Attributes:
        own: What the bodies themselves need. Shape (n, n_body, 6, p).
        applied: What loads, springs and motors make of it, which the forces of an open tree leave out. The same shape.
    """

    own: Array
    applied: Array


@dataclass(frozen=True, slots=True, eq=False)
class Visible:
    """The compared forces at n closed poses.

    Attributes:
        com: Centres of mass [m]. Shape (n, n_body, 3).
        counted: Which reactions are determined; the others are not compared.
    """

    lay: Layout
    rate: Velocities
    com: Array
    problem: Problem
    counted: Mobility

    def forces(self, needed: Needed) -> Iterator[tuple[str, str, Array]]:
        """(quantity, unit, its components) of every compared force. Shape (n, m, p)."""
        wanted, found = self.problem.wanted, _Table()
        if trees := [name for name in ("tree_force", "tree_force_soft") if name in wanted]:
            found[trees[0]] = self._tree(needed.own)  # the second says no more
        if wanted & _SOLVED:
            found |= self._solved(needed.own + needed.applied)
        for name, (units, array) in found.items():
            for unit in dict.fromkeys(units if name in wanted else ()):
                yield name, unit, array[:, [i for i, has in enumerate(units) if has == unit]]

    def _tree(self, own: Array) -> tuple[tuple[str, ...], Array]:
        """Power of the wrenches on the unit motion of each joint of the open tree."""
        path, columns = open_tree(self.lay)
        force, S = own[:, :, :3], self.rate.pose.S[:, columns]
        moment = own[:, :, 3:] + cross(self.com[:, :, None], force.swapaxes(2, 3)).swapaxes(2, 3)
        carried = np.einsum("bi,nbxp->nixp", path[:, columns], np.concatenate([moment, force], axis=2), optimize=True)
        return self._units(columns), np.einsum("nix,nixp->nip", S, carried)

    def _solved(self, whole: Array) -> _Table:
        """Generalised and actuator forces, and the reactions that are determined."""
        mechanism, wanted = self.lay.mechanism, self.problem.wanted
        linear_part, angular_part = dynamics.partial_motion(self.lay, self.rate, self.com)
        partial = np.concatenate([linear_part, angular_part], axis=3)
        Q = np.einsum("nbjx,nbxp->njp", partial, whole, optimize=True)
        found = {"generalized_force": (self._units(mechanism.independent_columns), Q)}
        if not wanted & {"actuator_force", "reaction"}:
            return found
        axial = self.problem.rule == "spherical_axial"
        B = self.rate.K[:, mechanism.actuated_columns]
        f = linear.solve(B.swapaxes(1, 2), Q)
        if axial or "reaction" in wanted:
            units, reactions, balanced = self._balanced(B, whole, axial=axial)
            found["reaction"] = units, reactions
            f = balanced if axial else f
        return {**found, "actuator_force": (mechanism.actuator_units, f)}

    def _balanced(self, B: Array, whole: Array, *, axial: bool) -> tuple[tuple[str, ...], Array, Array]:
        """Determined reactions, their units before them, and actuator forces, from the balance of all bodies."""
        at, n = self.rate.pose, len(B)
        reactions = dynamics.joint_reactions(self.lay, at)
        c = dynamics.force_matrix(self.lay, at, self.com, reactions)
        rule = dynamics.rule_rows(self.lay, at, B, reactions, axial=axial)
        m, units = len(reactions.names), (*reactions.units, *self.lay.mechanism.actuator_units)
        system, rows, size = dynamics.force_system(c, rule, units, self.rate.system.length)
        right = whole.reshape(n, len(rows), -1) / rows[:, None]
        right = np.concatenate([right, np.zeros((n, rule.shape[1], right.shape[2]))], axis=1)
        unknown = linear.solve(system, right) * size[:, None]
        fixed = dict(zip(self.counted.names, self.counted.determined, strict=True))
        known = [i for i, name in enumerate(reactions.names) if fixed[name]]
        return tuple(units[i] for i in known), unknown[:, known], unknown[:, m:]

    def _units(self, columns: list[int]) -> tuple[str, ...]:
        return tuple(FORCE[self.lay.mechanism.units[i]] for i in columns)
