"""Two models of one machine with their loops cut at the same links, wherever their files cut them.

Both get the tree that most of their joints have in common. A link that is no part of it is closed by points, if it is a
ball or a hinge, whether its file has a joint there or not; one that is part of it and that a file closes by points gets
a joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from screwgauge.diagnosis.machine.alignment import Alignment
from screwgauge.diagnosis.properties import Change, applied
from screwgauge.diagnosis.transformations import joined
from screwgauge.models.kinematics import rehomed
from screwgauge.models.machine import Element, Link, Machine, machine_of
from screwgauge.models.poses import matrix, screw
from screwgauge.models.readings.reading import BodyReading, ClosureReading, JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, rotation, rotation_vector

#: Kinds of links that points can close, and where these are along the axis, in lengths of the machine.
POINTS = {"S": (0.0,), "R": (-0.05, 0.05)}

_Pairs = Sequence[tuple[Link, Link]]


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """Joints in place of closures, or a ball in place of three hinges.

    Attributes:
        joints: Their names, those of the other model -> their coordinates there.
        axes: Unit vectors of hinges in the world; none of a ball. Shape (n, 3).
        turn: How the descendants have to be displaced to stand as in the other model. Shape (4, 4).
        hinges: That the ball replaces; none where it replaces closures.
    """

    joints: Mapping[str, float]
    axes: Array
    turn: Array
    hinges: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A link of the tree.

    Attributes:
        link: Names of its joints and closures, from the ground outwards.
        body: The member that the body at its far end is named after.
        made: Joints in place of others, by the first of these.
    """

    link: tuple[str, ...]
    body: str
    made: Mapping[str, Made] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Pointed:
    """A link whose joints become points.

    Attributes:
        joints: Their names, from the ground outwards.
        names: Of the points.
        places: Near them, in the world: the link itself determines where. Shape (n, 3).
        partners: Joints of the other model's link; none of one that is closed by points there, too.
    """

    joints: tuple[str, ...]
    names: tuple[str, ...]
    places: Array
    partners: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Where a model is cut to be compared.

    Attributes:
        branches: Its tree, from the ground outwards.
        points: Links that become points.
    """

    branches: tuple[Branch, ...]
    points: tuple[Pointed, ...] = ()

    @property
    def merged(self) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]:
        """Hinges that become a ball, and that ball of the other model."""
        made = (one for branch in self.branches for one in branch.made.values())
        return tuple((one.hinges, tuple(one.joints)) for one in made if one.hinges)

    @property
    def moved(self) -> tuple[str, ...]:
        """Joints that become points, and those that are made of points."""
        made = (name for branch in self.branches for one in branch.made.values() for name in one.joints)
        return (*(name for link in self.points for name in link.joints), *made)


def cuts(a: Machine, b: Machine, alignment: Alignment) -> tuple[Cut | None, Cut | None]:
    """Cuts of both that give them one tree; None for a model that has it. None for both where there is no such tree."""
    tree = _tree(alignment.links, {*_bound(a.reading), *_bound(b.reading)})
    rest = [pair for pair in alignment.links if not any(pair[0].names in _both(link) for link, _ in tree)]
    back = [(other, one) for one, other in tree], [(other, one) for one, other in rest]
    there = {alignment.bodies[name]: np.asarray(np.linalg.inv(T)) for name, T in alignment.placed.items()}
    try:
        one = _cut((a, b), tree, rest, alignment.only_a, there)
        two = _cut((b, a), *back, alignment.only_b, alignment.placed, follows=True)
    except _UncutError:
        return None, None
    return None if _as_read(a, one) else one, None if _as_read(b, two) else two


class _UncutError(Exception):
    """There is no tree that both models can be given."""


def _both(link: Link) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return link.names, link.reversed().names


def _bound(reading: Reading) -> set[str]:
    """Joints that are driven or coupled."""
    bound = {joint for joint, _ in reading.actuators.values()}
    return bound | {joint for coupling in reading.couplings.values() for joint in (coupling.joint, coupling.of)}


def _tree(pairs: _Pairs, bound: set[str]) -> list[tuple[Link, Link]]:
    """The links of a tree, from the ground outwards: as many as can be that are the same joints in both."""
    reached, tree, waiting = {GROUND}, list[tuple[Link, Link]](), list(pairs)
    while True:
        edges = [pair for pair in waiting if (pair[0].near in reached) != (pair[0].far in reached)]
        if not edges:
            return tree
        one, other = min(edges, key=lambda pair: _rank(pair[0], pair[1], bound))
        waiting = [pair for pair in waiting if pair[0] is not one]
        if one.near not in reached:
            one, other = one.reversed(), other.reversed()
        reached.add(one.far)
        tree.append((one, other))


def _shapes(link: Link) -> list[str]:
    return [each.kind for each in link.elements]


def _rank(one: Link, other: Link, bound: set[str]) -> int:
    """How much there is for cutting elsewhere than at a link."""
    same = _shapes(one) == _shapes(other)
    jointed = one.articulated, other.articulated
    if bound & {*one.joints, *other.joints} or one.kind not in POINTS:
        return 0
    if all(jointed):
        return 1 if same else 4
    return 2 if jointed[1] else 3 if jointed[0] else 5


def _cut(
    machines: tuple[Machine, Machine],
    tree: _Pairs,
    rest: _Pairs,
    alone: Sequence[Link],
    placed: Mapping[str, Array],
    *,
    follows: bool = False,
) -> Cut:
    """The cut of the first of two machines.

    Args:
        follows: Its points are where those of the other one are, if both have to be made.
        tree, rest: Pairs of its links and the other's.
        alone: Its links without a partner.
        placed: Body of the other one -> placement of the first one's world in the other's. Shape (4, 4).
    """
    own, other = machines
    branches = [_branch(own, other, pair, placed) for pair in tree]
    reached, left = {GROUND, *(link.far for link, _ in tree)}, list(alone)
    while edges := [link for link in left if link.articulated and (link.near in reached) != (link.far in reached)]:
        link = edges[0] if edges[0].near in reached else edges[0].reversed()
        left = [each for each in left if each.names not in _both(link)]
        reached.add(link.far)
        branches.append(Branch(link.names, _main(own, link.far, ())))
    points = list[Pointed]()
    for link, partner in [*rest, *((link, None) for link in left)]:
        if not link.joints:
            continue
        if not link.articulated or link.kind not in POINTS:
            raise _UncutError
        there = partner if partner is not None and (follows or not partner.joints) else None
        names, places = _points((own, other), link, there, placed)
        points.append(Pointed(link.names, names, places, partner.joints if partner is not None else ()))
    if lost := {*own.bodies} - reached:
        raise _UncutError(lost)
    return Cut(tuple(branches), tuple(points))


def _main(machine: Machine, body: str, names: Sequence[str]) -> str:
    """The member that a body is named after: one of some names, or the heaviest."""
    bodies = machine.reading.bodies
    return max(machine.bodies[body].members, key=lambda name: (name in names, bodies[name].mass))


def _points(
    machines: tuple[Machine, Machine], link: Link, partner: Link | None, placed: Mapping[str, Array]
) -> tuple[tuple[str, ...], Array]:
    """Names of the points that close a link, and places near them: where they are in the other model, or are made."""
    own, other = machines
    if partner is None:
        return _made(link, own.length)
    names, places = _made(partner, other.length)
    back = np.linalg.inv(placed[partner.near])
    return names, places @ back[:3, :3].T + back[:3, 3]


def _made(link: Link, length: float) -> tuple[tuple[str, ...], Array]:
    """The points of a link."""
    element = link.elements[0]
    if element.points is not None and len(element.closures) == len(element.points):
        return element.closures, element.points
    along = element.direction if link.kind == "R" else np.zeros(3)
    centre = link.centre if link.centre is not None else element.centre
    places = np.array([centre + share * length * along for share in POINTS[link.kind]])
    return tuple(f"{link.joints[0]}.{i + 1}" for i in range(len(places))), places


def _branch(own: Machine, other: Machine, pair: tuple[Link, Link], placed: Mapping[str, Array]) -> Branch:
    link, partner = pair
    made = {}
    if link.articulated and partner.articulated and _shapes(link) != _shapes(partner) == ["ball"]:
        turn = np.asarray(np.linalg.inv(placed[partner.near]) @ placed[partner.far])
        made[link.joints[0]] = Made({partner.joints[0]: 0.0}, np.zeros((0, 3)), turn, link.joints)
    for i, element in enumerate(link.elements):
        if element.joint:
            continue
        whole = len(link.elements) == 1
        if not partner.articulated or (not whole and len(partner.elements) != len(link.elements)):
            raise _UncutError
        theirs = partner.elements if whole else partner.elements[i : i + 1]
        near, far = placed[partner.near], placed[partner.far]
        turn = np.asarray(np.linalg.inv(near) @ far)
        axes = [near[:3, :3].T @ each.direction for each in theirs]
        hinges = np.array(axes if theirs[0].kind == "hinge" else []).reshape(-1, 3)
        homes = {each.joint: other.reading.joints[each.joint].home for each in theirs}
        made[element.names[0]] = Made(homes, hinges, turn)
    return Branch(link.names, _main(own, link.far, other.bodies[partner.far].members), made)


def _as_read(machine: Machine, cut: Cut) -> bool:
    """Whether a cut is that of the reading itself."""
    if cut.points or any(branch.made for branch in cut.branches):
        return False
    if any(len(body.members) > 1 for name, body in machine.bodies.items() if name != GROUND):
        return False
    links, reached = {frozenset(link.names): link for link in machine.links}, {GROUND}
    for branch in cut.branches:
        link = links[frozenset(branch.link)]
        link = link if link.near in reached else link.reversed()
        reached.add(link.far)
        if any(element.turned for element in link.elements):
            return False
    return {name for branch in cut.branches for name in branch.link} == {*machine.reading.joints}


def recut(reading: Reading, cut: Cut | None) -> Reading:
    """A reading with its loops cut elsewhere."""
    if cut is None:
        return reading
    machine = machine_of(reading)
    links = {frozenset(link.names): link for link in machine.links}
    called, joints, bodies = {GROUND: GROUND}, dict[str, JointReading](), dict[str, BodyReading]()
    fixed, made = dict(machine.bodies[GROUND].frames), list[tuple[str, Made, Array]]()
    fixed.pop(GROUND)
    used = set[str]()
    for branch in cut.branches:
        link = links.get(frozenset(branch.link))
        if link is None:
            continue  # another library reads it in another way
        link = link.of(link.near if link.near in called else link.far)
        names = list[str]()
        for element in link.elements:
            new = {element.joint: _turned(machine.reading.joints[element.joint], element)} if element.joint else {}
            if one := branch.made.get(element.names[0]):
                new = _joints(element, one, link.centre)
                made.append((next(iter(new)), one, element.centre if link.centre is None else link.centre))
            joints |= new
            names += new
            if one and element.joint:
                break
        used |= {*link.names}
        called[link.far] = branch.body
        bodies[branch.body] = _body(machine, link.far, branch.body, called[link.near], tuple(names))
    closures = dict(_closures(machine, called, used))
    for pointed in cut.points:
        if link := links.get(frozenset(pointed.joints)):
            closures |= _pinned(machine, called, link, pointed)
    ordered = {name: joints[name] for name in (*reading.joints, *joints) if name in joints}
    cut_reading = replace(machine.reading, bodies=bodies, joints=ordered, closures=closures, fixed=fixed)
    cut_reading = _kept(_as_there(cut_reading, made))
    as_read = {name: reading.joints[name].home for name in cut_reading.joints if name in reading.joints}
    return rehomed(cut_reading, {n: q for n, q in as_read.items() if q != cut_reading.joints[n].home})[0]


def _kept(reading: Reading) -> Reading:
    """A reading without couplings and actuators of joints that are gone."""
    joints = {*reading.joints}
    return replace(
        reading,
        couplings={n: c for n, c in reading.couplings.items() if c.joint in joints and (c.of or c.joint) in joints},
        actuators={n: driven for n, driven in reading.actuators.items() if driven[0] in joints},
    )


def _turned(joint: JointReading, element: Element) -> JointReading:
    """A joint whose far side is what its file has on the near one, if it is: its coordinate stays."""
    return replace(joint, screw=-joint.screw) if element.turned else joint


def _joints(element: Element, made: Made, centre: Array | None) -> dict[str, JointReading]:
    """Joints in place of closures, at the pose of this model."""
    point = element.centre if centre is None else centre
    joints = {}
    for i, (name, home) in enumerate(made.joints.items()):
        if not len(made.axes):
            joints[name] = JointReading("ball", np.zeros(6), point)
            continue
        axis = made.axes[i]
        if element.kind == "hinge":
            axis = element.direction * (1.0 if element.direction @ axis >= 0.0 else -1.0)
        joints[name] = JointReading("hinge", screw(True, axis, point), point, home)
    return joints


def _as_there(reading: Reading, made: Sequence[tuple[str, Made, Array]]) -> Reading:
    """Turns what each newly made joint carries as in the other model, which keeps the coordinates of that joint."""
    for name, one, point in reversed(made):
        turn, joint = one.turn[:3, :3], reading.joints[name]
        if len(one.joints) == 1 and joint.kind == "hinge":
            axis = joint.screw[:3]
            turn = rotation(axis, np.array(float(rotation_vector(turn) @ axis)))
        if np.abs(turn - np.eye(3)).max() > 0.0:
            axes = {n: reading.joints[n] for n in one.joints}
            moved = applied(reading, [Change(name, "placement", matrix(point - turn @ point, turn))])
            reading = replace(moved, joints={**moved.joints, **axes})
    return reading


def _body(machine: Machine, body: str, name: str, near: str, joints: tuple[str, ...]) -> BodyReading:
    """A body with all that is one with it."""
    whole = replace(machine.reading.bodies[name], near=near, joints=joints, first="")
    for member in machine.bodies[body].members:
        if member != name:
            whole = joined(whole, member, machine.reading.bodies[member])
    return whole


def _closures(machine: Machine, called: Mapping[str, str], used: set[str]) -> Iterator[tuple[str, ClosureReading]]:
    """Closures that no link of the tree contains, between bodies by the names of the tree."""
    poses = {name: body.pose for name, body in machine.reading.bodies.items()}
    for name, closure in machine.reading.closures.items():
        ends = [
            _end(machine, called, poses, *end)
            for end in ((closure.first, closure.first_frame), (closure.second, closure.second_frame))
        ]
        (first, T1), (second, T2) = ends
        if name not in used and first != second:
            yield name, replace(closure, first=first, first_frame=T1, second=second, second_frame=T2)


def _end(
    machine: Machine, called: Mapping[str, str], poses: Mapping[str, Array], member: str, frame: Array
) -> tuple[str, Array]:
    name = called[machine.part_of(member)]
    if name == member:
        return member, frame
    near = np.linalg.inv(poses[name]) if name in poses else np.eye(4)
    return name, np.asarray(near @ poses.get(member, np.eye(4)) @ frame)


def _pinned(machine: Machine, called: Mapping[str, str], link: Link, pointed: Pointed) -> dict[str, ClosureReading]:
    """Points in place of the joints of a link."""
    closures, element = {}, link.elements[0]
    poses = {name: body.pose for name, body in machine.reading.bodies.items()}
    for name, place in zip(pointed.names, pointed.places, strict=True):
        if link.centre is not None:
            point = link.centre
        else:
            point = element.centre + ((place - element.centre) @ element.direction) * element.direction
        at, ends = matrix(point, np.eye(3)), [called[link.near], called[link.far]]
        frames = [np.asarray(np.linalg.inv(poses[end]) @ at) if end in poses else at for end in ends]
        while name in machine.reading.closures:
            name += "'"
        closures[name] = ClosureReading("point", ends[0], frames[0], ends[1], frames[1])
    return closures
