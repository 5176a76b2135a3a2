"""Slips of convention and unit, in words: what B's value of a property would be made from A's by.

A tensor turned the wrong way, millimetres, grams; slips that give the same value are all named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product

import numpy as np

from screwgauge.models.formats import TENSOR
from screwgauge.models.matter import NOTHING, Matter, steiner
from screwgauge.reference.rotations import Array, rotation_vector

#: A slip has to explain all of a difference but this share of it, or else it is none.
LEFT = 1e-6
_AXES = "xyz"
_INCH, _POUND = 0.0254, 0.45359237
#: Factor by which B is too large -> what may have been mixed up; by quantity.
MASS = {1e3: "in g", 1e-3: "in t", 1 / _POUND: "in lb"}
LENGTH = {1e3: "in mm", 1e2: "in cm", 1 / _INCH: "in inches"}
INERTIA = {
    1e9: "in g mm^2",
    1e6: "in kg mm^2",
    1e7: "in g cm^2",
    1e4: "in kg cm^2",
    1e3: "in g m^2",
    1 / (_POUND * _INCH**2): "in lb in^2",
}
ANGLE = {180.0 / np.pi: "in degrees"}
GRAVITY = {-1.0: "upside down"}


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A property in both models, seen from one frame.

    Attributes:
        a, b: Its values.
        matter: Of the link in A, of whose mass properties it is one.
        turns: Model -> orientation of the inertial frame that it gives the link. Shape (3, 3) each.
    """

    a: Array
    b: Array
    matter: Matter = NOTHING
    turns: Mapping[str, Array] = field(default_factory=dict)


def unit_slip(units: Mapping[float, str], a: Array, b: Array) -> str:
    """``in mm`` where B is A written in mm and read in m, ``meant to be in mm`` the other way round; else nothing.

    Args:
        units: Of the quantity.
        a, b: Values. Shape (...).
    """
    for factor, name in units.items():
        if _is(factor * a, b, a):
            return name
        if factor > 0.0 and _is(a / factor, b, a):
            return f"as if A were {name}"
    return ""


def _units(units: Mapping[float, str], a: Array, b: Array) -> list[str]:
    return [f"is {slip}" for slip in [unit_slip(units, a, b)] if slip]


def _is(value: Array, b: Array, a: Array) -> bool:
    """Whether B is a value made from A, and not A itself."""
    before, small = float(np.abs(b - a).max()), max(float(np.abs(b).max()), 1e-9 * float(np.abs(a).max()))
    return before > 0.0 and float(np.abs(value - b).max()) <= LEFT * min(before, small)


def mass_slips(pair: Pair) -> list[str]:
    """Slips of unit or convention that would turn A's mass into B's. Shape ()."""
    return ["is left out"] if float(pair.b) == 0.0 < float(pair.a) else _units(MASS, pair.a, pair.b)


def angle_slips(pair: Pair) -> list[str]:
    """Slips of unit that would turn A's angles into B's. Shape (...)."""
    return _units(ANGLE, pair.a, pair.b)


def com_slips(pair: Pair) -> list[str]:
    """Slips that would turn A's centre of mass into B's, in the frame of the link. Shape (3,)."""
    a, b = pair.a, pair.b
    found = _units(LENGTH, a, b)
    if _is(np.zeros(3), b, a):
        found.append("is left out")
    mirrored = [(signs, np.array(signs) * a) for signs in product((1.0, -1.0), repeat=3) if min(signs) < 0.0]
    for signs, value in mirrored:
        if _is(value, b, a) and np.all(a[np.array(signs) < 0.0]):
            axes = " and ".join(axis for axis, sign in zip(_AXES, signs, strict=True) if sign < 0.0)
            found.append(f"is mirrored in {axes}")
    for order in permutations(range(3)):
        if _is(a[list(order)], b, a):
            found.append(f"has its entries in the order {''.join(_AXES[i] for i in order)}")
    for R in pair.turns.values():
        turned = {"turned by the orientation of its inertial": R @ a, "turned back by it": R.T @ a}
        found += [f"is {said}" for said, value in turned.items() if _is(value, b, a)]
    return found


def tensor_slips(pair: Pair) -> list[str]:
    """Slips that would turn A's inertia tensor into B's, about the centre of mass, axes of the link. Shape (3, 3)."""
    a, b = pair.a, pair.b
    found = _units(INERTIA, a, b)
    found += [said for said, value in _tensors(pair.matter, pair.turns) if _is(value, b, a)]
    if not found and (turn := _turned(a, b)):
        found.append(turn)
    return found


