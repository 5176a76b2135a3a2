"""Facts of couplings, as polynomials of A's coordinates: followed joints, held ones, and gauges that nothing shows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial import Polynomial

from screwgauge.diagnosis.facts.fact import Fact, Pair
from screwgauge.diagnosis.facts.structure import coupling_partners
from screwgauge.diagnosis.machine.features import features, gap
from screwgauge.diagnosis.properties import Change, unit_of
from screwgauge.models.machine import Element, Link, Machine
from screwgauge.models.matter import displaced
from screwgauge.models.poses import exponential
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.rotations import Array

#: Couplings that differ by less over a unit range are one [rad or m]; features that a turn leaves in place are round.
SAME, ROUND = 1e-8, 1e-6


def coupling_facts(pair: Pair) -> Iterator[Fact]:
    """Compare couplings by the joint that follows; a round body may be turned so that they agree."""
    a, b, partners = pair.a.reading.couplings, pair.b.reading.couplings, coupling_partners(pair)
    back = pair.back
    # what follows joints that one side alone has is told of these joints
    ours = {name for name, each in a.items() if {each.joint, each.of} - {""} <= pair.joints.keys()}
    theirs = {name for name, each in b.items() if {each.joint, each.of} - {""} <= back.keys()}
    yield from (_alone(pair, name, each, "A") for name, each in a.items() if name in ours - partners.keys())
    yield from (_alone(pair, name, each, "B") for name, each in b.items() if name in theirs - {*partners.values()})
    free = _free_zeros(pair.a, pair)
    for name, other in partners.items():
        yield from _followed(pair, name, a[name], b[other], free)


def _alone(pair: Pair, name: str, coupling: CouplingReading, side: str) -> Fact:
    """A joint that follows another one, or is held, on one side only."""
    back = pair.back if side == "B" else {}
    joint = back.get(coupling.joint, coupling.joint)
    held = not coupling.of
    value = np.asarray(coupling.polynomial[0]) if held else back.get(coupling.of, coupling.of)
    a, b = (value, None) if side == "A" else (None, value)
    unit = unit_of("zero", pair.a.reading.joints.get(joint)) if held else ""
    return Fact(joint, "held" if held else "coupling", a, b, unit, more=(name,))


def _followed(pair: Pair, name: str, one: CouplingReading, other: CouplingReading, free: set[str]) -> Iterator[Fact]:
    """Compare two couplings of one joint.

    Args:
        free: Joints whose zero nothing shows; one that a coupling fixes is taken out.
    """
    joint, lead = one.joint, pair.back.get(other.of, other.of)
    follower, leader = pair.partner(joint), pair.partner(lead)
    theirs = follower.sign * (
        Polynomial(other.polynomial)(Polynomial([leader.zero, leader.sign]) if other.of else 0.0) - follower.zero
    )
    theirs = theirs if isinstance(theirs, Polynomial) else Polynomial([float(theirs)])
    ours = Polynomial(one.polynomial)
    if lead != one.of:
        yield _fact(pair, name, ours, theirs, of=one.of, more=(one.of, lead))
        return
    step = ours - theirs
    # what turns freely is turned so that the two agree
    if abs(step.coef[0]) > SAME and not {joint, lead}.isdisjoint(free):
        free.discard(joint if joint in free else lead)
        theirs = theirs + step.coef[0]
    # a joint that sits turned about its own axis takes its coupling along
    plain = ours - follower.sign * Polynomial(other.polynomial)(Polynomial([0.0, leader.sign]))
    along = (follower.zero or leader.zero) and np.abs(plain.coef).max() < SAME
    if not along and _size(ours - theirs) > SAME:
        yield _fact(pair, name, ours, theirs, of=one.of, own=other.polynomial)


def _size(polynomial: Polynomial) -> float:
    return float(np.abs(polynomial(np.linspace(-1.0, 1.0, 7))).max())


def _fact(
    pair: Pair,
    name: str,
    ours: Polynomial,
    theirs: Polynomial,
    of: str,
    more: tuple[str, ...] = (),
    own: Array | None = None,
) -> Fact:
    """Args: own: B's polynomial as its joints count, zeros and senses being changed before."""
    n = max(len(ours.coef), len(theirs.coef))
    a, b = (np.pad(np.asarray(each.coef, float), (0, n - len(each.coef))) for each in (ours, theirs))
    joint = pair.a.reading.couplings[name].joint
    changes = () if own is None else (Change(name, "polynomial", np.pad(own, (0, max(0, n - len(own))))),)
    size, what = _size(ours - theirs), "leading joint" if more else "polynomial"
    return Fact(joint, what, a, b, "", size, changes=changes, of=of, more=more)


def _free_zeros(machine: Machine, pair: Pair) -> set[str]:
    """Hinges whose zero nothing shows: what they carry is the same at every angle."""
    links = [one for one, _ in pair.alignment.links if len(one.elements) == 1 or one.kind == "C"]
    return {x.joint for link in links for x in link.elements if x.joint and _is_round(machine, link, x)}


def _is_round(machine: Machine, link: Link, x: Element) -> bool:
    """Whether the body at either end of a hinge is the same after a turn about it."""
    if x.kind != "hinge":
        return False
    T = exponential("hinge", x.direction, x.centre, 1.0)
    return any(_stays(machine, link, body, T) for body in (link.far, link.near))


def _stays(machine: Machine, link: Link, body: str, T: Array) -> bool:
    """Whether the matter and the other links of a body lie where they were after a turn."""
    if body not in machine.reading.bodies:
        return False
    matter = machine.bodies[body].matter
    turned = displaced(matter, T)
    size = max(float(np.abs(matter.inertia).max()), 1e-14)
    still = float(np.linalg.norm(matter.com - turned.com)) < ROUND * machine.length
    same = still and bool(np.abs(matter.inertia - turned.inertia).max() < ROUND * size)
    own = link.of(body)
    others = [f for each in machine.at(body) if each.names != own.names for f in features(each, body)]
    return same and all(bool(np.linalg.norm(gap(f, f.placed(T), machine.length)) < ROUND) for f in others)
