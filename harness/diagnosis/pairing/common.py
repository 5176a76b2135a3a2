"""Two readings brought to the same names, order, home and world, and changes brought back to what B says itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from screwgauge.diagnosis.machine.alignment import assignment
from screwgauge.diagnosis.pairing.mapping import CLOSE, Pairing, fitting
from screwgauge.diagnosis.properties import PROPERTIES, ROOMS, Change, applied
from screwgauge.diagnosis.transformations import held, ordered, outwards, placed
from screwgauge.models.files.parts import NUMBERED
from screwgauge.models.formats import adjoint
from screwgauge.models.kinematics import ReadingTree, downwards, rehomed
from screwgauge.models.matter import Matter, combined
from screwgauge.models.readings.reading import ClosureReading, Reading, collapsed, renamed
from screwgauge.reference.rotations import Array, quaternion_rotation
from screwgauge.witness.tree import TreeStates

#: Gravity of a file that cannot say it [m/s^2].
STANDARD = np.array(PROPERTIES["gravity"].default)
#: Rounding of readers: nothing below counts, relative to 1 rad or to the size of the machine. Readers keep 1e-14. And
#: that of poses that are brought to each other.
ROUNDING, BROUGHT = 1e-11, 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Common:
    """A and B in common terms: the names, the order of joints and the home coordinates are those of A.

    Coordinates are counted as either file does: what counts otherwise shows as a difference.

    Attributes:
        a, b: Readings with the joints that both have; all others are held at home.
        own: Kind of item (``bodies``, ``joints``, ``closures``, ``couplings``, ``actuators``) -> common name -> B's.
        before, behind: Displacement from B's home to the common one of the parent of each joint, of each body.
        homes: Coordinate of each joint at B's own home.
        placement: Of B's world in A's. Shape (4, 4).
        standing: Body, by its common name -> pose of B's where B is in the pose of A, as far as that is known. (4, 4).
        held: Body of B -> matter that joints move there which A has not, in its frame; part of the body in `b`.
    """

    a: Reading
    b: Reading
    own: Mapping[str, Mapping[str, str]]
    before: Mapping[str, Array]
    behind: Mapping[str, Array]
    homes: Mapping[str, float]
    placement: Array
    standing: Mapping[str, Array]
    held: Mapping[str, Matter]

    @property
    def rounding(self) -> float:
        """What is rounding of places: of readers, or, where B is brought to the pose of A, of Newton's method."""
        return BROUGHT if self.standing else ROUNDING


def weighed(reading: Reading) -> Reading:
    """A reading with gravity, also of a file that cannot say it."""
    return replace(reading, gravity=STANDARD) if reading.gravity is None else reading


def brought(a: Reading, b: Reading, pairing: Pairing) -> Common:
    """Brings both to common terms."""
    a = held(collapsed(weighed(a), pairing.bodies), pairing.only_a)
    movable = collapsed(weighed(b), {*pairing.bodies.values()})
    b = held(movable, pairing.only_b)
    more = {n: body for n, body in b.bodies.items() if len(body.fixed) > len(movable.bodies[n].fixed)}
    extra = {n: combined(body, movable.bodies[n], -1.0) for n, body in more.items()}
    names = {
        "bodies": {other: name for name, other in pairing.bodies.items() if other in b.bodies},
        "joints": {other: name for name, other in pairing.joints.items()},
    }
    names |= {
        "closures": _same(_ends(a, {}), _ends(b, names["bodies"])),
        "couplings": _same(
            {n: c.joint for n, c in a.couplings.items()},
            {n: names["joints"].get(c.joint, "") for n, c in b.couplings.items()},
        ),
        "actuators": _same(
            {n: joint for n, (joint, _) in a.actuators.items()},
            {n: names["joints"].get(joint, "") for n, (joint, _) in b.actuators.items()},
            commanded=True,
        ),
    }
    b = ordered(renamed(_unclashed(b, names, pairing.only_b), names), a.joints)
    homes = {name: joint.home for name, joint in b.joints.items()}
    b, before, behind = rehomed(b, {n: j.home for n, j in a.joints.items() if j.home != homes[n]})
    roots = [b.bodies[name].joints[0] for name in b.roots]
    free = [root for root in roots if b.joints[root].kind == "free"]
    T = np.eye(4) if free == roots or (len(roots) == 1 and _turned(a, b, pairing.placement)) else pairing.placement
    for root in free:
        # A free base is where its coordinates say: this placement is one of them, not of the world.
        X = np.linalg.inv(T) @ _stands(a, b, root)
        b = applied(b, [Change(root, "placement", X)])
        bodies, joints = outwards(b, root)
        before = {n: X @ Y if n in joints and n != root else Y for n, Y in before.items()}
        behind = {n: X @ Y if n in bodies else Y for n, Y in behind.items()}
    b = placed(b, T)
    if nearer := _nearest(a, b, {name for other, name in names["closures"].items() if name != other}):
        b = renamed(b, {"closures": nearer})
        names["closures"] = {other: nearer.get(name, name) for other, name in names["closures"].items()}
    return Common(
        a,
        b,
        {kind: {name: other for other, name in entries.items()} for kind, entries in names.items()},
        {name: T @ X for name, X in before.items()},
        {name: T @ X for name, X in behind.items()},
        homes,
        T,
        {name: pairing.standing[other] for other, name in names["bodies"].items() if other in pairing.standing},
        {names["bodies"].get(other, other): matter for other, matter in extra.items()},
    )


