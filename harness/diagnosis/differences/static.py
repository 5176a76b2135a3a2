"""What two readings say otherwise, in physical terms: no format, no frame of a file, no order matters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from screwgauge.diagnosis.deadline import Deadline
from screwgauge.diagnosis.differences.change import PROPERTIES, Difference, Kind
from screwgauge.diagnosis.differences.geometry import Deviation, deviations, step_of
from screwgauge.diagnosis.differences.stated import another, differ, difference
from screwgauge.diagnosis.differences.static_bodies import bodies
from screwgauge.diagnosis.differences.static_loops import actuators, closures, couplings
from screwgauge.diagnosis.differences.words import axes_of, compared, each_in_its_own, place, unit_of
from screwgauge.diagnosis.pairing.common import ROUNDING, Common
from screwgauge.diagnosis.pairing.mapping import CLOSE
from screwgauge.diagnosis.transformations import axis
from screwgauge.models.kinematics import downwards, size
from screwgauge.models.mjcf import FAR
from screwgauge.models.readings.reading import JointReading
from screwgauge.reference.rotations import Array, rotation_vector

#: Entries of a joint that are one number each.
ENTRIES = ("armature", "damping", "friction", "stiffness", "rest")
#: A limit beyond so many rad or m is none.
BOUNDLESS = 100.0
#: Places along a joint whose zero is elsewhere are the same up to so much [rad or m]: files print some digits.
SHIFTED = 1e-6


def differences(common: Common, deadline: Deadline | None = None) -> tuple[list[Difference], Common]:
    """All of them, those of geometry first; and both models where B's geometry and counting are put right."""
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


def _deviation(common: Common, found: Deviation) -> Difference:
    item, what = found.right.item, found.right.what
    joint, (angle, way), length = common.a.joints[item], found.amount, size(common.a)
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
    axes, step = axes_of(common.a, carrier, common.a.bodies[carrier].near), found.step
    if what == "placement":  # files have that of the frame of what the joint carries
        step = step_of(np.asarray(np.linalg.inv(found.right.value)), common.a.bodies[carrier].pose[:3, 3])
    sentence = place(item, "zero" if ball else what, step, joint, axes, length)
    unit, change = unit_of(what, joint), found.change
    return Difference(item, change.item, what, found.right.value, b, unit, angle + way / length, sentence, change, kind)


def _model(common: Common) -> Iterator[Difference]:
    a, b = downwards(common.a), downwards(common.b)
    if np.linalg.norm(a - b) > ROUNDING * max(float(np.linalg.norm(a)), float(np.linalg.norm(b))):
        size_, sentence = compared("", "gravity", a, b, PROPERTIES["gravity"].unit)
        R = common.placement[:3, :3]
        if np.abs(R - np.eye(3)).max() > ROUNDING:
            unit, axes = PROPERTIES["gravity"].unit, "along the axes of its own world"
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
    """Of one joint.

    Args:
        written: B's as its file counts it, before it was put right.
        shift: By which A counts more than B's file, whichever way, in the same place.
    """
    a, b = common.a.joints[name], common.b.joints[name]
    if a.kind != b.kind:
        sentence = f"{name}: a {b.kind} in B, a {a.kind} in A"
        yield another(common, "joints", name, "kind", sentence)
    for what in ENTRIES:
        if what == "rest" and not (a.stiffness or b.stiffness):
            continue
        first, second = getattr(a, what), getattr(b, what)
        if differ(first, second):
            said = _counted(common, name, what, (first, second, getattr(written, what)))
            yield _as_its_zero(said, shift) if what == "rest" else said
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


def _as_its_zero(found: Difference, shift: float) -> Difference:
    """A place along a joint, told as a convention if it is the same place counted from another zero."""
    if not shift or found.a is None or found.b is None:
        return found
    off = np.abs(found.b + shift - found.a)[np.isfinite(found.a) & np.isfinite(found.b)]
    if not off.size or off.max() > SHIFTED * max(1.0, float(np.abs(found.a).max())):
        return found
    return replace(found, kind="convention", sentence=f"{found.sentence}: the same place, as its zero is elsewhere")


def _same_limit(x: float, y: float) -> bool:
    """URDF demands some of every hinge: beside a joint without any, those that nothing reaches are none."""
    if max(abs(x), abs(y)) >= FAR:
        return x * y > 0.0 and min(abs(x), abs(y)) >= BOUNDLESS
    return not abs(x - y) > ROUNDING * max(abs(x), abs(y), 1.0)


def distinct(found: Iterable[Difference]) -> list[Difference]:
    """Each once: shares of one body have its sentence."""
    return list({each.sentence: each for each in reversed([*found])}.values())[::-1]


def sorted_by_size(found: Iterable[Difference]) -> list[Difference]:
    """Models' own first, then conventions, then printed digits; the largest first."""
    order = ("model", "convention", "digits")
    return sorted(found, key=lambda one: (order.index(one.kind), -one.size))
