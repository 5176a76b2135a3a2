"""What two readings say otherwise, in physical terms: no format, no frame of a file, no order matters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from screwgauge.diagnosis.change import PROPERTIES, Change, Difference, Kind
from screwgauge.diagnosis.closing import residual_at_home
from screwgauge.diagnosis.common import Common, owned
from screwgauge.diagnosis.dynamics import downwards
from screwgauge.diagnosis.geometry import ROUNDING, Deviation, deviations
from screwgauge.diagnosis.lines import CLOSE, size
from screwgauge.diagnosis.tree import plant
from screwgauge.diagnosis.words import compared, place, unit_of
from screwgauge.models.readings.reading import BodyReading, ClosureReading, JointReading
from screwgauge.reference.rotations import Array

#: Entries of a joint that are one number each.
ENTRIES = ("armature", "damping", "friction", "stiffness", "rest")
#: A limit beyond so many rad or m is none.
BOUNDLESS = 100.0


def differences(common: Common) -> tuple[list[Difference], Common]:
    """All of them, those of geometry first; and both models where B's geometry and counting are put right."""
    found, right = deviations(common)
    out = [_deviation(common, deviation) for deviation in found]
    out += _model(right)
    for name in right.a.joints:
        out += _joint(right, name)
    for name in right.a.bodies:
        if name in right.b.bodies:
            out += _body(right, name)
    out += _unpaired(right)
    out += [*_closures(right), *_couplings(right), *_actuators(right)]
    return out, right


def _difference(
    common: Common, item: str, what: str, a: Array, b: Array, more: tuple[float, str] | None = None
) -> Difference:
    """With its change.

    Args:
        item: Common name.
        a, b: Values in B's frame.
        more: Relative size and sentence, where they are not those of the values.
    """
    owner = PROPERTIES[what].owner
    joint = common.a.joints.get(item) if owner == "joint" else None
    unit = unit_of(what, joint)
    size_, sentence = more or compared(item, what, a, b, unit)
    change = owned(common, Change(item, what, a))
    return Difference(item, change.item, what, a, b, unit, size_, sentence, change)


def _deviation(common: Common, found: Deviation) -> Difference:
    joint, item = common.a.joints[found.joint], found.joint
    length = size(common.a)
    angle, way = found.amount
    sentence = place(item, found.what, found.amount, joint, common)
    relative = angle + way / length
    a = found.value
    b = {
        "sign": np.array(1.0),
        "zero": np.asarray(common.b.joints[item].home),
        "placement": np.eye(4),
        "axis": common.b.joints[item].screw[3:] if joint.kind == "slide" else common.b.joints[item].screw[:3],
        "centre": common.b.joints[item].centre,
    }[found.what]
    kind: Kind = "convention" if found.what in ("sign", "zero") else "model"
    return Difference(
        item, found.change.item, found.what, a, b, unit_of(found.what, joint), relative, sentence, found.change, kind
    )


def _model(common: Common) -> Iterator[Difference]:
    a, b = downwards(common.a), downwards(common.b)
    if np.linalg.norm(a - b) > ROUNDING * max(float(np.linalg.norm(a)), float(np.linalg.norm(b))):
        size_, sentence = compared("", "gravity", a, b, PROPERTIES["gravity"].unit)
        yield _difference(common, "", "gravity", a, b, (size_, sentence + _stands(common, a, b)))
    first, second = np.array(common.a.medium), np.array(common.b.medium)
    if np.any(np.abs(first - second) > ROUNDING * np.maximum(first, second)):
        yield _difference(common, "", "medium", first, second)


def _stands(common: Common, a: Array, b: Array) -> str:
    """What is to be said of gravity that differs because one of the models stands turned."""
    R = common.placement[:3, :3]
    if np.linalg.norm(a - R.T @ b) > CLOSE * float(np.linalg.norm(a)):
        return ""
    angle = math.degrees(math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(R)) - 1.0)))))
    return f", because B as a whole stands turned by {angle:.4g} deg against A"


def _differ(a: float, b: float) -> bool:
    return abs(a - b) > ROUNDING * max(abs(a), abs(b))


