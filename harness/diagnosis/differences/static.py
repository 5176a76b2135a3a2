"""What two readings say otherwise, in physical terms: no format, no frame of a file, no order matters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.difference import Difference, Kind, another, differ, difference, only
from screwgauge.diagnosis.differences.geometry import Deviation, deviations, step_of
from screwgauge.diagnosis.differences.loops import actuators, closures, couplings
from screwgauge.diagnosis.differences.words import axes_of, compared, each_in_its_own, in_axes, place
from screwgauge.diagnosis.pairing.common import ROUNDING, Common
from screwgauge.diagnosis.pairing.mapping import CLOSE
from screwgauge.diagnosis.properties import INERTIAL, PASSIVE, unit_of, word
from screwgauge.diagnosis.transformations import axis
from screwgauge.models.kinematics import downwards, size
from screwgauge.models.matter import Matter, combined, displaced, steps_of
from screwgauge.models.mjcf import FAR
from screwgauge.models.poses import relative
from screwgauge.models.readings.reading import BodyReading, JointReading, Reading
from screwgauge.reference.errors import first_few
from screwgauge.reference.rotations import Array, rotation_vector

#: A limit beyond so many rad or m is none.
BOUNDLESS = 100.0
#: Places along a joint whose zero is elsewhere are the same up to so much [rad or m]: files print some digits.
SHIFTED = 1e-6


def differences(common: Common, deadline: Deadline | None = None) -> tuple[list[Difference], Common]:
    """Differences of two models, geometry first; and both models with B's geometry and counting corrected."""
    deadline = deadline or Deadline()
    found, right = deviations(common, deadline)
    out = [_deviation(common, deviation) for deviation in found]
    if deadline.over("all that bodies, joints and loops say beside their places"):
        return out, right
    out += _model(right)
    counted = [each.right for each in found]
    shifts = {each.item: float(each.value) - common.a.joints[each.item].home for each in counted if each.what == "zero"}
    for name in right.a.joints:
        out += _joint(right, name, common.b.joints[name], shifts.get(name, 0.0))
    out += bodies(right)
    turned = {each.item for each in counted if each.what == "sign"}
    out += [*closures(right, common), *couplings(right, shifts), *actuators(right, turned)]
    return out, right


def _deviation(common: Common, deviation: Deviation) -> Difference:
    item, what = deviation.right.item, deviation.right.what
    joint, (angle, way), length = common.a.joints[item], deviation.amount, size(common.a)
    b = {
        "sign": np.array(1.0),
        "zero": np.asarray(common.b.joints[item].home),
        "placement": np.eye(4),
        "axis": axis(common.b.joints[item]),
        "centre": common.b.joints[item].centre,
    }[what]
    ball = what == "placement" and joint.kind == "ball" and way <= common.rounding * length
    kind: Kind = "convention" if what in ("sign", "zero") or ball else "model"
    carrier = common.a.moved_by(item)
    axes, step = axes_of(common.a, carrier, common.a.bodies[carrier].near), deviation.step
    if what == "placement":  # files have that of the frame of what the joint carries
        step = step_of(np.asarray(np.linalg.inv(deviation.right.value)), common.a.bodies[carrier].pose[:3, 3])
    sentence = place(item, "zero" if ball else what, step, joint, axes, length)
    unit, change = unit_of(what, joint), deviation.change
    return Difference(
        item, change.item, what, deviation.right.value, b, unit, angle + way / length, sentence, change, kind
    )


def _model(common: Common) -> Iterator[Difference]:
    a, b = downwards(common.a), downwards(common.b)
    if np.linalg.norm(a - b) > ROUNDING * max(float(np.linalg.norm(a)), float(np.linalg.norm(b))):
        unit = unit_of("gravity")
        size_, sentence = compared("", "gravity", a, b, unit)
        R = common.placement[:3, :3]
        if np.abs(R - np.eye(3)).max() > ROUNDING:
            axes = "along the axes of its own world"
            apart = f"{np.linalg.norm(a - b):.4g} {unit} apart"
            sentence = each_in_its_own("", "gravity", a, R.T @ b, unit, axes, apart)
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


