"""Compares links: kind, placement, axis, zero position and sense of joints, and their passive forces and limits.

Once a body is aligned with its partner, the displacement of a neighbouring body splits into a motion of the joint
between them, which is a difference in zero position, and a remainder, which is a difference in placement. The axis is
the location of the joint on both bodies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, difference, step_of
from screwgauge.diagnosis.facts.loops import SUM, end_facts
from screwgauge.diagnosis.machine.features import EXACT, features, gap
from screwgauge.diagnosis.machine.pair import Pair, Partner
from screwgauge.diagnosis.machine.placement import descend, lay
from screwgauge.diagnosis.properties import PASSIVE, Change, unit_of
from screwgauge.diagnosis.shares import freedom_left
from screwgauge.models.machine import Element, Link
from screwgauge.models.poses import exponential
from screwgauge.models.readings.reading import JointReading
from screwgauge.reference.rotations import Array

#: Limits beyond this value are ignored [rad or m]: programs write 1000 for no limit, while 180 is a limit in degrees.
BOUNDLESS = 900.0


def link_facts(pair: Pair) -> Iterator[Fact]:
    """Compare all links that have a partner, from the ground outwards."""
    for one, other in pair.links:
        part, partner = ("/".join(link.joints or link.names) for link in (one, other))
        if one.kind != other.kind:
            yield from _kind(pair, one, other, part, partner)
        elif one.kind == "F":
            yield from _base(pair, one, other)
        elif one.articulated and other.articulated and one.letters != other.letters:
            yield Fact(part, "kind", one.letters, other.letters, kind="convention", partner=partner)
        if one.kind == other.kind and _is_plain(one) and _is_plain(other) and len(one.elements) == len(other.elements):
            yield from _coordinates(pair, one, other)
            continue
        if len(one.joints) == len(other.joints):
            pair.joints.update({x: Partner(y) for x, y in zip(one.joints, other.joints, strict=False)})
        yield from _lost_forces(pair, one, other)
        if len(one.joints) == len(other.joints) == 1:
            yield from _joint_facts(pair, one.joints[0], limited=one.kind == other.kind)
        if one.kind == other.kind:
            yield from _places(pair, one, other, moved=False)


def _is_plain(link: Link) -> bool:
    """Return True if a link consists only of hinges and slides that are joints in the file."""
    return all(each.joint and each.kind in ("hinge", "slide") for each in link.elements)


def _lost_forces(pair: Pair, one: Link, other: Link) -> Iterator[Fact]:
    """Yield passive forces of joints that the other model replaces with point closures."""
    if bool(one.joints) == bool(other.joints):
        return
    side, reading, joints = ("A", pair.a.reading, one.joints) if one.joints else ("B", pair.b.reading, other.joints)
    for name in joints:
        for what in (what for what in PASSIVE if getattr(reading.joints[name], what)):
            value = np.asarray(getattr(reading.joints[name], what))
            a, b = (value, np.zeros(())) if side == "A" else (np.zeros(()), value)
            changes = (Change(name, what, b),) if side == "A" else ()
            yield Fact(name, what, a, b, unit_of(what, reading.joints[name]), 1.0, changes=changes)


def _kind(pair: Pair, one: Link, other: Link, part: str, partner: str) -> Iterator[Fact]:
    """Yield joints that the other model fixes, or else the two kinds of the link, which loops may make equivalent."""
    met = [*_match_joints(pair, one, other)]
    if met and len(met) == min(len(one.elements), len(other.elements)):
        for k, (side, link) in enumerate(zip("AB", (one, other), strict=True)):
            for x in (x for x in link.elements if x.joint and all(x is not pair_[k] for pair_ in met)):
                a, b = (x.kind, None) if side == "A" else (None, x.kind)
                yield Fact(x.joint, "fixed", a, b, more=(link.far,))
        return
    joints = [{j for each in links for j in each.joints} for links in zip(*pair.links, strict=True)]
    covered = all({*machine.reading.joints} == names for machine, names in zip((pair.a, pair.b), joints, strict=True))
    looped = not (one.joints and other.joints) and covered
    alike = looped and freedom_left(pair.a.reading) == freedom_left(pair.b.reading)
    yield Fact(part, "kind", one.kind, other.kind, kind="convention" if alike else "model", partner=partner)


def _match_joints(pair: Pair, one: Link, other: Link) -> Iterator[tuple[Element, Element]]:
    """Match joints that have equal axes in two links of different kinds, keeping their order."""
    if len(one.elements) == len(other.elements):
        return
    left, T = [*other.elements], pair.placed[one.near]
    for x in (x for x in one.elements if x.joint):
        for i, y in enumerate(left):
            if y.joint and np.linalg.norm(gap(x, y.displace(T), pair.a.length)) < EXACT:
                yield x, y
                left = left[i + 1 :]
                break


def _base(pair: Pair, one: Link, other: Link) -> Iterator[Fact]:
    """Compare the joints and the initial pose of a free body in both models."""
    ours, theirs = (tuple(each.kind for each in link.elements) for link in (one, other))
    if ours != theirs:
        yield Fact(one.far, "base", ours, theirs, kind="convention", partner=other.far)
    T = pair.displacement(one.near, one.far)
    if (size := float(np.abs(T - np.eye(4)).max())) > SUM * TOLERANCE:
        origin = pair.a.bodies[one.far].pose[:3, 3]
        step = step_of(np.asarray(np.linalg.inv(T)), origin)
        yield Fact(one.far, "start", np.zeros((2, 3)), step, "m", size, "convention", partner=other.far)


def _coordinates(pair: Pair, one: Link, other: Link) -> Iterator[Fact]:
    """Split the displacement of the far body into the motion of the joints and a remainder."""
    a, b = pair.a, pair.b
    D = _displacement(pair, one, other)
    joints = [
        (a.reading.joints[x.joint], b.reading.joints[y.joint])
        for x, y in zip(one.elements, other.elements, strict=True)
    ]
    senses = _senses(pair, one, other)
    ways = _ways(one, D, a.length, [j.home - s * k.home for s, (j, k) in zip(senses, joints, strict=True)])
    E, size = remainder_of(one, D, ways, a.length)
    if moved := size > SUM * TOLERANCE:
        yield _place_fact(pair, one, other, D, np.asarray(np.linalg.inv(E)))
    for x, y, sense, way, (j, k) in zip(one.elements, other.elements, senses, ways, joints, strict=True):
        zero = k.home - sense * j.home + sense * way  # B's coordinate = sense * A's + zero
        zero = math.remainder(zero, math.tau) if x.kind == "hinge" else zero
        pair.joints[x.joint] = Partner(y.joint, sense, zero)
        yield from _count_facts(pair, x, j)
        yield from _joint_facts(pair, x.joint)
    yield from _places(pair, one, other, moved=moved)


def _displacement(pair: Pair, one: Link, other: Link) -> Array:
    """Return the displacement from A's far body to B's far body, with open loops closed at the link."""
    D = pair.displacement(one.near, one.far)
    D = D if other.step is None else pair.placed[one.far] @ other.step @ np.linalg.inv(pair.placed[one.near])
    return D if one.step is None else np.asarray(np.linalg.inv(one.step) @ D)


def _senses(pair: Pair, one: Link, other: Link) -> list[float]:
    """Return the sense of each joint of B relative to its partner: 1 or -1."""
    R = pair.placed[one.near if one.elements[0].turned else one.far][:3, :3]
    return [
        (1.0 if x.direction @ (R @ y.direction) >= 0.0 else -1.0) * (-1.0 if x.turned != y.turned else 1.0)
        for x, y in zip(one.elements, other.elements, strict=True)
    ]


def _ways(link: Link, D: Array, length: float, same: Sequence[float]) -> Sequence[float]:
    """Compute the joint motions of a link that best approximate a displacement D.

    Args:
        same: Joint motions that give equal coordinates; they are preferred if they fit equally well.
    """
    fitted = steps_of(link, D, length)
    if (
        remainder_of(link, D, same, length)[1] < SUM * TOLERANCE
        or remainder_of(link, D, fitted, length)[1] > SUM * TOLERANCE
    ):
        return same
    return fitted


def steps_of(link: Link, D: Array, length: float) -> Sequence[float]:
    x, R = link.elements[0], D[:3, :3]
    if len(link.elements) > 1:
        start = np.zeros(len(link.elements))
        return [*descend(lambda q: _entries(remainder_of(link, D, q, length)[0], length)[None], start)]
    if x.kind == "slide":
        return [float(x.direction @ D[:3, 3])]
    sine = 0.5 * float(x.direction @ np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]))
    return [math.atan2(sine, 0.5 * float(np.trace(R) - x.direction @ R @ x.direction))]


def _entries(E: Array, length: float) -> Array:
    return np.append((E[:3, :3] - np.eye(3)).ravel(), E[:3, 3] / length)


def remainder_of(link: Link, D: Array, ways: Sequence[float] | Array, length: float) -> tuple[Array, float]:
    """Compute the remainder of a displacement after motions of the joints, shape (4, 4), and its magnitude."""
    T: Array = np.eye(4)
    for element, way in zip(link.elements, ways, strict=True):
        T = exponential(element.kind, element.direction, element.centre, float(way)) @ T  # outer motions first
    E = np.asarray(np.linalg.inv(T) @ D)
    return E, float(np.abs(_entries(E, length)).max())


def _place_fact(pair: Pair, one: Link, other: Link, D: Array, X: Array) -> Fact:
    """Create the fact for a displaced link, and determine on which of its bodies it is displaced.

    Args:
        D: Displacement from A's near body to B's near body, with the far bodies aligned. Shape (4, 4).
        X: Displacement from A's far body to B's far body, with the near bodies aligned, excluding the motion of the
            joints. Shape (4, 4).
    """
    ends = {body for body, *_ in _shifts(pair, one, other)}
    far = ends == {one.far} if ends else one.elements[0].turned  # a shift along the axis is visible on neither body
    body, carried, element = (one.far, one.near, one.elements[-1]) if far else (one.near, one.far, one.elements[0])
    X = np.asarray(D @ np.linalg.inv(X) @ np.linalg.inv(D)) if far else X
    change = _end_change(one, body, X)
    hangs = change.what == "placement"
    return Fact(
        "/".join(one.joints),
        "placement" if hangs else "end",
        np.zeros((2, 3)),
        step_of(X, pair.a.bodies[carried].pose[:3, 3] if hangs else element.centre),
        "m",
        float(np.abs(_entries(X, pair.a.length)).max()),
        changes=(change,),
        partner="/".join(other.joints),
        of=body,
    )


def _end_change(link: Link, body: str, X: Array) -> Change:
    """Return the change that displaces a link's end on the given body by X."""
    far = body == link.far
    element = link.elements[-1 if far else 0]
    if element.turned == far:  # the file declares the joint from this body to the other
        return Change(element.joint, "placement", X)
    return Change(element.joint, "seat", np.asarray(np.linalg.inv(X)))


