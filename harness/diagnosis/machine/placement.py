"""Places a body of one machine in the world frame of a second machine.

Chooses a candidate, or a motion of the body's link, that aligns most features and the mass with the partner.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from enum import Enum
from itertools import chain, product

import numpy as np

from screwgauge.diagnosis.machine.features import EXACT, Overlay, features, gap
from screwgauge.models.machine import Body, Element, Link, Machine
from screwgauge.models.poses import exponential, matrix, shortest_turn
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array, cross

#: Distance at which a feature has half its weight [machine lengths, rad, relative].
HALF = 0.01
#: Number of frames with equal names that are tried.
FRAMES = 6
#: Smallest relative difference between distinct principal moments, and relative distance of a centre of mass from its
#: axis; largest relative difference between equal moments of two bodies.
DISTINCT, ALIKE = 1e-3, 1e-6
#: Number of candidates that are fitted along a link, and initial angles of its hinges [rad].
FITTED, TURNS = 3, (0.0, 2.1, -2.1)
#: Smallest length of a vector across a hinge that determines an angle [machine lengths].
FLAT = 1e-6
#: Gauss-Newton settings: finite-difference step, largest step, and scales at which residuals have half their weight.
STEP, FAR = 1e-7, 0.7
SCALES = (*np.geomspace(1.0, 1e-2, 8), *np.full(10, 1e-2))


class Believed(Enum):
    """Assumptions about the placement of bodies, in the order in which they are tried.

    Attributes:
        SIMILAR: Two similar robots, in which a few features match exactly by chance.
        COPY: An edited copy, in which most features match exactly.
        NAMED: An edited copy in which a displaced feature would mislead a fit; a body is placed only by coordinates
            and by frames with equal names, not by motions of its link, principal axes or centres of mass.
    """

    SIMILAR = 1
    COPY = 2
    NAMED = 3

    def score(self, off: Array) -> float:
        """Rate a placement by its misfits."""
        whole, exact = 0.5 * bool((off < EXACT).all()), 0.25 if self is Believed.SIMILAR else 1.0
        return whole + float((1.0 / (1.0 + (off / HALF) ** 2) + exact * (off < EXACT)).sum())


def place_body(a: Machine, b: Machine, links: tuple[Link, Link], near: Array, believed: Believed) -> Array:
    """Place B's world frame in A's such that the descendants of a link are aligned with its partner's descendants.

    Args:
        near: Placement determined by the parents of the links. Shape (4, 4).
    """
    overlay = Overlay(a, b, (links[0].far, links[1].far))
    tried, score = list(_candidates(a, b, links, near)), believed.score
    offs = [overlay.misfits(T) for T in tried]
    best = max(range(len(tried)), key=lambda i: (round(score(offs[i]), 5), -i))
    nearest, off = tried[best], offs[best]
    if off.max() <= EXACT or believed is Believed.NAMED:
        return nearest
    further = [_fitted_placements(a, b, links, overlay, tried, score)]
    if not {*a.bodies[links[0].far].frames} & {*b.bodies[links[1].far].frames}:
        further.append(_by_matter(a, b, links))
    for T in chain(*further):
        other = overlay.misfits(T)
        if score(other) > score(off) + 0.4:
            nearest, off = T, other
        if off.max() <= EXACT:
            break
    return nearest


def _fitted_placements(
    a: Machine,
    b: Machine,
    links: tuple[Link, Link],
    overlay: Overlay,
    tried: list[Array],
    score: Callable[[Array], float],
) -> Iterator[Array]:
    """Yield placements reached by motions of the link; they are used if no candidate is exact."""
    if len(links[0].elements) <= 3 or links[0].kind == "F":
        elsewhere = links[0].near == GROUND and distance(a, links, np.eye(4)) > EXACT
        steps = _free_motions(links[0]) if elsewhere else _freedoms(links[0])
        yield from (_fit(overlay, steps, T, score) for T in tried[:FITTED])


def _candidates(a: Machine, b: Machine, links: tuple[Link, Link], near: Array) -> Iterator[Array]:
    """Yield placements that need no fit: equal coordinates, equal pose, displaced joint, frames with equal names."""
    one, other = links
    same = one.kind == other.kind and one.articulated and other.articulated
    if same and len(one.elements) == len(other.elements):
        yield coordinate_placement(a, b, links, near)
    yield near
    mine, yours = features(one, one.near), [each.displace(near) for each in features(other, other.near)]
    if mine and yours and mine[0].kind == yours[0].kind:
        yield lay(mine[0], yours[0]) @ near
    first, second = a.bodies[one.far], b.bodies[other.far]
    for name in [name for name in first.frames if name in second.frames][:FRAMES]:
        yield first.frames[name] @ np.linalg.inv(second.frames[name])
    if one.kind == "F":
        yield _frame(a, first) @ np.linalg.inv(_frame(b, second))


def _by_matter(a: Machine, b: Machine, links: tuple[Link, Link]) -> Iterator[Array]:
    """Yield placements that align principal axes of inertia, or the link's axis and the centre of mass."""
    sides = [(m.bodies[link.far], link) for m, link in ((a, links[0]), (b, links[1]))]
    for landmarks in (_principal, _arm):
        (ours, size_), (theirs, other) = (landmarks(body, link, a.length) for body, link in sides)
        if len(ours) and len(theirs) and np.allclose(size_, other, rtol=ALIKE):
            yield from (T @ np.linalg.inv(theirs[0]) for T in ours)


