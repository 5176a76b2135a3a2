"""Which body and which link of one machine is which of another: outwards from the ground, by names and by geometry.

At each pair of bodies their links are assigned to each other at the least cost, by names, kind, place, mass and number
of neighbours. The body behind a pair of links is then placed in the first machine's world by the candidate, or the
motion of the link, that brings most of its own features and its matter onto their partners.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares, linear_sum_assignment

from screwgauge.diagnosis.machine.normal_form import Body, Element, Link, Machine
from screwgauge.diagnosis.mechanics.matter import displaced
from screwgauge.models.readings.assemble import exponential, matrix
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross, rotation

#: Share of the machine's length, or of 1 rad, up to which features are the same.
EXACT = 1e-6
#: Share of the machine's length up to which features are near each other; and share of bodies of which most are.
NEAR, MANY = 0.01, 0.5
#: Cost up to which two links are taken for one.
MOST = 3.2
#: Candidates from frames of one name that are tried.
FRAMES = 6
UPPER = np.triu_indices(3)
#: How many candidates are fitted along a link, and the angles of its hinges from which [rad].
FITTED, TURNS = 3, (0.0, 2.1, -2.1)


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """What a link is on one of its bodies: a point (S), a line (R) or a direction (P)."""

    kind: str
    point: Array
    direction: Array

    def placed(self, T: Array) -> Feature:
        """In another world. T: shape (4, 4)."""
        return Feature(self.kind, T[:3, :3] @ self.point + T[:3, 3], T[:3, :3] @ self.direction)


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Bodies and links of A with those of B.

    Attributes:
        bodies: Of A -> of B.
        placed: Body of A -> placement of B's world in A's that lays its partner onto it, both at their closed poses.
            Shape (4, 4).
        links: Pairs, each seen from the body of it that is nearer to the ground.
        only_a, only_b: Links without a partner.
    """

    bodies: Mapping[str, str]
    placed: Mapping[str, Array]
    links: tuple[tuple[Link, Link], ...]
    only_a: tuple[Link, ...]
    only_b: tuple[Link, ...]

    @property
    def joints(self) -> dict[str, str]:
        """Joints of A with those of B, of links that consist of the same joints."""
        pairs = ((x, y) for one, other in self.links for x, y in _elements(one, other))
        return {x.joint: y.joint for x, y in pairs if x.joint and y.joint}

    def covers(self, a: Machine, b: Machine) -> bool:
        """Whether every body and link has a partner."""
        return not (self.only_a or self.only_b) and len(self.bodies) == len(a.bodies) == len(b.bodies)

    def fits(self, a: Machine, b: Machine) -> bool:
        """Whether most bodies lie on their partners, but for some of their features."""
        pairs = [pair for pair in self.bodies.items() if pair[0] != GROUND]
        near = [np.median(misfits(a, b, pair, self.placed[pair[0]])) < NEAR for pair in pairs]
        return bool(sum(near) >= MANY * len(near))


def standing(a: Machine, b: Machine, alignment: Alignment, reading: Reading) -> tuple[Array, dict[str, Array]]:
    """Where B's world stands in A's, and where each body of B's reading stands there if B is in the pose of A.

    A whole that stands elsewhere is laid onto A by one placement for all that hangs on the ground.

    Args:
        reading: A, in the pose that is meant.

    Returns:
        Shape (4, 4); and body of B's reading -> pose in A's world, shape (4, 4).
    """
    roots = [(one, other) for one, other in alignment.links if one.near == GROUND]
    tried = [np.eye(4), *(alignment.placed[one.far] for one, _ in roots)]

    def off(T: Array) -> float:
        pairs = ((features(one, GROUND), features(other, GROUND)) for one, other in roots)
        gaps = [
            np.linalg.norm(gap(x, y.placed(T), a.length))
            for ours, theirs in pairs
            for x, y in zip(ours, theirs, strict=False)
        ]
        return float(max(gaps, default=0.0))

    T = next((T for T in tried if off(T) < EXACT), tried[0])
    poses = {n: body.pose for n, body in b.reading.bodies.items()}
    found = dict[str, Array]()
    for name, other in alignment.bodies.items():
        both = [n for n in a.bodies[name].members if n in reading.bodies and n in a.reading.bodies]
        X = reading.bodies[both[0]].pose @ np.linalg.inv(a.reading.bodies[both[0]].pose) if both else np.eye(4)
        G = X @ alignment.placed[name]
        found |= {n: np.asarray(G @ poses[n]) for n in b.bodies[other].members if n in poses}
    return T, found


