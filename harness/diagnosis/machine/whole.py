"""Finds differences that affect the whole machine: a different placement, a mirror image, different units.

It uses the features of all partners together, in the world frame: a search from the ground outwards would attribute
such a difference to a motion of the first joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, permutations, product
from operator import attrgetter

import numpy as np

from screwgauge.diagnosis.properties import put_on_axis
from screwgauge.models.kinematics import gravity_of, rehome, residual_at_home, size, tree_of
from screwgauge.models.machine import at_closed_pose
from screwgauge.models.matter import Matter
from screwgauge.models.poses import matrix
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading
from screwgauge.reference.rotations import Array, rotation_vector

#: Smallest number of parts that share a common factor, their smallest share of all parts, and the tolerance.
SEVERAL, MOST, SAME = 3, 0.6, 1e-4
#: Largest relative difference between equal factors of masses and inertias: files print six digits.
ROUNDED = 1e-5
#: Distance at which a feature has half its weight, and below which it is aligned [machine lengths, rad, relative].
NEAR, NONE = 0.02, 1e-6
#: Share of aligned features above which no transformation is sought, and smallest gain of a mere displacement.
ENOUGH, GAIN = 0.9, 0.1
#: Smallest sine of the angle between two axes that span a frame, and number of pairs of axes that are tried.
ACROSS, PAIRS = 0.3, 8
#: Reflection of the frames of bodies in a mirrored machine.
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
_AXES = "xyz"


@dataclass(frozen=True, slots=True, eq=False)
class Whole:
    """A transformation of A as a whole that yields B.

    Attributes:
        placement: Placement of A's world frame in B's, in A's unit of length; its determinant is -1 if B is mirrored.
            Shape (4, 4).
        length, mass, inertia: Scale factors from A to B.
    """

    placement: Array = field(default_factory=lambda: np.eye(4))
    length: float = 1.0
    mass: float = 1.0
    inertia: float = 1.0

    @property
    def stands(self) -> bool:
        """True if B is A at a different placement, in the same units."""
        return not self.mirrored and self.length == self.mass == self.inertia == 1.0

    @property
    def mirrored(self) -> bool:
        return bool(np.linalg.det(self.placement) < 0.0)

    @property
    def step(self) -> tuple[str, Array]:
        """Mirror axis (empty if none), and rotation vector [rad] and translation [m] from A to B. Shape (2, 3)."""
        R, way = self.placement[:3, :3], self.placement[:3, 3]
        if not self.mirrored:
            return "", np.array([rotation_vector(R), way])
        turns = [rotation_vector(np.asarray(R * np.where(np.arange(3) == i, -1.0, 1.0))) for i in range(3)]
        i = min(range(3), key=lambda i: float(np.linalg.norm(turns[i])))
        return _AXES[i], np.array([turns[i], way])

    def undo(self, b: Reading, a: Reading) -> Reading:
        """Convert B to A's units and placement, with gravity in the units and axes that best match A's gravity."""
        T = np.asarray(np.linalg.inv(self.placement))
        g = gravity_of(b)
        tried = [g, g / self.length, T[:3, :3] @ g, T[:3, :3] @ g / self.length]
        gravity = min(tried, key=lambda each: round(float(np.linalg.norm(each - gravity_of(a))), 9))
        out = _transform(b, T, 1.0 / self.length, 1.0 / self.mass, 1.0 / self.inertia)
        return replace(out, gravity=None if b.gravity is None else gravity)

    def apply(self, a: Reading) -> Reading:
        """Convert A to the units and placement of B, but keep A's gravity."""
        T = self.placement.copy()
        T[:3, 3] *= self.length
        return replace(_transform(a, T, self.length, self.mass, self.inertia), gravity=a.gravity)


