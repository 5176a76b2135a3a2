"""Compares bodies: mass, centre of mass, inertia and the gravity-compensated share of the weight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, difference
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.properties import INERTIAL, Change, unit_of
from screwgauge.models.machine import NO_MASS, Machine
from screwgauge.models.matter import Matter, displace, remainder
from screwgauge.reference.mechanism import GROUND


def body_facts(pair: Pair) -> Iterator[Fact]:
    """Compare all bodies that have a partner."""
    for name, other in pair.bodies.items():
        if GROUND in (name, other):
            continue
        theirs = displace(pair.b.bodies[other].matter, pair.placed[name])
        yield from _matter_facts(pair, name, other, pair.a.bodies[name].matter, theirs)
        yield from _compensation(pair, name, other)


def _matter_facts(pair: Pair, name: str, other: str, ours: Matter, theirs: Matter) -> Iterator[Fact]:
    """Compare the mass properties of two bodies in A's world frame."""
    sizes = _sizes(ours, theirs, pair.a.length)
    if not any(sizes.values()):
        return
    body = pair.a.bodies[name]
    changes = _changes(pair.a, name, Matter(*(getattr(theirs if sizes[what] else ours, what) for what in INERTIAL)))
    alone = len(body.members) == 1
    local = [displace(each, np.asarray(np.linalg.inv(body.pose))) for each in (ours, theirs)]
    for what in (what for what in INERTIAL if sizes[what]):
        a, b = (np.asarray(getattr(each, what)) for each in local)
        needed = (changes[what],) if alone else tuple(changes.values())
        yield Fact(name, what, a, b, unit_of(what), sizes[what], changes=needed, partner=other)


def _sizes(ours: Matter, theirs: Matter, length: float) -> dict[str, float]:
    """Return the relative difference in each property; 0 where it is within rounding."""
    solid = min(ours.mass, theirs.mass) > NO_MASS
    most = max(float(np.abs(ours.inertia).max()), float(np.abs(theirs.inertia).max()))
    # a tensor about a different centre is only as accurate as that centre
    floor = TOLERANCE * max(ours.mass, theirs.mass) * length**2
    away = float(np.linalg.norm(ours.com - theirs.com)) / length
    off = float(np.abs(ours.inertia - theirs.inertia).max())
    return {
        "mass": difference(ours.mass, theirs.mass, NO_MASS),
        "com": away if solid and away > TOLERANCE else 0.0,
        "inertia": off / most if most and off > max(10.0 * TOLERANCE * most, 1e-3 * floor) else 0.0,
    }


def _changes(machine: Machine, name: str, whole: Matter) -> dict[str, Change]:
    """Return the changes to the heaviest member of a body that give the whole body these mass properties."""
    members, bodies = machine.bodies[name].members, machine.reading.bodies
    main = max(members, key=lambda each: bodies[each].mass)
    others = (displace(bodies[each], bodies[each].pose) for each in members if each != main)
    own = displace(remainder(whole, others), np.asarray(np.linalg.inv(bodies[main].pose)))
    return {what: Change(main, what, np.asarray(getattr(own, what))) for what in INERTIAL}


def _compensation(pair: Pair, name: str, other: str) -> Iterator[Fact]:
    shares = []
    for machine, body in ((pair.a, pair.a.bodies[name]), (pair.b, pair.b.bodies[other])):
        own = machine.reading.bodies
        weight = sum(own[member].mass * own[member].gravcomp for member in body.members)
        shares.append(weight / (sum(own[member].mass for member in body.members) or 1.0))
    if size := difference(*shares):
        changes = tuple(Change(member, "gravcomp", np.array(shares[1])) for member in pair.a.bodies[name].members)
        a, b = map(np.asarray, shares)
        yield Fact(name, "gravcomp", a, b, "", size, changes=changes, partner=other)
