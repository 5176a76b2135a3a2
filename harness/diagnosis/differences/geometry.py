"""Where the joints of two models differ: which way they count and from where, where they sit, about what they turn.

Joints are checked from the ground outwards, each after those before it are corrected. If the bodies that it carries
are displaced with it, the joint is; if not, only its axis differs. `static` makes differences of these deviations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.machine.placement import descended
from screwgauge.diagnosis.pairing.common import ROUNDING, Common, owned
from screwgauge.diagnosis.pairing.mapping import apart
from screwgauge.diagnosis.properties import Change, applied
from screwgauge.diagnosis.transformations import axis, outwards
from screwgauge.models.kinematics import moved, rehomed, size
from screwgauge.models.poses import exponential
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading
from screwgauge.reference.rotations import Array, rotation_vector

#: A displacement is there if it brings what a joint carries so many decades nearer, all taken together.
DECADES = 4.0
#: What the machines as a whole tell of where a joint stands is what it can do, but for so much [rad or lengths].
STANDS = 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """How a joint of B differs in place from that of A.

    Attributes:
        right: What B should have in common terms: ``sign``, ``zero``, ``placement``, ``axis`` or ``centre``.
        amount: Angle [rad] and way [m] of the difference.
        step: From A to B, in A's world: rotation vector [rad] and way [m]. Shape (2, 3).
        change: The same in B's own terms.
    """

    right: Change
    amount: tuple[float, float]
    step: Array
    change: Change


def deviations(common: Common, deadline: Deadline) -> tuple[list[Deviation], Common]:
    """Deviations of all joints, from the ground outwards, and both models corrected, as far as time allows."""
    steps: list[Deviation] = []
    length = size(common.a)
    for name in _outwards(common.a):
        if deadline.over(f"place of {name}"):
            continue
        for what, value, step in _of_joint(common.a, common, name, length):
            change = Change(name, what, np.asarray(value, dtype=float))
            amount = float(np.linalg.norm(step[0])), float(np.linalg.norm(step[1]))
            steps.append(Deviation(change, amount, step, owned(common, change)))
            common = _righted(common, change)
    return steps, common


def _outwards(reading: Reading) -> list[str]:
    return [joint for body in reading.bodies.values() for joint in body.joints if joint in reading.joints]


def _righted(common: Common, change: Change) -> Common:
    """B with a change made, and at the common home again."""
    home = common.b.joints[change.item].home
    b = applied(common.b, [change])
    if change.what not in ("zero", "sign"):
        return replace(common, b=b)
    now = b.joints[change.item].home
    b, _, behind = rehomed(b, {change.item: home} if now != home else {})
    bodies, joints = outwards(common.b, change.item)
    # as one joint moves, all that it carries is displaced alike
    before = {n: behind[b.moved_by(n)] @ X if n in joints[1:] else X for n, X in common.before.items()}
    after = {n: behind[n] @ X if n in bodies else X for n, X in common.behind.items()}
    homes = {**common.homes, change.item: common.homes[change.item] * (-1.0 if change.what == "sign" else 1.0)}
    return replace(common, b=b, before=before, behind=after, homes=homes)


def _of_joint(a: Reading, common: Common, name: str, length: float) -> Iterator[tuple[str, Array | float, Array]]:
    """Deviations of one joint, with the step from A to B; after each, the caller corrects B and goes on."""
    ours, b = a.joints[name], common.b
    if ours.kind != b.joints[name].kind:
        return
    turns = ours.kind in ("hinge", "slide")
    along = _stands(common, name, length) if turns else None
    D = None if along is not None else _displaced(common, name, length)
    if D is not None and turns:
        along = _along(ours, D, length)
    if D is not None and along is None:  # which way it counts shows where it stands as in A
        yield "placement", D, step_of(np.asarray(np.linalg.inv(D)), ours.centre)
        b = applied(b, [Change(name, "placement", D)])
    if not turns:
        return
    if axis(ours) @ axis(b.joints[name]) < 0.0:
        yield "sign", -1.0, np.array([[math.pi, 0.0, 0.0], np.zeros(3)])
        home = b.joints[name].home
        b = _righted(replace(common, b=b), Change(name, "sign", np.array(-1.0))).b
        along = None if along is None else along - 2.0 * home  # it is at the same coordinate again, the other way
    if along is not None and ours.kind == "hinge":
        along = math.remainder(along, math.tau)
    if along is not None and abs(along) > common.rounding * (1.0 if ours.kind == "hinge" else length):
        # B's home geometry is A's at another coordinate
        way = -along * axis(ours)
        yield "zero", b.joints[name].home - along, np.array([way, 0 * way] if ours.kind == "hinge" else [0 * way, way])
        b = rehomed(
            applied(b, [Change(name, "zero", np.asarray(b.joints[name].home - along))]), {name: b.joints[name].home}
        )[0]
    yield from _of_axis(ours, b.joints[name], common.rounding, length)


def _of_axis(
    ours: JointReading, theirs: JointReading, rounding: float, length: float
) -> Iterator[tuple[str, Array | float, Array]]:
    """Deviations of the axis of a hinge or slide that points the same way at the same coordinate."""
    off = math.atan2(float(np.linalg.norm(np.cross(axis(theirs), axis(ours)))), float(axis(theirs) @ axis(ours)))
    if off > rounding:
        across = np.cross(axis(ours), axis(theirs))
        turn = off * across / max(float(np.linalg.norm(across)), 1e-300)
        yield "axis", axis(ours), np.array([turn, np.zeros(3)])
    if ours.kind == "hinge":
        step = ours.centre - theirs.centre
        step = step - (step @ axis(ours)) * axis(ours)
        if np.linalg.norm(step) > rounding * length:
            yield "centre", theirs.centre + step, np.array([np.zeros(3), -step])


def _displaced(common: Common, name: str, length: float) -> Array | None:
    """The displacement of a joint and all beyond it that brings B nearest to A; None if it is nearest as it is."""
    a, b = common.a, common.b
    bodies, joints = outwards(b, name)
    bodies = [body for body in bodies if body in a.bodies and (a.bodies[body].mass and b.bodies[body].mass)]
    joints = [joint for joint in joints if joint in a.joints]
    still = _nearness(a, b, (bodies, joints), np.eye(4), length)
    if still <= math.log10(ROUNDING) * (2 * len(bodies) + len(joints)):
        return None
    best, most, next_ = None, still - DECADES, _next(b, name)
    for D in _candidates(common, name):
        if _breaks(a, b, next_, D, length):
            continue
        score = _nearness(a, b, (bodies, joints), D, length)
        if score < most - 1e-6:
            best, most = D, score
    return best


def _next(b: Reading, name: str) -> tuple[list[str], list[str]]:
    """What a joint carries itself, not by another joint: a body at most, and the joints on it; itself."""
    carrier = b.moved_by(name)
    joints = b.bodies[carrier].joints
    if name != joints[-1]:
        return [], [name, joints[joints.index(name) + 1]]
    return [carrier], [name, *(body.joints[0] for body in b.bodies.values() if body.near == carrier)]


def _breaks(a: Reading, b: Reading, items: tuple[list[str], list[str]], D: Array, length: float) -> bool:
    """Whether a displacement takes something from its place that is there: then it is that of a joint further out."""
    for T, limit in ((np.eye(4), 10.0), (D, 100.0)):
        there = {name: apart(a.joints[name], moved(b.joints[name], T), length) for name in items[1] if name in a.joints}
        there |= {
            f"body {name}": max(matter_apart(a.bodies[name], b.bodies[name], T, length))
            for name in items[0]
            if name in a.bodies and a.bodies[name].mass and b.bodies[name].mass
        }
        near = {name for name, off in there.items() if off < limit * ROUNDING}
        if limit == 10.0:
            kept = near
    return not kept <= near


def _candidates(common: Common, name: str) -> Iterator[Array]:
    """Displacements that the machines as a whole suggest, or frames of one name."""
    carried = [body for body in outwards(common.b, name)[0] if body in common.a.bodies][:4]
    for there in (common.standing, {body: common.a.bodies[body].pose for body in carried}):
        for body in carried:
            if body in there:
                yield there[body] @ np.linalg.inv(common.b.bodies[body].pose)


def _nearness(a: Reading, b: Reading, items: tuple[list[str], list[str]], D: Array, length: float) -> float:
    """Decades of the distances of what a joint carries once it is displaced."""
    off = [apart(a.joints[name], moved(b.joints[name], D), length) for name in items[1]]
    for name in items[0]:
        off += matter_apart(a.bodies[name], b.bodies[name], D, length)
    return float(np.sum(np.log10(np.maximum(off, ROUNDING / 10.0))))


def matter_apart(a: BodyReading, b: BodyReading, D: Array, length: float) -> list[float]:
    """How far apart two bodies' centres of mass and the directions of their inertia are."""
    T = D @ b.pose
    R, S = a.pose[:3, :3], T[:3, :3]
    step = (R @ a.com + a.pose[:3, 3]) - (S @ b.com + T[:3, 3])
    I = R @ a.inertia @ R.T - S @ b.inertia @ S.T
    scale = max(float(np.abs(a.inertia).max()), float(np.abs(b.inertia).max())) or 1.0
    return [float(np.linalg.norm(step)) / length, float(np.abs(I).max()) / scale]


