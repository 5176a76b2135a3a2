"""Differences in words."""

from __future__ import annotations

import math
import re

import numpy as np

from screwgauge.diagnosis.differences.change import PROPERTIES
from screwgauge.models.readings.reading import JointReading
from screwgauge.reference.rotations import Array

_AXES = "xyz"
#: Property -> how it is called in a sentence.
NAMES = {
    "com": "centre of mass",
    "gravcomp": "compensated share of weight",
    "friction": "dry friction",
    "rest": "rest of the spring",
    "polynomial": "coupling",
}


def unit_of(what: str, joint: JointReading | None) -> str:
    """Of a property, by what the joint does."""
    turns, _, slides = PROPERTIES[what].unit.partition("|")
    unit = slides if slides and joint is not None and joint.kind == "slide" else turns
    return "" if unit == "1" else unit


def compared(item: str, what: str, a: Array, b: Array, unit: str, own: Array | None = None) -> tuple[float, str]:
    """Relative difference of two values, and a sentence on it.

    Args:
        own: B's value as its file has it, where that counts the other way.
    """
    shown = b if own is None else own
    name = NAMES.get(what, what)
    lead = f"{item}: {name}" if item else name
    behind = f" {unit}" if unit else ""
    step = b - a
    with np.errstate(invalid="ignore"):
        apart = float(np.nanmax(np.abs(step))) if np.size(step) else 0.0
    scale = max(_finite(a), _finite(b)) or 1.0
    if np.ndim(a) == 0:
        said = f"{lead} {digits(float(shown), float(a))}{behind} in B, {digits(float(a), float(shown))}{behind} in A"
        return apart / scale, f"{said} ({_change(float(a), float(b))})"
    if what in ("com", "centre", "gravity"):
        size = float(np.linalg.norm(step))
        said = f"{lead} {vector(b, a)}{behind} in B, {vector(a, b)}{behind} in A"
        if unit == "m":
            return size / scale, f"{said} ({size * 1e3:.4g} mm apart)"
        return size / scale, f"{said} ({size:.4g}{behind} apart)"
    if what == "inertia":
        return apart / scale, f"{lead} {_tensors(a, b)}"
    ours, theirs = vector(a, shown), vector(shown, a)
    if ours == theirs:
        return apart / scale, f"{lead} {ours}{behind} in both"
    return apart / scale, f"{lead} {theirs}{behind} in B, {ours}{behind} in A"


def each_in_its_own(
    item: str, what: str, a: Array, b: Array, unit: str, step: float, axes: str, way: Array | None = None
) -> str:
    """A sentence on vectors that each file gives in a frame of its own.

    Args:
        a, b: As the files have them. Shape (3,).
        step: How far apart they are, seen in one frame.
        axes: What each is given in.
        way: From A to B in A's world, where it is to be said. Shape (3,).
    """
    said = f"{item}: {NAMES.get(what, what)}" if item else NAMES.get(what, what)
    much = f"{step * 1e3:.4g} mm" if unit == "m" else f"{step:.4g} {unit}"
    off = f", by {_short(way * 1e3)} mm in A's world" if way is not None and unit == "m" else ""
    ours, theirs = vector(a, b), vector(b, a)
    if ours == theirs:
        return f"{said} {ours} {unit} in both, each {axes} ({much} apart{off})"
    return f"{said} {theirs} {unit} in B, {ours} {unit} in A, each {axes} ({much} apart{off})"


def place(item: str, what: str, amount: tuple[float, float], joint: JointReading, along: float = 0.0) -> str:
    """A sentence on a joint that is elsewhere, or counts in another way.

    Args:
        along: How far its zero is from that of A, along its axis [rad or m].
    """
    angle, way = amount
    if what == "sign":
        return f"{item}: counts the other way in B (its axis is reversed)"
    if what == "zero":
        turned = f"{along:+.6g} rad ({math.degrees(along):+.6g} deg)"
        much = turned if joint.kind == "hinge" else f"{along * 1e3:+.6g} mm"
        return f"{item}: its zero is {much} elsewhere in B"
    if what == "placement":
        return f"{item}: sits elsewhere in B, with all that it carries ({turn_and_way(amount)})"
    if what == "axis":
        return f"{item}: its axis alone is tilted in B by {angle:.6g} rad ({math.degrees(angle):.4g} deg)"
    return f"{item}: its axis alone is shifted in B by {way * 1e3:.6g} mm"


