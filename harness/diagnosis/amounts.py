"""Formats numbers (with enough digits to distinguish them), steps along axes, tensors and lists; names properties."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from screwgauge.diagnosis.properties import noun_of
from screwgauge.reference.rotations import Array

#: Kind of a link -> its noun.
LINKS = {
    "R": "a hinge",
    "P": "a slide",
    "S": "a ball joint",
    "C": "a cylindrical joint",
    "U": "a universal joint",
    "F": "free",
}
#: Letter of a degree of freedom, or kind of a joint -> its noun.
JOINTS = {"R": "hinge", "P": "slide", "S": "ball joint", "F": "free joint"}
JOINTS |= {"hinge": "hinge", "slide": "slide", "ball": "ball joint", "free": "free joint"}
#: Event -> noun, if the noun differs from the name of the event.
_NOUNS = {
    "axis": "location of the axis",
    "base": "joints of the base",
    "branch": "subtree",
    "coupling": "coupling",
    "end": "location of an end",
    "fixed": "freedom",
    "held": "freedom",
    "kind": "kind of joint",
    "link": "joint",
    "sign": "direction of the coordinate",
    "start": "start",
    "whole": "placement and units of the whole model",
}


def noun(what: str) -> str:
    """Return the noun for a property or an event."""
    return _NOUNS.get(what) or noun_of(what)


def other_side(side: str) -> str:
    """Return the letter of the other model: ``B`` for ``A``, ``A`` for ``B``."""
    return "B" if side == "A" else "A"


def join(nouns: Sequence[str]) -> str:
    """Join nouns: ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join(filter(None, (", ".join(nouns[:-1]), nouns[-1])))


def count(n: int, one: str, several: str = "") -> str:
    """Format a count: ``1 joint``, ``2 joints``."""
    return f"{n} {one if n == 1 else several or f'{one}s'}"


_AXES = "xyz"


def compare_values(what: str, a: Array, b: Array, unit: str) -> str:
    """Format two values of a property and the difference between them."""
    behind = f" {unit}" if unit else ""
    if np.ndim(a) == 0:
        x, y = float(a), float(b)
        apart = f" ({format_change(x, y)})" if x and y else ""
        return f"{digits(y, x)}{behind} in B, {digits(x, y)}{behind} in A{apart}"
    if what == "inertia":
        return _tensors(a, b)
    said = f"{vector(b, a)}{behind} in B, {vector(a, b)}{behind} in A"
    return f"{said} ({_difference(b - a, unit)})" if what in ("com", "gravity") else said


#: Name of a frame, such as ``link3 in A``, and its axes in A's world frame at the home pose as columns, shape (3, 3).
Axes = tuple[str, Array]
#: World axes, for steps that do not belong to a body.
WORLD: Axes = ("the world in A", np.eye(3))
#: Relative size below which the rotation or translation of a step, or a component of a vector, is rounding.
_SHARE = 1e-5


def turn_and_way(
    step: Array, axes: Sequence[Axes], length: float, turned: str = "turned", *, brief: bool = False
) -> str:
    """Format a rotation and a translation with their directions; omit whichever of the two vanishes.

    Args:
        step: Rotation vector [rad] and translation [m] in A's world frame. Shape (2, 3).
        length: Length of the machine [m], by which the translation is divided to compare it with the rotation.
        brief: Omit vectors.
    """
    angle, way = float(np.linalg.norm(step[0])), float(np.linalg.norm(step[1])) / length
    parts = []
    if angle > max(1e-12, _SHARE * way):
        parts.append(f"{turned} by {step_in_axes(step[0], axes, 'deg', brief=brief)}")
    if way > max(1e-12, _SHARE * angle):
        parts.append(f"shifted by {step_in_axes(step[1], axes, 'mm', brief=brief)}")
    return " and ".join(parts) or "by rounding"


def step_in_axes(step: Array, axes: Sequence[Axes], unit: str, *, brief: bool = False) -> str:
    """Format a step along a single axis with its sign, and any other step as a magnitude and a vector in ``axes[0]``.

    Args:
        step: Step in A's world frame [rad or m]. Shape (3,).
        unit: ``deg`` or ``mm``.
        brief: Omit the vector.
    """
    shown_ = np.degrees(step) if unit == "deg" else step * 1e3
    for name, R in axes:
        along = R.T @ shown_
        k = int(np.abs(along).argmax())
        if np.abs(np.delete(along, k)).max() <= _SHARE * abs(along[k]):
            return f"{along[k]:+.6g} {unit} {'about' if unit == 'deg' else 'along'} {_AXES[k]} of {name}"
    name, R = axes[0]
    along = R.T @ shown_
    size = f"{np.linalg.norm(along):.6g} {unit}"
    return size if brief else f"{size}, {_round_vector(along)} {unit} in the axes of {name}"


def format_value(value: object) -> str:
    """Format a number, or the entries of a vector in parentheses."""
    array = np.asarray(value, float)
    return f"{array:.6g}" if array.ndim == 0 else f"({', '.join(f'{x:.6g}' for x in array.ravel())})"


