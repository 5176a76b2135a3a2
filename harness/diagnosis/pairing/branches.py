"""Joints that one model has and the other has not: held there, or gone with all that they carry."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping

import numpy as np

from screwgauge.diagnosis.differences.change import Change, Difference, outwards, without
from screwgauge.diagnosis.mechanics.lines import CLOSE
from screwgauge.diagnosis.mechanics.reshape import held
from screwgauge.diagnosis.pairing.mapping import AGAINST_NAME, Pairing, joints_before
from screwgauge.models.kinematics import moved
from screwgauge.models.readings.reading import FREEDOMS, JointReading, Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross


def missing(a: Reading, b: Reading, pairing: Pairing) -> Iterator[Difference]:
    """One for each joint without a partner that does not hang on another such joint, or without a name of its own."""
    for name, other in pairing.joints.items():
        if pairing.how[name] == AGAINST_NAME:
            sentence = f"{name}: is called {other} in B, where {name} is another joint"
            yield Difference(name, other, "name", None, None, "", math.inf, sentence, kind="convention")
    bodies, T, back = dict(pairing.bodies), pairing.placement, np.asarray(np.linalg.inv(pairing.placement))
    there = {other: name for name, other in bodies.items()}
    split = (_split(a, b, pairing.only_b, bodies, T), _split(b, a, pairing.only_a, there, back))
    for side, lost, reading, found in (("A", "B", a, split[0]), ("B", "A", b, split[1])):
        for joint, names in found.items():
            kind, others = reading.joints[joint].kind, ", ".join(names)
            sentence = (
                f"{joint}: a {kind} joint in {side}, in {lost} the joints {others}, which move what they carry in the "
                f"same ways; all are held where torques are compared: make them one kind of joint to compare them"
            )
            items = (joint, names[0]) if side == "A" else (names[0], joint)
            yield Difference(*items, "kind", None, None, "", math.inf, sentence)
    said = [{*split[i], *(name for names in split[1 - i].values() for name in names)} for i in (0, 1)]
    for name in _retyped(a, b, pairing):
        said[0].add(name)
        said[1].add(name)
        kinds = a.joints[name].kind, b.joints[name].kind
        sentence = (
            f"{name}: a {kinds[0]} in A, a {kinds[1]} in B; it and all that it carries are compared where it is held"
        )
        yield Difference(name, name, "kind", None, None, "", math.inf, sentence)
    for side, here, beside, lost in (
        ("A", (a, pairing.only_a, said[0]), (b, bodies), "B"),
        ("B", (b, pairing.only_b, said[1]), (a, there), "A"),
    ):
        reading, alone, known = here
        before = joints_before(reading)
        for joint in alone:
            if before[joint] not in alone and joint not in known:
                yield _branch(reading, joint, alone, beside, (side, lost))


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


def bare(a: Reading, b: Reading, found: Iterable[Difference]) -> tuple[Reading, Reading]:
    """Both without the joints that, with all they carry, are `missing` in the other one: no part of what is before them
    has their mass there."""
    for each in found:
        if each.what == "branch" and each.a is not None:
            a = without(a, each.item_a) if each.item_a else a
            b = without(b, each.item_b) if each.item_b else b
    return a, b


def _split(
    one: Reading, other: Reading, alone: Collection[str], bodies: Mapping[str, str], T: Array
) -> dict[str, tuple[str, ...]]:
    """Ball or free joints that are several joints without a partner in another model, between the same bodies.

    Args:
        alone: Joints of the other model without a partner.
        bodies: Of the one and of the other.
        T: Placement of the other's world in the one's. Shape (4, 4).
    """
    found = {}
    for name, body in one.bodies.items():
        joint = one.joints[body.joints[0]]
        names, at, near = tuple[str, ...](), bodies.get(name, GROUND), bodies.get(body.near, GROUND)
        while at != near and at in other.bodies:
            names, at = (*other.bodies[at].joints, *names), other.bodies[at].near
        if at != near or not names or not {*names} <= {*alone} or len(body.joints) > 1:
            continue
        ways = np.vstack([_ways(moved(other.joints[each], T)) for each in names])
        ranks = {np.linalg.matrix_rank(S, tol=CLOSE) for S in (ways, np.vstack([ways, _ways(joint)]))}
        if len(ways) > 1 and ranks == {len(ways)} == {FREEDOMS[joint.kind]}:
            found[body.joints[0]] = names
    return found


def _ways(joint: JointReading) -> Array:
    """Unit screws of what a joint can do at home, in the world; of a ball about the world's axes. Shape (n, 6)."""
    if FREEDOMS[joint.kind] == 1:
        return joint.screw[None]
    turns = np.concatenate([np.eye(3), cross(joint.centre[None], np.eye(3))], axis=1)
    return turns if joint.kind == "ball" else np.concatenate([np.eye(6)[3:], turns])


def _branch(
    reading: Reading, joint: str, alone: tuple[str, ...], there: tuple[Reading, dict[str, str]], sides: tuple[str, str]
) -> Difference:
    side, lost = sides
    carried, joints = outwards(reading, joint)
    mass = sum(reading.bodies[name].mass for name in carried)
    stuck = not {*joints} <= {*alone} or _weighs(reading, joint, alone, there)
    item_a, item_b = (joint, "") if side == "A" else ("", joint)
    if stuck:
        sentence = f"{joint}: does not move in {lost}, where what it carries is part of what is before it"
        return Difference(item_a, item_b, "branch", None, None, "", math.inf, sentence)
    what = f"{len(carried)} bod{'y' if len(carried) == 1 else 'ies'}, {mass:.6g} kg"
    more = f" and {len(joints) - 1} joint{'s' if len(joints) > 2 else ''} behind it" if len(joints) > 1 else ""
    twin = there[0].joints.get(joint)
    carries = f"all that {'they carry' if more else 'it carries'} ({what})"
    sentence = f"{joint}{more}: missing in {lost}, with {carries}"
    if twin is not None and twin.kind != (kind := reading.joints[joint].kind):
        sentence = f"{joint}: a {kind} in {side}, a {twin.kind} in {lost}; it{more} and {carries} have no partner there"
    there_is, change = (np.array(1.0), np.array(0.0)), None
    if side == "A":
        sentence += ", without which torques are compared"
    else:
        there_is, change = there_is[::-1], Change(joint, "branch", np.array(0.0))
    return Difference(item_a, item_b, "branch", *there_is, "", math.inf, sentence, change)


def _weighs(reading: Reading, joint: str, alone: tuple[str, ...], there: tuple[Reading, dict[str, str]]) -> bool:
    """Whether the other model has the mass of what a joint carries, fixed to what is before it."""
    other, partners = there
    near = reading.bodies[reading.moved_by(joint)].near
    carried = {link for name in outwards(reading, joint)[0] for link in (name, *reading.bodies[name].fixed)}
    if near not in reading.bodies:
        return bool(carried & {*other.fixed})
    partner = other.bodies.get(partners.get(near, ""))
    if partner is not None and carried & {*partner.fixed}:
        return True
    bare, whole = (each.bodies[near].mass for each in (without(reading, joint), held(reading, alone)))
    return partner is not None and abs(partner.mass - whole) < abs(partner.mass - bare)
