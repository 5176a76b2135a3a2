"""Picture of a mechanism: a projection, data for ``stage.js``, and a description of the constraints."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from screwgauge.models.formats import quaternion
from screwgauge.models.shapes import (
    AXIS,
    COLOURS,
    CUT,
    DOUBT,
    DRIVEN,
    MASS,
    SPRING,
    STANDING,
    Shape,
    differences,
    shapes,
    springs,
    viewed_from,
)
from screwgauge.problem import spread
from screwgauge.reference.equations.kinematics import length
from screwgauge.reference.errors import first_few
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.reciprocal import Held, ScrewElement, idle_forces, normal_of_plane, supports
from screwgauge.reference.rigid import without_fixed_joints
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Block, Items, Picture, Text
from screwgauge.report.stage.drawing import WORLD, drawing
from screwgauge.report.stage.motion import Arrow, DrawnMotion, arrows, drawn_motion, home_pose
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.formatting import join_all

SPRINGS = 8  # number of springs named in a sentence
HELD = 30  # largest number of samples at which the constraints of a platform are computed
LONGEST = 0.3  # length of the longest arrow of a group, in lengths of the mechanism
TONES = {
    "loads": "#D62728",
    "actuators": DRIVEN,
    "reactions": "#7B5EA7",
    "masses": MASS,
    "springs": SPRING,
    "axes": AXIS,
    "other": DOUBT,
    "doubts": DOUBT,
}
NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
#: Nouns for the elements of each `_kind`, prepositions for a line and a direction, and a phrase for all six together.
WRENCHES = ("force", "couple", "wrench", "along", "about", "every force and couple")
TWISTS = ("rotation", "translation", "screw", "about", "along", "all six freedoms")


def stage(
    what: Scene | Mechanism,
    solutions: Mapping[str, Solution] | None = None,
    other: Mechanism | None = None,
    unsigned: Collection[str] = (),
) -> Picture:
    """Draw a mechanism in the home pose, and in motion on pages with scripts.

    Args:
        solutions: Solutions of the scene, whose poses and forces are shown.
        other: Mechanism for comparison; its differences in the home pose are also drawn.
        unsigned: Joints whose axes have no sense of direction in the model, see `differences`.
    """
    motion = drawn_motion(what, solutions or {}) if isinstance(what, Scene) else home_pose(what)
    mechanism = motion.lay.mechanism
    other_shapes = differences(mechanism, other, unsigned) if other else []
    coils = springs(mechanism, what.applied.springs) if isinstance(what, Scene) else []
    text = json.dumps(data(motion, [*coils, *other_shapes]), separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    title = f"{mechanism.title or mechanism.name}: home pose{', with differences of the other mechanism' * bool(other)}"
    idle = [one.label for one in what.undriven] if isinstance(what, Scene) else []
    return Picture("mechanism", title, drawing(mechanism, other_shapes, coils, idle), stage=text)


def remarks(picture: Picture) -> list[Block]:
    """Return remarks on a picture: differences between two mechanisms, constraints, and suspicious entries."""
    shown = json.loads(picture.stage)
    odd: list[Block] = [Text("Suspicious, marked by cages:"), Items(tuple(shown["doubts"]))]
    there = [shape for shape in shown["shapes"] if shape["g"] == "other"]
    moved = dict.fromkeys(shape["n"] for shape in there if shape["k"] != "arrow")
    turned = dict.fromkeys(shape["n"] for shape in there if shape["n"] not in moved)
    lines = (("At a different place in the second mechanism", moved), ("Axis reversed in the second mechanism", turned))
    other = [Text(f"{lead}: {', '.join(names)}.") for lead, names in lines if names]
    return [*other, Items(tuple(shown["words"])), *(odd if shown["doubts"] else [])]


def data(motion: DrawnMotion, more: Sequence[Shape] = ()) -> dict[str, Any]:
    """Build the input of ``stage.js``, with remarks; positions are relative to the centre, in mechanism lengths.

    Args:
        more: Springs, and shapes of a second mechanism.
    """
    mechanism, at, unit = motion.lay.mechanism, motion.at, length(motion.lay)
    middle, columns = at.com[0].mean(axis=0), mechanism.independent_columns
    keys, shown, solids = spread(len(motion.t), HELD), arrows(motion), shapes(mechanism)
    q = motion.q[:, mechanism.columns(mechanism.moving)]
    holding = supports(layout(without_fixed_joints(mechanism)), q[keys])
    longest, scales = dict[tuple[str, bool], float](), dict[str, str]()
    for one in shown:
        most, which = float(np.linalg.norm(one.vectors, axis=1).max()), (one.group, one.turns)
        longest[which] = max(longest.get(which, 0.0), most)
    for (group, turns), most in longest.items():
        before = f"{scales[group]}, " if group in scales else "longest drawn: "
        scales[group] = f"{before}{most:.4g} N{' m' * turns}"
    return {
        "title": mechanism.title or mechanism.name,
        "said": motion.source,
        "unit": unit,
        "view": _round(viewed_from(mechanism)),
        "t": [float(f"{t:.6g}") for t in motion.t],
        "y": {name: _round(motion.q[:, i]) for name, i in zip(mechanism.independent, columns, strict=True)},
        "units": [mechanism.units[i] for i in columns],
        "bodies": list(mechanism.body_index),
        "poses": _poses(at.R, (at.p - middle) / unit),
        "shapes": [_shape(one) for one in (*solids, *more)],
        "legend": _legend(mechanism, solids),
        "tones": TONES,
        "world": WORLD,
        "arrows": [_arrow(one, unit, longest[one.group, one.turns]) for one in shown],
        "scales": scales,
        "keys": keys.tolist(),
        "holds": _holds(holding, middle, unit),
        "doubts": [one.name for one in solids if one.group == "doubts"],
        "words": [*_sentences(motion, holding, motion.t[keys]), *_loads(shown), *_springs(more)],
    }


def _legend(mechanism: Mechanism, solids: Sequence[Shape]) -> list[tuple[str, str]]:
    """Return the colours that occur, with their meanings."""
    kinds = {one.kind for one in solids if one.group == "joints"}
    driven = "driven joint (turns in the ring)" if "ring" in kinds else "driven joint (slides along its arrows)"
    if {"ring", "arrow"} <= kinds:
        driven = "driven joint (ring: turns; arrows: slides)"
    entries = [(DRIVEN, driven)] * bool(mechanism.actuators) + [(CUT, "cage: cut joint, closes a loop")] * (
        "cage" in kinds
    )
    entries += [(STANDING, "foot: fixed to ground")] * ("foot" in kinds)
    odd = any(one.group == "doubts" for one in solids)
    return [*entries, *[(DOUBT, "cage: suspicious, see below")] * odd]


def _loads(shown: Sequence[Arrow]) -> list[str]:
    """Describe the loads on bodies and their magnitudes; weights are omitted."""
    loads = [one for one in shown if one.group == "loads"]
    each = [
        f"{'a moment' if one.turns else 'a force'} on {one.name.removeprefix('load on ')}, {_range(one)}"
        for one in loads
    ]
    return [f"Loads of the scene besides gravity: {'; '.join(each)}."] if each else []


def _springs(more: Sequence[Shape]) -> list[str]:
    names = [one.name.removeprefix("spring ") for one in more if one.group == "springs" and one.name]
    return [f"Springs and dampers of the scene: {first_few(names, SPRINGS, '; ')}."] if names else []


def _range(one: Arrow) -> str:
    """Format the range of a force's magnitude over the motion."""
    sizes = np.linalg.norm(one.vectors, axis=1)
    low, high, unit = f"{sizes.min():.4g}", f"{sizes.max():.4g}", f"N{' m' * one.turns}"
    return f"{high} {unit} throughout" if low == high else f"{low} to {high} {unit}"


