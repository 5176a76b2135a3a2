"""Compares the structure of two machines: missing parts, gravity and medium, actuators, and other content of files."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.facts.fact import TOLERANCE, Fact, Kind, difference
from screwgauge.diagnosis.facts.links import remainder_of, steps_of
from screwgauge.diagnosis.facts.loops import SUM
from screwgauge.diagnosis.machine.alignment import Names, align
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.machine.placement import Believed
from screwgauge.diagnosis.properties import Change, unit_of
from screwgauge.models.content import OTHER, Content, kinds
from screwgauge.models.files.parts import NUMBERED
from screwgauge.models.kinematics import rehome
from screwgauge.models.machine import Link, Machine, fuse, machine_of
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.reference.mechanism import GROUND


def pair_machines(a: Machine, b: Machine, names: Names, believed: Believed) -> Pair:
    """Align two machines. Bodies that move relative to each other in only one machine are fused in both.

    Such bodies are found by name before the alignment; bodies without matching names are found afterwards.
    """
    lost = list[Fact]()
    if names.bodies:
        a, b, lost = _fuse_by_names(a, b)
    pair = align(a, b, names.joints, names.bodies, believed)
    while (found := next(_hidden_links(pair), None)) is not None:
        side, link = found
        lost.append(_lost_link(side, "fixed", link, (link.far,)))
        pair = pair.fuse(link, side)
    return replace(pair, lost=tuple(lost))


def _hidden_links(pair: Pair) -> Iterator[tuple[str, Link]]:
    """Find links to unmatched bodies whose mass is included in that of their neighbour's partner."""
    for side, each in (("A", pair), ("B", pair.inverse)):
        partners = each.bodies
        for link in (end for one in each.only_a for end in (one, one.reverse())):
            if link.far in partners or link.near not in partners or link.near == GROUND:
                continue
            bare, more = (each.a.bodies[name].matter.mass for name in (link.near, link.far))
            there = each.b.bodies[partners[link.near]].matter.mass
            if abs(there - (bare + more)) < abs(there - bare):
                yield side, link


def _fuse_by_names(a: Machine, b: Machine) -> tuple[Machine, Machine, list[Fact]]:
    """Fuse bodies that form one body in the other machine, and drop welds that the other machine lacks."""
    sides, facts = {"A": a, "B": b}, list[Fact]()
    for side, other in ("AB", "BA"):
        sides[side], lost = _drop_welds(sides[side], sides[other], side)
        facts += lost
    for side, other in ("AB", "BA", "AB"):
        sides[side], lost = _fuse_links(sides[side], sides[other], side)
        facts += lost
    return sides["A"], sides["B"], facts


def _owners(machine: Machine) -> dict[str, str]:
    """Return the body to which each link belongs."""
    return {name: body for body, each in machine.bodies.items() for name in each.frames}


def _drop_welds(own: Machine, other: Machine, side: str) -> tuple[Machine, list[Fact]]:
    """Drop welds between bodies that are separate in the other machine."""
    owners, welds = _owners(other), {n: c for n, c in own.reading.closures.items() if c.kind == "weld"}
    gone = [n for n, c in welds.items() if len({owners[end] for end in (c.first, c.second) if end in owners}) == 2]
    if not gone:
        return own, []
    closures = {name: each for name, each in own.reading.closures.items() if name not in gone}
    return machine_of(replace(own.reading, closures=closures)), [
        _lone_fact(side, name, "link", "weld") for name in gone
    ]


def _fuse_links(own: Machine, other: Machine, side: str) -> tuple[Machine, list[Fact]]:
    """Fuse bodies that form one body in the other machine, at the joint coordinate that this body implies."""
    owners = _owners(other)
    held = {
        link.joints: q
        for link in own.links
        if len(link.joints) == 1
        and _is_one(own, link, owners)
        and (q := _holding_coordinate(own, other, link, owners)) is not None
    }
    own = machine_of(rehome(own.reading, {name: q for (name,), q in held.items()})[0]) if held else own
    facts = list[Fact]()
    while (link := next((link for link in own.links if _is_one(own, link, owners)), None)) is not None:
        joint = own.reading.joints[link.joints[0]] if link.joints else None
        at = f"{held[link.joints]:.6g} {unit_of('zero', joint)}" if link.joints in held else ""
        facts.append(_lost_link(side, "fixed", link, (link.far,), at))
        own = fuse(own, link)
    return own, facts


def _is_one(machine: Machine, link: Link, owners: Mapping[str, str]) -> bool:
    """Return True if the names of the members of both bodies of a link belong to a single body in the other model."""
    ends = [{owners[name] for name in machine.bodies[end].members if name in owners} for end in (link.near, link.far)]
    return len(ends[0]) == 1 and ends[0] == ends[1]


def _holding_coordinate(own: Machine, other: Machine, link: Link, owners: Mapping[str, str]) -> float | None:
    """Return the joint coordinate that gives the other model's relative pose; None if this is home or impossible."""
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