def _joint(common: Common, name: str) -> Iterator[Difference]:
    a, b = common.a.joints[name], common.b.joints[name]
    if a.kind != b.kind:
        sentence = f"{name}: a {b.kind} in B, a {a.kind} in A"
        yield Difference(name, common.own["joints"].get(name, name), "kind", None, None, "", math.inf, sentence)
    for what in ENTRIES:
        if what == "rest" and not (a.stiffness or b.stiffness):
            continue
        first, second = getattr(a, what), getattr(b, what)
        if _differ(first, second):
            yield _difference(common, name, what, np.asarray(first), np.asarray(second))
    if not _same_limits(a, b):
        yield _difference(common, name, "limits", np.array(a.limits), np.array(b.limits))


def _limits(joint: JointReading) -> list[float]:
    """Limits; those that nothing reaches are none: URDF demands some of every hinge."""
    return [limit if abs(limit) < BOUNDLESS else math.copysign(math.inf, limit) for limit in joint.limits]


def _same_limits(a: JointReading, b: JointReading) -> bool:
    pairs = list(zip(_limits(a), _limits(b), strict=True))
    return all(
        x == y or (math.isfinite(x) and math.isfinite(y) and not abs(x - y) > ROUNDING * max(abs(x), abs(y), 1.0))
        for x, y in pairs
    )


def _body(common: Common, name: str) -> Iterator[Difference]:
    a, b = common.a.bodies[name], common.b.bodies[name]
    com, inertia = seen_from(a, b)
    if _differ(a.mass, b.mass):
        yield _difference(common, name, "mass", np.asarray(a.mass), np.asarray(b.mass))
    if a.mass and b.mass:
        radius = max(math.sqrt(abs(float(np.trace(a.inertia))) / a.mass), float(np.linalg.norm(com)))
        step = float(np.linalg.norm(com - b.com))
        if step > ROUNDING * max(radius, size(common.a)):
            more = step / max(radius, 1e-300), compared(name, "com", com, b.com, "m")[1]
            yield _difference(common, name, "com", com, b.com, more)
    scale = max(float(np.abs(inertia).max()), float(np.abs(b.inertia).max()))
    if np.abs(inertia - b.inertia).max() > 10 * ROUNDING * scale:
        yield _difference(common, name, "inertia", inertia, b.inertia)
    if _differ(a.gravcomp, b.gravcomp):
        yield _difference(common, name, "gravcomp", np.asarray(a.gravcomp), np.asarray(b.gravcomp))


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
            own = common.own["bodies"].get(name, name)
            sentence = f"{own if side == 'B' else name}: a body of {body.mass:.6g} kg in {side} only"
            a, b = (np.asarray(body.mass), None) if side == "A" else (None, np.asarray(body.mass))
            yield Difference(
                name if side == "A" else "", own if side == "B" else "", "body", a, b, "kg", math.inf, sentence
            )


def _closures(common: Common) -> Iterator[Difference]:
    """Those that both have, with how far they are open; then those of one alone, A's first."""
    gaps = [residual_at_home(plant(each)) for each in (common.a, common.b)]
    for name in common.a.closures:
        if name in common.b.closures:
            yield from _closure(common, name, (gaps[0][name], gaps[1][name]))
    for side, here, there, open_ in (("A", common.a, common.b, gaps[0]), ("B", common.b, common.a, gaps[1])):
        for name, closure in here.closures.items():
            if name not in there.closures:
                own = common.own["closures"].get(name, name) if side == "B" else name
                sentence = f"{own}: a closure of {closure.first} and {closure.second} in {side} only"
                sentence += f", open at home by {_gap(closure, open_[name])}"
                items = (own, "") if side == "A" else ("", own)
                yield Difference(*items, "closure", None, None, "", math.inf, sentence)


def _gap(closure: ClosureReading, gap: float) -> str:
    return f"{gap:.3g} m" if closure.kind == "point" else f"{gap:.3g} m or rad"


