"""Differences in words."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from screwgauge.diagnosis.properties import word
from screwgauge.models.readings.reading import JointReading, Reading
from screwgauge.reference.rotations import Array

_AXES = "xyz"


def compared(item: str, what: str, a: Array, b: Array, unit: str, own: Array | None = None) -> tuple[float, str]:
    """Relative difference of two values, and a sentence on it.

    Args:
        own: B's value as its file has it, where that counts the other way.
    """
    shown = b if own is None else own
    name = word(what)
    lead = f"{item}: {name}" if item else name
    behind = f" {unit}" if unit else ""
    step = b - a
    with np.errstate(invalid="ignore"):
        apart = float(np.nanmax(np.abs(step))) if np.size(step) else 0.0
    scale = max(_finite(a), _finite(b)) or 1.0
    if np.ndim(a) == 0:
        sentence = (
            f"{lead} {digits(float(shown), float(a))}{behind} in B, {digits(float(a), float(shown))}{behind} in A"
        )
        return apart / scale, f"{sentence} ({_change(float(a), float(b))})"
    if what in ("com", "centre", "gravity"):
        size = float(np.linalg.norm(step))
        sentence = f"{lead} {vector(b, a)}{behind} in B, {vector(a, b)}{behind} in A"
        return size / scale, f"{sentence} ({_apart(step, unit)})"
    if what == "inertia":
        return apart / scale, f"{lead} {_tensors(a, b)}"
    ours, theirs = vector(a, shown), vector(shown, a)
    if ours == theirs:
        return apart / scale, f"{lead} {ours}{behind} in both"
    return apart / scale, f"{lead} {theirs}{behind} in B, {ours}{behind} in A"


def each_in_its_own(item: str, what: str, a: Array, b: Array, unit: str, axes: str, apart: str) -> str:
    """A sentence on vectors that each file gives in a frame of its own.

    Args:
        a, b: As the files have them. Shape (3,).
        axes: What each is given in.
        apart: How far apart they are, seen in one frame, in words.
    """
    head = f"{item}: {word(what)}" if item else word(what)
    ours, theirs = vector(a, b), vector(b, a)
    if ours == theirs:
        return f"{head} {ours} {unit} in both, each {axes} ({apart})"
    return f"{head} {theirs} {unit} in B, {ours} {unit} in A, each {axes} ({apart})"


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Axes in which a rotation or a displacement is stated.

    Attributes:
        name: Whose they are, such as ``link3 in A``.
        R: Their directions in A's world at home, as columns. Shape (3, 3).
    """

    name: str
    R: Array


#: Axes in which places are stated where no body has any.
WORLD = Axes("the world in A", np.eye(3))
#: A part of a step that is smaller than this share of the other one is rounding of that; so is a component of a vector.
_SHARE = 1e-5


def axes_of(a: Reading, *names: str) -> tuple[Axes, ...]:
    """Axes of bodies of A, then those of the world."""
    return (*(Axes(f"{name} in A", a.bodies[name].pose[:3, :3]) for name in names if name in a.bodies), WORLD)


def place(item: str, what: str, step: Array, joint: JointReading, axes: Sequence[Axes], length: float) -> str:
    """A sentence on a joint that is elsewhere, or counts in another way.

    Args:
        step: From A to B in A's world: rotation vector [rad] and way [m]. Shape (2, 3).
        joint: A's; `axes`: to state the step in.
        length: Size of the machine [m].
    """
    if what == "sign":
        return f"{item}: counts the other way in B (its axis is reversed)"
    if what == "zero":
        return f"{item}: its zero is {_own_step(step, joint, axes)} in B"
    told = turn_and_way(step, axes, length)
    if what == "placement":
        return f"{item}: sits elsewhere in B, with all that it carries, {told}"
    return f"{item}: its axis in B is {told.replace('turned', 'tilted')}, what it carries is not"


def _own_step(step: Array, joint: JointReading, axes: Sequence[Axes]) -> str:
    """A step by what the joint itself does."""
    if joint.kind == "hinge":
        along = float(step[0] @ joint.screw[:3])
        return f"turned by {math.degrees(along):+.6g} deg about its axis ({along:+.6g} rad)"
    if joint.kind == "slide":
        return f"shifted by {float(step[1] @ joint.screw[3:]) * 1e3:+.6g} mm along its axis"
    return f"turned by {in_axes(step[0], axes, 'deg')}"