def _principal(body: Body, link: Link, length: float) -> tuple[list[Array], Array]:
    """Return frames of the principal axes with all signs (none for a round body), and the moments."""
    moments, R = np.linalg.eigh(body.matter.inertia)
    if body.matter.mass == 0.0 or np.diff(moments).min() < DISTINCT * abs(moments[-1]):
        return [], moments
    R = R * np.linalg.det(R)
    signs = ((1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0))
    return [matrix(body.matter.com, R * np.array(each)) for each in signs], moments


def _arm(body: Body, link: Link, length: float) -> tuple[list[Array], Array]:
    """Return frames along a hinge and towards the centre of mass (none if it is near the axis), and the distance."""
    if link.kind != "R" or body.matter.mass == 0.0:
        return [], np.zeros(1)
    d, point = link.elements[0].direction, link.elements[0].centre
    foot = point + ((body.matter.com - point) @ d) * d
    arm = body.matter.com - foot
    reach = float(np.linalg.norm(arm))
    if reach < DISTINCT * length:
        return [], np.array([reach])
    x = arm / reach
    return [matrix(foot, np.array([x, np.cross(z, x), z]).T) for z in (d, -d)], np.array([reach])


def _frame(machine: Machine, body: Body) -> Array:
    return body.frames[body.members[0]] if body.members else np.eye(4)


def coordinate_placement(a: Machine, b: Machine, links: tuple[Link, Link], near: Array) -> Array:
    """Return the placement of B's world frame at which the joints of B's link have A's coordinates.

    Each element moves the bodies on its far side, whatever the direction of its joint. Coordinates are signed such that
    the axes of both machines agree once the preceding elements are at A's coordinates.
    """
    T = near
    for mine, yours in zip(links[0].elements, links[1].elements, strict=True):
        if mine.kind not in ("hinge", "slide") or mine.kind != yours.kind:
            continue
        p, q = a.reading.joints[mine.joint].home, b.reading.joints[yours.joint].home
        sign = 1.0 if mine.direction @ (T[:3, :3] @ yours.direction) >= 0.0 else -1.0
        # outer motions first: the axes refer to A's pose
        T = exponential(mine.kind, mine.direction, mine.centre, p - sign * q) @ T
    return T


def lay(one: Element, other: Element) -> Array:
    """Compute the shortest displacement of the second feature onto the first. Shape (4, 4)."""
    R: Array = np.eye(3)
    if one.kind != "ball":
        sense = 1.0 if one.direction @ other.direction >= 0.0 else -1.0
        R = shortest_turn(sense * other.direction, one.direction)
    step = one.centre - R @ other.centre
    way = {"hinge": step - (step @ one.direction) * one.direction, "ball": step, "slide": np.zeros(3)}[one.kind]
    return matrix(way, R)


def _fit(overlay: Overlay, steps: list[Element], near: Array, score: Callable[[Array], float]) -> Array:
    """Find the motion along given degrees of freedom that aligns most of a body exactly with its partner."""
    best, most = near, -math.inf
    for T in _moves(overlay, steps, near):
        off = overlay.misfits(T)
        if (found := score(off)) > most:
            best, most = T, found
        if off.max() <= EXACT:  # on symmetric machines, take the first exact placement, which moves least
            break
    return best


def _moves(overlay: Overlay, steps: list[Element], near: Array) -> Iterator[Array]:
    """Yield placements reached along given degrees of freedom, in closed form if there is at most one hinge."""
    hinges = [step for step in steps if step.kind == "hinge"]
    ways = np.array([step.direction for step in steps if step.kind == "slide"]).reshape(-1, 3)
    if len(hinges) <= 1 and (len(ways) in (0, 3) or not hinges or _are_parallel(ways, hinges[0].direction)):
        for T in _turns(overlay, hinges[0], near) if hinges else [near]:
            yield from _shifts(overlay, ways, T) if len(ways) else [T]
        return
    turns = TURNS if len(hinges) < 3 else (0.0,)
    for start in product(*(turns if step.kind == "hinge" else (0.0,) for step in steps)):
        yield _descend(overlay, steps, near, np.array(start))


