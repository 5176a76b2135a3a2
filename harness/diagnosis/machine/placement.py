"""Where a body of one machine lies in the world of another: by the candidate, or the motion of its link, that brings
most of its own features and its matter onto those of its partner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from screwgauge.models.machine import Body, Element, Link, Machine
from screwgauge.models.matter import displaced
from screwgauge.models.readings.assemble import exponential, matrix
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross, rotation

#: Share of the machine's length, or of 1 rad, up to which features are the same.
EXACT = 1e-6
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


def features(link: Link, body: str) -> list[Feature]:
    """Of a link on one of its bodies; none of a free one."""
    if link.kind == "F":
        return []
    if link.kind == "S" and link.centre is not None:
        return [Feature("S", link.centre, np.zeros(3))]
    return [feature(link.elements[0 if body == link.near else -1])]


def feature(element: Element) -> Feature:
    kind = {"hinge": "R", "slide": "P", "ball": "S", "free": "S"}[element.kind]
    return Feature(kind, element.centre, element.direction if kind != "S" else np.zeros(3))


def gap(one: Feature, other: Feature, length: float) -> Array:
    """How far two features are from each other: of directions, and of places. Shape (6,), lengths of the machine."""
    if one.kind != other.kind:
        return np.append(2.0, np.zeros(5))
    sign = 1.0 if one.direction @ other.direction >= 0.0 else -1.0
    step = (other.point - one.point) / length
    way = {"R": np.cross(step, one.direction), "S": step, "P": np.zeros(3)}[one.kind]
    return np.append(one.direction - sign * other.direction, way)


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
    elsewhere = links[0].near == GROUND and distance(a, links, np.eye(4)) > EXACT
    steps = _elsewhere(links[0]) if elsewhere else _freedoms(links[0])
    for T in tried[:FITTED]:
        fitted = _fitted(overlay, steps, T)
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


def _fitted(overlay: _Overlay, steps: list[Element], near: Array) -> Array:
    """The motion by some steps that lays a body onto its partner, robustly: some of its features may differ."""

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


def distance(a: Machine, links: tuple[Link, Link], T: Array) -> float:
    """How far two links are from each other on their near bodies, in lengths of the machine or rad.

    Args:
        T: Placement of B's world in A's. Shape (4, 4).
    """
    ours, theirs = (features(link, link.near) for link in links)
    gaps = (np.linalg.norm(gap(x, y.placed(T), a.length)) for x, y in zip(ours, theirs, strict=False))
    return float(max(gaps, default=0.0))


def _elsewhere(link: Link) -> list[Element]:
    """Hinges and slides by which the whole can still stand elsewhere, once a link at the ground lies on its partner."""
    if link.kind not in ("R", "P"):
        return _freedoms(link)
    axis, centre = link.elements[0].direction, link.elements[0].centre
    ways = [axis] if link.kind == "R" else [*np.eye(3)]
    turn = Element("hinge", np.append(axis, np.cross(centre, axis)), centre)
    return [*(Element("slide", np.append(np.zeros(3), way), centre) for way in ways), turn]


def _freedoms(link: Link) -> list[Element]:
    """Hinges and slides by which a link moves."""
    if link.kind in ("S", "F") and link.centre is not None:
        turns = [Element("hinge", np.append(e, np.cross(link.centre, e)), link.centre) for e in np.eye(3)]
        ways = [Element("slide", np.append(np.zeros(3), e), link.centre) for e in np.eye(3)]
        return turns if link.kind == "S" else [*ways, *turns]
    return [each for each in link.elements if each.kind in ("hinge", "slide")]