def turn_and_way(step: Array, axes: Sequence[Axes], length: float) -> str:
    """A turn [rad] and a way [m], those that are there, with their directions. Shape (2, 3).

    Args:
        length: Size of the machine [m], by which a turn and a way are compared.
    """
    angle, way = float(np.linalg.norm(step[0])), float(np.linalg.norm(step[1])) / length
    parts = []
    if angle > max(1e-12, _SHARE * way):
        parts.append(f"turned by {in_axes(step[0], axes, 'deg')}")
    if way > max(1e-12, _SHARE * angle):
        parts.append(f"shifted by {in_axes(step[1], axes, 'mm')}")
    return " and ".join(parts) or "by rounding"


def in_axes(step: Array, axes: Sequence[Axes], unit: str, apart: str = "") -> str:
    """A step along the one axis that it has, with its sign; else its size, and the vector in the first of some axes.

    Args:
        step: In A's world [rad or m]. Shape (3,).
        unit: ``deg`` or ``mm``.
        apart: Said behind a size without a sign.
    """
    shown = np.degrees(step) if unit == "deg" else step * 1e3
    for each in axes:
        along = each.R.T @ shown
        k = int(np.abs(along).argmax())
        if np.abs(np.delete(along, k)).max() <= _SHARE * abs(along[k]):
            return f"{along[k]:+.6g} {unit} {'about' if unit == 'deg' else 'along'} {_AXES[k]} of {each.name}"
    along = axes[0].R.T @ shown
    return f"{np.linalg.norm(along):.6g} {unit}{apart}, {_short(along)} {unit} in the axes of {axes[0].name}"


def _short(vector_: Array) -> str:
    most = float(np.abs(vector_).max())
    return f"({', '.join(f'{x:.4g}' if abs(x) > 1e-6 * most else '0' for x in vector_)})"


def _apart(step: Array, unit: str) -> str:
    """How far apart two vectors are that the same axes have: along one of these, if it is one."""
    shown, of = (step * 1e3, "mm") if unit == "m" else (step, unit)
    k = int(np.abs(shown).argmax())
    if np.abs(np.delete(shown, k)).max() <= _SHARE * abs(shown[k]):
        return f"{shown[k]:+.4g} {of} along {_AXES[k]}"
    return f"{np.linalg.norm(shown):.4g} {of} apart"


def with_sides(sentence: str, a: str, b: str) -> str:
    """A sentence with other words for "in A" and "in B"."""
    return re.sub(r"\bin ([AB])\b", lambda match: a if match.group(1) == "A" else b, sentence)


def digits(value: float, other: float) -> str:
    """A number with as many digits as distinguish it from another one, and two more; 4 at least."""
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
    """Change from A to B in percent, or, if large, as a factor."""
    if a == 0.0 or b == 0.0:
        return "none in A" if a == 0.0 else "none in B"
    share = (b - a) / a
    if abs(b + a) <= _SHARE * abs(a):
        return "of the other sign"
    if not 0.01 <= b / a < 11.0:
        return f"x {b / a:.4g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")
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
    same = float(np.abs(first - second).max()) < 1e-3 * float(np.abs(a - b).max())
    if same:
        percent = f"{100.0 * float(np.abs(a - b).max()) / scale:.3g} %"
        return f"has other axes in B, and the same principal moments {vector(first, first)} kg m^2 ({percent} apart)"
    return (
        f"with principal moments {vector(second, first)} kg m^2 in B, {vector(first, second)} kg m^2 in A "
        f"({_ratio(a, b)})"
    )


def _ratio(a: Array, b: Array) -> str:
    """Ratio of two tensors: one factor, or how much the largest moments differ."""
    most, other = (_finite(each) for each in (a, b))
    if not most or not other:
        return _change(most, other)
    with np.errstate(invalid="ignore", over="ignore"):
        factor = float(np.vdot(a / most, b)) / float(np.vdot(a / most, a))
        if np.abs(b - factor * a).max() <= _SHARE * other:
            return _change(1.0, factor)
    if not 0.1 <= other / most <= 10.0:
        return f"largest entry {_change(most, other)}"
    return f"{100.0 * float(np.abs(a - b).max()) / max(most, other):.3g} % apart"
