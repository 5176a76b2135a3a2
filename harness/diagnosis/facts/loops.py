"""Compares loops: ends of closures, couplings as functions of A's coordinates, and the softness of both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from screwgauge.diagnosis.amounts import join
from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, difference
from screwgauge.diagnosis.machine.alignment import assign
from screwgauge.diagnosis.machine.features import EXACT, features, gap
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.properties import Change, unit_of
from screwgauge.models.machine import Element, Link, Machine
from screwgauge.models.matter import displace
from screwgauge.models.poses import exponential
from screwgauge.models.readings.reading import CouplingReading
from screwgauge.reference.couplings import PolynomialSum
from screwgauge.reference.linear import rank
from screwgauge.reference.rotations import Array

#: Number of tolerances by which a location computed from several numbers may differ.
SUM = 3.0


def end_facts(pair: Pair, one: Link, other: Link) -> Iterator[Fact]:
    """Yield a fact for each displaced end of a closure, or a single fact if both ends are displaced equally."""
    for x, y in zip(one.elements, other.elements, strict=True):
        for name, partner in closure_names(pair, x, y).items():
            ends = [*_ends(pair, name, partner)]
            if not ends:
                continue
            both = len(ends) == 2 and np.linalg.norm(ends[0].b - ends[1].b) < EXACT * pair.a.length
            yield replace(ends[0], of="", changes=ends[0].changes + ends[1].changes) if both else ends[0]
            yield from ends[1:] if not both else ()


def closure_names(pair: Pair, x: Element, y: Element) -> dict[str, str]:
    """Pair closures of two elements by name if possible, or else by the distances between their points."""
    if {*x.closures} == {*y.closures}:
        return {name: name for name in x.closures}
    T = pair.placed[pair.a.part_of(_first_end(pair.a, x.closures[0])[0])]
    points = [[_first_end(m, name)[1] for name in e.closures] for m, e in ((pair.a, x), (pair.b, y))]
    moved = [T[:3, :3] @ point + T[:3, 3] for point in points[1]]
    cost = np.array([[float(np.linalg.norm(p - q)) for q in moved] for p in points[0]])
    return {x.closures[i]: y.closures[k] for i, k in assign(cost)}


def _first_end(machine: Machine, name: str) -> tuple[str, Array]:
    """Return the first body of a closure, and its point in the world frame. Shape (3,)."""
    (body, frame), _ = machine.reading.ends(name)
    return body, frame[:3, 3]


def _ends(pair: Pair, name: str, partner: str) -> Iterator[Fact]:
    """Yield displaced ends of a closure, except an end that the file derives from the opposite end."""
    a, b = pair.a.reading, pair.b.reading
    known = {pair.a.part_of(end): (end, frame) for end, frame in a.ends(name)}
    derived = a.closures[name].derived and b.closures[partner].derived
    for k, (end, frame) in enumerate(b.ends(partner)):
        body = next((n for n, o in pair.bodies.items() if o == pair.b.part_of(end)), "")
        if body not in known or (k == 1 and derived):
            continue
        own, here = known[body]
        there = pair.placed[body] @ frame
        way = there[:3, 3] - here[:3, 3]
        size = float(np.linalg.norm(way)) / pair.a.length
        if size > SUM * TOLERANCE:
            what = "first_frame" if own == a.closures[name].first else "second_frame"
            change = Change(name, what, np.asarray(np.linalg.inv(a.poses[own]) @ there))
            step = np.array([np.zeros(3), way])
            yield Fact(name, "end", np.zeros((2, 3)), step, "m", size, changes=(change,), partner=partner, of=body)


#: Tolerance of couplings over a unit range [rad or m], and of features that a rotation leaves unchanged.
SAME, ROUND = 1e-8, 1e-6


def coupling_facts(pair: Pair) -> Iterator[Fact]:
    """Compare couplings with the same dependent joint; a round body may be rotated to make them agree.

    Linear couplings that allow the same motions are equal, whichever joints are dependent.
    """
    if _are_equivalent(pair):
        return
    a, b, partners = pair.a.reading.couplings, pair.b.reading.couplings, coupling_partners(pair)
    # couplings to joints that only one model has are part of the facts about these joints
    ours = {name for name, each in a.items() if {*each.named} <= pair.joints.keys()}
    theirs = {name for name, each in b.items() if {*each.named} <= pair.back.keys()}
    yield from (_lone_coupling(pair, name, each, "A") for name, each in a.items() if name in ours - partners.keys())
    yield from (
        _lone_coupling(pair, name, each, "B") for name, each in b.items() if name in theirs - {*partners.values()}
    )
    counts = Counter(name for each in a.values() for name in each.named)
    free = {
        name for name in _free_zeros(pair.a, pair) if counts[name] == 1
    }  # a rotation that suits one coupling would violate a different coupling
    for name, other in partners.items():
        yield from _compare_couplings(pair, name, a[name], b[other], free)


def _lone_coupling(pair: Pair, name: str, coupling: CouplingReading, side: str) -> Fact:
    """Create the fact for a joint that is coupled or locked in only one model."""
    back = pair.back if side == "B" else {}
    joint, function = back.get(coupling.joint, coupling.joint), coupling.function.rename(back)
    held = not function.terms
    value = np.asarray(function.constant) if held else _leaders(function)
    a, b = (value, None) if side == "A" else (None, value)
    unit = unit_of("zero", pair.a.reading.joints.get(joint)) if held else ""
    return Fact(joint, "held" if held else "coupling", a, b, unit, more=(name,))


def _leaders(function: PolynomialSum) -> str:
    return join([*function.terms]) if function.terms else ""


def _compare_couplings(
    pair: Pair, name: str, one: CouplingReading, other: CouplingReading, free: set[str]
) -> Iterator[Fact]:
    """Compare two couplings of one joint.

    Args:
        free: Joints whose zero is unobservable; a joint is removed once a coupling determines its zero.
    """
    ours, joint, follower = one.function, one.joint, pair.partner(one.joint)
    other = other.solve_for(follower.name)
    if pair.back.get(other.joint, other.joint) != joint:
        yield from (_lone_coupling(pair, name, one, "A"), _lone_coupling(pair, name, other, "B"))
        return
    own, theirs = other.function.rename(pair.back), _function_in_a(pair, other)
    if {*own.terms} != {*ours.terms}:
        a, b = (np.concatenate([*each.polynomials.values()]) for each in (ours, theirs))
        size, more = _size(ours.minus(theirs)), (_leaders(ours), _leaders(own))
        yield Fact(joint, "leading joint", a, b, "", size, of=more[0], more=more)
        return
    # rotate a free joint to make the two couplings agree
    if abs(step := ours.constant - theirs.constant) > SAME and (turning := free & {joint, *own.terms}):
        free.discard(joint if joint in free else min(turning))
        theirs = theirs.plus(step)
    # if a joint is mounted rotated about its own axis, its coupling rotates with it
    plain = ours.paired_coefficients(_function_in_a(pair, other, zeros=False))
    along = any(pair.partner(n).zero for n in one.named) and np.abs(np.subtract(*plain)).max() < SAME
    if not along and (size := _size(ours.minus(theirs))) > SAME:
        changes = (Change(name, "polynomial", ours.paired_coefficients(own)[1]),)
        several = tuple(ours.terms) if len(ours.terms) > 1 else ()
        a, b = ours.paired_coefficients(theirs)
        yield Fact(joint, "polynomial", a, b, "", size, changes=changes, of=_leaders(ours), more=several)


def _function_in_a(pair: Pair, coupling: CouplingReading, *, zeros: bool = True) -> PolynomialSum:
    """Express the function of a coupling of B in coordinates of A.

    Args:
        zeros: Measure coordinates from A's zeros.
    """
    function, back = coupling.function.rename(pair.back), pair.back
    partners = {name: pair.partner(name) for name in (*function.terms, back.get(coupling.joint, coupling.joint))}
    starts = {name: each.zero if zeros else 0.0 for name, each in partners.items()}
    joint, follower = partners.popitem()
    signs = {name: each.sign for name, each in partners.items()}
    return function.change_variables(starts, signs).plus(-starts[joint]).times(follower.sign)


def _are_equivalent(pair: Pair) -> bool:
    """Return True if all couplings are linear and allow the same motions."""
    a, b = ([*machine.reading.couplings.values()] for machine in (pair.a, pair.b))
    if not (a and b) or not all(each.function.linear for each in (*a, *b)):
        return False
    ours = [{each.joint: -1.0, **each.function.slopes, "": each.function.constant} for each in a]
    theirs = []
    for each in b:
        function = _function_in_a(pair, each)
        theirs.append({pair.back.get(each.joint, each.joint): -1.0, **function.slopes, "": function.constant})
    columns = list(dict.fromkeys(name for row in (*ours, *theirs) for name in row))
    A, B = (np.array([[row.get(name, 0.0) for name in columns] for row in rows]) for rows in (ours, theirs))
    A, B = (rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (A, B))
    return len({rank(rows, SAME) for rows in (A, B, np.vstack([A, B]))}) == 1


def _size(function: PolynomialSum) -> float:
    """Estimate the largest magnitude of a function for coordinates between -1 and 1."""
    x = np.linspace(-1.0, 1.0, 7)
    values = [Polynomial([0.0, *p])(x) for p in function.terms.values()]
    ends = (sum((float(end(each)) for each in values), function.constant) for end in (np.min, np.max))
    return max(map(abs, ends))


def _free_zeros(machine: Machine, pair: Pair) -> set[str]:
    """Return hinges whose zero position is unobservable because one of their bodies is round."""
    links = [one for one, _ in pair.links if len(one.elements) == 1 or one.kind == "C"]
    return {x.joint for link in links for x in link.elements if x.joint and _is_round(machine, link, x)}


def _is_round(machine: Machine, link: Link, x: Element) -> bool:
    """Return True if a rotation about a hinge leaves one of the hinge's two bodies unchanged."""
    if x.kind != "hinge":
        return False
    T = exponential("hinge", x.direction, x.centre, 1.0)
    return any(_stays(machine, link, body, T) for body in (link.far, link.near))


