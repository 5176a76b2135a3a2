"""Which joint and which body of one model is which of another."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.machine.alignment import Match, matched
from screwgauge.diagnosis.transformations import axis
from screwgauge.models.kinematics import moved, rehomed, size
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import read_toml

#: Placements are compared by the joints that they lay onto each other so closely, relative to the size of the machine.
CLOSE = 1e-6
#: Frames of bodies that are tried as placements.
FRAMES = 8
#: Below this share of joints with a partner, two models are of different machines.
ALIKE = 0.5
#: So many identical names are no chance: their joints are compared, however much else the two models have.
NO_CHANCE = 5
#: How joints are paired that have each other's names.
AGAINST_NAME = "geometry, against its name"


@dataclass(frozen=True, slots=True, eq=False)
class Pairing:
    """Joints and bodies of A with those of B.

    Attributes:
        joints, bodies: Name in A -> name in B.
        how: Joint of A -> ``given``, ``name``, ``similar name``, ``geometry`` or ``geometry, against its name``.
        only_a, only_b: Joints without a partner.
        placement: Of B's world in A's. Shape (4, 4).
        standing: Body of B -> its pose in A's world if B is in the pose of A, as far as that is known. Shape (4, 4).
        match: Of the two as machines, where names leave joints without a partner.
    """

    joints: Mapping[str, str]
    bodies: Mapping[str, str]
    how: Mapping[str, str]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    placement: Array
    standing: Mapping[str, Array] = field(default_factory=dict)
    match: Match | None = None

    @property
    def alike(self) -> bool:
        """Whether the two can be compared: as models of one machine, or by the joints that share names."""
        return self.one_machine or "given" in self.how.values() or [*self.how.values()].count("name") >= NO_CHANCE

    @property
    def one_machine(self) -> bool:
        """Whether enough has a partner for the two to be models of one machine: of one by name, or of both.

        Or each body and each link, of whichever kinds.
        """
        if self.match is not None and self.match.whole:
            return bool(self.joints)
        named, alone = sum(how != "geometry" for how in self.how.values()), (len(self.only_a), len(self.only_b))
        by_name = named >= ALIKE * (len(self.joints) + min(alone))
        return bool(self.joints) and (by_name or len(self.joints) >= ALIKE * (len(self.joints) + max(alone)))


def read_map(path: Path) -> dict[str, str]:
    """Names of A and of B from a TOML file.

    Raises:
        DescriptionError: It is no table of names.
    """
    given = read_toml(path)
    for name, other in given.items():
        if not isinstance(other, str):
            raise DescriptionError(f"'{name}' is no name", str(path), 'write lines such as "joint of A" = "joint of B"')
    return given


def congruent(a: Reading, b: Reading, pairing: Pairing) -> bool:
    """Whether the trees and the closures of two models are between the same bodies."""
    if pairing.only_a or pairing.only_b or len(a.joints) != len(b.joints):
        return False
    behind = [joints_before(reading) for reading in (a, b)]
    if any(pairing.joints.get(before, "") != behind[1][pairing.joints[n]] for n, before in behind[0].items()):
        return False
    bodies = {other: name for name, other in pairing.bodies.items()}
    ours = Counter((c.kind, frozenset((c.first, c.second))) for c in a.closures.values())
    theirs = (frozenset(bodies.get(end, end) for end in (c.first, c.second)) for c in b.closures.values())
    return ours == Counter(zip((c.kind for c in b.closures.values()), theirs, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What two machines tell of their readings: joints of A with those of B, and as in `Pairing`."""

    joints: Mapping[str, str]
    placement: Array
    standing: Mapping[str, Array]
    match: Match | None = None


_NONE = Found({}, np.eye(4), {})