def _round(array: Array, digits: int = 4) -> list[Any]:
    return list((np.round(array, digits) + 0.0).tolist())


def _poses(R: Array, p: Array) -> list[list[float]]:
    """Return positions and quaternions (w, x, y, z) of each body, concatenated, at each sample."""
    return _round(np.concatenate([p, quaternion(R)], axis=2).reshape(len(R), -1))


def _shape(one: Shape) -> dict[str, Any]:
    a, b = _round(one.a), _round(one.b.T.ravel())
    values = (one.group, one.kind, one.body, one.other, a, b, round(one.size, 4), one.colour, one.name)
    return dict(zip("gkijabrcn", values, strict=True))


def _arrow(one: Arrow, unit: float, longest: float) -> dict[str, Any]:
    point, vectors = _round(one.point / unit), _round((one.vectors * LONGEST / longest).ravel(), 3)
    values = (one.group, one.name, TONES[one.group], int(one.turns), one.body, point, vectors)
    return dict(zip("gncmipv", values, strict=True))


def _holds(holding: Sequence[Held], middle: Array, unit: float) -> list[dict[str, Any]]:
    """Return leg wrenches and remaining twists at selected samples: their points, directions and kinds, flattened."""

    def row(system: Sequence[ScrewElement], k: int) -> list[float]:
        if k >= len(system):
            return [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1]
        return [*_round((system[k].point - middle) / unit, 3), *_round(system[k].direction, 3), _kind(system[k])]

    first, out = holding[0], list[dict[str, Any]]()
    parts = [("wrenches", leg.name, COLOURS[i % len(COLOURS)]) for i, leg in enumerate(first.legs)]
    for i, (group, name, colour) in enumerate([*parts, ("freedoms", first.body, "#777777")]):
        systems = [(*one.wrenches, one.twists)[i] for one in holding]
        for k in range(max(map(len, systems))):
            out.append({"g": group, "n": name, "c": colour, "w": [x for s in systems for x in row(s, k)]})
    return out