def _elements(one: Link, other: Link) -> Iterator[tuple[Element, Element]]:
    """Freedoms of two links, one by one; none of links that divide them in different ways."""
    kinds = [[element.kind for element in link.elements] for link in (one, other)]
    if kinds[0] == kinds[1]:
        yield from zip(one.elements, other.elements, strict=True)


def features(link: Link, body: str) -> list[Feature]:
    """Of a link on one of its bodies; none of a free one."""
    if link.kind == "F":
        return []
    if link.kind == "S" and link.centre is not None:
        return [Feature("S", link.centre, np.zeros(3))]
    element = link.elements[0 if body == link.near else -1]
    kind = {"hinge": "R", "slide": "P", "ball": "S", "free": "S"}[element.kind]
    return [Feature(kind, element.centre, element.direction if kind != "S" else np.zeros(3))]


def gap(one: Feature, other: Feature, length: float) -> Array:
    """How far two features are from each other: of directions, and of places. Shape (6,), lengths of the machine."""
    if one.kind != other.kind:
        return np.append(2.0, np.zeros(5))
    sign = 1.0 if one.direction @ other.direction >= 0.0 else -1.0
    step = (other.point - one.point) / length
    way = {"R": np.cross(step, one.direction), "S": step, "P": np.zeros(3)}[one.kind]
    return np.append(one.direction - sign * other.direction, way)


def aligned(a: Machine, b: Machine, known: Mapping[str, str], bodies: Mapping[str, str]) -> Alignment:
    """Finds partners.

    Args:
        known: Joints of A with those of B that names, or the user, say.
        bodies: The same of bodies of the readings.
    """
    return _Walk(a, b, known, bodies).done()


class _Walk:
    """The walk from the ground outwards."""

    def __init__(self, a: Machine, b: Machine, known: Mapping[str, str], bodies: Mapping[str, str]) -> None:
        self.a, self.b, self.known = a, b, known
        self.back = {other: name for name, other in known.items()}
        self.called = {a.part_of(name): b.part_of(other) for name, other in bodies.items()}
        self.bodies, self.placed = {GROUND: GROUND}, {GROUND: np.eye(4)}
        self.links: list[tuple[Link, Link]] = []
        self.open_a, self.open_b = list(a.links), list(b.links)

    def done(self) -> Alignment:
        queue = [GROUND]
        while queue:
            near = queue.pop(0)
            for one, other in self._assigned(near):
                self._taken(one, other)
                if one.far not in self.bodies:
                    self.bodies[one.far] = other.far
                    self.placed[one.far] = placed(self.a, self.b, (one, other), self.placed[near])
                    queue.append(one.far)
        return Alignment(self.bodies, self.placed, tuple(self.links), tuple(self.open_a), tuple(self.open_b))

    def _taken(self, one: Link, other: Link) -> None:
        self.links.append((one, other))
        self.open_a = [link for link in self.open_a if link.names != one.names and link.names != one.reversed().names]
        self.open_b = [
            link for link in self.open_b if link.names != other.names and link.names != other.reversed().names
        ]

    def _assigned(self, near: str) -> Iterator[tuple[Link, Link]]:
        """Pairs of links of a body, the surest first."""
        there = self.bodies[near]
        ours = [link.of(near) for link in self.open_a if link.joins(near)]
        theirs = [link.of(there) for link in self.open_b if link.joins(there)]
        if not ours or not theirs:
            return
        cost = np.array([[self._cost(one, other) for other in theirs] for one in ours])
        pairs = sorted(zip(*linear_sum_assignment(cost), strict=True), key=lambda pair: cost[pair])
        for i, j in pairs:
            one, other = ours[i], theirs[j]
            fresh = one.far not in self.bodies and other.far not in self.bodies.values()
            if cost[i, j] <= MOST and (fresh or self.bodies.get(one.far) == other.far):
                yield one, other

    def _cost(self, one: Link, other: Link) -> float:
        """How unlike two links and what is behind them are; names that are the same weigh more than all else."""
        a, b, T = self.a, self.b, self.placed[one.near]
        cost = 1.5 * (one.kind != other.kind) + self._names(one, other)
        for mine, yours in zip(features(one, one.near), features(other, other.near), strict=False):
            cost += min(1.0, 10.0 * float(np.linalg.norm(gap(mine, yours.placed(T), a.length))))
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