def _nearest(a: Reading, b: Reading, names: Collection[str]) -> dict[str, str]:
    """Closures of one pair of bodies by the names of those of A that they are nearest to, where others have these.

    Args:
        names: Of closures that may change theirs.
    """
    ends, nearest = _ends(a, {}), dict[str, str]()
    for pair in {frozenset(ends[name]) for name in names if name in a.closures and name in b.closures}:
        some = [name for name in names if name in b.closures and frozenset(ends.get(name, ())) == pair]
        points = [[_points(reading, reading.closures[name]) for name in some] for reading in (a, b)]
        cost = np.array([[np.linalg.norm(theirs - ours) for ours in points[0]] for theirs in points[1]])
        nearest |= {some[i]: some[j] for i, j in assignment(cost) if i != j}
    return nearest


def _points(reading: Reading, closure: ClosureReading) -> Array:
    """Origins of both frames of a closure in the world, in the order of the names of its bodies. Shape (2, 3)."""
    frames = {closure.first: closure.first_frame, closure.second: closure.second_frame}
    poses = {name: reading.bodies[name].pose if name in reading.bodies else np.eye(4) for name in frames}
    return np.array([(poses[name] @ frames[name])[:3, 3] for name in sorted(frames)])


def _turned(a: Reading, b: Reading, T: Array) -> bool:
    """Whether both say the same of where down is, and a placement of B's world turns that: then its base is turned."""
    g, h = downwards(a), downwards(b)
    least = CLOSE * float(np.linalg.norm(g) * np.linalg.norm(h))
    same = np.linalg.norm(np.cross(g, h)) <= least and g @ h > 0.0
    return bool(same and np.linalg.norm(T[:3, :3] @ h - h) * np.linalg.norm(g) > least)


def _stands(a: Reading, b: Reading, root: str) -> Array:
    """Placement of what a free joint of B carries that lays it onto the same of A. Shape (4, 4)."""
    trees = [(each, *outwards(each, root)) for each in (a, b)]
    one, two = (
        replace(r, bodies={n: r.bodies[n] for n in names}, joints={n: r.joints[n] for n in joints})
        for r, names, joints in trees
    )
    pairs, bodies = (
        [(n, n) for n in own if n in other] for own, other in ((one.joints, two.joints), (one.bodies, two.bodies))
    )
    return fitting(one, two, pairs, bodies)


def _unclashed(b: Reading, names: dict[str, dict[str, str]], alone: Collection[str]) -> Reading:
    """Names of B that are A's of something else get a stroke.

    Args:
        alone: Joints of B without a partner; they are held, but content may still name them.
    """
    for kind in ("bodies", "closures", "couplings", "actuators"):
        taken = set(names[kind].values())
        for name in getattr(b, kind):
            if name not in names[kind]:
                names[kind][name] = _stroked(name, taken)
    taken = {*names["joints"].values()}
    strokes = {name: _stroked(name, taken) for name in alone}
    return replace(b, content=tuple(each.renamed({"joints": strokes}) for each in b.content))


def _stroked(name: str, taken: set[str]) -> str:
    """The name, with as many strokes as make it one that is not taken; then it is."""
    while name in taken:
        name += "'"
    taken.add(name)
    return name