def _transform(reading: Reading, T: Array, length: float, mass: float, inertia: float) -> Reading:
    """Convert a reading to different units, then move or mirror it; coordinates of hinges remain unchanged.

    Args:
        T: Transformation with determinant 1 or -1. Shape (4, 4).
    """
    R, sense = T[:3, :3], float(np.sign(np.linalg.det(T)))
    F = MIRROR if sense < 0.0 else np.eye(4)
    M = F[:3, :3]

    def frame(X: Array) -> Array:
        return F @ matrix(length * X[:3, 3], X[:3, :3]) @ F

    def transform(X: Array) -> Array:
        return T @ F @ frame(X)  # keeps frames right-handed

    def joint(one: JointReading) -> JointReading:
        k, way = (length, 1.0) if one.kind == "slide" else (1.0, sense)  # an axis of rotation is an axial vector
        new = put_on_axis(one, way * (R @ one.direction), R @ (length * one.centre) + T[:3, 3])
        return replace(new, home=k * one.home, rest=k * one.rest, limits=(k * one.limits[0], k * one.limits[1]))

    def body(one: BodyReading) -> BodyReading:
        parts = {
            n: Matter(mass * m.mass, M @ m.com * length, inertia * M @ m.inertia @ M) for n, m in one.parts.items()
        }
        fixed = {n: frame(X) for n, X in one.fixed.items()}
        new = replace(one, mass=mass * one.mass, com=length * M @ one.com, inertia=inertia * M @ one.inertia @ M)
        return replace(new, pose=transform(one.pose), fixed=fixed, parts=parts)

    def end(name: str, X: Array) -> Array:
        return frame(X) if name in reading.bodies else transform(X)

    return replace(
        reading,
        bodies={n: body(each) for n, each in reading.bodies.items()},
        joints={n: joint(each) for n, each in reading.joints.items()},
        fixed={n: transform(X) for n, X in reading.fixed.items()},
        closures={
            n: replace(c, first_frame=end(c.first, c.first_frame), second_frame=end(c.second, c.second_frame))
            for n, c in reading.closures.items()
        },
    )


Pairs = tuple[Mapping[str, str], Mapping[str, str]]


def find_wholes(a: Reading, b: Reading, joints: Mapping[str, str], bodies: Mapping[str, str]) -> list[Whole]:
    """Find transformations of the whole machine that may explain the differences, likeliest first.

    Args:
        joints, bodies: Known partners, A -> B.
    """
    pairs: Pairs = (joints, bodies)
    if 2 * len(bodies) < min(len(a.bodies), len(b.bodies)):
        pairs = _pair_by_matter(a, b)
    pairs = ({x: y for x, y in pairs[0].items() if a.joints[x].kind == b.joints[y].kind}, pairs[1])
    found = list[tuple[float, Whole]]()
    base = count = 0.0
    several = [each for each in _factors(a, b, pairs) if each[0] != 1.0 or 1.0 not in each[1:]]
    for factors in dict.fromkeys([(1.0, 1.0, 1.0), *several]):
        length, mass, inertia = (1.0 / factor for factor in factors)
        unit = _transform(b, np.eye(4), length, mass, inertia)
        overlays = [_Overlay(a, each, pairs) for each in _poses(a, unit, pairs[0])]
        if not count:  # B as it is
            count, base = overlays[0].count, max(float(each.score(np.eye(4)[None])[0]) for each in overlays)
            if not count or base > ENOUGH * count:
                return []
        best = base
        for overlay in overlays:
            tried = overlay.candidates()
            moved = np.abs(tried - np.eye(4)).max(axis=(1, 2)) > 1e-9
            scores = overlay.score(tried) - 1e-3 * moved - 0.1 * (np.linalg.det(tried) < 0.0)
            i = int(scores.argmax())
            if scores[i] > best + (GAIN * count if factors == (1.0, 1.0, 1.0) else 0.0):
                best = float(scores[i])
                found.append((best, Whole(np.asarray(np.linalg.inv(_round(tried[i]))), *factors)))
    return [whole for _, whole in sorted(found, key=lambda each: -each[0])]


def _round(T: Array) -> Array:
    """Round entries of a placement that are nearly integers. Shape (4, 4)."""
    near = np.round(T)
    return np.where(np.abs(T - near) < 1e-9, near, T)