def _count_facts(pair: Pair, x: Element, joint: JointReading) -> Iterator[Fact]:
    """Compare the sense and the zero position of a joint."""
    name, partner = x.joint, pair.joints[x.joint]
    if partner.sign < 0.0:
        change = Change(name, "sign", np.array(-1.0))
        yield Fact(name, "sign", 1.0, -1.0, kind="convention", changes=(change,), partner=partner.name)
    size = abs(partner.zero) / (1.0 if x.kind == "hinge" else pair.a.length)
    if size > SUM * TOLERANCE:
        change = Change(name, "zero", np.array(joint.home + partner.sign * partner.zero))
        unit = unit_of("zero", joint)
        step = -partner.sign * partner.zero
        yield Fact(name, "zero", 0.0, step, unit, size, "convention", (change,), partner.name)


def _joint_facts(pair: Pair, name: str, *, limited: bool = True) -> Iterator[Fact]:
    """Compare passive forces and limits of a joint, with B's coordinate converted to A's."""
    partner = pair.joints[name]
    a, b = pair.a.reading.joints[name], pair.b.reading.joints[partner.name]
    for what in PASSIVE:
        if size := difference(getattr(a, what), getattr(b, what), 1e-12):
            yield _entry(name, what, getattr(a, what), getattr(b, what), a, size, partner)
    rest = partner.sign * (b.rest - partner.zero)
    if a.stiffness and b.stiffness and (size := abs(a.rest - rest)) > SUM * TOLERANCE:
        yield replace(
            _entry(name, "rest", a.rest, rest, a, size, partner), changes=(_change_to_b(name, "rest", b.rest),)
        )
    if limited:
        described = "" in (pair.a.reading.form, pair.b.reading.form)
        yield from _limits(name, a, b, partner, described=described)


