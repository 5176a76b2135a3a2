"""Joints that one model has and the other has not: held there, gone by themselves, or gone with all that they carry."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.differences.difference import Difference
from screwgauge.diagnosis.pairing.mapping import AGAINST_NAME, CLOSE, Pairing, joints_before
from screwgauge.diagnosis.properties import Change
from screwgauge.diagnosis.transformations import outwards, spliced, without
from screwgauge.models.kinematics import moved
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading
from screwgauge.reference.errors import first_few
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross

_NAMED = 3


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of two models.

    Attributes:
        name: ``A`` or ``B``.
        alone: Its joints without a partner.
        joints, bodies: Of it -> of the other one.
        placement: Of the other one's world in its own. Shape (4, 4).
    """

    name: str
    reading: Reading
    alone: tuple[str, ...]
    joints: Mapping[str, str]
    bodies: Mapping[str, str]
    placement: Array

    def difference(self, joint: str, other: str, what: str, sentence: str) -> Difference:
        """Difference of a joint of this model; `other`: its partner in the other model, if any."""
        items = (joint, other) if self.name == "A" else (other, joint)
        return Difference(*items, what, None, None, "", math.inf, sentence)


def _sides(a: Reading, b: Reading, pairing: Pairing) -> tuple[Side, Side]:
    joints, bodies = ({other: name for name, other in each.items()} for each in (pairing.joints, pairing.bodies))
    T = pairing.placement
    return (
        Side("A", a, pairing.only_a, pairing.joints, pairing.bodies, T),
        Side("B", b, pairing.only_b, joints, bodies, np.asarray(np.linalg.inv(T))),
    )


def missing(a: Reading, b: Reading, pairing: Pairing) -> Iterator[Difference]:
    """Names that are another joint's, joints of other kinds, and links that one model has and the other has not."""
    for name, other in pairing.joints.items():
        if pairing.how[name] == AGAINST_NAME:
            another = f", where {name} is another joint" if name in b.joints else ""
            sentence = f"{name}: is called {other} in B{another}"
            yield Difference(name, other, "name", None, None, "", math.inf, sentence, kind="convention")
    one, two = _sides(a, b, pairing)
    known: dict[str, set[str]] = {"A": set(), "B": set()}
    for side, against in ((one, two), (two, one)):
        for joint, names in _split(side, against).items():
            known[side.name].add(joint)
            known[against.name] |= {*names}
            sentence = (
                f"{joint}: a {side.reading.joints[joint].kind} joint in {side.name}, in {against.name} the joints "
                f"{', '.join(names)}, which move what they carry in the same ways; all are held where torques are "
                "compared: make them one kind of joint to compare them"
            )
            yield side.difference(joint, names[0], "kind", sentence)
    for name in _retyped(a, b, pairing):
        known = {letter: {*names, name} for letter, names in known.items()}
        kinds = a.joints[name].kind, b.joints[name].kind
        sentence = (
            f"{name}: a {kinds[0]} in A, a {kinds[1]} in B; it and all that it carries are compared where it is held"
        )
        yield one.difference(name, name, "kind", sentence)
    for side, against in ((one, two), (two, one)):
        yield from _absent(side, against, known[side.name])


def _retyped(a: Reading, b: Reading, pairing: Pairing) -> Iterator[str]:
    """Joints of one name and of two kinds, between the same bodies."""
    before = joints_before(a), joints_before(b)
    for name in pairing.only_a:
        if name not in pairing.only_b or a.joints[name].kind == b.joints[name].kind:
            continue
        bodies = a.moved_by(name), b.moved_by(name)
        same = pairing.joints.get(before[0][name], "") == before[1][name] and pairing.bodies.get(bodies[0]) == bodies[1]
        if same and FREEDOMS[a.joints[name].kind] == FREEDOMS[b.joints[name].kind]:
            yield name


def bare(a: Reading, b: Reading, differences: Iterable[Difference]) -> tuple[Reading, Reading]:
    """Readings without the links that are `missing` in the other one: no part of their parents has their mass."""
    for each in differences:
        if each.a is not None and (take := {"branch": without, "link": spliced}.get(each.what)):
            a = take(a, each.item_a) if each.item_a else a
            b = take(b, each.item_b) if each.item_b else b
    return a, b


def _split(side: Side, other: Side) -> dict[str, tuple[str, ...]]:
    """Ball or free joints that are several joints without a partner in the other model, between the same bodies."""
    splits, T, there = {}, side.placement, other.reading
    for name, body in side.reading.bodies.items():
        joint = side.reading.joints[body.joints[0]]
        names, at, near = tuple[str, ...](), side.bodies.get(name, GROUND), side.bodies.get(body.near, GROUND)
        while at != near and at in there.bodies:
            names, at = (*there.bodies[at].joints, *names), there.bodies[at].near
        if at != near or not names or not {*names} <= {*other.alone} or len(body.joints) > 1:
            continue
        ways = np.vstack([_ways(moved(there.joints[each], T)) for each in names])
        ranks = {np.linalg.matrix_rank(S, tol=CLOSE) for S in (ways, np.vstack([ways, _ways(joint)]))}
        if len(ways) > 1 and ranks == {len(ways)} == {FREEDOMS[joint.kind]}:
            splits[body.joints[0]] = names
    return splits


