"""The normal form of a reading: its rigid bodies and the links between them, at a pose that closes its loops.

Bodies that welds, or three points, make one are one; points that two bodies have in common are a ball (one) or a hinge
(two); carriers without mass are part of the link that leads through them. Where the loops were cut is gone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwgauge.models.kinematics import home, length_of, plant, rehomed, residual_at_home
from screwgauge.models.matter import NOTHING, Matter, combined, displaced
from screwgauge.models.poses import relative
from screwgauge.models.readings.reading import FREEDOMS, ClosureReading, JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import closed

#: Share of a machine's length, or angle [rad], below which lines meet; below which points are one; of gaps if closed.
CLOSE, SAME, CLOSED = 1e-6, 1e-9, 1e-9
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
        """Names of the joint or the closures."""
        return (self.joint,) if self.joint else self.closures

    @property
    def direction(self) -> Array:
        """Unit vector along a hinge or slide. Shape (3,)."""
        return self.screw[3:] if self.kind == "slide" else self.screw[:3]

    def reversed(self) -> Element:
        """The element seen from its other side."""
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
        """Names of all joints and closures, from the near body outwards."""
        return tuple(name for each in self.elements for name in each.names)

    @property
    def letters(self) -> str:
        """Letters of its freedoms, whichever body it is seen from."""
        return letters_of(self.elements)

    @property
    def articulated(self) -> bool:
        """Whether joints are all that it consists of."""
        return all(each.joint for each in self.elements)

    def reversed(self) -> Link:
        """The link seen from its other body."""
        elements = tuple(each.reversed() for each in self.elements[::-1])
        return replace(self, near=self.far, far=self.near, elements=elements)

    def of(self, body: str) -> Link:
        """The link seen from one of its bodies."""
        return self if body == self.near else self.reversed()

    def joins(self, body: str) -> bool:
        """Whether it holds a body."""
        return body in (self.near, self.far)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body.

    Attributes:
        members: Bodies of the reading that are one with it.
        pose: World pose of the one that it is named after. Shape (4, 4).
        local: Its matter in that frame; `matter` in the world.
        frames: Of all that is part of it, by name, in the world. Shape (4, 4) each.
    """

    members: tuple[str, ...]
    pose: Array
    local: Matter
    matter: Matter
    frames: Mapping[str, Array]

    @property
    def solid(self) -> bool:
        """Whether it has mass or inertia worth the name."""
        return self.matter.mass > NO_MASS or float(np.abs(self.matter.inertia).max()) > NO_INERTIA


@dataclass(frozen=True, eq=False)
class Machine:
    """A reading as a graph.

    Attributes:
        reading: At the pose that the graph shows.
        bodies: By the name of one of their members; the ground among them.
        links: Between them.
        length: Of the machine [m].
        remarks: Which bodies and joints closures make superfluous, a sentence each.
    """

    reading: Reading
    bodies: Mapping[str, Body]
    links: tuple[Link, ...]
    length: float
    remarks: tuple[str, ...] = ()

    @cached_property
    def _around(self) -> Mapping[str, list[Link]]:
        around: dict[str, list[Link]] = {}
        for link in self.links:
            around.setdefault(link.near, []).append(link)
            if link.far != link.near:
                around.setdefault(link.far, []).append(link.reversed())
        return around

    def at(self, body: str) -> list[Link]:
        """Links of a body, seen from it."""
        return self._around.get(body, [])

    def part_of(self, member: str) -> str:
        """The body that one of the reading is part of."""
        return next((name for name, body in self.bodies.items() if member in body.members), GROUND)


def machine_of(reading: Reading) -> Machine:
    """The normal form, at a pose that closes the loops if there is one near."""
    machine = uncontracted(at_closed_pose(reading))
    return contracted(machine, [name for name, body in machine.bodies.items() if not body.solid])


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


def uncontracted(reading: Reading) -> Machine:
    """Bodies and links at the home of a reading, bodies without mass among them; links have no kind yet."""
    length = length_of(reading)
    rigid, pins = _sorted_closures(reading, length)
    owner, remarks = {name: name for name in (GROUND, *reading.bodies)}, list[str]()
    for first, second in rigid:
        a, b = owner[first], owner[second]
        a, b = (b, a) if b == GROUND else (a, b)
        owner = {name: a if root == b else root for name, root in owner.items()}
        if a != b:
            remarks.append(f"'{b}' is one body with '{a}', as closures keep them together.")
    links = list[Link]()
    for name, body in reading.bodies.items():
        near, far = owner[body.near], owner[name]
        if near != far:
            links.append(Link(near, far, tuple(_element(joint, reading.joints[joint]) for joint in body.joints), ""))
            continue
        remarks += [f"Joint '{joint}' is held by closures, and left out." for joint in body.joints]
    links += [
        replace(pin, near=owner[pin.near], far=owner[pin.far]) for pin in pins if owner[pin.near] != owner[pin.far]
    ]
    bodies = {name: _body(reading, owner, name) for name, root in owner.items() if name == root}
    return Machine(reading, bodies, tuple(links), length, tuple(remarks))