def percent(factor: float) -> str:
    """Format a factor as a change in percent, or as ``x 12`` if it is far from 1."""
    return f"{100.0 * (factor - 1.0):+.2f} %" if 0.0 < factor < 10.0 else f"x {factor:g}"


def _round_vector(vector_: Array) -> str:
    most = float(np.abs(vector_).max())
    return f"({', '.join(f'{x:.4g}' if abs(x) > 1e-6 * most else '0' for x in vector_)})"


def _difference(step: Array, unit: str) -> str:
    """Format the difference between two vectors, along one axis if possible."""
    step_, of = (step * 1e3, "mm") if unit == "m" else (step, unit)
    k = int(np.abs(step_).argmax())
    if np.abs(np.delete(step_, k)).max() <= _SHARE * abs(step_[k]):
        return f"{step_[k]:+.4g} {of} along {_AXES[k]}"
    return f"{np.linalg.norm(step_):.4g} {of} apart"


def digits(value: float, other: float) -> str:
    """Format a number with two more digits than needed to distinguish it from another number, but at least 4 digits."""
    if 0.0 in (value, other) or not abs(value - other) > 1e-11 * max(abs(value), abs(other)):
        return f"{value + 0.0:.6g}"
    near = max(abs(value), abs(other)) / abs(value - other)
    shown = min(17, max(4, math.ceil(math.log10(near)) + 2))
    text = f"{value:#.{shown}g}"
    return text.rstrip(".") if "e" not in text else f"{value:.{shown}g}"


def vector(value: Array, other: Array) -> str:
    """Format a vector in parentheses, with the digits that distinguish its entries from those of another vector."""
    least = 1e-13 * max(_largest(value), _largest(other))  # rounding error relative to the largest entry
    pairs = zip(value.ravel(), other.ravel(), strict=True)
    return f"({', '.join(digits(*(float(x) if abs(x) > least else 0.0 for x in pair)) for pair in pairs)})"


def _largest(value: Array) -> float:
    finite = np.abs(np.asarray(value))[np.isfinite(value)]
    return float(finite.max()) if finite.size else 0.0


def format_change(a: float, b: float) -> str:
    """Format the change from A to B in percent or, if large, as a factor."""
    if a == 0.0 or b == 0.0:
        return "none in A" if a == 0.0 else "none in B"
    share = (b - a) / a
    if abs(b + a) <= _SHARE * abs(a):
        return "opposite sign"
    if not 0.01 <= b / a < 11.0:
        return f"x {b / a:.4g}"
    return f"{share * 100:+.2f} %" if abs(share) >= 1e-4 else f"{share * 100:+.3g} %"


def _tensors(a: Array, b: Array) -> str:
    """Format the difference between two tensors: the one entry that differs, a change of axes, or principal moments."""
    apart = np.triu(np.abs(a - b))
    entries = np.argwhere(apart > 1e-6 * apart.max())
    if len(entries) == 1:
        ((i, j),) = entries
        x, y = float(a[i, j]), float(b[i, j])
        return f"{_AXES[i]}{_AXES[j]} {digits(y, x)} kg m^2 in B, {digits(x, y)} kg m^2 in A ({format_change(x, y)})"
    with np.errstate(invalid="ignore"):
        first, second = (np.asarray(np.linalg.eigvalsh(each), dtype=float) for each in (a, b))
    scale = max(_largest(a), _largest(b)) or 1.0
    same = float(np.abs(first - second).max()) < 1e-3 * float(np.abs(a - b).max())
    if same:
        percent = f"{100.0 * float(np.abs(a - b).max()) / scale:.3g} %"
        return (
            f"has different axes in B, with the same principal moments {vector(first, first)} kg m^2 ({percent} apart)"
        )
    return (
        f"with principal moments {vector(second, first)} kg m^2 in B, {vector(first, second)} kg m^2 in A "
        f"({_ratio(a, b)})"
    )


def _ratio(a: Array, b: Array) -> str:
    """Format the ratio of two tensors: a common factor, the ratio of the largest entries, or the largest difference."""
    most, other = (_largest(each) for each in (a, b))
    if not most or not other:
        return format_change(most, other)
    with np.errstate(invalid="ignore", over="ignore"):
        factor = float(np.vdot(a / most, b)) / float(np.vdot(a / most, a))
        if np.abs(b - factor * a).max() <= _SHARE * other:
            return format_change(1.0, factor)
    if not 0.1 <= other / most <= 10.0:
        return f"largest entry {format_change(most, other)}"
    return f"{100.0 * float(np.abs(a - b).max()) / max(most, other):.3g} % apart"


def link_kind(kind: str) -> str:
    return LINKS.get(kind) or freedoms(kind)


def freedoms(kinds_: Sequence[str]) -> str:
    """List degrees of freedom: ``3 slides and a ball joint``."""
    named = [JOINTS.get(kind, kind) for kind in kinds_]
    return join(
        [f"a {each}" if named.count(each) == 1 else count(named.count(each), each) for each in dict.fromkeys(named)]
    )