def _ways(joint: JointReading) -> Array:
    """Unit screws of what a joint can do at home, in the world; of a ball about the world's axes. Shape (n, 6)."""
    if FREEDOMS[joint.kind] == 1:
        return joint.screw[None]
    turns = np.concatenate([np.eye(3), cross(joint.centre[None], np.eye(3))], axis=1)
    return turns if joint.kind == "ball" else np.concatenate([np.eye(6)[3:], turns])


def _absent(side: Side, other: Side, known: Collection[str]) -> Iterator[Difference]:
    """What hangs on the joints of one model that have no partner, from the ground outwards.

    Args:
        known: Joints of which all is said.
    """
    reading, alone, before, done = side.reading, {*side.alone}, joints_before(side.reading), {*known}
    for root in side.alone:
        if before[root] in alone or root in known:
            continue
        gap = _gap(side, root)
        if _held(side, other, root, gap):
            what = "what it carries is part of what is before it"
            yield side.difference(root, "", "branch", f"{root}: does not move in {other.name}, where {what}")
            continue
        for name in gap:
            joint = root if root in reading.bodies[name].joints else reading.bodies[name].joints[0]
            if joint in done:
                continue
            joints = outwards(reading, joint)[1]
            whole = {*joints} <= alone
            done |= {*joints} if whole else {joint}
            yield _branch(side, other, joint) if whole else _link(side, other, joint)


def _gap(side: Side, root: str) -> list[str]:
    """Bodies that joints without a partner alone lead to, from one of these on."""
    gap: list[str] = []
    for name in outwards(side.reading, root)[0]:
        body = side.reading.bodies[name]
        if root in body.joints or (body.near in gap and body.joints[0] in side.alone):
            gap.append(name)
    return gap


def _held(side: Side, other: Side, root: str, gap: Collection[str]) -> bool:
    """Whether the other model has what some joints move, fixed to their parent, or moves it by other joints."""
    bodies = {name: side.reading.bodies[name] for name in gap}
    mass = sum(body.mass for body in bodies.values())
    if not {*outwards(side.reading, root)[1]} <= {*side.alone}:
        joints = {joint for body in bodies.values() for joint in body.joints}
        if not mass or not joints <= {*side.alone} or {side.bodies.get(name) for name in gap} & {*other.reading.bodies}:
            return True
    links = {link for name, body in bodies.items() for link in (name, *body.fixed)}
    near = side.reading.bodies[side.reading.moved_by(root)].near
    if near not in side.reading.bodies:
        return bool(links & {*other.reading.fixed})
    partner, bare = other.reading.bodies.get(side.bodies.get(near, "")), side.reading.bodies[near].mass
    if partner is None:
        return False
    return bool(links & {*partner.fixed}) or abs(partner.mass - (bare + mass)) < abs(partner.mass - bare)


def _branch(side: Side, other: Side, joint: str) -> Difference:
    """A joint that is missing with all that it carries."""
    carried, joints = outwards(side.reading, joint)
    what = f"{len(carried)} bod{'y' if len(carried) == 1 else 'ies'}, {_mass(side, carried)}"
    more = f" and {len(joints) - 1} joint{'s' if len(joints) > 2 else ''} behind it" if len(joints) > 1 else ""
    twin, kind = other.reading.joints.get(joint), side.reading.joints[joint].kind
    carries = f"all that {'they carry' if more else 'it carries'} ({what})"
    sentence = f"{joint}{more}: missing in {other.name}, with {carries}"
    if twin is not None and twin.kind != kind:
        sentence = f"{joint}: a {kind} in {side.name}, a {twin.kind} in {other.name}; it{more} and {carries} have no "
        sentence += "partner there"
    without_it = ", without which torques are compared" if side.name == "A" else ""
    return _gone(side, joint, "branch", f"{sentence}{without_it}")


def _link(side: Side, other: Side, joint: str) -> Difference:
    """A joint that is missing with the body that it moves, but not what hangs on that."""
    name = side.reading.moved_by(joint)
    near = side.reading.bodies[name].near
    while near in side.reading.bodies and near not in side.bodies:
        near = side.reading.bodies[near].near
    gap = _gap(side, joint)
    behind = [
        side.joints[body.joints[0]]
        for each, body in side.reading.bodies.items()
        if body.near in gap and each not in gap
    ]
    where = f"{first_few(behind, _NAMED)} hang{'s' * (len(behind) == 1)} on {side.bodies.get(near, 'the ground')} there"
    without_it = ", without which torques are compared" if side.name == "A" else ""
    sentence = f"{joint}: missing in {other.name}, with {name} that it moves ({_mass(side, [name])})"
    return _gone(side, joint, "link", f"{sentence}{without_it}; {where}")


def _mass(side: Side, bodies: Iterable[str]) -> str:
    return f"{sum(side.reading.bodies[name].mass for name in bodies):.6g} kg"


def _gone(side: Side, joint: str, what: str, sentence: str) -> Difference:
    """Something that A alone has, without which torques are compared, or B alone, which a change takes away."""
    if side.name == "A":
        return Difference(joint, "", what, np.array(1.0), np.array(0.0), "", math.inf, sentence)
    change = Change(joint, what, np.array(0.0))
    return Difference("", joint, what, np.array(0.0), np.array(1.0), "", math.inf, sentence, change)
