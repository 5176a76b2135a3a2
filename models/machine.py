"""The normal form of a reading: rigid bodies and the links between them, at a pose that closes its loops.

Bodies that welds or three points connect rigidly are merged; points shared by two bodies become a ball (one point) or a
hinge (two points); massless intermediate bodies become part of the link through them. The result does not depend on
where the loops were cut.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwgauge.models.kinds import SAME, kind_of, letters_of
from screwgauge.models.kinematics import home, length_of, rehome, residual_at_home, tree_of
from screwgauge.models.matter import NOTHING, Matter, combine, displace
from screwgauge.models.poses import relative, shortest_step
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.witness.constraints import close_loops

#: Largest gap of a closed loop [machine lengths].
CLOSED = 1e-9
#: Values up to which mass [kg] and inertia [kg m^2] of a body are negligible.
NO_MASS, NO_INERTIA = 1e-12, 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """An element of a link: a joint of the reading, or a joint that closures form between two bodies.

    Attributes:
        kind: ``hinge``, ``slide``, ``ball`` or ``free``.
        screw: For a hinge or slide, world-frame screw of the far side's motion relative to the near side; zeros for
            other kinds. Shape (6,).
        centre: World position of the centre, or of a point on the axis. Shape (3,).
        joint: Name of the joint; empty for closures, which `closures` lists.
        turned: True if the joint of the reading leads from the far to the near side.
    """

    kind: str
    screw: Array
    centre: Array
    joint: str = ""
    closures: tuple[str, ...] = ()
    turned: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joint or the closures."""
        return (self.joint,) if self.joint else self.closures

    @property
    def direction(self) -> Array:
        """Unit vector along the axis of a hinge or slide. Shape (3,)."""
        return self.screw[3:] if self.kind == "slide" else self.screw[:3]

    def reverse(self) -> Element:
        """Return the element seen from its far side."""
        return replace(self, screw=-self.screw, turned=not self.turned)

    def displace(self, T: Array) -> Element:
        """Displace the element in the world frame by T, shape (4, 4)."""
        R, p = T[:3, :3], T[:3, 3]
        way = R @ self.screw[:3]
        return replace(self, screw=np.append(way, R @ self.screw[3:] + np.cross(p, way)), centre=R @ self.centre + p)


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """An articulated connection between two bodies.

    Attributes:
        near, far: Bodies of the machine.
        elements: Joints of the link, from the near body outwards.
        kind: R, P, C, U, S or F, or else the letters of the elements.
        centre: Intersection of the axes of a U or S link [m], shape (3,); None for other kinds.
        step: Displacement that closes open loops when applied to the link's end on the far body; None for closed loops.
            Shape (4, 4).
    """

    near: str
    far: str
    elements: tuple[Element, ...]
    kind: str
    centre: Array | None = None
    step: Array | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(each.joint for each in self.elements if each.joint)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all joints and closures, from the near body outwards."""
        return tuple(name for each in self.elements for name in each.names)

    @property
    def letters(self) -> str:
        """Letters of the elements; they are the same as seen from either body."""
        return letters_of(self.elements)

    @property
    def articulated(self) -> bool:
        """True if the link consists of joints only."""
        return all(each.joint for each in self.elements)

    def reverse(self) -> Link:
        """Return the link seen from its far body."""
        link = self if self.step is None else self.displace(self.step)
        elements = tuple(each.reverse() for each in link.elements[::-1])
        back = None if self.step is None else np.asarray(np.linalg.inv(self.step))
        return replace(link, near=self.far, far=self.near, elements=elements, step=back)

    def displace(self, T: Array) -> Link:
        """Displace the link in the world frame by T, shape (4, 4), keeping `step`."""
        centre = None if self.centre is None else T[:3, :3] @ self.centre + T[:3, 3]
        return replace(self, elements=tuple(each.displace(T) for each in self.elements), centre=centre)

    def concatenate(self, other: Link) -> Link:
        """Concatenate this link and a link that continues from its far body."""
        steps = [each for each in (other.step, self.step) if each is not None]
        behind = other if self.step is None else other.displace(np.asarray(np.linalg.inv(self.step)))
        step = np.asarray(np.linalg.multi_dot([*steps, np.eye(4)])) if steps else None
        return Link(self.near, other.far, self.elements + behind.elements, "", step=step)

    def of(self, body: str) -> Link:
        """Return the link seen from a body, which must be one of its two bodies."""
        return self if body == self.near else self.reverse()

    def rename_body(self, name: str, other: str) -> Link:
        """Rename one of the two bodies."""
        near, far = (other if end == name else end for end in (self.near, self.far))
        return replace(self, near=near, far=far)

    def joins(self, body: str) -> bool:
        """Return True if a body is one of the two bodies of the link."""
        return body in (self.near, self.far)


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body.

    Attributes:
        members: Bodies of the reading that are merged into this body.
        pose: World pose of the member after which this body is named. Shape (4, 4).
        local: Mass properties in the frame of that member.
        frames: Name of each link or member that is part of the body -> world frame. Shape (4, 4) each.
    """

    members: tuple[str, ...]
    pose: Array
    local: Matter
    frames: Mapping[str, Array]

    @cached_property
    def matter(self) -> Matter:
        """Mass properties in the world frame."""
        return displace(self.local, self.pose)

    @property
    def solid(self) -> bool:
        """True if mass or inertia is not negligible."""
        return self.matter.mass > NO_MASS or float(np.abs(self.matter.inertia).max()) > NO_INERTIA


