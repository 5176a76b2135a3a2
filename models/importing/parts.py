"""A closed reading as a graph: rigid parts in the world at home, and the chains of joints between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from screwgauge.models.importing.left_out import listed
from screwgauge.models.readings.assemble import joined
from screwgauge.models.readings.reading import ClosureReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: Share of the model's length below which points are one.
SAME = 1e-9


@dataclass(slots=True)
class Part:
    """What moves as one.

    Attributes:
        pose: World pose at home of the body that gives it its name and frame. Shape (4, 4).
        mass: [kg]; com [m], shape (3,); inertia about it [kg m^2], shape (3, 3): in its frame.
    """

    name: str
    pose: Array
    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def absorb(self, other: Part) -> None:
        """Adds another's mass."""
        if other.mass:
            own, T = (self.mass, self.com, self.inertia, np.eye(4)), np.linalg.inv(self.pose) @ other.pose
            self.mass, self.com, self.inertia = joined([own, (other.mass, other.com, other.inertia, T)])


@dataclass(frozen=True, slots=True)
class Chain:
    """Joints one after the other, through bodies without mass that nothing else is fixed to."""

    near: str
    joints: tuple[str, ...]
    far: str


@dataclass(frozen=True, slots=True)
class Pin:
    """Points (in the world at home, one or two) that two parts have in common, shape (n, 3), and their closures."""

    name: str
    first: str
    second: str
    points: Array
    closures: tuple[str, ...] = ()


@dataclass(slots=True)
class Graph:
    """Parts by name, and what joins them.

    Attributes:
        owner: Body, or the ground -> the part that it is one with.
        length: Of the model [m].
        remarks: What was simplified, a sentence each.
    """

    parts: dict[str, Part]
    chains: list[Chain]
    pins: list[Pin]
    length: float
    remarks: list[str]
    owner: dict[str, str]


def graph_of(reading: Reading, length: float, *, simplified: bool = True) -> Graph:
    """The graph of a reading whose loops are closed at home.

    Args:
        simplified: Without idle bodies, and with chains that lead through one body as one.
    """
    remarks: list[str] = []
    rigid, pins = _sorted_closures(reading, length)
    owner = {name: name for name in (GROUND, *reading.bodies)}
    for first, second in rigid:
        a, b = owner[first], owner[second]
        a, b = (b, a) if b == GROUND else (a, b)
        owner = {name: a if root == b else root for name, root in owner.items()}
        if a != b:
            remarks.append(f"'{b}' is one body with '{a}', as closures keep them together.")
    parts = {GROUND: Part(GROUND, np.eye(4))}
    for name, body in reading.bodies.items():
        parts[name] = Part(name, body.pose, body.mass, body.com, body.inertia)
    for name in reading.bodies:
        if owner[name] != name:
            parts[owner[name]].absorb(parts.pop(name))
    chains = [Chain(owner[body.near], body.joints, owner[name]) for name, body in reading.bodies.items()]
    locked = [chain for chain in chains if chain.near == chain.far and chain.joints]
    remarks += [f"Joint '{joint}' is held by closures, and left out." for c in locked for joint in c.joints]
    graph = Graph(parts, [chain for chain in chains if chain.near != chain.far], [], length, remarks, owner)
    for pin in pins:
        if owner[pin.first] != owner[pin.second]:
            graph.pins.append(replace(pin, first=owner[pin.first], second=owner[pin.second]))
    if not simplified:
        return graph
    _prune(graph, {entry.of for entry in reading.couplings.values()} - {""})
    _join(graph)
    return graph


def _sorted_closures(reading: Reading, length: float) -> tuple[list[tuple[str, str]], list[Pin]]:
    """Pairs of bodies that closures make one, and points that others have in common: one, or two of an axis."""
    rigid, points = [], dict[tuple[str, str], list[tuple[str, Array]]]()
    for name, closure in reading.closures.items():
        if closure.kind == "weld":
            rigid.append((closure.first, closure.second))
        else:
            pair = min(closure.first, closure.second), max(closure.first, closure.second)
            points.setdefault(pair, []).append((name, _point(reading, closure)))
    pins = list[Pin]()
    for (first, second), named in points.items():
        name = named[0][0] if len(named) == 1 else named[0][0].removesuffix(".1")
        cloud = np.array([point for _, point in named])
        _, s, Vt = np.linalg.svd(cloud - cloud.mean(axis=0))
        spread = int(np.sum(s > SAME * length))
        if spread >= 2:
            rigid.append((first, second))
            continue
        along = (cloud - cloud[0]) @ Vt[0]
        ends = cloud[[int(np.argmin(along)), int(np.argmax(along))]] if spread else cloud[:1]
        pins.append(Pin(name, first, second, ends, tuple(closure for closure, _ in named)))
    return rigid, pins


def _point(reading: Reading, closure: ClosureReading) -> Array:
    """Where a closure is at home, on its first body."""
    pose = np.eye(4) if closure.first == GROUND else reading.bodies[closure.first].pose
    return np.asarray((pose @ closure.first_frame)[:3, 3])


def _prune(graph: Graph, followed: set[str]) -> None:
    """Leaves out bodies without mass that carry nothing, but for those of joints that others follow."""
    while True:
        used = {chain.near for chain in graph.chains} | {side for pin in graph.pins for side in (pin.first, pin.second)}
        ends = [c for c in graph.chains if not graph.parts[c.far].mass and c.far not in used]
        idle = [c for c in ends if _ends(graph, c.far) == 1 and not followed & {*c.joints}]
        if not idle:
            return
        for chain in idle:
            graph.chains.remove(chain)
            del graph.parts[chain.far]
            graph.remarks.append(
                f"'{chain.far}' has no mass and carries nothing; left out with {listed(chain.joints)}."
            )


def _ends(graph: Graph, name: str) -> int:
    """How many chains and pins a part has."""
    sides = [side for chain in graph.chains for side in (chain.near, chain.far)]
    return [*sides, *(side for pin in graph.pins for side in (pin.first, pin.second))].count(name)


def _join(graph: Graph) -> None:
    """Joins chains through bodies without mass that nothing else is fixed to: the crosses of universal joints."""
    for name in [name for name, part in graph.parts.items() if not part.mass and name != GROUND]:
        into = [chain for chain in graph.chains if chain.far == name]
        out = [chain for chain in graph.chains if chain.near == name]
        if len(into) == len(out) == 1 and _ends(graph, name) == 2 and into[0].near != out[0].far:
            one, two = into[0], out[0]
            graph.chains.remove(two)
            graph.chains[graph.chains.index(one)] = Chain(one.near, one.joints + two.joints, two.far)
            del graph.parts[name]
