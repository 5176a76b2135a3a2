"""Finds reasons for differences: slips that turn A's values into B's values."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.causes.causes import factor_of
from screwgauge.diagnosis.causes.trials import LEFT, WATER, Slip, Trial, Written, parse_file
from screwgauge.diagnosis.facts.fact import Fact, difference
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.machine.whole import Whole
from screwgauge.diagnosis.properties import INERTIAL, PASSIVE, PROPERTIES, UNITS, unit_of
from screwgauge.models.machine import Machine
from screwgauge.models.matter import Matter, displace, join, remainder, steiner
from screwgauge.models.poses import relative
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: Properties that describe the placement of joints as steps, not as numbers in a file.
PLACED = ("placement", "axis", "centre", "zero", "sign")

#: Bodies at the ends of a link.
Ends = tuple[str, str]


@dataclass(frozen=True, slots=True, eq=False)
class Reason:
    """A likely mistake, such as a wrong unit, that explains differences (facts).

    Attributes:
        slip: Key of `answer.SLIPS`.
        facts: Facts that the slip explains.
        values: Names and numbers to insert into the sentence of the slip.
        part: Fixed link of the body, if the slip concerns only that link.
    """

    slip: str
    facts: tuple[Fact, ...]
    values: tuple[str | float, ...] = ()
    part: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Unexplained:
    """The facts that are still unexplained, the two machines and their parsed files."""

    facts: Sequence[Fact]
    pair: Pair
    files: tuple[Written, Written]

    @property
    def loose(self) -> float:
        """Relative error implied by the printed digits of the files."""
        return max(each.loose for each in self.files)

    def of(self, *whats: str) -> list[Fact]:
        """Return the facts about the given properties."""
        return [fact for fact in self.facts if fact.what in whats]


def find_reasons(
    facts: Iterable[Fact], pair: Pair, files: tuple[Path | None, Path | None] = (None, None)
) -> list[Reason]:
    """Find reasons: first reasons that explain several facts together, then reasons for each remaining fact.

    Args:
        files: Files of A and B; None for a model without a file.
    """
    real = [fact for fact in facts if fact.kind != "digits"]
    case, found = Unexplained(real, pair, (parse_file(files[0]), parse_file(files[1]))), list[Reason]()
    for entry in (_geoms, _totals, _units_of_whole, _orders, _exchanges, _gears, _merges, _conventions, _single_slips):
        some = _merge_reasons(entry(case))
        found += some
        taken = {id(fact) for each in some for fact in each.facts}
        case = replace(case, facts=[fact for fact in case.facts if id(fact) not in taken])
    return found


def _merge_reasons(some: Iterable[Reason]) -> list[Reason]:
    """Merge reasons with equal slips."""
    groups = defaultdict[object, list[Reason]](list)
    for each in some:
        groups[each.slip, each.values, each.part].append(each)
    return [replace(g[0], facts=tuple({id(f): f for each in g for f in each.facts}.values())) for g in groups.values()]


def _units_of_whole(case: Unexplained) -> Iterator[Reason]:
    """Find units that explain the scale factors of B as a whole."""
    for fact in (each for each in case.of("whole") if isinstance(each.b, Whole)):
        for factor, si in ((fact.b.length, "m"), (fact.b.mass, "kg"), (fact.b.inertia, "kg m^2")):
            for value, name in UNITS[si].items():
                for slip, other in (("unit", value), ("unit of A", 1.0 / value)):
                    if math.isclose(factor, other, rel_tol=1e-4):
                        yield Reason(slip, (fact,), (name,))


def _geoms(case: Unexplained) -> Iterator[Reason]:
    """Find bodies whose mass properties are computed from geoms in only one model."""
    for fact in case.of(*INERTIAL):
        names, machines = (fact.part, fact.partner), (case.pair.a, case.pair.b)
        sides = zip(case.files, names, machines, strict=True)
        keys = [file.from_geoms(name, machine.reading.library) for file, name, machine in sides]
        if bool(keys[0]) != bool(keys[1]):
            yield Reason(keys[0] or keys[1], (fact,), ("A" if keys[0] else "B",))


def _totals(case: Unexplained) -> Iterator[Reason]:
    """Explain a common factor of all masses and inertias by a total mass, or by a different density of all geoms."""
    machines = case.pair.a, case.pair.b
    wholes = [fact for fact in case.of("whole") if isinstance(fact.b, Whole)]
    facts = wholes or case.of("mass", "inertia")
    if wholes:
        factors = {float(f"{each:.5g}") for fact in wholes for each in (fact.b.mass, fact.b.inertia)}
    else:
        factors = {factor_of(fact) or 1.0 for fact in facts}
    heavy = [body for name, body in machines[0].bodies.items() if body.matter.mass and name != GROUND]
    if len(factors) != 1 or factors == {1.0} or not (wholes or len(case.of("mass")) == len(heavy)):
        return
    masses = machines[0].reading.mass, machines[1].reading.mass * (wholes[0].b.mass if wholes else 1.0)
    for side, file, mass in zip("AB", case.files, masses, strict=True):
        if file.total > 0.0 and math.isclose(mass, file.total, rel_tol=1e-5):
            yield Reason("settotalmass", tuple(facts), (side, file.total))
            return
    if wholes and math.isclose(*masses, rel_tol=1e-5):
        yield Reason("total kept", tuple(facts), (masses[0],))
    for x, y in product(*(file.densities or (WATER,) for file in case.files)):
        if x != y and math.isclose(y, max(factors) * x, rel_tol=1e-4):
            yield Reason("density", tuple(facts), (x, y))


def _orders(case: Unexplained) -> Iterator[Reason]:
    """Find joints in a different order: their names are permuted and their axes or kinds differ."""
    names = {fact.part: fact.b for fact in case.of("name")}
    cycles = [cycle for cycle in _cycles(names) if any(fact.part in cycle for fact in case.of("axis", "kind"))]
    whats = ("name", "axis", "kind", *PASSIVE, "limits")
    if cycles:
        facts = [fact for fact in case.of(*whats) if any(fact.part in cycle for cycle in cycles)]
        orders = (", ".join(order) for order in (cycles[0], map(names.__getitem__, cycles[0])))
        yield Reason(
            "joint order", tuple(facts), (*orders, f"; {len(cycles) - 1} more such groups" * (len(cycles) > 1))
        )


def _cycles(names: Mapping[str, str]) -> Iterator[list[str]]:
    """Yield the cycles of a permutation of names; each cycle keeps the original order of its names."""
    left = [*names]
    while left:
        cycle = [left[0]]
        while (following := names[cycle[-1]]) in left and following not in cycle:
            cycle.append(following)
        left = [name for name in left if name not in cycle]
        if names[cycle[-1]] == cycle[0]:
            yield [name for name in names if name in cycle]


def _exchanges(case: Unexplained) -> Iterator[Reason]:
    """Find two parts whose values are exchanged."""
    numbers = [fact for fact in case.facts if _is_number(fact)]
    sizes = {id(fact): (np.linalg.norm(fact.a), np.linalg.norm(fact.b)) for fact in numbers}
    for one, other in combinations(numbers, 2):
        (a, b), (c, d) = sizes[id(one)], sizes[id(other)]
        alike = one.what == other.what and abs(a - d) <= 1e-3 * a and abs(b - c) <= 1e-3 * b
        if alike and np.shape(one.a) == np.shape(other.a):
            pairs = ((one, other), (other, one))
            if all(_trial(case, x.a, x.b).fits(np.asarray(y.a, float)) for x, y in pairs):
                yield Reason("exchanged", (one, other), (one.part, other.part))


def _is_number(fact: Fact) -> bool:
    """Return True if both models have a value that is a number, vector or tensor in a file."""
    stated = fact.what in PROPERTIES and PROPERTIES[fact.what].shape is not None and fact.what not in PLACED
    return stated and fact.a is not None and fact.b is not None and np.shape(fact.a) == np.shape(fact.b)


def _trial(case: Unexplained, a: object, b: object, unit: str = "") -> Trial:
    return Trial(np.asarray(a, float), np.asarray(b, float), unit, case.loose)


def _gears(case: Unexplained) -> Iterator[Reason]:
    """Find armature, damping or friction that one model specifies on the motor side of the gear."""
    sides = [dict(m.reading.actuators.values()) for m in (case.pair.a, case.pair.b)]
    for fact in case.of("armature", "damping", "friction"):
        gears = {abs(side[name]) for side, name in zip(sides, (fact.part, fact.partner), strict=True) if name in side}
        powers = (1, 2) if fact.what == "friction" else (2, 1)
        for (k, gear), (side, a, b) in product(
            product(powers, gears - {1.0, 0.0}), (("B", fact.b, fact.a), ("A", fact.a, fact.b))
        ):
            if a and b and difference(float(a) * gear**k, float(b)) < 100.0 * LEFT:
                also = [each for each in case.of("gear") if each.of == fact.part]
                yield Reason("before the gear" if k == powers[0] else "gear once", (fact, *also), (side, gear))
                break


def _differing_bodies(case: Unexplained) -> Iterator[tuple[Machine, str, Machine, Matter, Matter, tuple[Fact, ...]]]:
    """Yield differing bodies, seen from A and from B: machine, body, other machine, mass properties in each, facts."""
    pair = case.pair
    for name in dict.fromkeys(fact.part for fact in case.of(*INERTIAL)):
        other = pair.bodies[name]
        facts = tuple(fact for fact in case.of(*INERTIAL) if fact.part == name)
        to_a = _to_a(pair, name)
        a, b = pair.a.bodies[name].local, pair.b.bodies[other].local
        yield pair.a, name, pair.b, a, displace(b, to_a), facts
        yield pair.b, other, pair.a, b, displace(a, np.asarray(np.linalg.inv(to_a))), facts


def _to_a(pair: Pair, name: str) -> Array:
    """Return the pose of a body's partner relative to the body, with the two models aligned. Shape (4, 4)."""
    other = pair.b.bodies[pair.bodies[name]]
    return relative(pair.a.bodies[name].pose, pair.placed[name] @ other.pose)


