"""Reciprocal screws: leg wrenches on a body, remaining twists of the body, and screw systems expressed as lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from screwgauge.reference import linear
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.closed_motion import motion_at
from screwgauge.reference.equations.kinematics import length, pose
from screwgauge.reference.graph import Edge, Layout, chain, coupled_joints, layout, root
from screwgauge.reference.mechanism import GROUND, Joint, Mechanism
from screwgauge.reference.rotations import Array, cross, skew

#: Pitch or distance [mechanism lengths], and component of a unit screw, below which a value counts as zero.
NONE = 1e-6


def reciprocal_screws(S: Array) -> Array:
    """Return wrenches ``[force; moment about O]`` that are reciprocal to twists S, eq. (8), or twists for wrenches S.

    Args:
        S: Twists or wrenches. Shape (6, m).

    Returns:
        Orthonormal basis of the reciprocal screws. Shape (6, 6 - rank S).
    """
    return linear.null_space(np.roll(S, 3, axis=0).T)


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A leg: joints that connect a body to the ground and are disjoint from all other paths from body to ground.

    Attributes:
        kinds: Kinds of the joints, starting at the ground, e.g. ``UPS``, or ``UPS, coupled``; empty if the leg is not a
            simple chain.
    """

    name: str
    kinds: str
    joints: tuple[Joint, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ScrewElement:
    """A screw; the pitch of a force or rotation is zero, and the pitch of a couple or translation is infinite.

    Attributes:
        direction: Unit vector. Shape (3,).
        point: Point on the axis [m]; arbitrary if the pitch is infinite. Shape (3,).
        pitch: Pitch [m/rad].
    """

    direction: Array
    point: Array
    pitch: float


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Support of a body at a pose: legs, wrenches and remaining twists.

    Attributes:
        wrenches: Constraint wrenches of each leg.
        twists: Twists of the body that the whole mechanism allows.
        overconstraints: Number of linearly dependent leg wrenches.
    """

    body: str
    legs: tuple[Leg, ...]
    wrenches: tuple[tuple[ScrewElement, ...], ...]
    twists: tuple[ScrewElement, ...]
    overconstraints: int


def end_body(mechanism: Mechanism) -> tuple[str, tuple[Leg, ...]]:
    """Return the body with the most legs (if several, the body farthest from the ground), and its legs."""
    away, rim = {GROUND: 0}, [GROUND]
    for body in rim:
        for joint in mechanism.joints:
            if body in joint.bodies and (far := Edge(joint, body).far) not in away:
                away[far] = away[body] + 1
                rim.append(far)
    reached = {body.name: legs(mechanism, body.name) for body in mechanism.bodies}
    best = max(reached, key=lambda name: (len(reached[name]), away[name]))
    return best, reached[best]


def legs(mechanism: Mechanism, body: str) -> tuple[Leg, ...]:
    """Return the legs of a body; coupled legs count as one leg, and joints without constraints do not count."""
    ends, owner = {GROUND, body}, {name: joint for joint in mechanism.joints for name in joint.coordinates}
    names = {joint: f"joint {joint.name}" for joint in mechanism.joints}  # body names do not contain spaces
    group = {name: name for name in (*(one.name for one in mechanism.bodies), *names.values())}
    ties = [[names[joint], *(side for side in joint.bodies if side not in ends)] for joint in mechanism.joints]
    ties += [[names[owner[name]] for name in one.named] for one in mechanism.couplings]
    for a, b in (pair for tie in ties for pair in pairwise(tie)):
        group[root(group, a)] = root(group, b)
    parts: dict[str, list[Joint]] = {}
    for joint, name in names.items():
        parts.setdefault(root(group, name), []).append(joint)
    ways = [part for part in parts.values() if ends <= {*_sides(part)}]
    kept = coupled_joints(mechanism) - {joint.name for joint in mechanism.joints if joint.fixed}
    return tuple(_leg(part, body, kept) for part in ways if any(joint.constrains for joint in part))


def _sides(joints: Sequence[Joint]) -> list[str]:
    return [side for joint in joints for side in joint.bodies]


def _leg(joints: list[Joint], body: str, kept: frozenset[str]) -> Leg:
    """Build a leg; prune dangling joints, except coupled joints (`kept`)."""

    def dangles(joint: Joint) -> bool:
        tips = {side for side in joint.bodies if _sides(joints).count(side) == 1}
        return bool(tips - {GROUND, body}) and joint.name not in kept

    while any(map(dangles, joints)):
        joints = [joint for joint in joints if not dangles(joint)]
    starts = [Edge(joint, GROUND) for joint in joints if GROUND in joint.bodies]
    walked = chain(starts[0], body, joints) if len(starts) == 1 else ()
    simple = len(walked) == len(joints) and walked[-1].far == body
    ends = [edge.joint for edge in walked] if simple else joints
    groups = {joint.name.rpartition(".")[0] for joint in joints}
    name = groups.pop() if len(groups) == 1 and len(joints) > 1 else ""
    name = name or (ends[0].name if len(joints) == 1 else f"{ends[0].name} to {ends[-1].name}")
    coupled = ", coupled" * any(joint.name in kept for joint in joints)
    kinds = "".join(joint.kind for joint in ends if not joint.fixed)
    return Leg(name, kinds + coupled if simple else "", tuple(joints))


def body_twists(mechanism: Mechanism, joints: Sequence[Joint], body: str, q: Array, unit: float = 1.0) -> list[Array]:
    """Return the twists of a body that given joints between ground and body allow. Shape (6, n_freedom), orthonormal.

    Args:
        q: All joint coordinates of closed poses. Shape (n, n_q).
        unit: Length that makes twists dimensionless [m].
    """
    names = {side for joint in joints for side in (joint.parent, joint.child)}
    bodies = tuple(one for one in mechanism.bodies if one.name in names)
    moved = {name for joint in joints for name in joint.coordinates}
    couplings = tuple(one for one in mechanism.couplings if {*one.named} <= moved)
    few = replace(mechanism, bodies=bodies, joints=tuple(joints), couplings=couplings, independent={}, axial=None)
    at = loop_equations(layout(few)).closing_system(q[:, mechanism.columns(few.coordinates)])
    columns, sizes = at.loops.columns, at.loops.size[:, None] / np.repeat([1.0, unit], 3)
    path = at.loops.lay.path[few.body_index[body], columns, None] * sizes
    moves = map(linear.null_space, at.system.A)
    return [_span((S * path).T @ free) for S, free in zip(at.pose.S[:, columns], moves, strict=True)]


def _span(A: Array) -> Array:
    """Return an orthonormal basis of the column space."""
    return np.asarray(np.linalg.svd(A, full_matrices=False)[0][:, : linear.rank(A)])


def supports(lay: Layout, q: Array, body: str = "") -> tuple[Held, ...]:
    """Analyse the support of a body (by default, the body with the most legs) at each of n closed poses.

    Leg wrenches follow eqs. (9)-(12); the remaining twists of the body are reciprocal to them, eqs. (13)-(14).

    Args:
        q: Joint coordinates. Shape (n, n_q).
    """
    mechanism, unit, at = lay.mechanism, length(lay), pose(lay, q)
    body, ways = (body, legs(mechanism, body)) if body else end_body(mechanism)
    ways = tuple(leg for leg in ways if not {joint.name for joint in leg.joints} <= pose_joints(mechanism))
    i = mechanism.body_index[body]
    middles = (at.p[:, i] + at.R[:, i] @ mechanism.body(body).com) / unit
    allowed = [body_twists(mechanism, leg.joints, body, q, unit) for leg in ways]
    free = body_twists(mechanism, mechanism.joints, body, q, unit)
    bodies = []
    for k, middle in enumerate(middles):
        systems = [reciprocal_screws(twists[k]) for twists in allowed]
        both = np.concatenate([np.zeros((6, 0)), *systems], axis=1)
        wrenches = tuple(elements(system, middle, unit) for system in systems)
        redundant = both.shape[1] - linear.rank(both)
        bodies.append(Held(body, ways, wrenches, elements(free[k], middle, unit), redundant))
    return tuple(bodies)


@lru_cache(maxsize=8)
def pose_joints(mechanism: Mechanism) -> frozenset[str]:
    """Return the ground joints that only assign coordinates to the pose of a body.

    Such joints are unconstrained (F) or, at home, made redundant by the remaining legs of the body (E), and no
    actuator, coupling or other leg depends on them.
    """
    found = {joint.name for joint in mechanism.joints if not joint.constrains}
    planar = [
        joint for joint in mechanism.joints if joint.kind == "E" and GROUND in joint.bodies and not joint.actuated
    ]
    for joint in planar:
        body = next(side for side in joint.bodies if side != GROUND)
        ways = legs(mechanism, body)
        if joint.name in coupled_joints(mechanism) or len(ways) < 2:
            continue
        q, unit = mechanism.home[None], length(layout(mechanism))
        own, rest = [], np.zeros((6, 0))
        for leg in ways:
            system = reciprocal_screws(body_twists(mechanism, leg.joints, body, q, unit)[0])
            if leg.joints == (joint,):
                own.append(system)
            else:
                rest = np.concatenate([rest, system], axis=1)
        if own and linear.rank(np.concatenate([rest, *own], axis=1)) == linear.rank(rest):
            found.add(joint.name)
    return frozenset(found)


def normal_of_plane(screws: Array) -> Array | None:
    """Return the normal of the plane in which all joints move, or None if the motion is spatial.

    Args:
        screws: Screws of all joints at a pose: directions of rotation and translation. Shape (n, 6).
    """
    turns = np.linalg.norm(screws[:, :3], axis=1) > 0.5
    if not turns.any():
        return None
    normal = screws[turns][0, :3]
    oblique = max(np.abs(cross(screws[turns, :3], normal)).max(), np.abs(screws[~turns, 3:] @ normal).max(initial=0.0))
    return normal * np.sign(normal[np.argmax(np.abs(normal))]) if oblique < NONE else None


def idle_forces(lay: Layout, q: Array) -> Array:
    """Return combinations of actuator forces with zero power at one closed pose. Shape (n_actuator, k), orthonormal.

    At a singular pose, where rates are NaN, k is 0.

    Args:
        q: Joint coordinates. Shape (1, n_q).
    """
    rates = motion_at(lay, q, np.zeros((1, len(lay.mechanism.independent)))).joint_map[0].T
    sizes = np.where(lay.turns, 1.0, length(lay))[lay.mechanism.actuated_columns]
    work = rates[:, lay.mechanism.actuated_columns] / sizes
    return linear.null_space(work) if work.size and np.isfinite(work).all() else np.zeros((work.shape[1], 0))


def elements(system: Array, near: Array, unit: float = 1.0) -> tuple[ScrewElement, ...]:
    """Express a screw system as lines and directions that span it; lines come first.

    The lines are principal screws (Ball, A Treatise on the Theory of Screws, 1900), which meet at one point, or lines
    of zero pitch if the system contains enough of them.

    Args:
        system: Independent dimensionless screws ``[direction; moment about O]``. Shape (6, k).
        near: Point near which points on the axes are chosen. Shape (3,).
        unit: Length unit of the system, used for points and pitches [m].
    """
    if not system.shape[1]:
        return ()
    moments = system[3:] - cross(near, system[:3].T).T
    U, s, Vt = np.linalg.svd(system[:3])
    f = int(np.count_nonzero(s[: system.shape[1]] > NONE))
    couples = _upright(_span(moments @ Vt[f:].T))
    D, M = U[:, :f], moments @ Vt[:f].T / s[:f]
    off = np.eye(3) - couples @ couples.T  # moments along couples may be added freely
    fixed = linear.null_space(couples.T @ D)
    E, h = _principal(D @ fixed, M @ fixed)
    rest = _upright(D @ linear.null_space(fixed.T) if 0 < fixed.shape[1] < f else D[:, fixed.shape[1] :])
    E, h = np.concatenate([E, rest], axis=1), np.concatenate([h, np.zeros(rest.shape[1])])
    E, points, h = _without_pitch(E, np.tile(_common_point(E, M @ D.T @ E, h, off), (len(h), 1)), h)
    E, couples = _fix_signs(E), _fix_signs(couples)
    lines = [ScrewElement(e, (near + r) * unit, float(p) * unit) for e, r, p in zip(E.T, points, h, strict=True)]
    return (*lines, *(ScrewElement(e, near * unit, np.inf) for e in couples.T))


def _without_pitch(E: Array, points: Array, h: Array) -> tuple[Array, Array, Array]:
    """Span a screw system by lines of zero pitch if its principal pitches have both signs.

    Two screws with pitches ``h1 < 0 < h2`` that meet at right angles span two such lines.
    """
    if not (h.size and h.min() < 0.0 < h.max()):
        return E, points, h
    low, high, E, points, h = int(np.argmin(h)), int(np.argmax(h)), E.copy(), points.copy(), h.copy()
    old, pitch = E.copy(), h.copy()
    for i in np.flatnonzero(pitch):
        a, b = (low, i) if pitch[i] > 0.0 else (i, high)
        turn = np.arctan(np.sqrt(-pitch[a] / pitch[b])) * (-1.0 if i == low else 1.0)
        E[:, i] = np.cos(turn) * old[:, a] + np.sin(turn) * old[:, b]
        moment = np.cos(turn) * pitch[a] * old[:, a] + np.sin(turn) * pitch[b] * old[:, b]
        points[i], h[i] = points[i] + cross(E[:, i], moment), 0.0
    return E, points, h


def _principal(E: Array, M: Array) -> tuple[Array, Array]:
    """Return principal directions (moment along force) of a system, and pitches. Shapes (3, k) -> (3, k), (k,)."""
    h, V = np.linalg.eigh((E.T @ M + M.T @ E) / 2.0)
    h = np.where(np.abs(h) < NONE, 0.0, h)
    E = E @ V
    for pitch in dict.fromkeys(np.round(h, 6)):  # for equal pitches, all directions are principal
        same = np.abs(h - pitch) < 2 * NONE
        E[:, same] = _upright(E[:, same])
    order = np.argsort(np.abs(h), kind="stable")
    return E[:, order], h[order]


def _common_point(E: Array, M: Array, h: Array, off: Array) -> Array:
    """Return the common point of the principal axes relative to O, ignoring pure couples. Shape (3,)."""
    wanted = off @ (M - E * h)
    A = (-off @ skew(E.T)).reshape(-1, 3)  # r x e = -e x r
    return np.asarray(np.linalg.lstsq(A, wanted.T.ravel(), rcond=NONE)[0])


def _upright(E: Array) -> Array:
    """Return an orthonormal basis of E's column space, along world axes that the space contains. Shape (3, k)."""
    k = E.shape[1]
    if k == 3:
        return np.eye(3)
    if k < 2:
        return E
    first = E @ E.T[:, int(np.argmax(np.round(np.linalg.norm(E, axis=1), 6)))]
    first /= np.linalg.norm(first)
    second = cross(cross(E[:, 0], E[:, 1]), first)
    return np.stack([first, second], axis=1)


def _fix_signs(E: Array) -> Array:
    """Flip directions so that the largest component is positive. Shape (3, k)."""
    largest = np.argmax(np.round(np.abs(E), 6), axis=0)
    return np.asarray(E * np.sign(np.take_along_axis(E, largest[None], axis=0)))
