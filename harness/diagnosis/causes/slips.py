"""Edits that would make B of A: each difference with its values and the slip of convention or unit that it looks like.

A slip says in words what B's value is, made from A's: a tensor turned the wrong way, millimetres, grams. Slips that
give the same value are all named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import permutations, product

import numpy as np

from screwgauge.diagnosis.differences.change import Change, Difference, applied
from screwgauge.diagnosis.differences.words import NAMES
from screwgauge.diagnosis.files.opened import Opened, frames_of
from screwgauge.diagnosis.pairing.common import weighed
from screwgauge.models.formats import TENSOR
from screwgauge.models.kinematics import downwards
from screwgauge.models.matter import Matter, combined, displaced, of_body, plainest, relative, steps_of
from screwgauge.models.readings.assemble import matrix, steiner
from screwgauge.models.readings.reading import Reading
from screwgauge.reference.rotations import Array, rotation, rotation_vector

INERTIAL = ("mass", "com", "inertia")
#: A slip has to explain all of a difference but this share of it, or else it is none.
LEFT = 1e-6
_AXES = "xyz"
#: Factor by which B is too large -> what may have been mixed up; by quantity.
_INCH, _POUND, _DEGREE = 0.0254, 0.45359237, np.pi / 180.0
UNITS: dict[str, dict[float, str]] = {
    "mass": {1e3: "in g", 1e-3: "in t", 1 / _POUND: "in lb"},
    "com": {1e3: "in mm", 1e2: "in cm", 1 / _INCH: "in inches"},
    "inertia": {
        1e9: "in g mm^2",
        1e6: "in kg mm^2",
        1e7: "in g cm^2",
        1e4: "in kg cm^2",
        1e3: "in g m^2",
        1 / (_POUND * _INCH**2): "in lb in^2",
    },
    "placement": {1e3: "in mm", 1e2: "in cm", 1 / _INCH: "in inches"},
    "angle": {1 / _DEGREE: "in degrees"},
    "gravity": {-1.0: "upside down"},
}


def unit_slip(what: str, a: Array, b: Array) -> str:
    """``in mm`` where B is A written in mm and read in m, ``meant to be in mm`` the other way round; else nothing.

    Args:
        what: A key of `UNITS`.
        a, b: Values. Shape (...).
    """
    for factor, name in UNITS[what].items():
        if _is(factor * a, b, a):
            return name
        if factor > 0.0 and _is(a / factor, b, a):
            return f"as if A were {name}"
    return ""


def _is(value: Array, b: Array, a: Array) -> bool:
    """Whether B is a value made from A, and not A itself."""
    before, small = float(np.abs(b - a).max()), max(float(np.abs(b).max()), 1e-9 * float(np.abs(a).max()))
    return before > 0.0 and float(np.abs(value - b).max()) <= LEFT * min(before, small)


def com_slips(a: Array, b: Array, R: Array) -> list[str]:
    """What a centre of mass is of another one.

    Args:
        a, b: In the frame of the link. Shape (3,).
        R: Orientation of the inertial frame in the link. Shape (3, 3).
    """
    found = [f"is {said}" for said in [unit_slip("com", a, b)] if said]
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
    turned = {"turned by the orientation of its inertial": R @ a, "turned back by it": R.T @ a}
    return found + [f"is {said}" for said, value in turned.items() if _is(value, b, a)]


def tensor_slips(a: Matter, b: Array, rotations: Mapping[str, Array]) -> list[str]:
    """What an inertia tensor is of another one.

    Args:
        a: Of the link in A, in the frame of the link.
        b: Inertia about the centre of mass in B, in the same frame. Shape (3, 3).
        rotations: Model -> orientation of the inertial frame that it gives the link. Shape (3, 3) each.
    """
    found = [f"is {said}" for said in [unit_slip("inertia", a.inertia, b)] if said]
    found += [said for said, value in _tensors(a, rotations) if _is(value, b, a.inertia)]
    if not found and (turn := _turned(a.inertia, b)):
        found.append(turn)
    return list(dict.fromkeys(found))


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
    """Of tensors with the same principal moments."""
    (one, V), (two, W) = np.linalg.eigh(a), np.linalg.eigh(b)
    if np.abs(one - two).max() > LEFT * np.abs(b - a).max():
        return ""
    turns = [W @ np.diag(signs) @ V.T for signs in product((1.0, -1.0), repeat=3)]
    angle = min(np.linalg.norm(rotation_vector(R)) for R in turns if np.linalg.det(R) > 0.0)
    return f"is turned by {np.degrees(angle):.4g} degrees"


def placement_slips(a: Array, b: Array) -> list[str]:
    """What a placement is of another one; both relative to the link before. Shape (4, 4)."""
    found = []
    (R, p), (Q, r) = ((T[:3, :3], T[:3, 3]) for T in (a, b))
    turn = rotation_vector(R)
    if np.abs(Q - R).max() <= LEFT * np.abs(r - p).max():
        found += [f"is {said}" for said in [unit_slip("placement", p, r)] if said]
        if _is(np.zeros(3), r, p):
            found.append("has no position")
    if np.abs(r - p).max() <= LEFT * np.abs(Q - R).max():
        if _is(R.T, Q, R):
            found.append("has its rotation transposed")
        if _is(np.eye(3), Q, R):
            found.append("has no rotation")
        if said := unit_slip("angle", turn, rotation_vector(Q)):
            found.append(f"has its angles {said}")
    return found


def gravity_slips(a: Array, b: Array) -> list[str]:
    """What gravity is of another one. Shape (3,)."""
    found = [f"is {said}" for said in [unit_slip("gravity", a, b)] if said]
    if not b.any():
        found.append("is left out")
    one, two = np.linalg.norm(a), np.linalg.norm(b)
    if not found and abs(one - two) <= LEFT * np.abs(b - a).max():
        found.append(f"is turned by {np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)):.4g} degrees")
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Value:
    """One property in both models.

    Attributes:
        item: Link, body or joint, in B's name; empty for the model.
        what: Property.
        a, b: In A and in B, in a frame of B: that of the link of mass properties.
    """

    item: str
    what: str
    a: Array
    b: Array


@dataclass(frozen=True, slots=True, eq=False)
class Edit:
    """What would make B's file of A's.

    Attributes:
        name: In words: what of which part.
        differences: Numbers of those that it makes.
        slips: What B's value would be made from A's by, if it is a slip of convention or unit; any of them.
        values: What it changes.
    """

    name: str
    differences: tuple[int, ...]
    slips: tuple[str, ...] = ()
    values: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Files:
    """The files of two models, where they are known and can be put beside their readings."""

    a: Opened | None = None
    b: Opened | None = None


def edits(differences: Sequence[Difference], b: Reading, files: Files | None = None) -> list[Edit]:
    """All that B's file would be changed by, link by link where bodies are several.

    Args:
        differences: Static ones between A and B.
        b: The reading that their changes are of.
    """
    found, files = list[Edit](), files or Files()
    real = {i: (d, d.change) for i, d in enumerate(differences) if d.change is not None and d.kind != "digits"}
    for body in dict.fromkeys(change.item for d, change in real.values() if d.what in INERTIAL):
        own = {i: change for i, (d, change) in real.items() if change.item == body and d.what in INERTIAL}
        found += _of_body(own, b, body, files)
    for i, (difference, change) in real.items():
        if difference.what not in INERTIAL:
            found.append(_single(i, difference, change, b, files))
    return found


def _of_body(own: Mapping[int, Change], b: Reading, body: str, files: Files) -> Iterator[Edit]:
    """Of a body: each of its mass properties, or, where it is several links, all of those of links."""
    old, new = of_body(b.bodies[body]), of_body(applied(b, own.values()).bodies[body])
    parts = files.b.parts(body) if files.b else {}
    pairs = _links(files, body, parts, old, new) if files.b and parts else [(body, old, new, {"B": np.eye(3)})]
    if len(parts) > 1:
        yield _together(own, body, pairs)
        return
    ((name, before, after, rotations),) = pairs
    slips, values = _slips(before, after, rotations), _values(name, before, after)
    for i, change in own.items():
        what = change.what
        yield Edit(f"{word(what)} of {body}", (i,), slips[what], (values[what],))


_Pair = tuple[str, Matter, Matter, dict[str, Array]]
"""Name of a link, its matter in B and in A, in its frame, and the orientations in which the models write its tensor."""


def _together(own: Mapping[int, Change], body: str, pairs: Sequence[_Pair]) -> Edit:
    """All mass properties of a body that differ, told by those of its links."""
    names, slips, values = list[str](), list[str](), list[Value]()
    for name, before, after, rotations in pairs:
        step, said = steps_of(before, after), _slips(before, after, rotations)
        which = [what for what in INERTIAL if step[what] > max(1e-13, 1e-6 * max(step.values()))]
        names.append(
            f"{', '.join(word(what) for what in which)} of {name}{'' if name == body else f', fixed to {body}'}"
        )
        slips += [slip for what in which for slip in said[what]]
        values += [_values(name, before, after)[what] for what in which]
    return Edit("; ".join(names), tuple(own), tuple(slips), tuple(values))


def _values(name: str, before: Matter, after: Matter) -> dict[str, Value]:
    return {w: Value(name, w, np.asarray(getattr(after, w)), np.asarray(getattr(before, w))) for w in INERTIAL}


def _links(files: Files, body: str, parts: Mapping[int, Matter], old: Matter, new: Matter) -> list[_Pair]:
    """The links of a body that differ: those that do by both files, else the one that has to change least."""
    file = files.b
    if file is None:
        return []
    T = {i: relative(file.reading.bodies[body].pose, file.links[i].frame) for i in parts}
    twins = {link.name: link for link in files.a.links} if files.a else {}
    theirs = {i: twins[file.links[i].name] for i in parts if file.links[i].name in twins}
    said = {i: displaced(m, T[i]) for i, link in theirs.items() if (m := link.matter) is not None}
    if {*said} == {*parts}:
        whole, scale = reduce(combined, said.values()), max(steps_of(old, new).values())
        changed = {i: max(steps_of(parts[i], said[i], new.mass).values()) for i in parts}
        fits = max(steps_of(whole, new).values()) <= 1e-6 * scale
        chosen = {i: said[i] for i in parts if changed[i] > 1e-6 * max(changed.values())} if fits else {}
    else:
        chosen = {}
    if not chosen:
        chosen = dict([plainest(parts, old, new)])
    pairs = list[_Pair]()
    for i, matter in chosen.items():
        turns = {"B": file.links[i].turn} | ({"A": theirs[i].turn} if i in theirs else {})
        back = relative(T[i], np.eye(4))
        pairs.append((file.links[i].name, displaced(parts[i], back), displaced(matter, back), turns))
    return pairs


def word(what: str) -> str:
    """What a property is called."""
    return NAMES.get(what, what)


def _slips(old: Matter, new: Matter, rotations: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Mass property -> what B's may have been made from A's by."""
    mass = unit_slip("mass", np.asarray(new.mass), np.asarray(old.mass))
    if old.mass == 0.0 < new.mass:
        mass = "left out"
    com = dict.fromkeys(slip for R in rotations.values() for slip in com_slips(new.com, old.com, R))
    return {
        "mass": (f"mass is {mass}",) if mass else (),
        "com": tuple(f"centre of mass {slip}" for slip in com),
        "inertia": tuple(f"inertia {slip}" for slip in tensor_slips(new, old.inertia, rotations)),
    }