def _joint(common: Common, name: str, written: JointReading, shift: float) -> Iterator[Difference]:
    """Differences of one joint.

    Args:
        written: B's as its file counts it, before it was corrected.
        shift: By which A counts more than B's file, whichever way, in the same place.
    """
    a, b = common.a.joints[name], common.b.joints[name]
    if a.kind != b.kind:
        sentence = f"{name}: a {b.kind} in B, a {a.kind} in A"
        yield another(common, "joints", name, "kind", sentence)
    for what in (*PASSIVE, "rest"):
        if what == "rest" and not (a.stiffness or b.stiffness):
            continue
        first, second = getattr(a, what), getattr(b, what)
        if differ(first, second):
            entry = _counted(common, name, what, (first, second, getattr(written, what)))
            yield _as_its_zero(entry, shift) if what == "rest" else entry
    if not all(map(_same_limit, a.limits, b.limits)):
        yield _as_its_zero(_counted(common, name, "limits", (a.limits, b.limits, written.limits)), shift)


def _counted(common: Common, name: str, what: str, values: tuple[object, object, object]) -> Difference:
    """An entry of a joint.

    Args:
        values: A's, B's as A counts, B's as its file has it.
    """
    a, b, own = (np.asarray(value, dtype=float) for value in values)
    unit = unit_of(what, common.a.joints[name])
    size_, sentence = compared(name, what, a, b, unit, own)
    turned = "" if np.array_equal(own, b) else "; B counts the other way"
    turned = turned.replace("; ", ", and ") if sentence.endswith(" in both") else turned
    return difference(common, name, what, a, b, (size_, f"{sentence}{turned}"))


def _as_its_zero(entry: Difference, shift: float) -> Difference:
    """A place along a joint, stated as a convention if it is the same place counted from another zero."""
    if not shift or entry.a is None or entry.b is None:
        return entry
    off = np.abs(entry.b + shift - entry.a)[np.isfinite(entry.a) & np.isfinite(entry.b)]
    if not off.size or off.max() > SHIFTED * max(1.0, float(np.abs(entry.a).max())):
        return entry
    return replace(entry, kind="convention", sentence=f"{entry.sentence}: the same place, as its zero is elsewhere")


def _same_limit(x: float, y: float) -> bool:
    """URDF demands some of every hinge: next to a joint without any, those that nothing reaches are none."""
    if max(abs(x), abs(y)) >= FAR:
        return x * y > 0.0 and min(abs(x), abs(y)) >= BOUNDLESS
    return not abs(x - y) > ROUNDING * max(abs(x), abs(y), 1.0)


def distinct(several: Iterable[Difference]) -> list[Difference]:
    """Each once: shares of one body have its sentence."""
    return list({each.sentence: each for each in reversed([*several])}.values())[::-1]


def sorted_by_size(several: Iterable[Difference]) -> list[Difference]:
    """Models' own first, then conventions, then printed digits; the largest first."""
    order = ("model", "convention", "digits")
    return sorted(several, key=lambda one: (order.index(one.kind), -one.size))


#: A missing part makes all of a difference but for such a share: files print some digits.
PART = 1e-3
_NAMED = 3


def bodies(common: Common) -> Iterator[Difference]:
    """Differences of all bodies; what we cut into shares of a body is said of the body as a whole."""
    for name in common.a.bodies:
        if name in common.b.bodies:
            entries = _body(common, name, common.a.bodies[name], common.b.bodies[name])
            entries = _as_a_whole(common, name, entries)
            yield from _beside_held(common, name, entries) if name in common.held else entries
    yield from _unpaired(common)


