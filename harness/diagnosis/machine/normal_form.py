"""The normal form of a reading: its rigid bodies and the links between them, at a pose that closes its loops.

Bodies that welds, or three points, make one are one; points that two bodies have in common are a ball (one) or a hinge
(two); carriers without mass are part of the link that leads through them. Where the loops were cut is gone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.mechanics.matter import Matter, combined, displaced, of_body
from screwgauge.models.importing.closing import length_of
from screwgauge.models.importing.parts import Graph, graph_of
from screwgauge.models.kinematics import home, plant, rehomed, residual_at_home
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, skew
from screwgauge.witness.constraints import closed

#: Share of a machine's length, or angle [rad], below which lines meet and points are one; and gaps that are closed.
CLOSE, CLOSED = 1e-6, 1e-9
#: Below these a body has no mass [kg] and no inertia [kg m^2].
NO_MASS, NO_INERTIA = 1e-12, 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """A freedom of a link: a joint of the reading, or what its closures leave between two bodies.

    Attributes:
        kind: ``hinge``, ``slide``, ``ball`` or ``free``.
        screw: Of a hinge or slide, by which the far side moves against the near one, in the world; else zeros. (6,).
        centre: A point of it in the world. Shape (3,).
        joint: Its name; empty of closures, which `closures` names.
        turned: Whether the joint of the reading leads from far to near.
        points: Of closures, one or two, in the world; None of a joint. Shape (n, 3).
    """

    kind: str
    screw: Array
    centre: Array
    joint: str = ""
    closures: tuple[str, ...] = ()
    turned: bool = False
    points: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the joint or the closures."""
        return (self.joint,) if self.joint else self.closures

    @property
    def direction(self) -> Array:
        """Unit vector along a hinge or slide. Shape (3,)."""
        return self.screw[3:] if self.kind == "slide" else self.screw[:3]

    def reversed(self) -> Element:
        """The same seen from its other side."""
        return replace(self, screw=-self.screw, turned=not self.turned)


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """What keeps two bodies together.

    Attributes:
        near, far: Bodies of the machine.
        elements: Its freedoms, from the near body outwards.
        kind: R, P, C, U, S or F; else the letters of its freedoms.
        centre: Where the axes of a U or S meet [m], shape (3,); None of all others.
    """

    near: str
    far: str
    elements: tuple[Element, ...]
    kind: str
    centre: Array | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(each.joint for each in self.elements if each.joint)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all joints and closures, from the near body outwards."""
        return tuple(name for each in self.elements for name in each.names)

    @property
    def articulated(self) -> bool:
        """Whether joints are all that it consists of."""
        return all(each.joint for each in self.elements)

    def reversed(self) -> Link:
        """The same seen from its other body."""
        elements = tuple(each.reversed() for each in self.elements[::-1])
        return replace(self, near=self.far, far=self.near, elements=elements)

    def of(self, body: str) -> Link:
        """The same seen from one of its bodies."""
        return self if body == self.near else self.reversed()

    def joins(self, body: str) -> bool:
        """Whether it holds a body."""
        return body in (self.near, self.far)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body.

    Attributes:
        members: Bodies of the reading that are one with it.
        matter: In the world at the closed pose.
        frames: Of all that is part of it, by name, in the world. Shape (4, 4) each.
    """

    members: tuple[str, ...]
    matter: Matter
    frames: Mapping[str, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Machine:
    """A reading as a graph.

    Attributes:
        reading: At a pose that closes its loops, or as it was read where none does.
        bodies: By the name of one of their members; the ground among them.
        links: Between them.
        length: Of the machine [m].
    """

    reading: Reading
    bodies: Mapping[str, Body]
    links: tuple[Link, ...]
    length: float

    def at(self, body: str) -> list[Link]:
        """Links of a body, seen from it."""
        return [link.of(body) for link in self.links if link.joins(body)]

    def part_of(self, member: str) -> str:
        """The body that one of the reading is part of."""
        return next((name for name, body in self.bodies.items() if member in body.members), GROUND)


def machine_of(reading: Reading, keep: Collection[str] = ()) -> Machine:
    """The normal form.

    Args:
        keep: Bodies without mass that stay bodies.
    """
    reading = at_closed_pose(reading)
    length = length_of(reading)
    graph = graph_of(reading, length, simplified=False)
    bodies = {name: _body(reading, graph, name) for name in graph.parts}
    links = [*_chains(reading, graph), *_pins(graph)]
    links = [_classed(each, length) for each in _contracted(bodies, links, keep)]
    return Machine(reading, bodies, tuple(links), length)


def at_closed_pose(reading: Reading) -> Reading:
    """A reading with its home at the nearest pose that closes its loops; itself where it is closed, or none is near."""
    tree = plant(reading)
    if max(residual_at_home(tree).values(), default=0.0) <= CLOSED * length_of(reading) and not reading.couplings:
        return reading
    start = home(reading)
    there, fits = closed(tree, start)
    if not fits[0]:
        return reading
    moved = {n: there.q[0, at] for n, at in tree.places.items() if np.abs(there.q - start.q)[0, at].max() > CLOSED}
    return rehomed(reading, moved)[0]


def _body(reading: Reading, graph: Graph, name: str) -> Body:
    members = tuple(member for member, owner in graph.owner.items() if owner == name)
    matter, frames = Matter(0.0, np.zeros(3), np.zeros((3, 3))), dict[str, Array]()
    for member in members:
        if member == GROUND:
            frames |= {GROUND: np.eye(4), **reading.fixed}
            continue
        body = reading.bodies[member]
        frames |= {member: body.pose, **{link: body.pose @ T for link, T in body.fixed.items()}}
        part = displaced(of_body(body), body.pose)
        matter = combined(matter, part) if matter.mass or part.mass else part
    return Body(members, matter, frames)


def _chains(reading: Reading, graph: Graph) -> Iterable[Link]:
    """Links that joints make."""
    for chain in graph.chains:
        elements = tuple(_element(name, reading.joints[name]) for name in chain.joints)
        yield Link(chain.near, chain.far, elements, "")


def _element(name: str, joint: JointReading) -> Element:
    return Element(joint.kind, joint.screw, joint.centre, name)


def _pins(graph: Graph) -> Iterable[Link]:
    """Links that points make."""
    for pin in graph.pins:
        centre = pin.points.mean(axis=0)
        if len(pin.points) == 1:
            element = Element("ball", np.zeros(6), centre, "", pin.closures, points=pin.points)
        else:
            along = pin.points[1] - pin.points[0]
            along = along / np.linalg.norm(along)
            element = Element(
                "hinge", np.append(along, np.cross(centre, along)), centre, "", pin.closures, points=pin.points
            )
        yield Link(pin.first, pin.second, (element,), "")


def _contracted(bodies: dict[str, Body], links: list[Link], keep: Collection[str]) -> list[Link]:
    """Links through carriers without mass as one; the carriers are taken out of `bodies`."""
    for name in [n for n, body in bodies.items() if n != GROUND and not _solid(body) and not {*body.members} & {*keep}]:
        held = [link for link in links if link.joins(name)]
        if len(held) != 2:
            continue
        one, two = held[0].of(name).reversed(), held[1].of(name)
        if one.near == two.far or len(one.elements) + len(two.elements) > max(FREEDOMS.values()):
            continue
        links = [link for link in links if link not in held]
        links.append(Link(one.near, two.far, one.elements + two.elements, ""))
        del bodies[name]
    return links


def _solid(body: Body) -> bool:
    return body.matter.mass > NO_MASS or float(np.abs(body.matter.inertia).max()) > NO_INERTIA


def _classed(link: Link, length: float) -> Link:
    """A link with its kind and centre."""
    elements = link.elements
    kinds = [each.kind for each in elements]
    if kinds == ["ball"]:
        return replace(link, kind="S", centre=elements[0].centre)
    if sum(FREEDOMS[kind] for kind in kinds) == FREEDOMS["free"]:
        return replace(link, kind="F", centre=elements[-1].centre)
    letters = "".join({"hinge": "R", "slide": "P", "ball": "S", "free": "F"}[kind] for kind in kinds)
    if letters in ("RRR", "RR"):
        axes = np.array([each.direction for each in elements])
        rows = np.vstack([skew(axis) for axis in axes])
        offs = np.concatenate([np.cross(axis, each.centre) for axis, each in zip(axes, elements, strict=True)])
        point = np.linalg.lstsq(rows, offs, rcond=None)[0]
        meet = np.abs(rows @ point - offs).max() < CLOSE * length
        if meet and np.linalg.matrix_rank(axes, tol=CLOSE) == len(axes):
            return replace(link, kind="S" if len(axes) == 3 else "U", centre=point)
    if letters in ("RP", "PR") and np.linalg.norm(np.cross(elements[0].direction, elements[1].direction)) < CLOSE:
        return replace(link, kind="C")
    return replace(link, kind=min(letters, letters[::-1]))