def coincident(a: Reading, b: Reading, pairing: Pairing) -> bool:
    """Whether joints and centres of mass of two models are in one place where their coordinates are the same."""
    length, there = size(a), counted_as(a, b, pairing.joints)
    for name, other in pairing.joints.items():
        if not apart(a.joints[name], moved(there.joints[other], pairing.placement), length) < CLOSE:
            return False
    for name, other in pairing.bodies.items():
        one, two = a.bodies[name], there.bodies[other]
        if one.mass and two.mass and _step(one, two, pairing.placement) > CLOSE * length:
            return False
    return True


def _step(one: BodyReading, two: BodyReading, T: Array) -> float:
    """How far two centres of mass are apart [m].

    Args:
        T: Placement of the other's world in the one's. Shape (4, 4).
    """
    S = T @ two.pose
    return float(np.linalg.norm(one.pose[:3, :3] @ one.com + one.pose[:3, 3] - S[:3, :3] @ two.com - S[:3, 3]))


def paired(a: Reading, b: Reading, given: Mapping[str, str] | None = None, found: Found | None = None) -> Pairing:
    """Finds partners: as given, by name, by similar name, then by the tree and the geometry.

    Args:
        given: Joints or bodies of A -> those of B.
        found: What the two tell as machines, which is believed where names say nothing.

    Raises:
        UnknownNameError: A given name is of neither.
    """
    given = given or {}
    for name, other in given.items():
        if name not in a.joints and name not in a.bodies:
            raise UnknownNameError("joint or body of A", name, [*a.joints, *a.bodies], "map")
        if other not in b.joints and other not in b.bodies:
            raise UnknownNameError("joint or body of B", other, [*b.joints, *b.bodies], "map")
    joints, how = _by_name(a, b, given)
    crossed, alone = _crossed(a, b, joints, how)
    for name in alone:
        del joints[name], how[name]
    joints, how = joints | crossed, how | dict.fromkeys(crossed, AGAINST_NAME)
    match = found.match if found else None
    if found is None and len(joints) < min(len(a.joints), len(b.joints)):
        match = matched(a, b, joints)
    for name, other in (found or match or _NONE).joints.items():
        if name in a.joints and name not in joints and other in b.joints and other not in joints.values():
            joints[name], how[name] = other, "geometry"
    T = found.placement if found else _placement(a, counted_as(a, b, joints), joints, match)
    bodies = _bodies(a, b, joints, given)
    return Pairing(
        {name: joints[name] for name in a.joints if name in joints},
        bodies,
        how,
        tuple(name for name in a.joints if name not in joints),
        tuple(name for name in b.joints if name not in joints.values()),
        T,
        found.standing if found else {},
        match,
    )


def counted_as(a: Reading, b: Reading, joints: Mapping[str, str]) -> Reading:
    """B where its joints have the coordinates that their partners in A have at home."""
    there = {other: a.joints[name].home for name, other in joints.items() if name in a.joints}
    return rehomed(b, {name: q for name, q in there.items() if b.joints[name].home != q})[0]