def _single(i: int, difference: Difference, change: Change, b: Reading, files: Files) -> Edit:
    """A difference of anything else than mass properties."""
    what, slips, more = difference.what, list[str](), list[Value]()
    if what == "gravity":
        slips = gravity_slips(change.value, downwards(weighed(b)))
        more = _base(change, b) if slips else []
    elif what == "placement":
        slips = placement_slips(*_placements(change, b, files.b))
    elif what in ("limits", "rest", "zero") and difference.a is not None and difference.b is not None:
        slips = [f"is {said}" for said in [unit_slip("angle", difference.a, difference.b)] if said]
    name = f"{word(what)}{f' of {change.item}' if change.item else ''}"
    values = [] if difference.a is None or difference.b is None else [(difference.a, difference.b)]
    noun = "each limit" if what == "limits" else word(what)
    told = [f"{noun} {slip}" for slip in slips]
    if more:
        told.append(f"gravity is that of a base, which carries {', '.join(each.item for each in more)}, that is turned")
    if more and files.b:  # whose placement may be a slip
        frames = [link.frame for link in files.b.links if {each.item for each in more} & {*link.joints}]
        turns = [matrix(np.zeros(3), F[:3, :3]) for F in frames]
        told += [f"placement {slip}" for F in turns for slip in placement_slips(more[0].a @ F, F)]
    return Edit(name, (i,), tuple(told), (*(Value(change.item, what, *pair) for pair in values), *more))