def structure_facts(pair: Pair) -> Iterator[Fact]:
    """Yield parts that only one model has: joints fixed in the other model, subtrees, links between paired bodies."""
    yield from pair.lost
    for side, links in (("A", pair.only_a), ("B", pair.only_b)):
        machine = pair.a if side == "A" else pair.b
        known = {*pair.bodies} if side == "A" else {*pair.bodies.values()}
        told = set[str]()
        for link in links:
            ends = {link.near, link.far} - known
            if not ends:
                yield _lost_link(side, "link", link)
            elif not ends & told:
                bodies = _component(links, ends, known)
                told |= {*bodies}
                mass = sum(machine.bodies[body].matter.mass for body in bodies)
                ways = sum(len({each.near, each.far} & {*bodies}) == 1 for each in machine.links)
                yield _lost_link(side, "branch" if ways == 1 else "link", link, bodies, f"{mass:.6g}")


def _component(links: Sequence[Link], bodies: set[str], known: Collection[str]) -> list[str]:
    """Return the given bodies and the unmatched bodies that are connected to them."""
    found = list(bodies)
    for body in found:
        ends = {end for link in links if link.joins(body) for end in (link.near, link.far)}
        found += sorted(ends - {*found, *known})
    return found


def _lost_link(side: str, what: str, link: Link, bodies: Sequence[str] = (), of: str = "") -> Fact:
    """Create the fact for an unmatched link and its bodies; `of` is their mass, or the coordinate of a fixed joint."""
    gone = side == "A" and bool(link.joints) and (what == "branch" or (what == "link" and len(bodies) == 1))
    changes = (Change(link.joints[0], what, np.array(0.0)),) if gone else ()
    fact = _lone_fact(side, "/".join(link.joints or link.names), what, link.kind)
    return replace(fact, changes=changes, of=of, more=tuple(bodies))


def _lone_fact(side: str, part: str, what: str, kind: str) -> Fact:
    a, b = (kind, None) if side == "A" else (None, kind)
    return Fact(part, what, a, b)


def name_facts(pair: Pair) -> Iterator[Fact]:
    """Yield joints that have the name of a different joint in the other model."""
    for name, partner in pair.joints.items():
        if pair.crosses_names(name):
            yield Fact(name, "name", name, partner.name, kind="convention", partner=partner.name)


def model_facts(pair: Pair) -> Iterator[Fact]:
    """Compare gravity, if both models specify it, and the medium."""
    a, b = pair.a.reading, pair.b.reading
    if a.gravity is not None and b.gravity is not None:
        most = max(float(np.linalg.norm(a.gravity)), float(np.linalg.norm(b.gravity)), 1e-300)
        if (size := float(np.linalg.norm(a.gravity - b.gravity)) / most) > TOLERANCE:
            change = Change("", "gravity", b.gravity)
            yield Fact("", "gravity", a.gravity, b.gravity, unit_of("gravity"), size, changes=(change,))
    for what, unit, ours, theirs in zip(("density", "viscosity"), ("kg/m^3", "Pa s"), a.medium, b.medium, strict=True):
        if size := difference(ours, theirs):
            change = Change("", "medium", np.array(b.medium))
            yield Fact("", what, np.asarray(ours), np.asarray(theirs), unit, size, changes=(change,))


def actuator_facts(pair: Pair) -> Iterator[Fact]:
    """Compare motors by the joints that they drive, if both files have motors."""
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
        # a motor of a reversed joint may have either sign
        same = not difference(gear, -other) and pair.partner(joint).sign < 0.0
        if size := difference(gear, other):
            change = Change(name, "gear", np.array(other))
            kind: Kind = "convention" if same else "model"
            yield Fact(
                name, "gear", np.asarray(gear), np.asarray(other), "", size, kind, (change,), partners[name], joint
            )
    for name in b.keys() - partners.values():
        joint, gear = b[name]
        yield Fact(name, "actuator", None, np.asarray(gear), of=joint)


def actuator_partners(pair: Pair) -> dict[str, str]:
    """Pair actuators by name and joint, then by explicit name, then by joint, and finally by any name."""
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


#: Items of A and B; one may be missing.
_Both = tuple[Content | None, Content | None]
#: Content, each item with the model that contains it.
Sided = tuple[tuple[str, Content], ...]


def compare_content(pair: Pair) -> tuple[list[Fact], Sided, Sided]:
    """Compare content that is not in the fields of a reading; pair the items by the parts on which they act.

    Returns:
        Differences; content that could differ but is not compared; content that is out of scope.
    """
    a, b = pair.a.reading, pair.b.reading
    names = {
        "joints": pair.back,
        "bodies": {other: name for name, other in pair.bodies.items()},
        "actuators": {other: name for name, other in actuator_partners(pair).items()},
    }
    alike = all(name == partner.name for name, partner in pair.joints.items())
    facts, fates = list[Fact](), {"withheld": list[tuple[str, Content]](), "aside": list[tuple[str, Content]]()}
    theirs = [each.rename(names) for each in b.content]
    for one, other in _pairs(_drop_lone(a.content, pair), _drop_lone(theirs, pair)):
        fate = _fate(one, other, (a, b), alike=alike)
        if fate == "differs":
            facts.append(_fact(one, other))
        elif fate in fates:
            fates[fate] += [(side, each) for side, each in zip("AB", (one, other), strict=True) if each is not None]
    return facts, tuple(fates["withheld"]), tuple(fates["aside"])


