"""The graph of a mechanism: spanning tree, loops, and the serial chains between ground and the output body."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from screwgauge.reference.errors import DescriptionError
from screwgauge.reference.mechanism import GROUND, Joint, Mechanism

#: Kinds of joint whose loop is closed by points of the two bodies that coincide, and how many.
POINTS = {"R": 2, "S": 1}


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A tree joint as walked from ground: `near` is the body on the ground side.

    `reverse` marks a joint that the description declares the other way round.
    """

    joint: Joint
    near: str
    far: str
    reverse: bool


@dataclass(frozen=True, slots=True, eq=False)
class SpanningTree:
    """Tree edges in an order in which every `near` body is known before its edge, and the joints left out.

    Each joint left out closes one loop.
    """

    edges: tuple[Edge, ...]
    cuts: tuple[Joint, ...]


def spanning_tree(mechanism: Mechanism, keep: Collection[str] = ()) -> SpanningTree:
    """The tree that leaves out, where the graph allows it, S and else R joints without actuator: points close these.

    Kruskal's algorithm: F joints, which close no loop, those with coupled coordinates, which have to be unknowns, those
    asked for, actuated ones, kinds that points cannot close, then few freedoms first, by name: the order of the
    description says nothing.

    Args:
        keep: Names of joints that are cut only where they close a loop among themselves.
    """
    group = {name: name for name in mechanism.body_index}
    coupled = coupled_joints(mechanism)

    def root(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    def rank(joint: Joint) -> tuple[bool, bool, bool, bool, bool, int, str]:
        free, wanted, few = not joint.constrains, joint.name in keep, len(joint.coordinates)
        return (
            not free,
            joint.name not in coupled,
            not wanted,
            not joint.actuated,
            joint.kind in POINTS,
            few,
            joint.name,
        )

    kept = []
    for joint in sorted(mechanism.joints, key=rank):
        a, b = root(joint.parent), root(joint.child)
        if a != b:
            group[a] = b
            kept.append(joint)
    cuts = tuple(joint for joint in mechanism.joints if joint not in kept)
    return SpanningTree(_walk(kept, mechanism), cuts)


def coupled_joints(mechanism: Mechanism) -> frozenset[str]:
    """Names of the joints of which a coordinate is coupled, or another one depends on it."""
    named = {name for coupling in mechanism.couplings for name in (coupling.coordinate, coupling.of)}
    return frozenset(joint.name for joint in mechanism.joints if named & {*joint.coordinates})


def _walk(kept: list[Joint], mechanism: Mechanism) -> tuple[Edge, ...]:
    known, edges = {GROUND}, []
    left = [joint for joint in mechanism.joints if joint in kept]
    while joint := next((j for j in left if known & {j.parent, j.child}), None):
        edges.append(_edge(joint, joint.child if joint.parent not in known else joint.parent))
        known.add(edges[-1].far)
        left.remove(joint)
    return tuple(edges)


def _edge(joint: Joint, near: str) -> Edge:
    reverse = joint.parent != near
    return Edge(joint, near, joint.parent if reverse else joint.child, reverse)


def check_connected(mechanism: Mechanism, where: str) -> None:
    """Refuses a body that no joint connects to ground, and loops of F joints or of coupled joints alone."""
    tree, coupled = spanning_tree(mechanism), coupled_joints(mechanism)
    for joint in tree.cuts:
        if joint.name in coupled:
            what = "every joint of the loop that it closes has a coupled coordinate"
            raise DescriptionError(what, joint.where, "leave one of these couplings out: the loop moves that joint")
        if not joint.constrains:
            raise DescriptionError("F joints alone make a loop", joint.where, "remove one of them")
    reached = {GROUND, *(edge.far for edge in tree.edges)}
    for body in mechanism.bodies:
        if body.name not in reached:
            what = f"body '{body.name}' is not connected to {GROUND}"
            raise DescriptionError(what, where, "add the missing joint or remove it")


def output_body(mechanism: Mechanism) -> str:
    """The body with the most joints, the moving platform of a parallel mechanism."""
    sides = [side for joint in mechanism.joints for side in (joint.parent, joint.child)]
    return max((body.name for body in mechanism.bodies), key=sides.count)


def serial_chains(mechanism: Mechanism) -> tuple[tuple[Edge, ...], ...]:
    """The serial chains from ground to the output body (section 2.2), in the order of their first joints.

    Branches that are no simple chain between the two are left out.
    """
    target = output_body(mechanism)
    chains = []
    for first in mechanism.joints:
        if GROUND not in (first.parent, first.child):
            continue
        chain, joint, near = [], first, GROUND
        while True:
            chain.append(_edge(joint, near))
            far = chain[-1].far
            onward = [j for j in mechanism.joints if j is not joint and far in (j.parent, j.child)]
            if far == target or len(onward) != 1:
                break
            joint, near = onward[0], far
        if chain[-1].far == target:
            chains.append(tuple(chain))
    return tuple(chains)
