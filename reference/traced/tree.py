"""The spanning tree of a mechanism at one pose: motions outwards, wrenches inwards, and the rows of its cut joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from screwgauge.reference.graph import Edge
from screwgauge.reference.mechanism import GROUND, Joint
from screwgauge.reference.pose import Layout
from screwgauge.reference.traced.closing import Cut, Row
from screwgauge.reference.traced.crossing import Coordinates, Motion, Step, Wrench, crossing, fixed
from screwgauge.reference.traced.vectors import ZERO, Scalar, Vector, add, product, scale, sub, transpose, turn_back

NOTHING: Wrench = (ZERO, ZERO)


def plus(a: Wrench, b: Wrench, factor: Scalar = 1.0) -> Wrench:
    """``a + factor b``."""
    return add(a[0], scale(factor, b[0])), add(a[1], scale(factor, b[1]))


def summed(rows: Iterable[tuple[Cut, Row]], amounts: Iterable[Scalar]) -> dict[str, tuple[Wrench, Wrench]]:
    """Cut joint -> what acts between its bodies, in its frames of the child and of the parent."""
    found = dict[str, tuple[Wrench, Wrench]]()
    for (cut, row), amount in zip(rows, amounts, strict=True):
        child, parent = found.get(cut.joint.name, (NOTHING, NOTHING))
        found[cut.joint.name] = plus(child, row.child, amount), plus(parent, row.parent, amount)
    return found


@dataclass(frozen=True, eq=False)
class TreeAt:
    """A tree at one pose.

    Attributes:
        closed: Whether cut joints without slide are known to be together.
    """

    lay: Layout
    q: Coordinates
    closed: bool = True

    @cached_property
    def steps(self) -> dict[str, list[Step]]:
        """Body -> steps that lead to it from the body before."""
        return {edge.far: self.across_joint(edge.joint, reverse=edge.reverse) for edge in self.lay.tree.edges}

    def across_joint(self, joint: Joint, *, reverse: bool) -> list[Step]:
        """Steps over a joint, away from its parent unless reversed."""
        return crossing(joint, self.lay.columns[joint.name], self.q, reverse=reverse)

    @cached_property
    def motions(self) -> dict[str, Motion]:
        """Motion of each body."""
        found = {GROUND: Motion()}
        for edge in self.lay.tree.edges:
            at = found[edge.near]
            for step in self.steps[edge.far]:
                at = step.outward(at, self.q)
            found[edge.far] = at
        return found

    @cached_property
    def sides(self) -> list[tuple[Motion, Motion]]:
        """Motion of each cut joint's frame on its parent and on its child."""
        return [
            (
                fixed(joint.parent_frame).outward(self.motions[joint.parent], self.q),
                fixed(joint.child_frame).outward(self.motions[joint.child], self.q),
            )
            for joint in self.lay.tree.cuts
        ]

    @cached_property
    def cuts(self) -> list[Cut]:
        cuts = []
        for joint, (parent, child) in zip(self.lay.tree.cuts, self.sides, strict=True):
            together = self.closed and joint.kind not in "PC"
            d: Vector = ZERO if together else turn_back(parent.R, sub(child.p, parent.p))
            # the rows of a joint that slides are derivatives of its residuals in the axes of its parent only
            outer = joint.kind not in "PC" and len(self._own(joint.child, joint.parent)) >= len(
                self._own(joint.parent, joint.child)
            )
            cuts.append(Cut(joint, product(transpose(parent.R), child.R), d, outer))
        return cuts

    @cached_property
    def _by_far(self) -> dict[str, Edge]:
        return {edge.far: edge for edge in self.lay.tree.edges}

    def way(self, body: str) -> list[Edge]:
        """Edges from a body to the ground."""
        edges = list[Edge]()
        while body != GROUND:
            edges.append(self._by_far[body])
            body = edges[-1].near
        return edges

    def _own(self, body: str, other: str) -> set[int]:
        """Dependent coordinates on the way from a body that are not on that from another."""
        beyond = self.way(other)
        own = {c for edge in self.way(body) if edge not in beyond for c in self.lay.columns[edge.joint.name]}
        return own - {*self.lay.mechanism.independent_columns}

    def work(self, body: str, wrench: Wrench, until: str) -> dict[int, Scalar]:
        """Power of a wrench on the body per rate of each coordinate, up to where the way from another body joins."""
        torques, beyond = dict[int, Scalar](), self.way(until)
        for edge in self.way(body):
            if edge in beyond:
                break
            for step in reversed(self.steps[edge.far]):
                wrench = step.inward(wrench, torques)
        torques.pop(-1, None)
        return torques

    def row(self, cut: Cut, child: Wrench, parent: Wrench) -> dict[int, Scalar]:
        """Power of a wrench between the bodies of a cut joint per rate of each tree coordinate."""
        joint = cut.joint
        found = self.work(joint.child, fixed(joint.child_frame).inward(child, {}), joint.parent)
        other = self.work(joint.parent, fixed(joint.parent_frame).inward(parent, {}), joint.child)
        for column, power in other.items():
            found[column] = found.get(column, 0.0) - power
        return found

    def between(self, acting: Mapping[str, tuple[Wrench, Wrench]]) -> dict[str, Wrench]:
        """Wrenches on the bodies of what acts between those of cut joints, see `summed`."""
        on = dict[str, Wrench]()
        for joint in self.lay.tree.cuts:
            child, parent = acting.get(joint.name, (NOTHING, NOTHING))
            child, parent = fixed(joint.child_frame).inward(child, {}), fixed(joint.parent_frame).inward(parent, {})
            on[joint.child] = plus(on.get(joint.child, NOTHING), child)
            on[joint.parent] = plus(on.get(joint.parent, NOTHING), parent, -1.0)
        return on

    def inward(self, wrenches: Mapping[str, Wrench], joints: dict[str, Wrench] | None = None) -> dict[int, Scalar]:
        """Power of wrenches on bodies per rate of each tree coordinate.

        Args:
            joints: Filled with the wrench of parent on child that each tree joint has to exert, in the joint's frame
                of the child.
        """
        total, torques = dict(wrenches), dict[int, Scalar]()
        for edge in reversed(self.lay.tree.edges):
            wrench, steps = total.get(edge.far, NOTHING), self.steps[edge.far]
            before = list[Wrench]()
            for step in reversed(steps):
                wrench = step.inward(wrench, torques)
                before.append(wrench)
            if joints is not None:
                joints[edge.joint.name] = plus(NOTHING, before[-2], -1.0) if edge.reverse else before[0]
            total[edge.near] = plus(total.get(edge.near, NOTHING), wrench)
        torques.pop(-1, None)
        return torques
