"""Explains the differences between two machines by the fewest causes, for B as it is or after aligning B with A."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from screwgauge.diagnosis.causes.causes import group_facts
from screwgauge.diagnosis.facts.bodies import body_facts
from screwgauge.diagnosis.facts.fact import Fact, Kind, known_gravity
from screwgauge.diagnosis.facts.links import link_facts
from screwgauge.diagnosis.facts.loops import coupling_facts, softness_facts
from screwgauge.diagnosis.facts.structure import (
    actuator_facts,
    model_facts,
    name_facts,
    pair_machines,
    structure_facts,
)
from screwgauge.diagnosis.machine.alignment import Names, find_partners
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.machine.placement import Believed
from screwgauge.diagnosis.machine.whole import Whole, find_wholes
from screwgauge.models.machine import Machine, machine_of
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array

#: Cost of a cause that consists of conventions only, which do not change the motion; additional cost of each fact; and
#: additional cost of a placement, which a change of one body may replace.
CONVENTION, EACH, PLACE = 0.2, 0.02, 0.01
#: Cost of an explanation with one cause, which no other explanation can undercut.
ONE = 1.1
#: Facts about placements and unmatched parts, which a different alignment may avoid; and the share that counts as most
#: bodies.
ELSEWHERE = frozenset({"placement", "axis", "end", "zero", "sign", "start", "kind", "base", "branch", "link", "name"})
MOST = 0.5
#: Additional cost of a transformation of the whole machine.
WHOLE = 0.01
#: Number of ground link placements that are tried as transformations of the whole.
ROOTS = 2


@dataclass(frozen=True, eq=False)
class Explanation:
    """An explanation of the differences between two machines, as a list of facts.

    Attributes:
        pair: The pair that the facts describe; B is moved and scaled if `whole` is set.
        facts: All facts; the fact for `whole` comes first.
        whole: Transformation of B as a whole; None if B is compared as it is.
        standing: Facts without that transformation; empty if `whole` is None.
    """

    pair: Pair
    facts: tuple[Fact, ...]
    whole: Whole | None = None
    standing: tuple[Fact, ...] = ()

    @cached_property
    def cost(self) -> float:
        """Cost of the explanation, measured in causes; the explanation with the lowest cost is chosen."""
        groups = group_facts(self.real)
        # a transformation of the whole machine is cheap if it explains everything
        light = (all(f.kind == "convention" and (f.what != "whole" or len(groups) == 1) for f in g) for g in groups)
        causes = sum(CONVENTION if each else 1.0 for each in light)
        places = sum(fact.what == "placement" for fact in self.real)
        rounding = EACH * (len(self.real) < len(self.facts))
        return causes + rounding + EACH * len(self.real) + PLACE * places + WHOLE * (self.whole is not None)

    @property
    def real(self) -> list[Fact]:
        """Facts that are not rounding."""
        return [fact for fact in self.facts if fact.kind != "digits"]

    @property
    def plain(self) -> bool:
        """True if no other explanation can have fewer causes: one cause, or conventions only.

        A single displacement of a round body, or one difference shared by a left and a right part, may instead be a
        rotation of the whole machine.
        """
        counting = self.whole is None and all(fact.kind == "convention" for fact in self.real)
        places = [fact.of for fact in self.real if fact.what == "placement"]
        outer = not places or places == [GROUND]
        return counting or (self.cost <= ONE and outer) or self._settled

    @property
    def _settled(self) -> bool:
        """True if all parts have the same placement, which rules out a better alignment.

        Differences in centre of mass are allowed in bodies with different masses, unless most masses differ, in which
        case the unit of mass may differ.
        """
        heavy = {fact.part for fact in self.real if fact.what == "mass"}
        elsewhere = any(
            f.what in ELSEWHERE or (f.what in ("com", "inertia") and f.part not in heavy) for f in self.real
        )
        sides = {fact.side for fact in self.real if fact.what == "fixed"}
        return self.whole is None and not elsewhere and len(sides) < 2 and len(heavy) < MOST * len(self.pair.a.bodies)


def explain(
    a: Reading, b: Reading, names: Names, marked: Callable[[Sequence[Fact]], Iterable[Fact]] = tuple
) -> Explanation:
    """Choose the explanation with the fewest causes.

    Args:
        a, b: Readings at the home pose of their files.
        marked: Function that marks facts due to rounded numbers in a file.
    """
    best, standing = None, tuple[Fact, ...]()
    for each in _explanations(machine_of(a), b, names):
        each = replace(each, facts=tuple(marked(each.facts)))
        standing = standing or each.facts
        best = each if best is None or each.cost < best.cost else best
        if each.plain:
            break
    assert best is not None
    return replace(best, standing=standing if best.whole else ())


def _explanations(a: Machine, b: Reading, names: Names) -> Iterator[Explanation]:
    """Yield explanations with B as it is, moved as a whole, aligned by geometry alone, or aligned by ground links."""
    theirs = machine_of(b)
    for believed in Believed:
        yield compare_machines(a, theirs, names, believed)
    for whole in find_wholes(a.reading, b, names.joints, names.bodies):
        yield _compare_whole(a, b, whole, names)
    nameless = Names({}, {}, {})
    alone = compare_machines(a, theirs, nameless)
    yield alone
    yield from (_compare_whole(a, b, whole, nameless) for whole in _roots(alone.pair))


def compare_readings(a: Reading, b: Reading, names: Names | None = None) -> Explanation:
    """Compare two readings of one machine without moving B as a whole.

    Args:
        names: Partners; by default parts with equal names.
    """
    one, two, names = machine_of(a), machine_of(b), names or find_partners(a, b)
    return min((compare_machines(one, two, names, believed) for believed in Believed), key=lambda each: each.cost)


def compare_machines(a: Machine, b: Machine, names: Names, believed: Believed = Believed.SIMILAR) -> Explanation:
    """Compare two machines without moving B as a whole."""
    return compare_pair(pair_machines(a, b, names, believed))


def compare_pair(pair: Pair) -> Explanation:
    """Compare two machines with matched bodies."""
    return Explanation(pair, tuple(fact for compare in COMPARISONS for fact in compare(pair)))


#: Comparisons of a pair; `link_facts` also matches the joints.
COMPARISONS: Sequence[Callable[[Pair], Iterator[Fact]]] = (
    structure_facts,
    link_facts,
    body_facts,
    model_facts,
    coupling_facts,
    actuator_facts,
    softness_facts,
    name_facts,
)


def _compare_whole(a: Machine, b: Reading, whole: Whole, names: Names) -> Explanation:
    rest = compare_machines(a, machine_of(whole.undo(b, a.reading)), names)
    return replace(rest, facts=(_fact(whole, a), *rest.facts), whole=whole)


def _fact(whole: Whole, a: Machine) -> Fact:
    """Create the fact for a transformation of B; assign a rotation about the only ground joint to that joint."""
    gravity = known_gravity(a.reading.gravity)
    turned = float(np.abs(whole.placement[:3, :3].T @ gravity - gravity).max())
    kind: Kind = "convention" if whole.stands and turned < 1e-9 * float(np.linalg.norm(gravity)) + 1e-12 else "model"
    return Fact("", "whole", None, whole, kind=kind, of=_root(whole.placement, a) if whole.stands else "")


def _root(T: Array, a: Machine) -> str:
    """Return the only hinge at the ground if the displacement is a rotation about it, or an empty name."""
    links = [link for link in a.links if link.joins(GROUND)]
    if len(links) != 1 or links[0].kind != "R" or not links[0].joints:
        return ""
    axis = links[0].elements[0]
    still = T[:3, :3] @ axis.centre + T[:3, 3] - axis.centre
    along = T[:3, :3] @ axis.direction - axis.direction
    same = np.linalg.norm(still) < 1e-6 * a.length and np.linalg.norm(along) < 1e-6
    return axis.joint if same else ""


def _roots(pair: Pair) -> Iterator[Whole]:
    """Yield placements that align ground links with their partners, most frequent first."""
    found: dict[bytes, list[Array]] = {}
    for one, _ in pair.links:
        T = pair.placed[one.far]
        if one.near == GROUND and np.abs(T - np.eye(4)).max() > 1e-6:
            found.setdefault(np.round(T, 4).tobytes(), []).append(T)
    for some in sorted(found.values(), key=len, reverse=True)[:ROOTS]:
        yield Whole(np.asarray(np.linalg.inv(some[0])))
