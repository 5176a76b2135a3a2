"""The picture of a mechanism: static by projection, and as data for ``stage.js``."""

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
    STANDING,
    Shape,
    differing,
    shapes,
    viewed_from,
)
from screwgauge.problem import spread
from screwgauge.reference.equations.kinematics import length
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.reciprocal import Element, Held, held
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Block, Items, Paragraph, Picture
from screwgauge.report.stage.drawing import WORLD, drawing
from screwgauge.report.stage.motion import Arrow, DrawnMotion, arrows, drawn_motion, home_pose
from screwgauge.report.stage.words import kind, sentences
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution

HELD = 30  # samples at which a platform is asked how it is held, at most
LONGEST = 0.3  # of all arrows of a group, in lengths of the mechanism
TONES = {
    "loads": "#D62728",
    "actuators": DRIVEN,
    "reactions": "#7B5EA7",
    "masses": MASS,
    "axes": AXIS,
    "other": DOUBT,
    "doubts": DOUBT,
}


def stage(
    what: Scene | Mechanism,
    solutions: Mapping[str, Solution] | None = None,
    other: Mechanism | None = None,
    unsigned: Collection[str] = (),
) -> Picture:
    """A mechanism at home, and for pages with scripts in motion.

    Args:
        solutions: Of a run of the scene: whose poses and forces are shown.
        other: What it is compared with: where this one differs at home is drawn, too.
        unsigned: Joints whose axes have no sense of direction in the model, see `differing`.
    """
    motion = drawn_motion(what, solutions or {}) if isinstance(what, Scene) else home_pose(what)
    mechanism = motion.lay.mechanism
    beside = differing(mechanism, other, unsigned) if other else []
    text = json.dumps(data(motion, beside), separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    title = f"{mechanism.title or mechanism.name}: home pose{' and what differs in the other' * bool(other)}"
    return Picture("mechanism", title, drawing(mechanism, beside), stage=text)


def told(picture: Picture) -> list[Block]:
    """What stands beside the picture of a mechanism: what differs in another, how it is held, and what looks odd."""
    found = json.loads(picture.stage)
    odd: list[Block] = [Paragraph("Suspicious, marked by cages:"), Items(tuple(found["doubts"]))]
    there = [shape for shape in found["shapes"] if shape["g"] == "other"]
    moved = dict.fromkeys(shape["n"] for shape in there if shape["k"] != "arrow")
    turned = dict.fromkeys(shape["n"] for shape in there if shape["n"] not in moved)
    lines = (("Elsewhere in the other", moved), ("Axis reversed in the other", turned))
    other = [Paragraph(f"{lead}: {', '.join(names)}.") for lead, names in lines if names]
    return [*other, Items(tuple(found["words"])), *(odd if found["doubts"] else [])]


def data(motion: DrawnMotion, beside: Sequence[Shape] = ()) -> dict[str, Any]:
    """What ``stage.js`` draws, and what is said beside it. Lengths in lengths of the mechanism, from its middle."""
    mechanism, at, unit = motion.lay.mechanism, motion.at, length(motion.lay)
    middle, columns = at.com[0].mean(axis=0), mechanism.independent_columns
    keys, shown, solids = spread(len(motion.t), HELD), arrows(motion), shapes(mechanism)
    found = held(motion.lay, at.rows(keys))
    longest, scales = dict[tuple[str, bool], float](), dict[str, str]()
    for one in shown:
        most, which = float(np.linalg.norm(one.vectors, axis=1).max()), (one.group, one.turns)
        longest[which] = max(longest.get(which, 0.0), most)
    for (group, turns), most in longest.items():
        before = f"{scales[group]}, " if group in scales else "longest: "
        scales[group] = f"{before}{most:.4g} N{' m' * turns}"
    return {
        "title": mechanism.title or mechanism.name,
        "said": motion.source,
        "unit": unit,
        "view": _rounded(viewed_from(mechanism)),
        "t": [float(f"{t:.6g}") for t in motion.t],
        "y": {name: _rounded(at.q[:, i]) for name, i in zip(mechanism.independent, columns, strict=True)},
        "units": [mechanism.units[i] for i in columns],
        "bodies": list(mechanism.body_index),
        "poses": _poses(at.R, (at.p - middle) / unit),
        "shapes": [_shape(one) for one in (*solids, *beside)],
        "legend": _legend(mechanism, solids),
        "tones": TONES,
        "world": WORLD,
        "arrows": [_arrow(one, unit, longest[one.group, one.turns]) for one in shown],
        "scales": scales,
        "keys": keys.tolist(),
        "holds": _holds(found, middle, unit),
        "doubts": [one.name for one in solids if one.group == "doubts"],
        "words": [*sentences(motion.lay, at.rows(keys), found, motion.t[keys]), *_loads(shown)],
    }


def _legend(mechanism: Mechanism, solids: Sequence[Shape]) -> list[tuple[str, str]]:
    """Colours of joints with what they mean, of those that are there."""
    kinds = {one.kind for one in solids if one.group == "joints"}
    driven = "driven joint (turns in the ring)" if "ring" in kinds else "driven joint (slides along its arrows)"
    if {"ring", "arrow"} <= kinds:
        driven = "driven joint (ring: turns; arrows: slides)"
    entries = [(DRIVEN, driven)] * bool(mechanism.actuators) + [(CUT, "cage: cut joint, closes a loop")] * (
        "cage" in kinds
    )
    return [*entries, *[(STANDING, "foot: fixed to ground")] * ("foot" in kinds)]


def _loads(found: Sequence[Arrow]) -> list[str]:
    """Loads that the scene puts on bodies, with how large they get; weights are no arrows."""
    loads = [one for one in found if one.group == "loads"]
    each = [
        f"{'a moment' if one.turns else 'a force'} on {one.name.removeprefix('load on ')}, {_range(one)}"
        for one in loads
    ]
    return [f"Loads of the scene besides gravity: {'; '.join(each)}."] if each else []


def _range(one: Arrow) -> str:
    """How large a force is over the motion."""
    sizes = np.linalg.norm(one.vectors, axis=1)
    low, high, unit = f"{sizes.min():.4g}", f"{sizes.max():.4g}", f"N{' m' * one.turns}"
    return f"{high} {unit} throughout" if low == high else f"{low} to {high} {unit}"


def _rounded(array: Array, digits: int = 4) -> list[Any]:
    return list((np.round(array, digits) + 0.0).tolist())


def _poses(R: Array, p: Array) -> list[list[float]]:
    """At each sample position and quaternion (w, x, y, z) of each body, one after the other."""
    return _rounded(np.concatenate([p, quaternion(R)], axis=2).reshape(len(R), -1))


def _shape(one: Shape) -> dict[str, Any]:
    a, b = _rounded(one.a), _rounded(one.b.T.ravel())
    values = (one.group, one.kind, one.body, one.other, a, b, round(one.size, 4), one.colour, one.name)
    return dict(zip("gkijabrcn", values, strict=True))


def _arrow(one: Arrow, unit: float, longest: float) -> dict[str, Any]:
    point, vectors = _rounded(one.point / unit), _rounded((one.vectors * LONGEST / longest).ravel(), 3)
    values = (one.group, one.name, TONES[one.group], int(one.turns), one.body, point, vectors)
    return dict(zip("gncmipv", values, strict=True))


def _holds(found: Sequence[Held], middle: Array, unit: float) -> list[dict[str, Any]]:
    """Wrenches of legs and twists left at some samples: point, direction and `kind` of each element, one by one."""

    def row(system: Sequence[Element], k: int) -> list[float]:
        if k >= len(system):
            return [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1]
        return [*_rounded((system[k].point - middle) / unit, 3), *_rounded(system[k].direction, 3), kind(system[k])]

    first, out = found[0], list[dict[str, Any]]()
    parts = [("wrenches", leg.name, COLOURS[i % len(COLOURS)]) for i, leg in enumerate(first.legs)]
    for i, (group, name, colour) in enumerate([*parts, ("freedoms", first.body, "#777777")]):
        systems = [(*one.wrenches, one.twists)[i] for one in found]
        for k in range(max(map(len, systems))):
            out.append({"g": group, "n": name, "c": colour, "w": [x for s in systems for x in row(s, k)]})
    return out