def _sorted_closures(reading: Reading, length: float) -> tuple[list[tuple[str, str]], list[Link]]:
    """Pairs of bodies that closures make one, and links by a point, or two of an axis, that others have in common."""
    rigid, points = [], dict[tuple[str, str], dict[str, Array]]()
    for name, closure in reading.closures.items():
        if closure.kind == "weld":
            rigid.append((closure.first, closure.second))
        else:
            pair = min(closure.first, closure.second), max(closure.first, closure.second)
            points.setdefault(pair, {})[name] = _point(reading, closure)
    pins = list[Link]()
    for (first, second), named in points.items():
        cloud = np.array([*named.values()])
        _, s, Vt = np.linalg.svd(cloud - cloud.mean(axis=0))
        spread = int(np.sum(s > SAME * length))
        if spread >= 2:
            rigid.append((first, second))
            continue
        along = (cloud - cloud[0]) @ Vt[0]
        ends = cloud[[int(np.argmin(along)), int(np.argmax(along))]] if spread else cloud[:1]
        pins.append(Link(first, second, (_pin(ends, tuple(named)),), ""))
    return rigid, pins


def _point(reading: Reading, closure: ClosureReading) -> Array:
    """Position of a closure at home, on its first body."""
    pose = np.eye(4) if closure.first == GROUND else reading.bodies[closure.first].pose
    return np.asarray((pose @ closure.first_frame)[:3, 3])


def _pin(points: Array, closures: tuple[str, ...]) -> Element:
    """A ball of one point, or a hinge of two."""
    centre = points.mean(axis=0)
    if len(points) == 1:
        return Element("ball", np.zeros(6), centre, "", closures, points=points)
    along = points[1] - points[0]
    along = along / np.linalg.norm(along)
    return Element("hinge", np.append(along, np.cross(centre, along)), centre, "", closures, points=points)


def _element(name: str, joint: JointReading) -> Element:
    return Element(joint.kind, joint.screw, joint.centre, name)


def _body(reading: Reading, owner: Mapping[str, str], name: str) -> Body:
    members = tuple(member for member, root in owner.items() if root == name)
    frames = {GROUND: np.eye(4), **reading.fixed} if name == GROUND else {}
    pose, local = (np.eye(4), NOTHING) if name == GROUND else (reading.bodies[name].pose, reading.bodies[name])
    for member in members:
        if member == GROUND:
            continue
        body = reading.bodies[member]
        frames |= {member: body.pose, **{link: body.pose @ T for link, T in body.fixed.items()}}
        if member != name:
            local = combined(local, displaced(body, relative(pose, body.pose)))
    return Body(members, pose, local, displaced(local, pose), frames)


def contracted(machine: Machine, carriers: Iterable[str]) -> Machine:
    """A machine with the two links of each carrier as one, if a joint can have so many freedoms; links by kind.

    Args:
        carriers: Bodies without mass; those that have other than two links stay.
    """
    bodies, links = dict(machine.bodies), list(machine.links)
    for name in carriers:
        held = [link for link in links if link.joins(name)]
        if name == GROUND or len(held) != 2:
            continue
        one, two = held[0].of(name).reversed(), held[1].of(name)
        if one.near == two.far or len(one.elements) + len(two.elements) > max(FREEDOMS.values()):
            continue
        links[links.index(held[0])] = Link(one.near, two.far, one.elements + two.elements, "")
        links.remove(held[1])
        del bodies[name]
    return replace(machine, bodies=bodies, links=tuple(_classed(link, machine.length) for link in links))


def _classed(link: Link, length: float) -> Link:
    kind, centre = kind_of(link.elements, length)
    return replace(link, kind=kind, centre=centre)


def kind_of(elements: Sequence[Element], length: float) -> tuple[str, Array | None]:
    """Kind of a link of these freedoms, as in `Link.kind`, and where the axes of a U, S or F meet."""
    kinds = [each.kind for each in elements]
    if kinds == ["ball"]:
        return "S", elements[0].centre
    if sum(FREEDOMS[kind] for kind in kinds) == FREEDOMS["free"]:
        return "F", elements[-1].centre
    letters = letters_of(elements)
    if letters in ("RRR", "RR") and (centre := _meeting(elements, length)) is not None:
        return ("S" if len(elements) == 3 else "U"), centre
    if letters == "PR" and np.linalg.norm(np.cross(elements[0].direction, elements[1].direction)) < CLOSE:
        return "C", None
    return letters, None


def letters_of(elements: Sequence[Element]) -> str:
    """Letters of freedoms in the order from whichever side comes first in the alphabet."""
    letters = "".join({"hinge": "R", "slide": "P", "ball": "S", "free": "F"}[each.kind] for each in elements)
    return min(letters, letters[::-1])


def _meeting(hinges: Sequence[Element], length: float) -> Array | None:
    """The point in which hinges of independent directions meet; None if they do not. Shape (3,)."""
    axes = np.array([each.direction for each in hinges])
    if np.linalg.matrix_rank(axes, tol=CLOSE) < len(axes):
        return None
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    centres = np.array([each.centre for each in hinges])
    point = np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, centres))
    # where one of the points given is the one, it is exact
    exact = centres[np.linalg.norm(centres - point, axis=1) < SAME * length]
    meet = np.linalg.norm(np.einsum("nij,nj->ni", across, point - centres), axis=1).max() < CLOSE * length
    return np.asarray([*exact, point][0]) if meet else None