def _drop_lone(content: Iterable[Content], pair: Pair) -> list[Content]:
    """Drop content that acts only on unmatched joints, because such joints are reported as facts."""
    acts = [({name for room, name, _ in each.of if room == "joints"}, each) for each in content]
    return [each for joints, each in acts if not joints or joints & pair.joints.keys()]


def _pairs(a: Sequence[Content], b: Sequence[Content]) -> Iterator[_Both]:
    """Pair items that act on the same parts; pair equal items first."""
    ours, theirs = _group(a), _group(b)
    for key in dict.fromkeys((*ours, *theirs)):
        mine, others = list(ours.get(key, ())), list(theirs.get(key, ()))
        for each in list(mine):
            if partner := next((other for other in others if _agree(each, other)), None):
                mine.remove(each)
                others.remove(partner)
                yield each, partner
        both = min(len(mine), len(others))
        yield from zip(mine[:both], others[:both], strict=True)
        yield from ((each, None) for each in mine[both:])
        yield from ((None, each) for each in others[both:])


def _group(content: Iterable[Content]) -> Mapping[object, list[Content]]:
    """Group content by kind and by the parts on which it acts, or by its name if it does not act on a part."""
    groups = defaultdict[object, list[Content]](list)
    for each in content:
        element = each.what if not each.of or not kinds()[each.kind].arrays else ""
        acts = tuple(sorted((room, name) for room, name, _ in each.of))
        groups[each.kind, element, acts or each.whose].append(each)
    return groups


def _entries(a: Content, b: Content) -> Iterator[tuple[str, float | str, float | str]]:
    """Yield the label of each entry of two items, and its value in each item."""
    for (_, name, x), (*_, y) in zip(sorted(a.of), sorted(b.of), strict=False):
        yield f"coefficient of {name}", x, y
    for (key, one), (_, other) in zip(a.values or (), b.values or (), strict=False):
        yield key, one, other


def _differences(a: Content, b: Content) -> list[tuple[str, float | str, float | str]]:
    return [(key, x, y) for key, x, y in _entries(a, b) if _size(x, y)]


def _size(x: float | str, y: float | str) -> float:
    if isinstance(x, float) and isinstance(y, float):
        return difference(x, y)
    return 0.0 if x == y else math.inf


def _agree(a: Content, b: Content) -> bool:
    """Return True if the values of both items are known and equal, up to rounding."""
    if a.values is None or b.values is None or len(a.of) != len(b.of) or len(a.values) != len(b.values):
        return False
    labels = all(key == other for (key, _), (other, _) in zip(a.values, b.values, strict=True))
    return labels and not _differences(a, b)


def _fate(a: Content | None, b: Content | None, readings: tuple[Reading, Reading], *, alike: bool) -> str:
    """Return the treatment of a pair of items: ``same``, ``differs``, or a fate defined in `content.toml`.

    Args:
        alike: True if all joints have the same names in both models.
    """
    one = a or b
    assert one is not None
    kind, both = kinds()[one.kind], a is not None and b is not None
    if kind.name == OTHER and alike and a is not None and b is not None and _agree(a, b):
        return "same"  # both files specify it identically for the same parts
    if kind.fate != "compared":
        return kind.fate
    if any(each is not None and each.values is None for each in (a, b)):
        return "withheld"
    texts = any(isinstance(value, str) for each in (a, b) if each for _, value in each.values or ())
    if texts and not alike:  # texts contain names of joints
        return "withheld"
    if both:
        return "same" if _agree(a, b) else "differs"  # type: ignore[arg-type]
    mine, other = readings if b is None else readings[::-1]
    if kind.alone == "aside":
        return "differs" if mine.form == other.form else "aside" if mine.form != "mjcf" else "withheld"
    can_say = other.library == "mujoco" if kind.arrays else other.form == mine.form
    return "withheld" if kind.alone or not can_say else "differs"


def _fact(a: Content | None, b: Content | None) -> Fact:
    """Create a fact whose values are the differing numbers and strings, keyed by label."""
    one = a or b
    assert one is not None
    names = [each.whose.rpartition(" ")[2] if each else "" for each in (a, b)]
    if a is None or b is None:
        first, second = (None if each is None else dict[str, float | str]() for each in (a, b))
        return Fact(names[0] or names[1], one.kind, first, second, partner=names[1], of=one.sentence)
    unlike = _differences(a, b)
    same_length = len(a.of) == len(b.of) and len(a.values or ()) == len(b.values or ())
    size = max((_size(x, y) for _, x, y in unlike), default=math.inf) if same_length else math.inf
    ours, theirs = ({key: pair[k] for key, *pair in unlike} for k in (0, 1))
    return Fact(names[0], one.kind, ours, theirs, "", size, partner=names[1], of=one.sentence)