def _body(common: Common, name: str, a: BodyReading, b: BodyReading) -> Iterator[Difference]:
    (com, inertia), (moved, turned) = seen_from(a, b)
    links = _links(a, b)

    def made(what: str, one: Array, other: Array, size_: float, sentence: str) -> Difference:
        if what == "mass" and (lost := _missing_part(common, a, b)):
            words = f"{name}: {lost}: {sentence.removeprefix(f'{name}: ')}"
        else:
            words = f"{sentence}{links}"
        return difference(common, name, what, one, other, (size_, words))

    if differ(a.mass, b.mass):
        one, other = np.asarray(a.mass), np.asarray(b.mass)
        yield made("mass", one, other, *compared(name, "mass", one, other, "kg"))
    if a.mass and b.mass:
        radius = max(math.sqrt(abs(float(np.trace(a.inertia))) / a.mass), float(np.linalg.norm(com)))
        step = float(np.linalg.norm(com - b.com))
        if step > common.rounding * max(radius, size(common.a)):
            sentence = compared(name, "com", com, b.com, "m")[1]
            if moved:
                way, axes = b.pose[:3, :3] @ (b.com - com), "in the frame of its own file"
                apart = in_axes(way, axes_of(common.a, name), "mm", " apart")
                sentence = each_in_its_own(name, "com", a.com, b.com, "m", axes, apart)
            yield made("com", com, b.com, step / max(radius, 1e-300), sentence)
    scale = max(float(np.abs(inertia).max()), float(np.abs(b.inertia).max()))
    if np.abs(inertia - b.inertia).max() > 10 * common.rounding * scale:
        size_, sentence = compared(name, "inertia", inertia, b.inertia, "kg m^2")
        along = ", along the axes of B" if turned and "principal" not in sentence else ""
        yield made("inertia", inertia, b.inertia, size_, sentence + along)
    if differ(a.gravcomp, b.gravcomp):
        one, other = np.asarray(a.gravcomp), np.asarray(b.gravcomp)
        yield made("gravcomp", one, other, *compared(name, "gravcomp", one, other, ""))


def _beside_held(common: Common, name: str, entries: Iterator[Difference]) -> Iterator[Difference]:
    """Differences of a body of which joints that B alone has move a part: changes are of what it is without that part.

    What would have no mass without it has no change.
    """
    a, b, held = common.a.bodies[name], common.b.bodies[name], common.held[name]
    (com, inertia), _ = seen_from(a, b)
    old, new = (combined(matter, held, -1.0) for matter in (b, Matter(a.mass, com, inertia)))
    told = {each.what: each for each in entries}
    if not {*INERTIAL} & {*told}:
        yield from told.values()
        return
    for what in INERTIAL:
        value, now = (np.asarray(getattr(matter, what), dtype=float) for matter in (new, old))
        sentence = f"{name}: its {word(what)} without what further joints of B move is another one in A"
        each = told.get(what) or difference(common, name, what, value, now, (0.0, sentence))
        if what in told or np.abs(value - now).max() > ROUNDING * float(np.abs(value).max()):
            told[what] = replace(
                each, change=each.change and replace(each.change, value=value) if new.possible else None
            )
    yield from told.values()


def seen_from(a: BodyReading, b: BodyReading) -> tuple[tuple[Array, Array], tuple[bool, bool]]:
    """Centre of mass and inertia of A's body in the frame of B's, as both are in the world at home; and whether that is
    another frame, and has other axes.
    """
    T = np.linalg.inv(b.pose) @ a.pose
    R, off = T[:3, :3], np.abs(T - np.eye(4))
    if np.array_equal(a.pose, b.pose) or off.max() < 1e-13:  # rounding of products of exponentials
        return (a.com, a.inertia), (False, False)
    turned = bool(off[:3, :3].max() > ROUNDING)
    return (R @ a.com + T[:3, 3], R @ a.inertia @ R.T), (turned or bool(off.max() > ROUNDING), turned)