def _stands(common: Common, name: str, length: float) -> float | None:
    """The coordinate by which a joint has to move to stand as in A, where the two machines as a whole show that.

    None where they do not, or where what its body needs is more than its joints can do.
    """
    b = common.b
    carrier = b.moved_by(name)
    if carrier not in common.standing:
        return None
    D = common.standing[carrier] @ np.linalg.inv(b.bodies[carrier].pose)
    names = b.bodies[carrier].joints
    chain = [b.joints[each] for each in names[names.index(name) :]]
    if any(joint.kind not in ("hinge", "slide") for joint in chain):
        return None

    def off(q: Array) -> Array:
        E = np.linalg.inv(D)
        for joint, value in zip(chain, q, strict=True):
            E = E @ exponential(joint.kind, axis(joint), joint.centre, float(value))
        return np.append((E[:3, :3] - np.eye(3)).ravel(), E[:3, 3] / length)[None]

    for start in product(*((0.0, 2.0, -2.0) if joint.kind == "hinge" else (0.0,) for joint in chain)):
        q = descended(off, np.array(start))
        if np.abs(off(q)).max() < STANDS:
            sign = 1.0 if axis(common.a.joints[name]) @ axis(chain[0]) >= 0.0 else -1.0
            return sign * float(q[0])
    return None


def _along(joint: JointReading, D: Array, length: float) -> float | None:
    """The coordinate by which a joint itself displaces so; None if it cannot."""
    R, p = D[:3, :3], D[:3, 3]
    w = rotation_vector(R)
    angle, step = float(np.linalg.norm(w)), R @ joint.centre + p - joint.centre
    scale = max(angle, float(np.linalg.norm(step)) / length)
    loose = max(1e-4 * scale, ROUNDING)
    if joint.kind == "slide":
        way = float(step @ axis(joint))
        off = max(angle, float(np.linalg.norm(step - way * axis(joint))) / length)
        return way if off < loose else None
    along = float(w @ axis(joint))
    if along < 0.0 and angle > math.pi - 1e-9:  # half a turn is one either way
        w, along = -w, -along
    off = max(float(np.linalg.norm(w - along * axis(joint))), float(np.linalg.norm(step)) / length)
    return along if off < loose else None


def step_of(D: Array, at: Array) -> Array:
    """Rotation vector of a displacement [rad], and by how much it moves a point [m]. Shape (2, 3)."""
    R = D[:3, :3]
    return np.array([rotation_vector(R), R @ at + D[:3, 3] - at])