def _kind(one: ScrewElement) -> int:
    """Return the kind of pitch: 0 for zero, 1 for infinite, 2 for finite nonzero pitch."""
    return 0 if one.pitch == 0.0 else 1 if np.isinf(one.pitch) else 2


def _sentences(motion: DrawnMotion, holding: Sequence[Held], t: Array) -> list[str]:
    """Describe the legs' constraints, remaining freedoms, actuator redundancy, and their changes during the motion.

    Args:
        holding: Constraints at selected samples; only the first sample, the start of the motion, is described in
            detail.
        t: Times of these samples [s].
    """
    lay, at, first, mechanism = motion.lay, motion.at, holding[0], motion.lay.mechanism
    joints = [joint for joint in mechanism.joints if joint.constrains and joint.angles]
    places = {joint.name: at.joint(joint).p_child[0] for joint in joints}
    rigid = without_fixed_joints(mechanism)
    sides = [side for joint in rigid.joints for side in joint.bodies]
    tips = sum(sides.count(body.name) == 1 for body in rigid.bodies)
    text = [f"An open tree with {tips} ends; {first.body} is the farthest end."] if tips > 1 and not lay.cuts else []
    normal = normal_of_plane(at.S[0, mechanism.columns(mechanism.moving)])
    text += filter(None, [_constraints(first, places, normal)])
    text.append(f"Remaining freedoms of {first.body}: {_screws(first.twists, TWISTS, places)}.")
    if (n := first.overconstraints) and normal is not None and n == 3 * (len(first.legs) - 1):
        each = "leg" if _has_legs(first) else "chain"
        text.append(
            f"Each {each} by itself keeps {first.body} in the plane, so that {_count(n, 'constraint')} are redundant."
        )
    elif n:
        text.append(f"{_count(n, 'of these', '').capitalize()} constraints {'is' if n == 1 else 'are'} redundant.")
    if n := idle_forces(lay, motion.q[:1]).shape[1]:
        freedoms = _count(len(mechanism.independent), "degree of freedom", "degrees of freedom", whole=True)
        idle = "does no work and only preloads" if n == 1 else "do no work and only preload"
        text.append(
            f"{len(mechanism.actuator_names)} actuators for {freedoms}: {_count(n, 'combination')} of their forces"
            f" {idle} the mechanism, so that a rule has to choose {'it' if n == 1 else 'them'}."
        )
    kinds = [[[*map(_kind, system)] for system in (*one.wrenches, one.twists)] for one in holding]
    if changes := [f"{t[k]:.3g} s" for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]]:
        times = ", ".join(changes[:3]) + ", ..." * (len(changes) > 3)
        text.append(f"The first pose is described; the kind or number of constraints changes near t = {times}.")
    elif len(kinds) > 1:
        samples = f"all {len(kinds)} samples tried"
        text.append(f"Points and directions are those of the first pose; kinds are the same at {samples}.")
    return text