class _Overlay:
    """A body of B laid on one of A, for one placement after the other: their features as arrays, made once."""

    def __init__(self, a: Machine, b: Machine, bodies: tuple[str, str]) -> None:
        (name, other), self.length = bodies, a.length
        ours, theirs = ([each for link in m.at(n) for each in features(link, n)] for m, n in ((a, name), (b, other)))
        self.points, self.others = (np.array([each.point for each in some]).reshape(-1, 3) for some in (ours, theirs))
        self.ways, self.other_ways = (
            np.array([each.direction for each in some]).reshape(-1, 3) for some in (ours, theirs)
        )
        self.lines, self.places = (np.array([each.kind == kind for each in ours], dtype=bool) for kind in "RS")
        self.unlike = np.array([[one.kind != each.kind for each in theirs] for one in ours], dtype=bool)
        self.first, self.second = a.bodies[name].matter, b.bodies[other].matter

    def residuals(self, T: Array) -> Array:
        """How it lies there: a row for each feature, for the centre of mass and for the inertia. Shape (n, 6).

        Args:
            T: Placement of B's world in A's. Shape (4, 4).
        """
        rows = [*self._gaps(T)]
        first, second = self.first, displaced(self.second, T)
        if first.mass and second.mass:
            rows.append(np.append((first.com - second.com) / self.length, np.zeros(3)))
            scale = float(np.abs(first.inertia).max()) or 1.0
            rows.append(((first.inertia - second.inertia) / scale)[UPPER])
        return np.array(rows or [np.zeros(6)])

    def misfits(self, T: Array) -> Array:
        """Sizes of the `residuals`. Shape (n,)."""
        return np.asarray(np.linalg.norm(self.residuals(T), axis=1))

    def _gaps(self, T: Array) -> Array:
        """As `gap` of each feature of A and the nearest one of B. Shape (n, 6)."""
        n = len(self.points)
        if not self.unlike.size:
            return np.tile(np.append(1.0, np.zeros(5)), (n, 1))
        R = T[:3, :3]
        ways = self.other_ways @ R.T
        signs = np.where(self.ways @ ways.T >= 0.0, 1.0, -1.0)
        turns = self.ways[:, None] - signs[..., None] * ways
        steps = (self.others @ R.T + T[:3, 3] - self.points[:, None]) / self.length
        across = cross(steps, np.broadcast_to(self.ways[:, None], steps.shape))
        off = np.where(self.lines[:, None, None], across, np.where(self.places[:, None, None], steps, 0.0))
        gaps = np.concatenate([turns, off], axis=-1)
        gaps[self.unlike] = np.append(2.0, np.zeros(5))
        return np.asarray(gaps[np.arange(n), np.argmin(np.einsum("ijk,ijk->ij", gaps, gaps), axis=1)])


def misfits(a: Machine, b: Machine, bodies: tuple[str, str], T: Array) -> Array:
    """How a body of B lies on one of A, with B's world placed in A's, shape (4, 4). Shape (n,)."""
    return _Overlay(a, b, bodies).misfits(T)


def _score(off: Array) -> float:
    """How good a placement is: how many residuals are none, then how small the others are."""
    return float((off < EXACT).sum() - np.minimum(off, 1.0).mean())


def placed(a: Machine, b: Machine, links: tuple[Link, Link], near: Array) -> Array:
    """Placement of B's world in A's that lays what is behind a link onto what is behind its partner.

    Args:
        near: The same of what is before them. Shape (4, 4).
    """
    overlay = _Overlay(a, b, (links[0].far, links[1].far))
    tried = list(_candidates(a, b, links, near))
    scores = [_score(overlay.misfits(T)) for T in tried]
    best = max(range(len(tried)), key=lambda i: (round(scores[i], 5), -i))
    found, score = tried[best], scores[best]
    if overlay.misfits(found).max() <= EXACT or (len(links[0].elements) > 3 and links[0].kind != "F"):
        return found
    for T in tried[:FITTED]:
        fitted = _fitted(overlay, links[0], T)
        if (better := _score(overlay.misfits(fitted))) > score + 0.4:
            found, score = fitted, better
        if overlay.misfits(found).max() <= EXACT:
            break
    return found


