"""Facts of bodies: mass, centre of mass, inertia, compensated weight; and of those that only one side moves apart.

By their names that is known before machines are aligned; without names, only afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, Pair, apart
from screwgauge.diagnosis.facts.links import remainder_of, steps_of
from screwgauge.diagnosis.facts.loops import SUM
from screwgauge.diagnosis.properties import INERTIAL, Change, unit_of
from screwgauge.models.kinematics import rehomed
from screwgauge.models.machine import NO_MASS, Link, Machine, fused, machine_of
from screwgauge.models.matter import Matter, combined, displaced, remainder
from screwgauge.models.readings.reading import FREEDOMS
from screwgauge.reference.mechanism import GROUND

#: Fused body -> side that moves it, and the body of A that it is part of on the other side.
Fused = Mapping[str, tuple[str, str]]


def fused_by_names(a: Machine, b: Machine) -> tuple[Machine, Machine, tuple[Fact, ...]]:
    """Both machines without links between bodies that the other one has as one, and without welds that it lacks."""
    sides, facts = {"A": a, "B": b}, list[Fact]()
    for side, other in ("AB", "BA"):
        sides[side], lost = _without_welds(sides[side], sides[other], side)
        facts += lost
    for side, other in ("AB", "BA", "AB"):
        sides[side], lost = _without_links(sides[side], sides[other], side)
        facts += lost
    return sides["A"], sides["B"], tuple(facts)


def _owners(machine: Machine) -> dict[str, str]:
    """The body that each of its links is part of."""
    return {name: body for body, each in machine.bodies.items() for name in each.frames}


def _without_welds(own: Machine, other: Machine, side: str) -> tuple[Machine, list[Fact]]:
    """A machine without welds of bodies that the other one has, and not as one."""
    owners, welds = _owners(other), {n: c for n, c in own.reading.closures.items() if c.kind == "weld"}
    gone = [n for n, c in welds.items() if len({owners[end] for end in (c.first, c.second) if end in owners}) == 2]
    if not gone:
        return own, []
    closures = {name: each for name, each in own.reading.closures.items() if name not in gone}
    return machine_of(replace(own.reading, closures=closures)), [_lost(side, name, "link", "weld") for name in gone]


def _without_links(own: Machine, other: Machine, side: str) -> tuple[Machine, list[Fact]]:
    """A machine with bodies as one that the other one has as one, where that has them."""
    owners = _owners(other)
    held = {
        link.joints: q
        for link in own.links
        if len(link.joints) == 1 and _is_one(own, link, owners) and (q := _held(own, other, link, owners)) is not None
    }
    own = machine_of(rehomed(own.reading, {name: q for (name,), q in held.items()})[0]) if held else own
    facts = list[Fact]()
    while (link := next((link for link in own.links if _is_one(own, link, owners)), None)) is not None:
        joint = own.reading.joints[link.joints[0]] if link.joints else None
        at = f"{held[link.joints]:.6g} {unit_of('zero', joint)}" if link.joints in held else ""
        facts.append(_lost(side, "/".join(link.joints or link.names), "fixed", link.kind, (link.far,), at))
        own = fused(own, link)
    return own, facts


def _lost(side: str, part: str, what: str, kind: str, bodies: tuple[str, ...] = (), at: str = "") -> Fact:
    a, b = (kind, None) if side == "A" else (None, kind)
    return Fact(part, what, a, b, of=at, more=bodies)


def _is_one(machine: Machine, link: Link, owners: Mapping[str, str]) -> bool:
    """Whether both bodies of a link are one on the other side, by the names of their members."""
    ends = [{owners[name] for name in machine.bodies[end].members if name in owners} for end in (link.near, link.far)]
    return len(ends[0]) == 1 and ends[0] == ends[1]


def _held(own: Machine, other: Machine, link: Link, owners: Mapping[str, str]) -> float | None:
    """The coordinate of a joint at which its bodies are as the other side has them; None at home, or where none is."""
    near, far = (next(name for name in own.bodies[end].members if name in owners) for end in (link.near, link.far))
    there = other.bodies[owners[near]].frames
    N, F = (own.bodies[end].frames[name] for end, name in ((link.near, near), (link.far, far)))
    D = np.asarray(N @ np.linalg.inv(there[near]) @ there[far] @ np.linalg.inv(F))
    joint = own.reading.joints[link.joints[0]]
    if FREEDOMS[joint.kind] > 1 or link.step is not None:
        return None
    (way,) = steps_of(link, D, own.length)
    fits = remainder_of(link, D, [way], own.length)[1] <= SUM * TOLERANCE
    return joint.home + way if fits and abs(way) > SUM * TOLERANCE else None


def fused_bodies(pair: Pair) -> Fused:
    """Find bodies that only one side moves, and that are part of their neighbour on the other side."""
    found = {}
    for side, links in (("A", pair.alignment.only_a), ("B", pair.alignment.only_b)):
        for link in links:
            for near, far in ((link.near, link.far), (link.far, link.near)):
                if neighbour := _neighbour(pair, side, near, far):
                    found[far] = side, neighbour
    return found


def _neighbour(pair: Pair, side: str, near: str, far: str) -> str:
    """The body of A that a body without a partner is part of on the other side; empty where there is none."""
    partners = pair.alignment.bodies if side == "A" else {b: a for a, b in pair.alignment.bodies.items()}
    own, other = (pair.a, pair.b) if side == "A" else (pair.b, pair.a)
    if far in partners or near not in partners:
        return ""
    return (near if side == "A" else partners[near]) if _is_fixed(own, other, far, (near, partners[near])) else ""


def _is_fixed(own: Machine, other: Machine, body: str, near: tuple[str, str]) -> bool:
    """Whether the partner of a neighbour has the body, or a link of it, as a part; else whether its mass says so."""
    if {*own.bodies[body].frames} & {*other.bodies[near[1]].frames}:
        return True
    bare, mass = own.bodies[near[0]].matter.mass, own.bodies[body].matter.mass
    there = other.bodies[near[1]].matter.mass
    return near[0] != GROUND and abs(there - (bare + mass)) < abs(there - bare)


def body_facts(pair: Pair, fused: Fused) -> Iterator[Fact]:
    """Compare all bodies that have a partner, with what is part of them on one side only."""
    for name, other in pair.alignment.bodies.items():
        if GROUND in (name, other):
            continue
        ours, theirs = pair.a.bodies[name].matter, pair.b.bodies[other].matter
        for far in (far for far, (_, near) in fused.items() if near == name):
            if fused[far][0] == "A":
                ours = combined(ours, pair.a.bodies[far].matter)
            else:
                theirs = combined(theirs, pair.b.bodies[far].matter)
        theirs = displaced(theirs, pair.alignment.placed[name])
        yield from _matter_facts(pair, name, other, ours, theirs)
        yield from _compensation(pair, name, other)


def _matter_facts(pair: Pair, name: str, other: str, ours: Matter, theirs: Matter) -> Iterator[Fact]:
    """Compare two matters in A's world."""
    sizes = _sizes(ours, theirs, pair.a.length)
    if not any(sizes.values()):
        return
    body = pair.a.bodies[name]
    changes = _changes(pair.a, name, Matter(*(getattr(theirs if sizes[what] else ours, what) for what in INERTIAL)))
    alone = len(body.members) == 1
    local = [displaced(each, np.asarray(np.linalg.inv(body.pose))) for each in (ours, theirs)]
    for what in (what for what in INERTIAL if sizes[what]):
        a, b = (np.asarray(getattr(each, what)) for each in local)
        needed = (changes[what],) if alone else tuple(changes.values())
        yield Fact(name, what, a, b, unit_of(what), sizes[what], changes=needed, partner=other)