def _merges(case: Unexplained) -> Iterator[Reason]:
    """Find fixed links that the other model merged incorrectly into a body; try them all together, then one by one."""
    for own, name, there, old, new, facts in _differing_bodies(case):
        body = own.reading.bodies[name]
        gone = {p: m for p, m in body.parts.items() if m.mass and p in body.fixed and not there.reading.has_link(p)}
        for names in dict.fromkeys([tuple(gone), *((p,) for p in gone)]) if gone else ():
            made = _mergers(body.fixed, gone, names, old)
            slips = next((slips for slips, matter in made if _have_equal_matter(matter, new, 10.0 * case.loose)), [])
            side = "B" if own is case.pair.a else "A"
            yield from (Reason(slip, facts, (" and ".join(names), side)) for slip in slips)


def _have_equal_matter(one: Matter, other: Matter, loose: float) -> bool:
    """Return True if two bodies have equal mass properties, each within a relative tolerance."""
    pairs = [(np.asarray(getattr(one, what)), np.asarray(getattr(other, what))) for what in INERTIAL]
    return all(float(np.abs(a - b).max()) <= loose * float(np.abs(b).max()) for a, b in pairs)


def _mergers(
    frames: Mapping[str, Array], parts: Mapping[str, Matter], names: Sequence[str], whole: Matter
) -> Iterator[tuple[list[str], Matter]]:
    """Yield combinations of slips, fewest slips first, and the body that results from merging parts that way."""
    own = remainder(whole, (parts[name] for name in names))
    yield ["missing part"], own
    local = {name: displace(parts[name], np.asarray(np.linalg.inv(frames[name]))) for name in names}
    turns: Mapping[str, Callable[[Array], Array]]
    places: Mapping[str, Callable[[Array], Array]]
    turns = {"": lambda R: R, "merged without rotation": lambda R: np.eye(3), "merged transposed": lambda R: R.T}
    places = {
        "": lambda T: T[:3, 3],
        "merged without position": lambda T: np.zeros(3),
        "merged by the inverse": lambda T: -T[:3, :3].T @ T[:3, 3],
    }
    options = sorted(product(turns, turns, places, (False, True)), key=lambda each: sum(map(bool, each)))
    for com, inertia, place, plain in options[1:]:
        made = [own]
        for name in names:
            R, m = frames[name][:3, :3], local[name]
            Q = turns[inertia](R)
            made.append(Matter(m.mass, turns[com](R) @ m.com + places[place](frames[name]), Q @ m.inertia @ Q.T))
        body = join(made)
        if plain:
            off = sum(m.mass * steiner(m.com - body.com) for m in made)
            body = replace(body, inertia=body.inertia - off)
        yield [*dict.fromkeys(filter(None, (com, inertia, place, "merged without parallel axis" * plain)))], body


