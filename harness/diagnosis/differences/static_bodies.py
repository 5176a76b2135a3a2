"""What two readings say otherwise of bodies: their mass, centre of mass and inertia, in the numbers of either file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.differences.change import Difference
from screwgauge.diagnosis.differences.stated import differ, difference, only
from screwgauge.diagnosis.differences.words import NAMES, axes_of, compared, each_in_its_own, in_axes
from screwgauge.diagnosis.pairing.common import ROUNDING, Common
from screwgauge.models.kinematics import size
from screwgauge.models.matter import Matter, combined, displaced, of_body, relative, steps_of
from screwgauge.models.readings.reading import BodyReading, Reading
from screwgauge.reference.errors import first_few
from screwgauge.reference.rotations import Array

#: A missing part makes all of a difference but for such a share: files print some digits.
PART = 1e-3
_NAMED = 3


def bodies(common: Common) -> Iterator[Difference]:
    """Of all bodies; what we cut into shares of a body is said of the body as a whole."""
    for name in common.a.bodies:
        if name in common.b.bodies:
            found = _body(common, name, common.a.bodies[name], common.b.bodies[name])
            found = _as_a_whole(common, name, found)
            yield from _beside_held(common, name, found) if name in common.held else found
    yield from _unpaired(common)


def _body(common: Common, name: str, a: BodyReading, b: BodyReading) -> Iterator[Difference]:
    (com, inertia), (moved, turned) = seen_from(a, b)
    links = _links(a, b)

    def found(what: str, one: Array, other: Array, size_: float, sentence: str) -> Difference:
        if what == "mass" and (lost := _missing_part(common, a, b)):
            said = f"{name}: {lost}: {sentence.removeprefix(f'{name}: ')}"
        else:
            said = f"{sentence}{links}"
        return difference(common, name, what, one, other, (size_, said))

    if differ(a.mass, b.mass):
        one, other = np.asarray(a.mass), np.asarray(b.mass)
        yield found("mass", one, other, *compared(name, "mass", one, other, "kg"))
    if a.mass and b.mass:
        radius = max(math.sqrt(abs(float(np.trace(a.inertia))) / a.mass), float(np.linalg.norm(com)))
        step = float(np.linalg.norm(com - b.com))
        if step > common.rounding * max(radius, size(common.a)):
            sentence = compared(name, "com", com, b.com, "m")[1]
            if moved:
                way, axes = b.pose[:3, :3] @ (b.com - com), "in the frame of its own file"
                apart = in_axes(way, axes_of(common.a, name), "mm", " apart")
                sentence = each_in_its_own(name, "com", a.com, b.com, "m", axes, apart)
            yield found("com", com, b.com, step / max(radius, 1e-300), sentence)
    scale = max(float(np.abs(inertia).max()), float(np.abs(b.inertia).max()))
    if np.abs(inertia - b.inertia).max() > 10 * common.rounding * scale:
        size_, sentence = compared(name, "inertia", inertia, b.inertia, "kg m^2")
        along = ", along the axes of B" if turned and "principal" not in sentence else ""
        yield found("inertia", inertia, b.inertia, size_, sentence + along)
    if differ(a.gravcomp, b.gravcomp):
        one, other = np.asarray(a.gravcomp), np.asarray(b.gravcomp)
        yield found("gravcomp", one, other, *compared(name, "gravcomp", one, other, ""))


def _beside_held(common: Common, name: str, found: Iterator[Difference]) -> Iterator[Difference]:
    """Differences of a body of which joints that B alone has move a part: changes are of what it is without that part.

    What would have no mass without it has no change.
    """
    a, b, held = common.a.bodies[name], common.b.bodies[name], common.held[name]
    (com, inertia), _ = seen_from(a, b)
    old, new = (combined(matter, held, -1.0) for matter in (of_body(b), Matter(a.mass, com, inertia)))
    told = {each.what: each for each in found}
    if not {"mass", "com", "inertia"} & {*told}:
        yield from told.values()
        return
    for what in ("mass", "com", "inertia"):
        value, now = (np.asarray(getattr(matter, what), dtype=float) for matter in (new, old))
        sentence = f"{name}: its {NAMES.get(what, what)} without what further joints of B move is another one in A"
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
    """That a link fixed to a body of one model is missing in the other one, if that makes all of the difference."""
    (com, inertia), _ = seen_from(a, b)
    T = relative(b.pose, a.pose)
    sides = (
        ("A", Matter(a.mass, com, inertia), {n: displaced(part, T) for n, part in a.parts.items()}, common.b),
        ("B", of_body(b), b.parts, common.a),
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
    said = [f"{first_few(body.parts, _NAMED)} in {side}" for side, body in (("A", a), ("B", b)) if body.parts]
    return f", with {' and '.join(said)}"


def _as_a_whole(common: Common, name: str, found: Iterator[Difference]) -> Iterator[Difference]:
    """Differences of a body, or of a share of one, in the numbers of the whole."""
    pair = common.a.bodies[name], common.b.bodies[name]
    original = pair[0].copy_of or pair[1].copy_of or name
    shares = _shares(common, original)
    if len(shares) == 1:
        yield from found
        return
    wholes = {side: _whole(reading, original, shares) for side, reading in (("A", common.a), ("B", common.b))}
    for side, body in wholes.items():
        if not pair["AB".index(side)].copy_of and not any(_reading(common, side).bodies[n].copy_of for n in shares):
            cut = {n: _reading(common, side).bodies[n] for n in shares if n != original}
            extra = {n: displaced(of_body(share), relative(body.pose, share.pose)) for n, share in cut.items()}
            wholes[side] = replace(body, parts={**body.parts, **extra})
    said = {each.what: each for each in _body(common, original, wholes["A"], wholes["B"])}
    for each in found:
        if each.what in said:
            one = said[each.what]
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
    whole = of_body(body)
    for name in shares[1:]:
        share = reading.bodies[name]
        whole = combined(whole, displaced(of_body(share), relative(body.pose, share.pose)))
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