def _change_to_b(name: str, what: str, value: object) -> Change:
    """Create a change to the number in B's file, for a joint that already has the zero and sense of B."""
    return Change(name, what, np.asarray(value, float))


def _entry(name: str, what: str, a: object, b: object, joint: JointReading, size: float, partner: Partner) -> Fact:
    values = np.asarray(a, float), np.asarray(b, float)
    change = Change(name, what, values[1])
    return Fact(name, what, *values, unit_of(what, joint), size, changes=(change,), partner=partner.name)


def _limits(name: str, a: JointReading, b: JointReading, partner: Partner, *, described: bool) -> Iterator[Fact]:
    """Compare limits, ignoring unreachable limits; equal numbers with a different zero count as a convention.

    Args:
        described: True if either model is a description; descriptions have no limits.
    """
    theirs = sorted(partner.sign * (x - partner.zero) for x in b.limits)
    first, second = (np.clip(each, -BOUNDLESS, BOUNDLESS) for each in (a.limits, theirs))
    none = [bool((np.abs(each) >= BOUNDLESS).all()) for each in (first, second)]
    scale = max(1.0, *(float(np.abs(each).max()) for each in (first, second)))
    size = float(np.abs(first - second).max()) / scale
    if all(none) or (described and any(none)) or size <= SUM * TOLERANCE:
        return
    ours, others = (None if lacks else each for lacks, each in zip(none, (first, second), strict=True))
    same = bool(partner.zero) and np.allclose(a.limits, b.limits, rtol=1e-9)
    yield Fact(
        name,
        "limits",
        ours,
        others,
        unit_of("limits", a),
        math.inf if any(none) else size,
        "convention" if same else "model",
        (_change_to_b(name, "limits", np.clip(b.limits, -BOUNDLESS, BOUNDLESS)),),
        partner.name,
    )