def _base(change: Change, b: Reading) -> list[Value]:
    """Placements of all that stands on the ground, if gravity that points elsewhere is to be that of a turned base."""
    down, other = downwards(weighed(b)), change.value
    if abs(np.linalg.norm(down) - np.linalg.norm(other)) > 1e-9 * np.linalg.norm(down):
        return []
    axis = np.cross(other, down)
    sine, cosine = float(np.linalg.norm(axis)), float(other @ down)
    unit = axis / sine if sine > 0.0 else np.eye(3)[int(np.abs(down).argmin())]
    T = matrix(np.zeros(3), rotation(unit, np.array(np.arctan2(sine, cosine))))
    return [Value(b.bodies[name].joints[0], "placement", T, np.eye(4)) for name in b.roots]


def _placements(change: Change, b: Reading, file: Opened | None) -> tuple[Array, Array]:
    """Of what a joint carries on what is before it, in A and in B. Shape (4, 4) each."""
    after, joint = applied(b, [change]), change.item
    links = [i for i, link in enumerate(file.links) if joint in link.joints] if file else []
    if file and links:
        i, frames = links[0], frames_of(file, after)
        near = file.links[i].near
        return relative(frames[near], frames[i]), relative(file.links[near].frame, file.links[i].frame)
    name = b.moved_by(joint)
    poses = [({n: body.pose for n, body in r.bodies.items()}) for r in (after, b)]
    a, old = (relative(pose.get(b.bodies[name].near, np.eye(4)), pose[name]) for pose in poses)
    return a, old
