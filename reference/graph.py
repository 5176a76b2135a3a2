"""Topology of a mechanism: spanning tree, paths, loops, serial chains to a body, and the choice of cut joints."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.mechanism import GROUND, POINTS, Joint, Mechanism
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A joint that is traversed from the body `near`."""

    joint: Joint
    near: str

    @property
    def reverse(self) -> bool:
        """True if the walk enters the joint from its child."""
        return self.near != self.joint.parent

    @property
    def far(self) -> str:
        """Body beyond the joint."""
        return self.joint.parent if self.reverse else self.joint.child


@dataclass(frozen=True, eq=False)
class Layout:
    """A mechanism with a spanning tree and the resulting paths and loops.

    Attributes:
        edges: Joints of the tree; every edge follows the edge that leads to its `near` body.
        cuts: Joints outside the tree; each closes one loop.
        kept: Results that are computed once per layout, e.g. by `loops.loop_equations`.
    """

    mechanism: Mechanism
    edges: tuple[Edge, ...]
    cuts: tuple[Joint, ...]
    kept: dict[tuple[int, ...] | str, Any] = field(default_factory=dict)

    @cached_property
    def columns(self) -> dict[str, list[int]]:
        """Joint -> columns of its coordinates."""
        return {joint.name: self.mechanism.columns(joint.coordinates) for joint in self.mechanism.joints}

    @cached_property
    def path(self) -> Array:
        """Signs of coordinates (+1, -1 or 0) on the tree path from the ground to each body. Shape (n_body + 1, n_q)."""
        index, home = self.mechanism.body_index, self.mechanism.home
        path = np.zeros((len(index), len(home)), dtype=home.dtype)
        for edge in self.edges:
            path[index[edge.far]] = path[index[edge.near]]
            path[index[edge.far], self.columns[edge.joint.name]] = -1.0 if edge.reverse else 1.0
        return path

    @cached_property
    def loop(self) -> Array:
        """Signs of coordinates around each loop: path of parent + cut joint - path of child. Shape (n_cut, n_q)."""
        index = self.mechanism.body_index
        loop = np.zeros((len(self.cuts), self.path.shape[1]), dtype=self.path.dtype)
        for row, joint in zip(loop, self.cuts, strict=True):
            row += self.path[index[joint.parent]] - self.path[index[joint.child]]
            row[self.columns[joint.name]] = 1.0
        return loop

    @cached_property
    def turns(self) -> NDArray[np.bool_]:
        """True for coordinates that are angles. Shape (n_q,)."""
        return np.array([turn for joint in self.mechanism.joints for turn, _ in joint.freedoms])

    @cached_property
    def cut_columns(self) -> list[int]:
        """Columns of the cut joints' coordinates, joint by joint."""
        return [column for joint in self.cuts for column in self.columns[joint.name]]

    @cached_property
    def tree_columns(self) -> list[int]:
        """Columns of the tree joints' coordinates."""
        return [column for column in range(self.path.shape[1]) if column not in self.cut_columns]


def layout(mechanism: Mechanism) -> Layout:
    """Build the spanning tree that keeps the joints of independent coordinates, which must be tree unknowns."""
    chosen = {*mechanism.independent.values()}
    return spanning_tree(mechanism, [joint.name for joint in mechanism.joints if chosen & {*joint.coordinates}])