def _stays(machine: Machine, link: Link, body: str, T: Array) -> bool:
    """Return True if a rotation leaves the mass properties and the other links of a body unchanged."""
    if body not in machine.reading.bodies:
        return False
    matter = machine.bodies[body].matter
    turned = displace(matter, T)
    size = max(float(np.abs(matter.inertia).max()), 1e-14)
    still = float(np.linalg.norm(matter.com - turned.com)) < ROUND * machine.length
    same = still and bool(np.abs(matter.inertia - turned.inertia).max() < ROUND * size)
    own = link.of(body)
    others = [f for each in machine.at(body) if each.names != own.names for f in features(each, body)]
    return same and all(bool(np.linalg.norm(gap(f, f.displace(T), machine.length)) < ROUND) for f in others)


def softness_facts(pair: Pair) -> Iterator[Fact]:
    """Compare how softly a library enforces closures and couplings, if both files specify it."""
    for room, partners in (("closures", _closure_partners(pair)), ("couplings", coupling_partners(pair))):
        for name, other in partners.items():
            a, b = (
                np.array(getattr(machine.reading, room)[each].softness)
                for machine, each in ((pair.a, name), (pair.b, other))
            )
            size = max(map(difference, a, b), default=0.0)
            if a.size == b.size and size:
                change = Change(name, "softness", b)
                yield Fact(name, "softness", a, b, "", size, changes=(change,), partner=other)


