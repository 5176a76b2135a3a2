"""What two readings say otherwise, in physical terms: no format, no frame of a file, no order matters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.change import PROPERTIES, Difference, Kind, axis
from screwgauge.diagnosis.differences.geometry import ROUNDING, Deviation, deviations
from screwgauge.diagnosis.differences.stated import another, differ, difference, only
from screwgauge.diagnosis.differences.static_loops import actuators, closures, couplings
from screwgauge.diagnosis.differences.words import compared, place, unit_of
from screwgauge.diagnosis.mechanics.dynamics import downwards
from screwgauge.diagnosis.mechanics.lines import CLOSE, size
from screwgauge.diagnosis.pairing.common import Common
from screwgauge.models.mjcf import FAR
from screwgauge.models.readings.reading import BodyReading
from screwgauge.reference.rotations import Array, rotation_vector

#: Entries of a joint that are one number each.
ENTRIES = ("armature", "damping", "friction", "stiffness", "rest")
#: A limit beyond so many rad or m is none.
BOUNDLESS = 100.0


def differences(common: Common, deadline: Deadline | None = None) -> tuple[list[Difference], Common]:
    """All of them, those of geometry first; and both models where B's geometry and counting are put right."""
    deadline = deadline or Deadline()
    found, right = deviations(common, deadline)
    out = [_deviation(common, deviation) for deviation in found]
    if deadline.over("all that bodies, joints and loops say beside their places"):
        return out, right
    out += _model(right)
    for name in right.a.joints:
        out += _joint(right, name)
    for name in right.a.bodies:
        if name in right.b.bodies:
            out += _body(right, name)
    out += _unpaired(right)
    out += [*closures(right, common), *couplings(right), *actuators(right)]
    return out, right


def _deviation(common: Common, found: Deviation) -> Difference:
    item, what = found.right.item, found.right.what
    joint, (angle, way) = common.a.joints[item], found.amount
    sentence, relative = place(item, what, found.amount, joint), angle + way / size(common.a)
    b = {
        "sign": np.array(1.0),
        "zero": np.asarray(common.b.joints[item].home),
        "placement": np.eye(4),
        "axis": axis(common.b.joints[item]),
        "centre": common.b.joints[item].centre,
    }[what]
    kind: Kind = "convention" if what in ("sign", "zero") else "model"
    unit, change = unit_of(what, joint), found.change
    return Difference(item, change.item, what, found.right.value, b, unit, relative, sentence, change, kind)


def _model(common: Common) -> Iterator[Difference]:
    a, b = downwards(common.a), downwards(common.b)
    if np.linalg.norm(a - b) > ROUNDING * max(float(np.linalg.norm(a)), float(np.linalg.norm(b))):
        size_, sentence = compared("", "gravity", a, b, PROPERTIES["gravity"].unit)
        yield difference(common, "", "gravity", a, b, (size_, sentence + _stands(common, a, b)))
    first, second = np.array(common.a.medium), np.array(common.b.medium)
    if np.any(np.abs(first - second) > ROUNDING * np.maximum(first, second)):
        yield difference(common, "", "medium", first, second)


def _stands(common: Common, a: Array, b: Array) -> str:
    """What is to be said of gravity that differs because one of the models stands turned."""
    R = common.placement[:3, :3]
    if np.linalg.norm(a - R.T @ b) > CLOSE * float(np.linalg.norm(a)):
        return ""
    angle = math.degrees(np.linalg.norm(rotation_vector(R)))
    return f", because the whole stands turned by {angle:.4g} deg in B"


def _joint(common: Common, name: str) -> Iterator[Difference]:
    a, b = common.a.joints[name], common.b.joints[name]
    if a.kind != b.kind:
        sentence = f"{name}: a {b.kind} in B, a {a.kind} in A"
        yield another(common, "joints", name, "kind", sentence)
    for what in ENTRIES:
        if what == "rest" and not (a.stiffness or b.stiffness):
            continue
        first, second = getattr(a, what), getattr(b, what)
        if differ(first, second):
            yield difference(common, name, what, np.asarray(first), np.asarray(second))
    if not all(map(_same_limit, a.limits, b.limits)):
        yield difference(common, name, "limits", np.array(a.limits), np.array(b.limits))


def _same_limit(x: float, y: float) -> bool:
    """URDF demands some of every hinge: beside a joint without any, those that nothing reaches are none."""
    if max(abs(x), abs(y)) >= FAR:
        return x * y > 0.0 and min(abs(x), abs(y)) >= BOUNDLESS
    return not abs(x - y) > ROUNDING * max(abs(x), abs(y), 1.0)


def _body(common: Common, name: str) -> Iterator[Difference]:
    a, b = common.a.bodies[name], common.b.bodies[name]
    com, inertia = seen_from(a, b)
    if differ(a.mass, b.mass):
        yield difference(common, name, "mass", np.asarray(a.mass), np.asarray(b.mass))
    if a.mass and b.mass:
        radius = max(math.sqrt(abs(float(np.trace(a.inertia))) / a.mass), float(np.linalg.norm(com)))
        step = float(np.linalg.norm(com - b.com))
        if step > ROUNDING * max(radius, size(common.a)):
            more = step / max(radius, 1e-300), compared(name, "com", com, b.com, "m")[1]
            yield difference(common, name, "com", com, b.com, more)
    scale = max(float(np.abs(inertia).max()), float(np.abs(b.inertia).max()))
    if np.abs(inertia - b.inertia).max() > 10 * ROUNDING * scale:
        yield difference(common, name, "inertia", inertia, b.inertia)
    if differ(a.gravcomp, b.gravcomp):
        yield difference(common, name, "gravcomp", np.asarray(a.gravcomp), np.asarray(b.gravcomp))


def seen_from(a: BodyReading, b: BodyReading) -> tuple[Array, Array]:
    """Centre of mass and inertia of A's body in the frame of B's, as both are in the world at home."""
    if np.array_equal(a.pose, b.pose):
        return a.com, a.inertia
    T = np.linalg.inv(b.pose) @ a.pose
    R = T[:3, :3]
    if np.abs(T - np.eye(4)).max() < 1e-13:  # rounding of products of exponentials
        return a.com, a.inertia
    return R @ a.com + T[:3, 3], R @ a.inertia @ R.T


def _unpaired(common: Common) -> Iterator[Difference]:
    """Bodies that one has and the other has not, of joints that both have."""
    for here, there, side in ((common.a, common.b, "A"), (common.b, common.a, "B")):
        for name, body in here.bodies.items():
            if name in there.bodies or body.mass == 0.0:
                continue
            own = common.own["bodies"].get(name, name) if side == "B" else name
            sentence = f"{own}: a body of {body.mass:.6g} kg in {side} only"
            yield only(side, own, "body", sentence, np.asarray(body.mass), "kg")


def sorted_by_size(found: Iterable[Difference]) -> list[Difference]:
    """Models' own first, then conventions, then printed digits; the largest first."""
    order = ("model", "convention", "digits")
    return sorted(found, key=lambda one: (order.index(one.kind), -one.size))