def _pair_by_matter(a: Reading, b: Reading) -> Pairs:
    """Pair joints and bodies by mass and moments of inertia, which are invariant under motion."""
    sides = []
    for reading in (a, b):
        at: dict[tuple[float, ...], list[str]] = {}
        for name, body in reading.bodies.items():
            moments = np.linalg.eigvalsh(body.inertia)
            ratios = (*(moments[:2] / (moments[2] or 1.0)), body.mass / (reading.mass or 1.0))
            at.setdefault(tuple(float(f"{ratio:.3g}") for ratio in ratios), []).append(name)
        sides.append({key: names[0] for key, names in at.items() if len(names) == 1})
    bodies = {name: sides[1][key] for key, name in sides[0].items() if key in sides[1]}
    joints = dict[str, str]()
    for name, other in bodies.items():
        ours, theirs = a.bodies[name].joints, b.bodies[other].joints
        joints |= dict(zip(ours, theirs, strict=True)) if len(ours) == len(theirs) else {}
    return joints, bodies


def _poses(a: Reading, b: Reading, joints: Mapping[str, str]) -> list[Reading]:
    """Return B at the coordinates of A, if B's loops close there, and at the closed pose nearest to its home pose."""
    b = at_closed_pose(b)
    q = {y: a.joints[x].home for x, y in joints.items() if abs(b.joints[y].home - a.joints[x].home) > 1e-12}
    if not q:
        return [b]
    there = rehome(b, q)[0]
    closed = max(residual_at_home(tree_of(there)).values(), default=0.0) < NONE * size(b)
    return [there, b] if closed else [b]


def _factors(a: Reading, b: Reading, pairs: Pairs) -> Iterator[tuple[float, float, float]]:
    """Yield ratios of lengths, masses and inertias that most parts share."""
    bodies = [(a.bodies[x], b.bodies[y]) for x, y in pairs[1].items()]
    mass = _common_ratio([(x.mass, y.mass) for x, y in bodies])
    inertia = _common_ratio([(_norm(x.inertia), _norm(y.inertia)) for x, y in bodies])
    inertia = mass if math.isclose(mass, inertia, rel_tol=ROUNDED) else inertia
    joints = [(a.joints[x], b.joints[y]) for x, y in pairs[0].items()]
    gaps = [(_gap(x, u), _gap(y, v)) for (x, y), (u, v) in pairwise(joints)]
    centres = [(_norm(x.com), _norm(y.com)) for x, y in bodies]
    yield _common_ratio(gaps), mass, inertia
    yield _common_ratio([*gaps, *centres]), mass, inertia


def _common_ratio(pairs: Sequence[tuple[float, float]]) -> float:
    """Return the ratio that most pairs share; 1 if there is no such ratio."""
    ratios = [y / x for x, y in pairs if x > 1e-9 and y > 1e-12]
    middle = float(np.median(ratios)) if ratios else 1.0
    near = [ratio for ratio in ratios if abs(ratio / middle - 1.0) < SAME]
    if len(near) < max(SEVERAL, MOST * len(ratios)) or abs(middle - 1.0) < 0.005:
        return 1.0
    return float(f"{np.median(near):.12g}")


def _gap(one: JointReading, other: JointReading) -> float:
    """Compute the distance between two axes, which is invariant under motion of either joint [m]."""
    d, e = (each.direction if each.kind == "hinge" else np.zeros(3) for each in (one, other))
    step, normal = other.centre - one.centre, np.cross(d, e)
    if np.linalg.norm(normal) > 1e-6:
        return abs(float(step @ normal)) / float(np.linalg.norm(normal))
    return float(np.linalg.norm(np.cross(step, d)))


