"""Pairs bodies and links of two machines, from the ground outwards, by names and by geometry.

For each pair of bodies, their links are assigned to each other at minimal cost, which depends on names, kind, location,
mass and number of neighbours. The body at the far end of each pair of links is then placed in the first machine's world
frame (`placement`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path

import numpy as np

from screwgauge.diagnosis.machine.features import EXACT, features, gap, misfits
from screwgauge.diagnosis.machine.pair import Pair
from screwgauge.diagnosis.machine.placement import Believed, distance, place_body
from screwgauge.models.machine import Link, Machine
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.errors import DescriptionError, UnknownNameError
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array
from screwgauge.reference.tables import read_toml


@dataclass(frozen=True, slots=True)
class Names:
    """Partners matched by name.

    Attributes:
        joints, bodies: Name in A -> name in B.
        how: Joint of A -> ``given``, ``name`` or ``similar name``.
    """

    joints: Mapping[str, str]
    bodies: Mapping[str, str]
    how: Mapping[str, str]


def read_map(path: Path) -> dict[str, str]:
    """Read a mapping from names in A to names in B from a TOML file.

    Raises:
        DescriptionError: An entry of the file does not map a name to a string.
    """
    given = read_toml(path)
    for name, other in given.items():
        if not isinstance(other, str):
            raise DescriptionError(
                f"the partner of '{name}' is not a name", str(path), 'write lines such as "joint of A" = "joint of B"'
            )
    return given


def find_partners(a: Reading, b: Reading, given: Mapping[str, str] | None = None) -> Names:
    """Find partners: first the given pairs, then pairs with equal names, then pairs with similar names.

    Args:
        given: Joint or body of A -> joint or body of B.

    Raises:
        UnknownNameError: A given name does not exist in its model.
    """
    given = given or {}
    for name, other in given.items():
        if name not in a.joints and name not in a.bodies:
            raise UnknownNameError("joint or body of A", name, [*a.joints, *a.bodies], "map")
        if other not in b.joints and other not in b.bodies:
            raise UnknownNameError("joint or body of B", other, [*b.joints, *b.bodies], "map")
    joints = {name: other for name, other in given.items() if name in a.joints and other in b.joints}
    how = dict.fromkeys(joints, "given")
    for similar, word in ((str, "name"), (_simplify, "similar name")):
        found = _pair_similar(a, b, joints, similar)
        joints, how = joints | found, how | dict.fromkeys(found, word)
    if not joints:
        joints = _pair_prefixed(a, b)
        how = dict.fromkeys(joints, "similar name")
    bodies = {name: other for name, other in given.items() if name in a.bodies and other in b.bodies}
    bodies |= {name: name for name in a.bodies if name in b.bodies and name not in bodies}
    return Names(joints, bodies, how)


def _pair_similar(a: Reading, b: Reading, joints: Mapping[str, str], similar: Callable[[str], str]) -> dict[str, str]:
    """Pair additional joints of the same kind whose simplified names are equal and unique."""
    left = [name for name in b.joints if name not in joints.values()]
    keys, own = [similar(name) for name in left], [similar(name) for name in a.joints if name not in joints]
    found = {}
    for name in (name for name in a.joints if name not in joints):
        key = similar(name)
        if keys.count(key) == 1 == own.count(key):
            other = left[keys.index(key)]
            if a.joints[name].kind == b.joints[other].kind:
                found[name] = other
    return found


def _pair_prefixed(a: Reading, b: Reading) -> dict[str, str]:
    """Pair joints if prepending a common prefix to all names of one model gives the names of the other model."""
    for one, two, back in ((a, b, False), (b, a, True)):
        first = next(iter(one.joints), "")
        for prefix in (name.removesuffix(first) for name in two.joints if first and name.endswith(first)):
            longer = {name: prefix + name for name in one.joints}
            kinds = all(n in two.joints and two.joints[n].kind == one.joints[m].kind for m, n in longer.items())
            if kinds and len(longer) == len(two.joints):
                return {n: m for m, n in longer.items()} if back else longer
    return {}


def _simplify(name: str) -> str:
    """Simplify a name: ignore case; drop separators, the words joint and link, and a preceding robot name."""
    return re.sub(r"[^a-z0-9]|joint|link|jnt", "", name.rpartition("/")[2].lower())


#: Largest distance between nearby features in machine lengths; smallest share of such features of a matching body.
NEAR, MANY = 0.01, 0.5
#: Largest cost of partners; and largest cost of partners that carry bodies with the same name.
MOST, NAMED = 3.2, 6.0
#: Distance in machine lengths or rad beyond which links of a part that does not fit anywhere are not matched.
FAR = 0.1
#: Cost of pairing an independent joint of a coupling with a dependent one; it tells otherwise identical fingers apart.
UNLIKE = 0.5
#: Cost that replaces an infinite or undefined cost; larger than any other cost.
DEAREST = 1e9


def assign(cost: Array) -> list[tuple[int, int]]:
    """Pair rows with columns at minimal total cost; use each row and column at most once.

    Args:
        cost: Costs of the pairs; every row or column of the smaller dimension is assigned, and non-finite costs count
            as larger than all others. Shape (n, m).
    """
    if cost.shape[0] > cost.shape[1]:
        return [(i, j) for j, i in assign(cost.T)]
    cost = np.where(np.isfinite(cost), cost, DEAREST)
    cheapest = cost.argmin(axis=1)
    if len({*cheapest}) == len(cost):  # no two rows compete, which saves the half second of importing SciPy
        return [*enumerate(cheapest.tolist())]
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(cost)
    return [*zip(rows.tolist(), columns.tolist(), strict=True)]


def _roles(reading: Reading, link: Link) -> tuple[bool, bool]:
    """Return two flags: a joint of the link is independent in a coupling; a joint of the link is dependent in one."""
    joints, couplings = {*link.joints}, reading.couplings.values()
    return any(joints & {*each.function.terms} for each in couplings), any(each.joint in joints for each in couplings)


def _next_links(machine: Machine, link: Link) -> list[Link]:
    """Return all links of the far body of a link except that link."""
    return [far for far in machine.at(link.far) if {*far.names} != {*link.names}]


def align(a: Machine, b: Machine, known: Mapping[str, str], bodies: Mapping[str, str], believed: Believed) -> Pair:
    """Match all bodies and links of two machines.

    Args:
        known: Joint of A -> joint of B, by name or as given by the user.
        bodies: Body of A's reading -> body of B's reading, by name or as given by the user.
        believed: Assumptions about the placement of bodies.
    """
    return _Walk(a, b, known, bodies, believed).walk()


class _Walk:
    """Matches links in a walk from the ground outwards."""

    def __init__(
        self, a: Machine, b: Machine, known: Mapping[str, str], bodies: Mapping[str, str], believed: Believed
    ) -> None:
        self.a, self.b, self.known, self.believed = a, b, known, believed
        self.back = {other: name for name, other in known.items()}
        self.called = {a.part_of(name): b.part_of(other) for name, other in bodies.items()}
        self.bodies, self.placed = {GROUND: GROUND}, {GROUND: np.eye(4)}
        self.links: list[tuple[Link, Link]] = []
        self.open_a, self.open_b = list(a.links), list(b.links)

    def walk(self) -> Pair:
        queue = [GROUND]
        while queue:
            near = queue.pop(0)
            for one, other in chain(self._skip(near), self._assign(near)):
                self._take(one, other)
                if one.far not in self.bodies:
                    self.bodies[one.far] = other.far
                    self.placed[one.far] = place_body(self.a, self.b, (one, other), self.placed[near], self.believed)
                    queue.append(one.far)
        return Pair(self.a, self.b, self.bodies, self.placed, tuple(self.links), tuple(self.open_a), tuple(self.open_b))

    def _take(self, one: Link, other: Link) -> None:
        self.links.append((one, other))
        ours, theirs = {*one.names}, {*other.names}
        self.open_a = [link for link in self.open_a if {*link.names} != ours]
        self.open_b = [link for link in self.open_b if {*link.names} != theirs]

    def _skip(self, near: str) -> list[tuple[Link, Link]]:
        """Where a link is missing, pair links of a body with coincident links that are one link farther outwards."""
        if len(self.a.links) == len(self.b.links):
            return []
        there = self.bodies[near]
        ours = [link.of(near) for link in self.open_a if link.joins(near)]
        theirs = [link.of(there) for link in self.open_b if link.joins(there)]
        direct = [pair for pair in product(ours, theirs) if self._coincide(*pair, near)]
        ours = [link for link in ours if all(link is not one for one, _ in direct)]
        theirs = [link for link in theirs if all(link is not other for _, other in direct)]
        pairs = [product(_next_links(self.a, link), theirs) for link in ours]
        pairs += [product(ours, _next_links(self.b, link)) for link in theirs]
        skipped = max(([pair for pair in some if self._coincide(*pair, near)] for some in pairs), key=len, default=[])
        self.placed |= {one.near: self.placed[near] for one, _ in skipped}
        return self._choose(skipped)

    def _choose(self, pairs: list[tuple[Link, Link]]) -> list[tuple[Link, Link]]:
        """Keep only the likeliest pair for each link, since parallel slides coincide."""
        chosen = list[tuple[Link, Link]]()
        for one, other in sorted(filter(self._may_meet, pairs), key=lambda pair: self._cost(*pair)):
            if all(one is not x and other is not y for x, y in chosen):
                chosen.append((one, other))
        return chosen

    def _coincide(self, one: Link, other: Link, near: str) -> bool:
        """Return True if two links and most of their descendants coincide at the placement of a body."""
        T = self.placed[near]
        if one.kind != other.kind or distance(self.a, (one, other), T) > EXACT:
            return False
        off = misfits(self.a, self.b, (one.far, other.far), T)
        return bool((off < NEAR).sum() >= MANY * len(off))

    def _assign(self, near: str) -> Iterator[tuple[Link, Link]]:
        """Pair the links of a body; yield the most certain pairs first."""
        there = self.bodies[near]
        ours = [link.of(near) for link in self.open_a if link.joins(near)]
        theirs = [link.of(there) for link in self.open_b if link.joins(there)]
        if not ours or not theirs:
            return
        cost = np.array([[self._cost(one, other) for other in theirs] for one in ours])
        pairs = sorted(assign(cost), key=lambda pair: cost[pair])
        for i, j in pairs:
            one, other = ours[i], theirs[j]
            named = one.far in self.called and self.called[one.far] == other.far
            if cost[i, j] <= (NAMED if named else MOST) and self._may_meet((one, other)):
                yield one, other

    def _may_meet(self, pair: tuple[Link, Link]) -> bool:
        """Return True if the far bodies of two links are partners or both unmatched."""
        one, other = pair
        fresh = one.far not in self.bodies and other.far not in self.bodies.values()
        return fresh or self.bodies.get(one.far) == other.far

    def _cost(self, one: Link, other: Link) -> float:
        """Compute the dissimilarity of two links and their descendants; equal names outweigh everything else."""
        a, b, T = self.a, self.b, self.placed[one.near]
        cost = 1.5 * (one.kind != other.kind) + self._names(one, other)
        for mine, yours in zip(features(one, one.near), features(other, other.near), strict=False):
            cost += min(1.0, 10.0 * float(np.linalg.norm(gap(mine, yours.displace(T), a.length))))
        cost += UNLIKE * (_roles(a.reading, one) != _roles(b.reading, other))
        first, second = a.bodies[one.far], b.bodies[other.far]
        cost += min(1.0, abs(math.log((first.matter.mass + 1e-9) / (second.matter.mass + 1e-9))))
        cost += min(1.0, 0.3 * abs(len(a.at(one.far)) - len(b.at(other.far))))
        if one.far in self.bodies or other.far in self.bodies.values():
            return cost + (-3.0 if self.bodies.get(one.far) == other.far else 100.0)
        if one.kind == other.kind:
            cost += 0.7 * float(np.minimum(misfits(a, b, (one.far, other.far), T), 1.0).mean())
        return cost

    def _names(self, one: Link, other: Link) -> float:
        partners = {self.known[name] for name in one.joints if name in self.known}
        cost = -3.0 * bool(partners & {*other.joints}) + 2.0 * bool(partners - {*other.names})
        cost += 2.0 * bool({self.back[name] for name in other.joints if name in self.back} - {*one.names})
        if one.far in self.called or other.far in self.called.values():
            cost += -2.0 if self.called.get(one.far) == other.far else 2.0
        return cost