def _conventions(case: Unexplained) -> Iterator[Reason]:
    """Find placements that agree when the rotations of one file are read in a different convention."""
    moved = [*_differing_joints(case)]
    told = set[tuple[str | float, str]]()
    for k, side in ((1, "B"), (0, "A")) if moved else ():
        for slip, frames in case.files[k].frames():
            for facts, ends, places in moved:
                key = slip[0], facts[0].part
                if key in told or not {*ends[k]} <= frames.keys():
                    continue
                near, far = (frames[name] for name in ends[k])
                if Trial(places[k], places[1 - k], loose=10.0 * case.loose).fits(relative(near, far)):
                    told.add(key)
                    yield Reason(str(slip[0]), facts, (side, *slip[1:]))


def _relative_frame(file: Written, machine: Machine, ends: Ends) -> Array:
    """Return the far body's frame relative to the near body, from the file if possible, else from the home pose."""
    written = file.plain
    near, far = (written[n] if {*ends} <= written.keys() else machine.bodies[n].pose for n in ends)
    return relative(near, far)


def _differing_joints(case: Unexplained) -> Iterator[tuple[tuple[Fact, ...], tuple[Ends, Ends], tuple[Array, Array]]]:
    """Yield, for each displaced link, the facts about it, the bodies at its ends, and its placement in A and in B."""
    for one, other in case.pair.links:
        names = {"/".join(one.joints), *one.joints}
        facts = [f for f in case.of("placement", "zero") if f.part in names]
        facts += [f for f in case.of("limits", "rest") if f.part in names and f.kind == "convention" and facts]
        if facts:
            ends = (one.near, one.far), (other.near, other.far)
            sides = zip(case.files, (case.pair.a, case.pair.b), ends, strict=True)
            yield tuple(facts), ends, tuple(_relative_frame(*side) for side in sides)  # type: ignore[misc]