def directed(step: Array) -> str:
    """The direction of a turn [rad] and a way [m] from A to B, those that are there. Shape (2, 3)."""
    parts = [f"turned by {_short(step[0])} rad"] * bool(np.linalg.norm(step[0]) > 1e-12)
    parts += [f"off by {_short(step[1] * 1e3)} mm"] * bool(np.linalg.norm(step[1]) > 1e-12)
    return f", {' and '.join(parts)} in A's world" if parts else ""


def _short(vector_: Array) -> str:
    most = float(np.abs(vector_).max())
    return f"({', '.join(f'{x:.4g}' if abs(x) > 1e-6 * most else '0' for x in vector_)})"


def turn_and_way(amount: tuple[float, float]) -> str:
    """An angle [rad] and a way [m], those that are there."""
    angle, way = amount
    return " and ".join([f"{angle:.4g} rad"] * (angle > 1e-12) + [f"{way * 1e3:.4g} mm"] * (way > 1e-12)) or "nothing"


def with_sides(sentence: str, a: str, b: str) -> str:
    """A sentence with other words for "in A" and "in B"."""
    return re.sub(r"\bin ([AB])\b", lambda found: a if found.group(1) == "A" else b, sentence)


def digits(value: float, other: float) -> str:
    """A number with as many digits as tell it from another one, and two more; 4 at least."""
    if 0.0 in (value, other) or not abs(value - other) > 1e-11 * max(abs(value), abs(other)):
        return f"{value + 0.0:.6g}"
    near = max(abs(value), abs(other)) / abs(value - other)
    shown = min(17, max(4, math.ceil(math.log10(near)) + 2))
    text = f"{value:#.{shown}g}"
    return text.rstrip(".") if "e" not in text else f"{value:.{shown}g}"


def vector(value: Array, other: Array) -> str:
    """Entries in brackets."""
    least = 1e-13 * max(_finite(value), _finite(other))  # rounding beside the largest entry
    pairs = zip(value.ravel(), other.ravel(), strict=True)
    return f"({', '.join(digits(*(float(x) if abs(x) > least else 0.0 for x in pair)) for pair in pairs)})"


def _finite(value: Array) -> float:
    finite = np.abs(np.asarray(value))[np.isfinite(value)]
    return float(finite.max()) if finite.size else 0.0


def _change(a: float, b: float) -> str:
    """From A to B in percent, or, of large ones, as a factor."""
    if a == 0.0 or b == 0.0:
        return "none in A" if a == 0.0 else "none in B"
    share = (b - a) / a
    if abs(share) >= 10.0:
        return f"x {b / a:.4g}"
    return f"{share * 100:+.2f} %" if abs(share) >= 1e-4 else f"{share * 100:+.3g} %"


def _tensors(a: Array, b: Array) -> str:
    """The entry that differs, if it is one; else principal moments, and whether the axes are others."""
    apart = np.triu(np.abs(a - b))
    entries = np.argwhere(apart > 1e-6 * apart.max())
    if len(entries) == 1:
        ((i, j),) = entries
        x, y = float(a[i, j]), float(b[i, j])
        return f"{_AXES[i]}{_AXES[j]} {digits(y, x)} kg m^2 in B, {digits(x, y)} kg m^2 in A ({_change(x, y)})"
    with np.errstate(invalid="ignore"):
        first, second = (np.asarray(np.linalg.eigvalsh(each), dtype=float) for each in (a, b))
    scale = max(_finite(a), _finite(b)) or 1.0
    percent = f"{100.0 * float(np.abs(a - b).max()) / scale:.3g} %"
    same = float(np.abs(first - second).max()) < 1e-3 * float(np.abs(a - b).max())
    if same:
        return f"has other axes in B, and the same principal moments {vector(first, first)} kg m^2 ({percent} apart)"
    return (
        f"with principal moments {vector(second, first)} kg m^2 in B, {vector(first, second)} kg m^2 in A "
        f"({percent} apart)"
    )