def _candidates(a: Machine, b: Machine, links: tuple[Link, Link], near: Array) -> Iterator[Array]:
    """Placements without a fit: the same coordinates, the same pose, the joint displaced, frames of one name."""
    one, other = links
    same = one.kind == other.kind and one.articulated and other.articulated
    if same and len(one.elements) == len(other.elements):
        yield _coordinates(a, b, links, near)
    yield near
    mine, yours = features(one, one.near), [each.placed(near) for each in features(other, other.near)]
    if mine and yours and mine[0].kind == yours[0].kind:
        yield _laid(mine[0], yours[0]) @ near
    first, second = a.bodies[one.far], b.bodies[other.far]
    for name in [name for name in first.frames if name in second.frames][:FRAMES]:
        yield first.frames[name] @ np.linalg.inv(second.frames[name])
    if one.kind == "F":
        yield _frame(a, first) @ np.linalg.inv(_frame(b, second))


def _frame(machine: Machine, body: Body) -> Array:
    return body.frames[body.members[0]] if body.members else np.eye(4)


def _coordinates(a: Machine, b: Machine, links: tuple[Link, Link], near: Array) -> Array:
    """With the joints of B's link at the coordinates of A's, counted in the direction in which axes agree."""
    out: Array = np.eye(4)
    R = near[:3, :3]
    for mine, yours in zip(links[0].elements, links[1].elements, strict=True):
        if mine.kind not in ("hinge", "slide") or mine.kind != yours.kind:
            continue
        p, q = a.reading.joints[mine.joint].home, b.reading.joints[yours.joint].home
        sign = 1.0 if mine.direction @ (R @ yours.direction) >= 0.0 else -1.0
        sign *= -1.0 if mine.turned != yours.turned else 1.0
        # outer motions come first: the axes are those of A's pose
        way = (p - sign * q) * (-1.0 if mine.turned else 1.0)
        out = exponential(mine.kind, mine.direction, mine.centre, way) @ out
    return np.asarray(out @ near)


def _laid(one: Feature, other: Feature) -> Array:
    """The shortest displacement of another feature onto the one. Shape (4, 4)."""
    R: Array = np.eye(3)
    if one.kind != "S":
        direction = other.direction if one.direction @ other.direction >= 0.0 else -other.direction
        turn = np.cross(direction, one.direction)
        sine = float(np.linalg.norm(turn))
        R = rotation(turn / sine, np.array(math.atan2(sine, direction @ one.direction))) if sine > 1e-12 else R
    step = one.point - R @ other.point
    way = {"R": step - (step @ one.direction) * one.direction, "S": step, "P": np.zeros(3)}[one.kind]
    return matrix(way, R)


def _fitted(overlay: _Overlay, link: Link, near: Array) -> Array:
    """The motion of a link that lays what is behind it onto what is behind its partner, robustly: some may differ."""
    steps = _freedoms(link)

    def at(q: Array) -> Array:
        out: Array = np.eye(4)
        for step, value in zip(steps, q, strict=True):
            out = exponential(step.kind, step.direction, step.centre, float(value)) @ out
        return np.asarray(out @ near)

    def off(q: Array) -> Array:
        return overlay.residuals(at(q))

    def sizes(q: Array) -> Array:
        return np.asarray(np.linalg.norm(off(q), axis=1))

    best, most = near, -math.inf
    hinges = [step.kind == "hinge" for step in steps]
    turns = TURNS if sum(hinges) < 3 else (0.0,)
    for start in product(*(turns if hinge else (0.0,) for hinge in hinges)):
        q = least_squares(lambda q: off(q).ravel(), np.array(start), x_scale=0.1, max_nfev=20).x
        q = least_squares(sizes, q, loss="cauchy", f_scale=1e-2, x_scale=0.1, max_nfev=30).x
        near_ones = sizes(q) < 0.02
        if near_ones.any():
            tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
            q = least_squares(lambda q, w=near_ones: off(q)[w].ravel(), q, x_scale=0.1, max_nfev=40, **tight).x
        if (score := _score(overlay.misfits(at(q)))) > most:
            best, most = at(q), score
        if overlay.misfits(best).max() <= EXACT:
            break
    return best


def _freedoms(link: Link) -> list[Element]:
    """Hinges and slides by which a link moves."""
    if link.kind in ("S", "F") and link.centre is not None:
        turns = [Element("hinge", np.append(e, np.cross(link.centre, e)), link.centre) for e in np.eye(3)]
        ways = [Element("slide", np.append(np.zeros(3), e), link.centre) for e in np.eye(3)]
        return turns if link.kind == "S" else [*ways, *turns]
    return [each for each in link.elements if each.kind in ("hinge", "slide")]