def _single_slips(case: Unexplained) -> Iterator[Reason]:
    """Find slips in single values."""
    for facts, _, places in _differing_joints(case):
        if any(fact.what == "placement" for fact in facts):
            yield from _of_placement(case, facts, *places)
    for facts, part, what, trial in _trials(case):
        for slip in trial.slips(what):
            yield Reason(str(slip[0]), facts, slip[1:], part)


def _of_placement(case: Unexplained, facts: tuple[Fact, ...], a: Array, b: Array) -> Iterator[Reason]:
    length = case.pair.a.length
    turned, away = np.abs(a[:3, :3] - b[:3, :3]).max(), np.abs(a[:3, 3] - b[:3, 3]).max() / length
    what, some, unit = ("position", np.s_[:3, 3], "m") if away > turned else ("rotation", np.s_[:3, :3], "")
    if min(turned, away) < 1e-3 * max(turned, away):
        for slip in _trial(case, a[some], b[some], unit).slips(what):
            yield Reason(str(slip[0]), facts, slip[1:])


def _trials(case: Unexplained) -> Iterator[tuple[tuple[Fact, ...], str, str, Trial]]:
    """Yield values to test, with facts, link and property; treat links separately if both files have the same links."""
    for fact in (each for each in case.facts if _is_number(each) and each.what not in INERTIAL):
        yield (fact,), "", fact.what, _trial(case, fact.a, fact.b, fact.unit)
    for name in dict.fromkeys(fact.part for fact in case.of(*INERTIAL)):
        facts = tuple(fact for fact in case.of(*INERTIAL) if fact.part == name)
        links = [*_links(case.pair, name)] or [("", case.pair.a.bodies[name].local, {f.what: f.b for f in facts})]
        for link, ours, theirs in links:
            frames, turns = _inertials(case.files, (link or name, link or facts[0].partner))
            for what, value in theirs.items():
                own = facts if len(links) > 1 else tuple(fact for fact in facts if fact.what == what)
                a, b = (np.asarray(each, float) for each in (getattr(ours, what), value))
                yield own, link, what, Trial(a, b, unit_of(what), case.loose, ours, frames, turns)


def _links(pair: Pair, name: str) -> Iterator[tuple[str, Matter, dict[str, Array]]]:
    """If a body has the same links in both files, yield each link's name and its mass properties in A and B."""
    bodies = pair.a.bodies[name], pair.b.bodies[pair.bodies[name]]
    one, two = (m.reading.bodies[each.members[0]] for m, each in zip((pair.a, pair.b), bodies, strict=True))
    if max(len(body.members) for body in bodies) > 1 or not one.parts or {*one.parts} != {*two.parts}:
        return
    ours, theirs = ({"": remainder(each, each.parts.values()), **each.parts} for each in (one, two))
    for link, matter in ours.items():
        back = np.asarray(np.linalg.inv(one.fixed[link])) if link else np.eye(4)
        other = displace(theirs[link], back @ _to_a(pair, name))
        yield link, displace(matter, back), {what: getattr(other, what) for what in INERTIAL}


def _inertials(
    files: tuple[Written, Written], names: tuple[str, str]
) -> tuple[dict[str, Array], list[tuple[Slip, Array]]]:
    """Return the axes in which each file gives a tensor, and slips in these axes with the rotations they cause."""
    frames, turns = {}, list[tuple[Slip, Array]]()
    for side, file, name in zip("AB", files, names, strict=True):
        if (link := file.link(name)) is None:
            continue
        R = frames[side] = link.turn
        for slip, Q in file.meanings(link.element.find("inertial")):
            turns.append(((slip[0], side, *slip[1:]), Q @ R.T if side == "A" else R @ Q.T))
    return frames, turns