def _closure(common: Common, name: str, gaps: tuple[float, float]) -> Iterator[Difference]:
    a, b = common.a.closures[name], common.b.closures[name]
    own = common.own["closures"].get(name, name)
    still = f"; open at home by {_gap(b, gaps[1])} in B, {_gap(a, gaps[0])} in A"
    if a.kind != b.kind:
        sentence = f"{name}: a {b.kind} in B, a {a.kind} in A{still}"
        yield Difference(name, own, "closure", None, None, "", math.inf, sentence)
    if (a.first, a.second) == (b.second, b.first) and a.first != a.second:
        a = ClosureReading(a.kind, a.second, a.second_frame, a.first, a.first_frame)
    for what, body in (("first_frame", a.first), ("second_frame", a.second)):
        ours, theirs = getattr(a, what), getattr(b, what)
        if body in common.a.bodies and body in common.b.bodies:
            ours = np.linalg.inv(common.b.bodies[body].pose) @ common.a.bodies[body].pose @ ours
        step = float(np.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
        turn = float(np.abs(ours[:3, :3] - theirs[:3, :3]).max()) if a.kind == b.kind == "weld" else 0.0
        if max(step / size(common.a), turn) > 10 * ROUNDING:
            off = f"{step * 1e3:.6g} mm" + (f" and {turn:.6g} rad" if turn else "")
            more = step / size(common.a) + turn, f"{name}: its frame on {body} is {off} elsewhere in B{still}"
            yield _difference(common, name, what, ours, theirs, more)


def _couplings(common: Common) -> Iterator[Difference]:
    for name, coupling in common.a.couplings.items():
        other = common.b.couplings.get(name)
        if other is None:
            sentence = f"{coupling.joint} follows {coupling.of or 'nothing'} in A only"
            yield Difference(name, "", "coupling", coupling.polynomial, None, "1", math.inf, sentence)
            continue
        if coupling.of != other.of:
            own = common.own["couplings"].get(name, name)
            leads = common.own["joints"].get(other.of, other.of) or "nothing"
            sentence = f"{coupling.joint}: follows {leads} in B, {coupling.of or 'nothing'} in A"
            yield Difference(name, own, "leading joint", None, None, "", math.inf, sentence)
        n = max(len(coupling.polynomial), len(other.polynomial))
        a, b = (np.pad(each.polynomial, (0, n - len(each.polynomial))) for each in (coupling, other))
        if np.abs(a - b).max() > ROUNDING * max(float(np.abs(a).max()), float(np.abs(b).max())):
            yield _difference(common, name, "polynomial", a, b)
    for name, coupling in common.b.couplings.items():
        if name not in common.a.couplings:
            sentence = f"{coupling.joint} follows {coupling.of or 'nothing'} in B only"
            yield Difference(
                "",
                common.own["couplings"].get(name, name),
                "coupling",
                None,
                coupling.polynomial,
                "1",
                math.inf,
                sentence,
            )


def _actuators(common: Common) -> Iterator[Difference]:
    if not (common.a.actuators and common.b.actuators):
        return  # one of the formats has none
    for name, (joint, gear) in common.a.actuators.items():
        if name not in common.b.actuators:
            yield Difference(
                name, "", "actuator", np.asarray(gear), None, "1", math.inf, f"{name}: an actuator of {joint} in A only"
            )
            continue
        driven, other = common.b.actuators[name]
        if driven != joint:
            own = common.own["actuators"].get(name, name)
            sentence = f"{name}: drives {common.own['joints'].get(driven, driven)} in B, {joint} in A"
            yield Difference(name, own, "driven joint", None, None, "", math.inf, sentence)
        if _differ(gear, other):
            yield _difference(common, name, "gear", np.asarray(gear), np.asarray(other))
    for name, (joint, gear) in common.b.actuators.items():
        if name not in common.a.actuators:
            own = common.own["actuators"].get(name, name)
            yield Difference(
                "", own, "actuator", None, np.asarray(gear), "1", math.inf, f"{own}: an actuator of {joint} in B only"
            )


def sorted_by_size(found: Iterable[Difference]) -> list[Difference]:
    """Models' own first, then conventions, then printed digits; the largest first."""
    order = ("model", "convention", "digits")
    return sorted(found, key=lambda one: (order.index(one.kind), -one.size))