def _places(pair: Pair, one: Link, other: Link, *, moved: bool) -> Iterator[Fact]:
    """Compare the locations of a link on its two bodies.

    Args:
        moved: True if a displacement of the carried body was already reported.
    """
    sides = [*_shifts(pair, one, other)]
    if not sides or (moved and len(sides) < 2):
        return
    joint = one.joints[0] if len(one.joints) == len(one.elements) == 1 and len(sides) == 2 else ""
    elements = [*zip(one.elements, other.elements, strict=False)]
    if len(one.elements) == len(other.elements) and all(len(x.closures) == len(y.closures) > 0 for x, y in elements):
        yield from end_facts(pair, one, other)
        return
    for body, x, y, size in sides[:1] if joint else sides:
        step = _step(x, y)
        if joint:
            changes = tuple(_axis(joint, x, y, step, pair.a.length))
        else:
            changes = (_end_change(one, body, lay(y, x)),) if one.articulated and len(sides) == 1 else ()
        yield Fact(
            "/".join(one.joints or one.names),
            "axis" if joint else "end",
            np.zeros((2, 3)),
            step,
            "m",
            size,
            changes=changes,
            partner="/".join(other.joints or other.names),
            of=one.near if joint else body,
        )


def _shifts(pair: Pair, one: Link, other: Link) -> Iterator[tuple[str, Element, Element, float]]:
    """Yield features of a link whose locations on a body and on its partner differ, and the distance between them."""
    for body, there in ((one.near, other.near), (one.far, other.far)):
        for x, y in zip(features(one, body), features(other, there), strict=False):
            y = y.displace(pair.placed[body])
            size = float(np.linalg.norm(gap(x, y, pair.a.length)))
            if size > SUM * TOLERANCE:
                yield body, x, y, size


def _step(x: Element, y: Element) -> Array:
    """Compute the rotation and translation between two features; omit translations without effect. Shape (2, 3)."""
    way = y.centre - x.centre
    way = {"hinge": way - (way @ y.direction) * y.direction, "ball": way, "slide": np.zeros(3)}[x.kind]
    sense = 1.0 if x.direction @ y.direction >= 0.0 else -1.0
    turn = np.cross(x.direction, sense * y.direction)
    sine = float(np.linalg.norm(turn))
    angle = math.atan2(sine, abs(float(x.direction @ y.direction)))
    return np.array([turn / sine * angle if sine > 1e-12 else np.zeros(3), way])


def _axis(joint: str, x: Element, y: Element, step: Array, length: float) -> Iterator[Change]:
    """Yield the changes that move only the axis of a joint."""
    if np.linalg.norm(step[0]) > TOLERANCE:
        sense = 1.0 if x.direction @ y.direction >= 0.0 else -1.0
        yield Change(joint, "axis", sense * y.direction)
    if x.kind != "slide" and np.linalg.norm(step[1]) > TOLERANCE * length:
        yield Change(joint, "centre", x.centre + step[1])