def spanning_tree(mechanism: Mechanism, keep: Collection[str] = ()) -> Layout:
    """Build a tree that preferably cuts S joints, or else R joints without an actuator; points can close both kinds.

    Kruskal's algorithm adds joints in this order: F joints, which do not close loops; joints with coupled coordinates,
    which must be unknowns; joints in `keep`; joints with an actuator or a rotor; kinds that point constraints cannot
    close; joints with few degrees of freedom. Ties are resolved by name, so that the order of the description does not
    matter.

    Args:
        keep: Names of joints that are cut only where they close a loop among themselves.
    """
    group = {name: name for name in mechanism.body_index}
    coupled = coupled_joints(mechanism)

    def rank(joint: Joint) -> tuple[bool | int | str, ...]:
        drives = joint.actuated, bool(joint.rotor.any())
        first = not joint.constrains, joint.name in coupled, joint.name in keep, *drives
        return *(not each for each in first), joint.kind in POINTS, len(joint.coordinates), joint.name

    kept = []
    for joint in sorted(mechanism.joints, key=rank):
        a, b = root(group, joint.parent), root(group, joint.child)
        if a != b:
            group[a] = b
            kept.append(joint)
    cuts = tuple(joint for joint in mechanism.joints if joint not in kept)
    return Layout(mechanism, _order_outward([joint for joint in mechanism.joints if joint in kept]), cuts)


def root(group: Mapping[str, str], name: str) -> str:
    """Return the representative of a name's group."""
    while group[name] != name:
        name = group[name]
    return name


def coupled_joints(mechanism: Mechanism) -> frozenset[str]:
    """Return the names of joints with a coordinate that takes part in a coupling."""
    named = {name for coupling in mechanism.couplings for name in coupling.named}
    return frozenset(joint.name for joint in mechanism.joints if named & {*joint.coordinates})


def _order_outward(joints: list[Joint]) -> tuple[Edge, ...]:
    """Order the joints of a tree from the ground outwards."""
    known, edges = {GROUND}, list[Edge]()
    while joint := next((joint for joint in joints if known & {*joint.bodies}), None):
        edges.append(Edge(joint, joint.parent if joint.parent in known else joint.child))
        known.add(edges[-1].far)
        joints.remove(joint)
    return tuple(edges)


def check_connected(mechanism: Mechanism, where: str) -> None:
    """Reject bodies that are not connected to the ground, and loops that consist only of F or coupled joints."""
    tree, coupled = spanning_tree(mechanism), coupled_joints(mechanism)
    for joint in tree.cuts:
        at = joint.where or f"{where}, joints.{joint.name}"
        if joint.name in coupled:
            what = "every joint of the loop that it closes is fixed or has a coupled coordinate"
            raise DescriptionError(what, at, "remove one of these joints")
        if not joint.constrains:
            raise DescriptionError("a loop consists of F joints only", at, "remove one of these joints")
    reached = {GROUND, *(edge.far for edge in tree.edges)}
    for body in mechanism.bodies:
        if body.name not in reached:
            what = f"body '{body.name}' is not connected to {GROUND}"
            raise DescriptionError(what, where, "add the missing joint, or remove the body")


def output_body(mechanism: Mechanism) -> str:
    """Return the body with the most joints, e.g. the moving platform of a parallel mechanism."""
    sides = [body for joint in mechanism.joints for body in joint.bodies]
    return max((body.name for body in mechanism.bodies), key=sides.count)


def chain(first: Edge, target: str, joints: Sequence[Joint]) -> tuple[Edge, ...]:
    """Follow joints from the first edge to the target body or the ground, or until the chain branches."""
    walked, unused = [first], [joint for joint in joints if joint is not first.joint]
    while (near := walked[-1].far) not in (target, GROUND):
        onward = [joint for joint in unused if near in joint.bodies]
        if len(onward) != 1:
            break
        walked.append(Edge(onward[0], near))
        unused.remove(onward[0])
    return tuple(walked)


def serial_chains(mechanism: Mechanism) -> tuple[tuple[Edge, ...], ...]:
    """Return the serial chains from the ground to the output body (section 2.2), in the order of their first joints.

    Branches that are not simple chains between ground and output body are omitted.
    """
    target = output_body(mechanism)
    starts = [Edge(joint, GROUND) for joint in mechanism.joints if GROUND in joint.bodies]
    chains = [chain(start, target, mechanism.joints) for start in starts]
    return tuple(way for way in chains if way[-1].far == target)