def _same(a: Mapping[str, object], b: Mapping[str, object], *, commanded: bool = False) -> dict[str, str]:
    """Name in B -> name in A, of what has the same name and is of the same joint or bodies, or else one of the two.

    Args:
        a, b: Name -> what it is of.
        commanded: A name that the file gives tells more than what it is of: those who command it use it.
    """
    found: dict[str, str] = {}

    def pair(fits: Callable[[str, str], bool]) -> None:
        for other in b:
            names = [name for name in a if name not in found.values() and fits(name, other)]
            if names and other not in found:
                found[other] = names[0]

    pair(lambda name, other: name == other and a[name] == b[other])
    if commanded:
        pair(lambda name, other: name == other and not NUMBERED.fullmatch(name))
    pair(lambda name, other: a[name] == b[other])
    pair(lambda name, other: name == other)
    return found


def _ends(reading: Reading, bodies: Mapping[str, str]) -> dict[str, set[str]]:
    """Closure -> the bodies that it joins, by other names."""
    closures = reading.closures.items()
    return {name: {bodies.get(c.first, c.first), bodies.get(c.second, c.second)} for name, c in closures}


def owned(common: Common, change: Change) -> Change:
    """A change of the common B as one of the B that was read."""
    what, value = change.what, change.value
    item = common.own.get(ROOMS.get(PROPERTIES[what].owner, ""), {}).get(change.item, change.item)
    X = common.before.get(change.item, common.placement)
    if what == "zero":
        value = value - common.b.joints[change.item].home + common.homes[change.item]
    elif what == "placement":
        value = np.linalg.inv(X) @ value @ X
    elif what == "axis":
        value = X[:3, :3].T @ value
    elif what == "centre":
        value = X[:3, :3].T @ (value - X[:3, 3])
    elif what == "pose":
        value = np.linalg.inv(common.behind[change.item]) @ value
    elif what == "gravity":
        value = common.placement[:3, :3].T @ value
    elif what in ("first_frame", "second_frame"):
        closure = common.b.closures[change.item]
        if (closure.first if what == "first_frame" else closure.second) not in common.b.bodies:
            value = np.linalg.inv(common.placement) @ value
    return Change(item, what, np.asarray(value, dtype=float))


def states_of_b(a: ReadingTree, b: ReadingTree, states: TreeStates) -> TreeStates:
    """States of B at states of A, where the frames that ball and free joints carry differ."""
    if not (other := _reframed(a, b)):
        return states
    q, C = states.q.copy(), velocity_map(a, b)
    for i, frame in other:
        place = list(a.places.values())[i]
        q[:, place] = _conjugated(states.q[:, place], frame)
    return TreeStates(q, states.qd @ C.T, states.qdd @ C.T)


def velocity_map(a: ReadingTree, b: ReadingTree) -> Array:
    """Velocities of A -> those of B, where frames of ball and free joints differ. Shape (n_freedom, n_freedom)."""
    C = np.eye(len(a.before))
    for i, frame in _reframed(a, b):
        part = list(a.freedoms.values())[i]
        C[part, part] = adjoint(np.asarray(np.linalg.inv(frame)))[: part.stop - part.start, : part.stop - part.start]
    return C


def _reframed(a: ReadingTree, b: ReadingTree) -> list[tuple[int, Array]]:
    """Ball and free joints whose frames differ, and B's frame in A's."""
    frames = []
    for i, frame in a.frames.items():
        C = np.linalg.inv(frame) @ b.frames[i]
        if list(a.reading.joints.values())[i].kind == "ball":
            C[:3, 3] = 0.0
        if not np.allclose(C, np.eye(4), rtol=0.0, atol=1e-12):
            frames.append((i, C))
    return frames


def _conjugated(q: Array, C: Array) -> Array:
    """``C^-1 X C`` of placements in coordinates of ball or free joints. Shape (n, 4 or 7)."""
    R = C[:3, :3].T
    turned = np.concatenate([q[:, -4:-3], q[:, -3:] @ R.T], axis=1)
    if q.shape[1] == 4:
        return turned
    moved = (quaternion_rotation(q[:, 3:]) @ C[:3, 3]) + q[:, :3] - C[:3, 3]
    return np.concatenate([moved @ R.T, turned], axis=1)