def _tensors(a: Matter, rotations: Mapping[str, Array]) -> Iterator[tuple[str, Array]]:
    """What A's tensor would be after each slip."""
    I = a.inertia
    away = a.mass * steiner(a.com)
    yield "is about the origin of the link, not the centre of mass", I + away
    yield "has the parallel-axis term taken off twice", I - away
    for name, R in rotations.items():
        whose = f"its orientation in {name}"
        if np.abs(R - np.eye(3)).max() > 0.0:
            yield f"is not turned by {whose}", R.T @ I @ R
            yield f"is turned by {whose} once too often", R @ I @ R.T
            yield f"is turned by {whose} transposed", R.T @ R.T @ I @ R @ R
            yield f"is turned by {whose}, where it should be turned by the transposed one", R @ R @ I @ R.T @ R.T
        local = R.T @ I @ R
        for said, value in _entries(local):
            yield said, R @ value @ R.T
    values, V = np.linalg.eigh(I)
    for order in permutations(range(3)):
        yield "has its principal moments on other axes", V @ np.diag(values[list(order)]) @ V.T


def _entries(I: Array) -> Iterator[tuple[str, Array]]:
    """Slips with the entries of a tensor, in the axes in which it is written."""
    moments, products = np.diag(np.diag(I)), I - np.diag(np.diag(I))
    yield "has products of inertia of the other sign", moments - products
    yield "has no products of inertia", moments
    mjcf, urdf = tuple(TENSOR), tuple(sorted(TENSOR))
    yield "has URDF's order of entries in the place of MJCF's", _reordered(I, mjcf, urdf)
    yield "has MJCF's order of entries in the place of URDF's", _reordered(I, urdf, mjcf)
    for what, names in (("products", ("xy", "xz", "yz")), ("its moments", ("xx", "yy", "zz"))):
        for order in permutations(names):
            yield f"has {what} of inertia in another order", _reordered(I, names, order)


def _reordered(I: Array, names: Sequence[str], others: Sequence[str]) -> Array:
    """A tensor of which some entries are in the places of others."""
    out = I.copy()
    for (i, j), other in zip((TENSOR[name] for name in names), others, strict=True):
        out[i, j] = out[j, i] = I[TENSOR[other]]
    return out


def _turned(a: Array, b: Array) -> str:
    """Rotation between two tensors with the same principal moments, in words; empty if these differ."""
    (one, V), (two, W) = np.linalg.eigh(a), np.linalg.eigh(b)
    if np.abs(one - two).max() > LEFT * np.abs(b - a).max():
        return ""
    turns = [W @ np.diag(signs) @ V.T for signs in product((1.0, -1.0), repeat=3)]
    angle = min(np.linalg.norm(rotation_vector(R)) for R in turns if np.linalg.det(R) > 0.0)
    return f"is turned by {np.degrees(angle):.4g} degrees"


def placement_slips(pair: Pair) -> list[str]:
    """Slips that would turn A's placement into B's; both relative to the link before. Shape (4, 4)."""
    found = []
    (R, p), (Q, r) = ((T[:3, :3], T[:3, 3]) for T in (pair.a, pair.b))
    turn = rotation_vector(R)
    if np.abs(Q - R).max() <= LEFT * np.abs(r - p).max():
        found += _units(LENGTH, p, r)
        if _is(np.zeros(3), r, p):
            found.append("has no position")
    if np.abs(r - p).max() <= LEFT * np.abs(Q - R).max():
        if _is(R.T, Q, R):
            found.append("has its rotation transposed")
        if _is(np.eye(3), Q, R):
            found.append("has no rotation")
        if said := unit_slip(ANGLE, turn, rotation_vector(Q)):
            found.append(f"has its angles {said}")
    return found


def gravity_slips(pair: Pair) -> list[str]:
    """Slips that would turn A's gravity into B's. Shape (3,)."""
    a, b = pair.a, pair.b
    found = _units(GRAVITY, a, b)
    if not b.any():
        found.append("is left out")
    one, two = np.linalg.norm(a), np.linalg.norm(b)
    if not found and abs(one - two) <= LEFT * np.abs(b - a).max():
        found.append(f"is turned by {np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)):.4g} degrees")
    return found