class _Overlay:
    """Features of partners in the world frame, as arrays: axes, centres of mass, inertias."""

    def __init__(self, a: Reading, b: Reading, pairs: Pairs) -> None:
        joints = [(a.joints[x], b.joints[y]) for x, y in pairs[0].items() if a.joints[x].kind in ("hinge", "slide")]
        bodies = [(a.bodies[x], b.bodies[y]) for x, y in pairs[1].items() if a.bodies[x].mass and b.bodies[y].mass]
        self.length, self.count = size(a), 2 * len(joints) + 2 * len(bodies)
        self.hinges = np.array([one.kind == "hinge" for one, _ in joints], dtype=bool)
        self.axes, self.points = (
            [np.array([of(pair[i]) for pair in joints]).reshape(-1, 3) for i in (0, 1)]
            for of in (attrgetter("direction"), attrgetter("centre"))
        )
        self.centres = [np.array([pair[i].centre for pair in bodies]).reshape(-1, 3) for i in (0, 1)]
        self.inertias = [np.array([_tensor(pair[i]) for pair in bodies]).reshape(-1, 3, 3) for i in (0, 1)]
        self.masses = np.array([math.log(other.mass / one.mass) for one, other in bodies])

    def score(self, T: Array) -> Array:
        """Count features of B aligned with their partners, and near misses in part. Shape (n, 4, 4) -> (n,)."""
        R, p = T[:, :3, :3], T[:, None, :3, 3]
        (d, e), (c, k), (m, n), (I, J) = self.axes, self.points, self.centres, self.inertias
        tilt = np.linalg.norm(np.cross(np.einsum("gij,nj->gni", R, e), d), axis=-1)
        step = np.einsum("gij,nj->gni", R, k) + p - c
        off = np.linalg.norm(np.cross(step, d), axis=-1) * self.hinges / self.length
        com = np.linalg.norm(np.einsum("gij,nj->gni", R, n) + p - m, axis=-1) / self.length
        scale = np.maximum(np.linalg.norm(I, axis=(1, 2)), 1e-300)
        inertia = np.linalg.norm(np.einsum("gij,njk,glk->gnil", R, J, R) - I, axis=(2, 3)) / scale
        errors = np.concatenate([tilt, off, com, inertia + np.abs(self.masses)], axis=1)
        return np.asarray((0.5 / (1.0 + (errors / NEAR) ** 2) + 0.5 * (errors < NONE)).sum(axis=1))

    def candidates(self) -> Array:
        """Return candidate placements and mirror images of B's world frame in A's. Shape (n, 4, 4)."""
        points, others = self.centres if len(self.centres[0]) else self.points
        out = []
        for R in self._turns(points, others):
            steps = points - others @ R.T
            out += [matrix(way, R) for way in (np.zeros(3), np.median(steps, axis=0), *steps[:3])]
        return np.array(out)

    def _turns(self, points: Array, others: Array) -> Iterator[Array]:
        """Yield signed permutations, rotations aligning two axes, and best fits of all points. Shape (3, 3) each."""
        yield np.eye(3)
        for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
            yield np.eye(3)[list(order)] * np.array(signs)
        d, e = self.axes
        pairs = [(i, j) for i in range(len(d)) for j in range(i) if _sine(d[i], d[j]) > ACROSS < _sine(e[i], e[j])]
        for i, j in pairs[:: max(1, len(pairs) // PAIRS)]:
            for first, second, sense in product((1.0, -1.0), repeat=3):
                turn = _frame(d[i], d[j]) @ np.diag([1.0, 1.0, sense]) @ _frame(first * e[i], second * e[j]).T
                yield np.asarray(turn)
        U, _, V = np.linalg.svd((points - points.mean(axis=0)).T @ (others - others.mean(axis=0)))
        yield from (U @ np.diag([1.0, 1.0, sign * np.linalg.det(U @ V)]) @ V for sign in (1.0, -1.0))


def _norm(value: Array) -> float:
    return float(np.linalg.norm(value))


def _tensor(body: BodyReading) -> Array:
    return np.asarray(body.pose[:3, :3] @ body.inertia @ body.pose[:3, :3].T)


def _sine(one: Array, other: Array) -> float:
    return float(np.linalg.norm(np.cross(one, other)))


def _frame(x: Array, y: Array) -> Array:
    z = np.cross(x, y) / _sine(x, y)
    return np.array([x, np.cross(z, x), z]).T
