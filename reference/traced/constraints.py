"""Constraint forces of all joints, number by number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.reactions import reaction_components
from screwgauge.reference.traced import closing
from screwgauge.reference.traced.closing import Row, along
from screwgauge.reference.traced.crossing import Wrench
from screwgauge.reference.traced.elimination import solve
from screwgauge.reference.traced.equations import Dynamics
from screwgauge.reference.traced.trace import NotTraceableError
from screwgauge.reference.traced.tree import NOTHING, plus, summed
from screwgauge.reference.traced.vectors import (
    ZERO,
    Scalar,
    Vector,
    cross,
    dot,
    matrix,
    rotation,
    turn,
    turn_back,
    vector,
)

#: Redundant constraint forces times all of them: the smallest norm costs several operations for each pair.
MOST_REDUNDANT = 1500


class Constraints:
    """Constraint forces of all joints."""

    def __init__(self, dynamics: Dynamics) -> None:
        self.dynamics, self.pose, self.at = dynamics, dynamics.pose, dynamics.at
        self.question, cuts = dynamics.question, self.at.cuts
        self.between = [(cuts[c], row) for c, row in zip(self.pose.owners, self.pose.rows, strict=True)]
        mechanism, n = self.question.lay.mechanism, len(self.question.lay.mechanism.joints)
        eye = [np.eye(3)[None]] * n
        with np.errstate(invalid="ignore"):  # of a pose that is none: names are wanted, no directions
            self.components = reaction_components(mechanism.joints, eye, eye, [np.zeros((1, 3))] * n)
        self.amounts = self._amounts()
        self.values, self.rest = self._read(self.amounts, particular=True)

    def _amounts(self) -> list[Scalar]:
        """Of the wrenches of the cut joints; where more than one answer is right, that of smallest norm of all."""
        dynamics, factors = self.dynamics, self.pose.factors
        tau = dict(dynamics.torques)
        for row, force in zip(dynamics.drives, dynamics.forces, strict=True):
            for i, x in row.items():
                tau[i] = tau.get(i, 0.0) - x * force
        columns = [column for _, column in factors.pivots]
        found = factors.solve_transposed({i: tau[i] for i in columns})
        if not factors.spare:
            return found
        redundant = len(factors.spare) * len(self.components.names)
        if redundant > MOST_REDUNDANT:
            what = f"{len(factors.spare)} of its constraint forces are redundant"
            raise NotTraceableError(what, self.question.lay.mechanism.name, "use backend array")
        size = [self.question.length if unit == "N m" else 1.0 for unit in self.components.units]
        own = [x * (1.0 / s) for x, s in zip(self._read(found, particular=True)[0], size, strict=True)]
        zero = dict.fromkeys(columns, 0.0)
        spaces = [factors.solve_transposed(zero, {row: 1.0}) for row in factors.spare]
        null = [
            [x * (1.0 / s) for x, s in zip(self._read(space, particular=False)[0], size, strict=True)]
            for space in spaces
        ]
        inner = [[sum((x * y for x, y in zip(a, b, strict=True)), start=0.0) for b in [*null, own]] for a in null]
        _, shares = solve([row[:-1] for row in inner], [row[-1] for row in inner])
        for share, space in zip(shares, spaces, strict=True):
            found = [x - share * y for x, y in zip(found, space, strict=True)]
        return found

    def _read(self, amounts: Sequence[Scalar], *, particular: bool) -> tuple[list[Scalar], dict[int, Scalar]]:
        """All reaction components, and what is left along the tree's coordinates."""
        acting = summed(self.between, amounts)
        external = self.at.between(acting)
        if particular:
            cuts = self.at.cuts
            driven = [(cuts[self.question.lay.tree.cuts.index(j)], f) for j, f in self._cut_drives()]
            pulls = [(cut, Row(False, ZERO, *along(cut), 0.0)) for cut, _ in driven]
            for body, wrench in self.at.between(summed(pulls, [f for _, f in driven])).items():
                external[body] = plus(external.get(body, NOTHING), wrench)
        wrenches = dict(self.dynamics.required) if particular else {}
        for body, wrench in external.items():
            if body != GROUND:
                wrenches[body] = plus(wrenches.get(body, NOTHING), wrench, -1.0)
        joints = dict[str, Wrench]()
        rest = self.at.inward(wrenches, joints)
        last = {cut.joint.name: amount for (cut, _), amount in zip(self.between, amounts, strict=True)}
        each = {j.name: iter(self._components(j, joints, acting, last)) for j in self.question.lay.mechanism.joints}
        mechanism = self.question.lay.mechanism
        return [next(each[mechanism.joints[i].name]) for i in self.components.joints], rest

    def _cut_drives(self) -> list[tuple[Joint, Scalar]]:
        mechanism = self.question.lay.mechanism
        pairs = zip(mechanism.actuators, self.dynamics.forces, strict=True)
        return [(joint, force) for joint, force in pairs if joint in self.question.lay.tree.cuts]

    def _components(
        self,
        joint: Joint,
        joints: Mapping[str, Wrench],
        acting: Mapping[str, tuple[Wrench, Wrench]],
        last: Mapping[str, Scalar],
    ) -> list[Scalar]:
        """Components of one joint, in the order of `reactions`.

        Args:
            joints: Wrench of parent on child of each tree joint, in its frame of the child.
            acting: On child and parent of each cut joint, see `summed`.
            last: Amount of the last wrench of each cut joint.
        """
        if joint.kind == "F":
            return []
        axis = vector(joint.axes[0])
        if joint.name in joints:
            (force, moment), world, normal = self._of_tree(joint, joints[joint.name])
        else:
            (force, moment), world, normal = self._of_cut(joint, *acting[joint.name], last[joint.name])
        forces = [dot(u, force) for u in closing.across(axis)] if joint.kind in "PC" else [*world]
        moments = {"U": [dot(normal, moment)], "P": [*moment], "S": []}
        return forces + moments.get(joint.kind, [dot(u, moment) for u in closing.across(axis)])

    def _of_tree(self, joint: Joint, wrench: Wrench) -> tuple[Wrench, Vector, Vector]:
        """Wrench in the joint's frame of the child, its force in the world, and the direction of a U joint's moment."""
        world = turn(self.at.motions[joint.child].R, turn(matrix(joint.child_frame.R), wrench[0]))
        if joint.kind != "U":
            return wrench, world, ZERO
        s, c = self.at.q.angle[self.question.lay.columns[joint.name][1]]
        first, second = (vector(axis) for axis in joint.axes)
        return wrench, world, turn_back(rotation(second, s, c), cross(first, second))

    def _of_cut(self, joint: Joint, child: Wrench, parent: Wrench, last: Scalar) -> tuple[Wrench, Vector, Vector]:
        """The same of a cut joint."""
        c = self.question.lay.tree.cuts.index(joint)
        outer = self.at.cuts[c].outer
        world = turn(self.at.sides[c][outer].R, (child if outer else parent)[0])
        if joint.kind == "U":  # its direction is a unit vector where the loop is closed
            return ((child[0], (last, 0.0, 0.0)), world, (1.0, 0.0, 0.0))
        return child, world, ZERO