def _constraints(first: Held, places: Mapping[str, Array], normal: Array | None) -> str:
    """Describe each leg's constraint forces and couples on a body; legs with equal constraints share a clause.

    For planar mechanisms (`normal` of the plane), only forces and couples that act in the plane are listed.
    """
    if not first.legs:
        return f"Nothing constrains {first.body}."
    alike: dict[str, list[str]] = {}
    for leg, system in zip(first.legs, first.wrenches, strict=True):
        acting = [one for one in system if normal is None or _acts_in_plane(one, normal)]
        alike.setdefault(_screws(acting, WRENCHES, places), []).append(leg.name + f" ({leg.kinds})" * bool(leg.kinds))
    if [*alike] == ["none"] and len(first.legs) == 1:  # e.g. the hand of an arm with six joints or more
        return ""
    clauses = [f"{join_all(names)}: {what}" for what, names in alike.items()]
    plane = "" if normal is None else f" in the plane normal to {_way(normal)}"
    lead = f"Constraint forces on {first.body} from each leg{plane}"
    if not _has_legs(first):
        lead = f"Constraint forces on {first.body}{plane}" + ", by chain of joints" * (len(first.legs) > 1)
    return f"{lead}: {'; '.join(clauses)}."


def _has_legs(first: Held) -> bool:
    """Return True for a platform on named legs, as opposed to a link with paths to ground."""
    names = {joint.name for leg in first.legs for joint in leg.joints}
    return len(first.legs) > 1 and any(leg.name not in names and " to " not in leg.name for leg in first.legs)


def _acts_in_plane(one: ScrewElement, normal: Array) -> bool:
    """Return True for a force in the plane, or for a couple about its normal."""
    along = abs(float(one.direction @ normal))
    return along > 0.5 if _kind(one) == 1 else along < 0.5


def _screws(system: Sequence[ScrewElement], nouns: tuple[str, ...], places: Mapping[str, Array]) -> str:
    """Describe a system of screws, such as ``two rotations through s, about x and y``."""
    force, couple, wrench, along, about, all_six = nouns
    lines, ways, screws = ([one for one in system if _kind(one) == k] for k in range(3))
    parts, many = [], _count(len(lines), force)
    if len(lines) > 1 and all(np.allclose(one.point, lines[0].point, rtol=0.0, atol=1e-9) for one in lines):
        directions = f", {along} {join_all([_way(one.direction) for one in lines])}" if len(lines) == 2 else ""
        parts.append(f"{many} through {_place(lines[0], places)}{directions}")
    elif lines:
        each = [f"{_way(one.direction)} through {_place(one, places)}" for one in lines]
        parts.append(f"{many} {along} {join_all(each)}")
    for one in screws:
        pitch = f"{1e3 * one.pitch:.3g} mm/rad"
        parts.append(f"a {wrench} about {_way(one.direction)} through {_place(one, places)} of {pitch}")
    if ways:
        directions = "every axis" if len(ways) == 3 else join_all([_way(one.direction) for one in ways])
        parts.append(f"{_count(len(ways), couple)} {about} {directions}")
    return all_six if len(system) == 6 else join_all(parts) if parts else "none"


def _count(n: int, what: str, plural: str = "s", *, whole: bool = False) -> str:
    return f"{NUMBERS[n] if n < len(NUMBERS) else n} {what if n == 1 else plural if whole else what + plural}"


def _way(direction: Array) -> str:
    k = int(np.argmax(np.abs(direction)))
    return "xyz"[k] if abs(direction[k]) > 1.0 - 1e-9 else _vector(direction)


def _vector(v: Array) -> str:
    return f"({', '.join(f'{x:.3g}' if abs(x) > 5e-7 else '0' for x in v)})"


def _place(one: ScrewElement, places: Mapping[str, Array]) -> str:
    """Return the name of the joint at the point, or else the coordinates of the point."""
    near = [name for name, there in places.items() if np.abs(one.point - there).max() < 1e-6]
    return near[0] if near else f"{_vector(one.point)} m"