def _sizes(ours: Matter, theirs: Matter, length: float) -> dict[str, float]:
    """Size of the difference of each property; 0 where it is rounding."""
    solid = min(ours.mass, theirs.mass) > NO_MASS
    most = max(float(np.abs(ours.inertia).max()), float(np.abs(theirs.inertia).max()))
    # a tensor about another centre is only as exact as that centre
    floor = TOLERANCE * max(ours.mass, theirs.mass) * length**2
    off = float(np.abs(ours.inertia - theirs.inertia).max())
    return {
        "mass": apart(ours.mass, theirs.mass, NO_MASS),
        "com": _beyond(float(np.linalg.norm(ours.com - theirs.com)) / length) if solid else 0.0,
        "inertia": off / most if most and off > max(10.0 * TOLERANCE * most, 1e-3 * floor) else 0.0,
    }


def _beyond(size: float) -> float:
    return size if size > TOLERANCE else 0.0


def _changes(machine: Machine, name: str, whole: Matter) -> dict[str, Change]:
    """Changes of the heaviest member of a body that give the whole a matter, in A's world."""
    members, bodies = machine.bodies[name].members, machine.reading.bodies
    main = max(members, key=lambda each: bodies[each].mass)
    others = (displaced(bodies[each], bodies[each].pose) for each in members if each != main)
    own = displaced(remainder(whole, others), np.asarray(np.linalg.inv(bodies[main].pose)))
    return {what: Change(main, what, np.asarray(getattr(own, what))) for what in INERTIAL}


def _compensation(pair: Pair, name: str, other: str) -> Iterator[Fact]:
    shares = []
    for machine, body in ((pair.a, pair.a.bodies[name]), (pair.b, pair.b.bodies[other])):
        own = machine.reading.bodies
        weight = sum(own[member].mass * own[member].gravcomp for member in body.members)
        shares.append(weight / (sum(own[member].mass for member in body.members) or 1.0))
    if size := apart(*shares):
        changes = tuple(Change(member, "gravcomp", np.array(shares[1])) for member in pair.a.bodies[name].members)
        a, b = map(np.asarray, shares)
        yield Fact(name, "gravcomp", a, b, "", size, changes=changes, partner=other)