def _by_name(a: Reading, b: Reading, given: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    joints = {name: other for name, other in given.items() if name in a.joints and other in b.joints}
    how = dict.fromkeys(joints, "given")
    for similar, word in ((lambda name: name, "name"), (_plain, "similar name")):
        left = [name for name in b.joints if name not in joints.values()]
        keys = [similar(name) for name in left]
        own = [similar(name) for name in a.joints if name not in joints]
        for name in a.joints:
            key = similar(name)
            if name in joints or keys.count(key) != 1 or own.count(key) != 1:
                continue
            other = left[keys.index(key)]
            if a.joints[name].kind == b.joints[other].kind:
                joints[name], how[name] = other, word
    if not joints:
        joints = _prefixed(a, b)
        how = dict.fromkeys(joints, "similar name")
    return joints, how


def _prefixed(a: Reading, b: Reading) -> dict[str, str]:
    """Joints of which the names of one model are those of the other with one and the same text before them."""
    for one, two, back in ((a, b, False), (b, a, True)):
        first = next(iter(one.joints), "")
        for prefix in (name.removesuffix(first) for name in two.joints if first and name.endswith(first)):
            longer = {name: prefix + name for name in one.joints}
            kinds = all(n in two.joints and two.joints[n].kind == one.joints[m].kind for m, n in longer.items())
            if kinds and len(longer) == len(two.joints):
                return {n: m for m, n in longer.items()} if back else longer
    return {}


def _plain(name: str) -> str:
    """A name without what files add to it: case, separators, the words joint and link, a robot's name before it."""
    return re.sub(r"[^a-z0-9]|joint|link|jnt", "", name.rpartition("/")[2].lower())


def _placement(a: Reading, b: Reading, joints: Mapping[str, str], match: Match | None = None) -> Array:
    bodies = [(name, name) for name in a.bodies if name in b.bodies]
    return fitting(a, b, [*joints.items()], bodies, match.roots if match else ())


def joints_before(reading: Reading) -> dict[str, str]:
    """Joint -> the one before it; empty of one at the ground."""
    last: dict[str, str] = {}
    before = {}
    for name, body in reading.bodies.items():
        prior = last.get(body.near, "")
        for joint in body.joints:
            before[joint], prior = prior, joint
        last[name] = prior
    return before


def _crossed(
    a: Reading, b: Reading, joints: Mapping[str, str], how: Mapping[str, str]
) -> tuple[dict[str, str], set[str]]:
    """Joints that sit where one of another name does in B: names that are permuted, or numbers that are shifted.

    Returns:
        They with their partners, and joints whose namesake is such a partner, while they have none themselves.
    """
    alike = counted_as(a, b, joints)
    tried = [(alike, np.eye(4)), (alike, _placement(a, alike, joints))]
    tried += [] if alike is b else [(b, np.eye(4))]
    crossings = [_permutation(a, one, joints, [n for n in joints if how[n] == "name"], T) for one, T in tried]
    return max(crossings, key=lambda crossing: len(crossing[0]))


def _permutation(
    a: Reading, b: Reading, joints: Mapping[str, str], names: Collection[str], T: Array
) -> tuple[dict[str, str], set[str]]:
    """See `_crossed`.

    Args:
        names: Of joints that both have, which may be those of others.
        T: Placement of B's world in A's. Shape (4, 4).
    """
    partners_of_b = {*joints.values()}
    free = ([n for n in a.joints if n not in joints], [n for n in b.joints if n not in partners_of_b])
    if looped := bool(a.closures or b.closures):
        free = [], []  # which joint is missing depends on the cut
    length, placed = size(a), {name: moved(b.joints[name], T) for name in (*names, *free[1])}
    behind = [{j: (n, i) for n, body in r.bodies.items() for i, j in enumerate(body.joints)} for r in (a, b)]

    def sits(name: str, other: str) -> bool:
        return apart(a.joints[name], placed[other], length) < CLOSE

    def carries(name: str, other: str) -> bool:
        """Whether the name of a body says so; where it says nothing, what is carried has to be alike."""
        body, there = behind[0][name][0], behind[1][other][0]
        if body in b.bodies or name in free[0] or other in free[1]:
            return behind[0][name] == behind[1][other]
        one, two = a.bodies[body], b.bodies[there]
        return bool(abs(one.mass - two.mass) < CLOSE * one.mass and _step(one, two, T) < CLOSE * length)

    off = [name for name in names if not (sits(name, name) and carries(name, name))]
    if not off:
        return {}, set()
    others = {n: off if n in free[0] else [o for o in (*off, *free[1]) if o != n] for n in (*off, *free[0])}
    fits = {n: [o for o in some if sits(n, o) and carries(n, o)] for n, some in others.items()}
    single = {name: some[0] for name, some in fits.items() if len(some) == 1}
    partners = {name: other for name, other in single.items() if [*single.values()].count(other) == 1}
    # a chain of shifted numbers begins or ends where one model has no joint
    alone = ({n for n in off if not fits[n]}, {*off} - {*chain(*fits.values())}) if not looped else (set(), set())

    def holds(name: str, other: str) -> bool:
        """Whether the namesakes of two partners have other partners, too."""
        ours = other not in off or other in partners or other in alone[0]
        return ours and (name not in off or name in partners.values() or name in alone[1])

    while loose := [pair for pair in partners.items() if not holds(*pair)]:
        partners = {name: other for name, other in partners.items() if (name, other) not in loose}
    return partners, {name for name in off if name in partners.values() and name not in partners}


def _bodies(a: Reading, b: Reading, joints: Mapping[str, str], given: Mapping[str, str]) -> dict[str, str]:
    """Bodies on the same last joint, then those of the same name."""
    behind = {body.joints[-1]: name for name, body in b.bodies.items()}
    bodies = {name: other for name, other in given.items() if name in a.bodies and other in b.bodies}
    for name, body in a.bodies.items():
        partner = behind.get(joints.get(body.joints[-1], ""))
        if name not in bodies and partner is not None and partner not in bodies.values():
            bodies[name] = partner
    for name in a.bodies:
        if name not in bodies and name in b.bodies and name not in bodies.values() and name != GROUND:
            bodies[name] = name
    return {name: bodies[name] for name in a.bodies if name in bodies}


def apart(a: JointReading, b: JointReading, length: float) -> float:
    """How far two joints are from turning or sliding alike, whichever way they count: angle plus way over a length."""
    if a.kind != b.kind:
        return float("inf")
    if a.kind == "free":
        return 0.0  # wherever its coordinates say
    if a.kind == "ball":
        return float(np.linalg.norm(a.centre - b.centre)) / length
    sign = 1.0 if axis(a) @ axis(b) >= 0.0 else -1.0
    off = float(np.linalg.norm(axis(a) - sign * axis(b)))
    if a.kind == "hinge":
        off += float(np.linalg.norm(np.cross(b.centre - a.centre, axis(a)))) / length
    return off


def fitting(
    a: Reading,
    b: Reading,
    pairs: Sequence[tuple[str, str]],
    bodies: Iterable[tuple[str, str]],
    also: Iterable[Array] = (),
) -> Array:
    """The placement of B's world in A's that lays most joints onto their partners; none where those at the ground fit.

    A base that stands elsewhere looks the same as a first joint that counts from elsewhere, which is likelier.

    Args:
        pairs: Joints of A with those of B.
        bodies: Bodies of A with those of B.
        also: Further placements that are tried. Shape (4, 4) each.

    Returns:
        Shape (4, 4).
    """
    length, best, most = size(a), np.eye(4), -1.0
    pairs = [(i, j) for i, j in pairs if a.joints[i].kind != "free"]
    ground = {a.bodies[name].joints[0] for name in a.roots}
    stands = [a.fixed[name] @ np.linalg.inv(b.fixed[name]) for name in a.fixed if name in b.fixed]
    rooted = [apart(a.joints[i], b.joints[j], length) for i, j in pairs if i in ground]
    if (rooted and max(rooted) < CLOSE) or any(np.abs(T - best).max() < CLOSE for T in stands):
        return best
    frames = [a.bodies[name].pose @ np.linalg.inv(b.bodies[other].pose) for name, other in [*bodies][:FRAMES]]
    tried = [best, *frames, *also, *stands]
    if len({"free" in (joint.kind for joint in each.joints.values()) for each in (a, b)}) == 2:
        tried = [*tried[1:], best]  # a base that one model alone says is free stands where its coordinates say
    for T in tried:
        off = [apart(a.joints[i], moved(b.joints[j], T), length) for i, j in pairs]
        score = sum(each < CLOSE for each in off) - np.mean(np.minimum(off, 1.0)) if off else 0.0
        if score > most + 1e-3:
            best, most = T, float(score)
    return best