def _closure_partners(pair: Pair) -> dict[str, str]:
    """Pair closures of A and B: closures of a link by their points, welds by name."""
    found: dict[str, str] = {}
    for one, other in pair.links:
        for x, y in zip(one.elements, other.elements, strict=False):
            if len(x.closures) == len(y.closures):
                found.update(closure_names(pair, x, y))
    welds = [{n for n, c in machine.reading.closures.items() if c.kind == "weld"} for machine in (pair.a, pair.b)]
    return {**{name: name for name in sorted(welds[0] & welds[1])}, **found}


def coupling_partners(pair: Pair) -> dict[str, str]:
    """Pair couplings of A and B by the dependent joint if possible, or else by all their joints."""
    a, b, back, found = pair.a.reading.couplings, pair.b.reading.couplings, pair.back, dict[str, str]()
    named = {name: [back.get(joint, joint) for joint in each.named] for name, each in b.items()}
    keys: tuple[Callable[[Sequence[str]], Hashable], ...] = (lambda joints: joints[0], frozenset)
    for key in keys:
        theirs = {key(joints): name for name, joints in named.items() if name not in found.values()}
        ours = {name: key(each.named) for name, each in a.items() if name not in found}
        found |= {name: theirs[each] for name, each in ours.items() if each in theirs}
    return found