def _missing_part(common: Common, a: BodyReading, b: BodyReading) -> str:
    """Sentence on a link of a body that the other model lacks, if that makes all of the difference."""
    (com, inertia), _ = seen_from(a, b)
    T = relative(b.pose, a.pose)
    sides = (
        ("A", Matter(a.mass, com, inertia), {n: displaced(part, T) for n, part in a.parts.items()}, common.b),
        ("B", b, b.parts, common.a),
    )
    for (side, whole, parts, there), (other, rest, *_) in (sides, sides[::-1]):
        for part, matter in parts.items():
            step = max(steps_of(whole, rest).values())
            if there.has_link(part) or matter.mass == 0.0:
                continue
            if max(steps_of(combined(whole, matter, -1.0), rest).values()) < PART * step:
                return f"{part} ({matter.mass:.6g} kg), fixed to it in {side}, is missing in {other}"
    return ""


def _links(a: BodyReading, b: BodyReading) -> str:
    """Which further links a body is made of, of which the numbers are not those of one link."""
    if not (a.parts or b.parts):
        return ""
    if {*a.parts} == {*b.parts}:
        return f", with {first_few(a.parts, _NAMED)}"
    phrases = [f"{first_few(body.parts, _NAMED)} in {side}" for side, body in (("A", a), ("B", b)) if body.parts]
    return f", with {' and '.join(phrases)}"


def _as_a_whole(common: Common, name: str, entries: Iterator[Difference]) -> Iterator[Difference]:
    """Differences of a body, or of a share of one, in the numbers of the whole."""
    pair = common.a.bodies[name], common.b.bodies[name]
    original = pair[0].copy_of or pair[1].copy_of or name
    shares = _shares(common, original)
    if len(shares) == 1:
        yield from entries
        return
    wholes = {side: _whole(reading, original, shares) for side, reading in (("A", common.a), ("B", common.b))}
    for side, body in wholes.items():
        if not pair["AB".index(side)].copy_of and not any(_reading(common, side).bodies[n].copy_of for n in shares):
            cut = {n: _reading(common, side).bodies[n] for n in shares if n != original}
            extra = {n: displaced(share, relative(body.pose, share.pose)) for n, share in cut.items()}
            wholes[side] = replace(body, parts={**body.parts, **extra})
    of_whole = {each.what: each for each in _body(common, original, wholes["A"], wholes["B"])}
    for each in entries:
        if each.what in of_whole:
            one = of_whole[each.what]
            yield replace(each, size=one.size, sentence=one.sentence, whole=(one.a, one.b))
        else:
            among = f"among {', '.join(shares)}; the whole is the same"
            divided = f"{original}: B divides its {each.what} otherwise {among}"
            yield replace(each, sentence=divided)


def _reading(common: Common, side: str) -> Reading:
    return common.a if side == "A" else common.b


def _shares(common: Common, original: str) -> list[str]:
    """A body and its shares, in models that both have."""
    both = [n for n in common.a.bodies if n in common.b.bodies]
    cut = [n for n in both if original in (common.a.bodies[n].copy_of, common.b.bodies[n].copy_of)]
    return [original, *cut] if original in both else [original]


def _whole(reading: Reading, original: str, shares: Sequence[str]) -> BodyReading:
    """A body with its shares, in its frame."""
    body = reading.bodies[original]
    whole: Matter = body
    for name in shares[1:]:
        share = reading.bodies[name]
        whole = combined(whole, displaced(share, relative(body.pose, share.pose)))
    return replace(body, mass=whole.mass, com=whole.com, inertia=whole.inertia)


def _unpaired(common: Common) -> Iterator[Difference]:
    """Bodies that one has and the other has not, of joints that both have."""
    for here, there, side in ((common.a, common.b, "A"), (common.b, common.a, "B")):
        for name, body in here.bodies.items():
            if name in there.bodies or body.mass == 0.0:
                continue
            own = common.own["bodies"].get(name, name) if side == "B" else name
            sentence = f"{own}: a body of {body.mass:.6g} kg in {side} only"
            yield only(side, own, "body", sentence, np.asarray(body.mass), "kg")
