"""Facts of what one side has alone, of the model as a whole, of actuators and of softness."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator, Sequence

import numpy as np

from screwgauge.diagnosis.facts.ends import closure_names
from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, Kind, Pair, apart
from screwgauge.diagnosis.facts.fused import Fused
from screwgauge.diagnosis.properties import Change, unit_of
from screwgauge.models.files.parts import NUMBERED
from screwgauge.models.machine import Link
from screwgauge.reference.rotations import Array


def structure_facts(pair: Pair, fused: Fused) -> Iterator[Fact]:
    """Tell what one side has alone: joints that are fixed on the other side, subtrees, links between known bodies."""
    for side, links in (("A", pair.alignment.only_a), ("B", pair.alignment.only_b)):
        machine = pair.a if side == "A" else pair.b
        known = {*pair.alignment.bodies} if side == "A" else {*pair.alignment.bodies.values()}
        told = set[str]()
        for link in links:
            ends = {link.near, link.far} - known
            if ends & fused.keys():
                yield _lost(side, "fixed", link, sorted(ends & fused.keys()))
            elif not ends:
                yield _lost(side, "link", link)
            elif not ends & told:
                bodies = _component(links, ends, known | fused.keys())
                told |= {*bodies}
                mass = sum(machine.bodies[body].matter.mass for body in bodies)
                ways = sum(len({each.near, each.far} & {*bodies}) == 1 for each in machine.links)
                yield _lost(side, "branch" if ways == 1 else "link", link, bodies, f"{mass:.6g}")


def _component(links: Sequence[Link], bodies: set[str], known: Collection[str]) -> list[str]:
    """Bodies without a partner that hang together, from some of them on."""
    found = list(bodies)
    for body in found:
        ends = {end for link in links if link.joins(body) for end in (link.near, link.far)}
        found += sorted(ends - {*found, *known})
    return found


def _lost(side: str, what: str, link: Link, bodies: Sequence[str] = (), mass: str = "") -> Fact:
    """A link without a partner, with the bodies that go with it and their mass."""
    a, b = (link.kind, None) if side == "A" else (None, link.kind)
    gone = side == "A" and bool(link.joints) and (what == "branch" or (what == "link" and len(bodies) == 1))
    changes = (Change(link.joints[0], what, np.array(0.0)),) if gone else ()
    return Fact("/".join(link.joints or link.names), what, a, b, changes=changes, of=mass, more=tuple(bodies))


def name_facts(pair: Pair) -> Iterator[Fact]:
    """Tell joints that have the name of another joint on the other side."""
    for name, partner in pair.joints.items():
        if pair.crosses_names(name):
            yield Fact(name, "name", name, partner.name, kind="convention", partner=partner.name)


def model_facts(pair: Pair) -> Iterator[Fact]:
    """Compare gravity, where both sides state it, and the medium."""
    a, b = pair.a.reading, pair.b.reading
    if a.gravity is not None and b.gravity is not None:
        most = max(float(np.linalg.norm(a.gravity)), float(np.linalg.norm(b.gravity)), 1e-300)
        if (size := float(np.linalg.norm(a.gravity - b.gravity)) / most) > TOLERANCE:
            change = Change("", "gravity", b.gravity)
            yield Fact("", "gravity", a.gravity, b.gravity, unit_of("gravity"), size, changes=(change,))
    for what, unit, ours, theirs in zip(("density", "viscosity"), ("kg/m^3", "Pa s"), a.medium, b.medium, strict=True):
        if size := apart(ours, theirs):
            change = Change("", "medium", np.array(b.medium))
            yield Fact("", what, np.asarray(ours), np.asarray(theirs), unit, size, changes=(change,))


def actuator_facts(pair: Pair) -> Iterator[Fact]:
    """Compare motors of joints by the joints that they drive; a file without any says nothing of them."""
    a, b = pair.a.reading.actuators, pair.b.reading.actuators
    if not (a and b):
        return
    partners = actuator_partners(pair)
    back = pair.back
    for name, (joint, gear) in a.items():
        if name not in partners:
            yield Fact(name, "actuator", np.asarray(gear), None, of=joint)
            continue
        driven, other = b[partners[name]]
        if back.get(driven, driven) != joint:
            yield Fact(name, "driven joint", joint, driven, partner=partners[name], of=joint)
            continue
        # a motor of a joint that counts the other way may have either sign
        same = not apart(gear, -other) and pair.partner(joint).sign < 0.0
        if size := apart(gear, other):
            change = Change(name, "gear", np.array(other))
            kind: Kind = "convention" if same else "model"
            yield Fact(
                name, "gear", np.asarray(gear), np.asarray(other), "", size, kind, (change,), partners[name], joint
            )
    for name in b.keys() - partners.values():
        joint, gear = b[name]
        yield Fact(name, "actuator", None, np.asarray(gear), of=joint)


def actuator_partners(pair: Pair) -> dict[str, str]:
    """Actuators of A with those of B: of one name and joint, of a name that a file gives, of one joint, of one name."""
    a, b, back = pair.a.reading.actuators, pair.b.reading.actuators, pair.back
    ours = {name: joint for name, (joint, _) in a.items()}
    theirs = {name: back.get(joint, joint) for name, (joint, _) in b.items()}
    found: dict[str, str] = {}
    tests: tuple[Callable[[str, str], bool], ...] = (
        lambda x, y: x == y and ours[x] == theirs[y],
        lambda x, y: x == y and not NUMBERED.fullmatch(x),
        lambda x, y: ours[x] == theirs[y],
        lambda x, y: x == y,
    )
    for fits in tests:
        for name in (name for name in ours if name not in found):
            free = (other for other in theirs if other not in found.values() and fits(name, other))
            if (partner := next(free, None)) is not None:
                found[name] = partner
    return found


def softness_facts(pair: Pair) -> Iterator[Fact]:
    """Compare how softly a library keeps closures and couplings, where both files say it."""
    for room, partners in (("closures", _closure_partners(pair)), ("couplings", coupling_partners(pair))):
        for name, other in partners.items():
            a, b = (
                np.array(getattr(machine.reading, room)[each].softness)
                for machine, each in ((pair.a, name), (pair.b, other))
            )
            if a.size == b.size and a.size and (size := _largest(a, b)):
                change = Change(name, "softness", b)
                yield Fact(name, "softness", a, b, "", size, changes=(change,), partner=other)


def _largest(a: Array, b: Array) -> float:
    return max(apart(float(x), float(y)) for x, y in zip(a, b, strict=True))


def _closure_partners(pair: Pair) -> dict[str, str]:
    """Closures of A with those of B: of one link, in the order of their names there; welds by their names."""
    found: dict[str, str] = {}
    for one, other in pair.alignment.links:
        for x, y in zip(one.elements, other.elements, strict=False):
            if len(x.closures) == len(y.closures):
                found.update(closure_names(pair, x, y))
    welds = [{n for n, c in machine.reading.closures.items() if c.kind == "weld"} for machine in (pair.a, pair.b)]
    return {**{name: name for name in sorted(welds[0] & welds[1])}, **found}


def coupling_partners(pair: Pair) -> dict[str, str]:
    """Couplings of A with those of B, by the joint that follows, else by all joints that they couple."""
    a, b, back, found = pair.a.reading.couplings, pair.b.reading.couplings, pair.back, dict[str, str]()
    named = {name: [back.get(joint, joint) for joint in each.named] for name, each in b.items()}
    keys: tuple[Callable[[Sequence[str]], Hashable], ...] = (lambda joints: joints[0], frozenset)
    for key in keys:
        theirs = {key(joints): name for name, joints in named.items() if name not in found.values()}
        ours = {name: key(each.named) for name, each in a.items() if name not in found}
        found |= {name: theirs[each] for name, each in ours.items() if each in theirs}
    return found