@dataclass(frozen=True, eq=False)
class Machine:
    """A reading as a graph of bodies and links.

    Attributes:
        reading: The reading, at the pose of the graph.
        bodies: Bodies, each named after one of its members, including the ground.
        links: Links between the bodies.
        length: Characteristic length of the machine [m].
        remarks: Sentences about bodies and joints that closures make redundant.
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
                around.setdefault(link.far, []).append(link.reverse())
        return around

    def at(self, body: str) -> list[Link]:
        """Return the links of a body, seen from that body."""
        return self._around.get(body, [])

    def part_of(self, member: str) -> str:
        """Return the body that contains a body of the reading."""
        return next((name for name, body in self.bodies.items() if member in body.members), GROUND)


def machine_of(reading: Reading) -> Machine:
    """Build the normal form at a pose that closes the loops, or at the home pose if no such pose is near."""
    machine = graph_at_home(at_closed_pose(reading))
    machine = contract(machine, [name for name, body in machine.bodies.items() if not body.solid])
    idle = [link for link in machine.links if link.kind == "F" and _is_held(machine, link)]
    return replace(machine, links=tuple(link for link in machine.links if link not in idle)) if idle else machine


def _is_held(machine: Machine, free: Link) -> bool:
    """Return True if the two bodies of a free link are also connected through other links."""
    reached, queue = {free.near}, [free.near]
    for body in queue:
        ends = {end for each in machine.at(body) if {*each.names} != {*free.names} for end in (each.near, each.far)}
        queue += sorted(ends - reached)
        reached |= ends
    return free.far in reached


def fuse(machine: Machine, link: Link) -> Machine:
    """Merge the two bodies of a link, and drop the links between them."""
    near, far = sorted((link.near, link.far), key=lambda name: name != GROUND)
    one, two = machine.bodies[near], machine.bodies[far]
    body = Body(
        one.members + two.members,
        one.pose,
        combine(one.local, displace(two.local, relative(one.pose, two.pose))),
        {**one.frames, **two.frames},
    )
    bodies = {name: body if name == near else each for name, each in machine.bodies.items() if name != far}
    links = [each.rename_body(far, near) for each in machine.links]
    return replace(machine, bodies=bodies, links=tuple(each for each in links if each.near != each.far))


def at_closed_pose(reading: Reading) -> Reading:
    """Move the home pose of a reading to the nearest pose that closes its loops, unless no such pose is near."""
    tree = tree_of(reading)
    if max(residual_at_home(tree).values(), default=0.0) <= CLOSED * length_of(reading) and not reading.couplings:
        return reading
    start = home(reading)
    there, fits = close_loops(tree, start)
    if not fits[0]:
        return reading
    moved = {n: there.q[0, at] for n, at in tree.places.items() if np.abs(there.q - start.q)[0, at].max() > CLOSED}
    return rehome(reading, moved)[0]


def graph_at_home(reading: Reading) -> Machine:
    """Build the graph of a reading at its home pose; keep massless bodies and leave the kinds of links empty."""
    length = length_of(reading)
    rigid, pins = _sorted_closures(reading, length)
    owner, shift, joined = _owners([GROUND, *reading.bodies], rigid)
    copies = {name for name, body in reading.bodies.items() if body.copy_of}
    remarks = [f"Closures join '{b}' and '{a}' rigidly; they become one body." for b, a in joined if b not in copies]
    links = list[Link]()
    for name, body in reading.bodies.items():
        near, far = owner[body.near], owner[name]
        if near != far:
            elements = tuple(_element(joint, reading.joints[joint]) for joint in body.joints)
            links.append(_merged_link(Link(body.near, name, elements, ""), owner, shift))
            continue
        remarks += [f"Joint '{joint}' is locked by closures and left out." for joint in body.joints]
    links += [_merged_link(pin, owner, shift) for pin in pins if owner[pin.near] != owner[pin.far]]
    bodies = {name: _body(reading, owner, shift, name) for name, root in owner.items() if name == root}
    return Machine(reading, bodies, tuple(links), length, tuple(remarks))


def _owners(
    bodies: Sequence[str], rigid: Iterable[tuple[str, str, Array | None]]
) -> tuple[dict[str, str], dict[str, Array], list[tuple[str, str]]]:
    """Return body -> merged body; body -> displacement that closes open loops, shape (4, 4); and the merged pairs.

    Args:
        rigid: Pairs of rigidly connected bodies, and the displacement of the second body that closes their gap, if any.
    """
    owner, shift, joined = {name: name for name in bodies}, dict.fromkeys(bodies, np.eye(4)), list[tuple[str, str]]()
    for first, second, step in rigid:
        a, b = owner[first], owner[second]
        if a == b:
            continue
        onto = np.eye(4) if step is None else step
        if b == GROUND:
            a, b, first, second, onto = b, a, second, first, np.asarray(np.linalg.inv(onto))
        if step is not None or shift[first] is not shift[second]:
            onto = shift[first] @ onto @ np.linalg.inv(shift[second])
            shift |= {name: onto @ shift[name] for name, root in owner.items() if root == b}
        owner = {name: a if root == b else root for name, root in owner.items()}
        joined.append((b, a))
    return owner, shift, joined


def _sorted_closures(reading: Reading, length: float) -> tuple[list[tuple[str, str, Array | None]], list[Link]]:
    """Return pairs of bodies that closures merge, and links through one common point or two points of a common axis.

    Returns:
        Pairs of bodies, each with the displacement of the second body that closes the gap, shape (4, 4), or None if
        there is no gap; and the links.
    """
    rigid, points = list[tuple[str, str, Array | None]](), dict[tuple[str, str], dict[str, Array]]()
    for name, closure in reading.closures.items():
        (one, T1), (other, T2) = reading.ends(name)
        if closure.kind == "weld":
            open_ = np.abs(T1 - T2).max() > CLOSED * length
            rigid.append((one, other, np.asarray(T1 @ np.linalg.inv(T2)) if open_ else None))
        else:
            at = (one, T1[:3, 3]), (other, T2[:3, 3])
            near, far = sorted(at, key=lambda end: end[0])
            points.setdefault((near[0], far[0]), {})[name] = np.array([near[1], far[1]])
    pins = list[Link]()
    for (first, second), named in points.items():
        clouds = np.array([*named.values()]).swapaxes(0, 1)  # points of the first and of the second body
        _, s, Vt = np.linalg.svd(clouds[0] - clouds[0].mean(axis=0))
        spread = int(np.sum(s > SAME * length))
        if spread >= 2:
            rigid.append((first, second, None))
            continue
        along = (clouds[0] - clouds[0, 0]) @ Vt[0]
        chosen = [int(np.argmin(along)), int(np.argmax(along))] if spread else [0]
        open_ = np.abs(clouds[0] - clouds[1]).max() > CLOSED * length
        here, there = (_pin(cloud[chosen], tuple(named)) for cloud in clouds)
        step = shortest_step((here.direction, here.centre), (there.direction, there.centre)) if open_ else None
        pins.append(Link(first, second, (here,), "", step=step))
    return rigid, pins


def _pin(points: Array, closures: tuple[str, ...]) -> Element:
    """Return a ball at one point, or a hinge through two points."""
    centre = points.mean(axis=0)
    if len(points) == 1:
        return Element("ball", np.zeros(6), centre, "", closures)
    along = points[1] - points[0]
    along = along / (np.linalg.norm(along) or 1.0)
    return Element("hinge", np.append(along, np.cross(centre, along)), centre, "", closures)


def _merged_link(link: Link, owner: Mapping[str, str], shift: Mapping[str, Array]) -> Link:
    """Convert a link between bodies of the reading to a link between merged bodies, displaced by `shift`."""
    near, far = shift[link.near], shift[link.far]
    found = replace(link, near=owner[link.near], far=owner[link.far])
    if near is far and link.step is None:
        return found
    step = far @ (np.eye(4) if link.step is None else link.step) @ np.linalg.inv(near)
    return replace(found.displace(near), step=np.asarray(step))


def _element(name: str, joint: JointReading) -> Element:
    return Element(joint.kind, joint.screw, joint.centre, name)


def _body(reading: Reading, owner: Mapping[str, str], shift: Mapping[str, Array], name: str) -> Body:
    members = tuple(member for member, root in owner.items() if root == name)
    frames = {GROUND: np.eye(4), **reading.fixed} if name == GROUND else {}
    pose, local = (np.eye(4), NOTHING) if name == GROUND else (reading.bodies[name].pose, reading.bodies[name])
    for member in members:
        if member == GROUND:
            continue
        body = reading.bodies[member]
        there = shift[member] @ body.pose
        frames |= {member: there, **{link: there @ T for link, T in body.fixed.items()}}
        if member != name:
            local = combine(local, displace(body, relative(pose, there)))
    return Body(members, pose, local, frames)


def contract(machine: Machine, carriers: Iterable[str]) -> Machine:
    """Merge the two links of each massless body unless the result has more than six elements; set the kinds of links.

    Args:
        carriers: Massless bodies; bodies that do not have exactly two links are kept.
    """
    bodies, links = dict(machine.bodies), list(machine.links)
    for name in carriers:
        held = [link for link in links if link.joins(name)]
        if name == GROUND or len(held) != 2:
            continue
        one, two = held[0].of(name).reverse(), held[1].of(name)
        if one.near == two.far or len(one.elements) + len(two.elements) > max(FREEDOMS.values()):
            continue
        links[links.index(held[0])] = one.concatenate(two)
        links.remove(held[1])
        del bodies[name]
    return replace(machine, bodies=bodies, links=tuple(_classify(link, machine.length) for link in links))


def _classify(link: Link, length: float) -> Link:
    kind, centre = kind_of(link.elements, length)
    return replace(link, kind=kind, centre=centre)