def _are_parallel(ways: Array, axis: Array) -> bool:
    """Return True if directions (zero for points) are parallel to an axis. Shape (3,) or (n, 3)."""
    return float(np.abs(cross(ways, np.broadcast_to(axis, ways.shape))).max()) < EXACT


def _turns(overlay: Overlay, hinge: Element, near: Array) -> Iterator[Array]:
    """Yield rotations about a hinge that align a feature, the centre of mass or the inertia with its partner."""
    axis, centre = hinge.direction, hinge.centre
    ours, theirs = overlay.ours, overlay.theirs.move(near)
    places = product(ours.places(), theirs.places())
    pairs = [
        (x - centre, y - centre, False) for (k, x, way), (m, y, _) in places if k == m and _are_parallel(way, axis)
    ]
    ways = product(ours.directions(), theirs.directions())
    pairs += [(u, v, True) for (k, u), (m, v) in ways if k == m]
    angles = {0.0}
    for u, v, senseless in pairs:
        sine, cosine = float(cross(v, u) @ axis), float(u @ v - (u @ axis) * (v @ axis))
        if math.hypot(sine, cosine) > FLAT:
            angle = math.atan2(sine, cosine)
            some = [angle, math.remainder(angle + math.pi, math.tau)] if senseless else [angle]
            angles |= {round(each, 13) for each in some}
    for angle in sorted(angles, key=abs):
        yield exponential("hinge", axis, centre, angle) @ near


def _shifts(overlay: Overlay, ways: Array, near: Array) -> list[Array]:
    """Return placements shifted along given directions, shape (n, 3), that align a point of a body with its partner."""
    shifted = [near]
    for (kind, x, way), (other, y, _) in product(overlay.ours.places(), overlay.theirs.move(near).places()):
        if kind == other:
            across = np.eye(3) - np.outer(way, way)
            shifted.append(matrix(np.linalg.pinv(across @ ways.T) @ across @ (x - y) @ ways, np.eye(3)) @ near)
    return shifted


def _descend(overlay: Overlay, steps: list[Element], near: Array, start: Array) -> Array:
    """Fit a placement along given degrees of freedom, starting from initial coordinates."""

    def placement(q: Array) -> Array:
        out: Array = np.eye(4)
        for step, value in zip(steps, q, strict=True):
            out = exponential(step.kind, step.direction, step.centre, float(value)) @ out
        return np.asarray(out @ near)

    return placement(descend(lambda q: overlay.residuals(placement(q)), start))


def descend(residuals: Callable[[Array], Array], q: Array) -> Array:
    """Minimise residuals with robust Gauss-Newton steps: large residuals are down-weighted (Cauchy loss).

    Args:
        residuals: Function from coordinates, shape (k,), to residuals; each row gets one weight. Shape (n, m).
        q: Initial guess. Shape (k,).
    """
    r = residuals(q)
    for scale in SCALES:
        J = np.stack([(residuals(q + step) - r) / STEP for step in STEP * np.eye(len(q))], axis=-1)
        root = 1.0 / np.sqrt(1.0 + (np.linalg.norm(r, axis=1) / scale) ** 2)[:, None]
        step = -np.linalg.lstsq((root[..., None] * J).reshape(-1, len(q)), (root * r).ravel(), rcond=None)[0]
        step *= min(1.0, FAR / max(float(np.abs(step).max()), 1e-300))
        q = q + step
        r = residuals(q)
        if np.abs(step).max() < 1e-15:
            break
    return q


def distance(a: Machine, links: tuple[Link, Link], T: Array) -> float:
    """Compute the distance between two links on their near bodies, in machine lengths or rad.

    Args:
        T: Placement of B's world frame in A's. Shape (4, 4).
    """
    ours, theirs = (features(link, link.near) for link in links)
    gaps = (np.linalg.norm(gap(x, y.displace(T), a.length)) for x, y in zip(ours, theirs, strict=False))
    return float(max(gaps, default=0.0))


def _free_motions(link: Link) -> list[Element]:
    """Return the rotations and translations that remain free after a ground link is aligned with its counterpart."""
    if link.kind not in ("R", "P"):
        return _freedoms(link)
    axis, centre = link.elements[0].direction, link.elements[0].centre
    ways = [axis] if link.kind == "R" else [*np.eye(3)]
    turn = Element("hinge", np.append(axis, np.cross(centre, axis)), centre)
    return [*(Element("slide", np.append(np.zeros(3), way), centre) for way in ways), turn]


def _freedoms(link: Link) -> list[Element]:
    """Return the hinges and slides of a link."""
    if link.kind in ("S", "F") and link.centre is not None:
        turns = [Element("hinge", np.append(e, np.cross(link.centre, e)), link.centre) for e in np.eye(3)]
        ways = [Element("slide", np.append(np.zeros(3), e), link.centre) for e in np.eye(3)]
        return turns if link.kind == "S" else [*ways, *turns]
    return [each for each in link.elements if each.kind in ("hinge", "slide")]
