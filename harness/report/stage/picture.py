"""The picture of a mechanism: static by projection, and as data for ``stage.js``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from screwgauge.models.placement import quaternion
from screwgauge.models.shapes import COLOURS, DRIVEN, Shape, differing, shapes
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import length
from screwgauge.reference.reciprocal import Held, held
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Block, Items, Paragraph, Picture
from screwgauge.report.stage.drawing import drawing, viewed_from
from screwgauge.report.stage.words import kind, sentences
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution
from screwgauge.study.motion import Arrow, Motion, arrows, few, followed, still

HELD = 30  # samples at which a platform is asked how it is held, at most
LONGEST = 0.3  # of all arrows of a group, in lengths of the mechanism
TONES = {"loads": "#D62728", "actuators": DRIVEN, "reactions": "#7B5EA7"}


def stage(
    what: Scene | Mechanism, solutions: Mapping[str, Solution] | None = None, other: Mechanism | None = None
) -> Picture:
    """A mechanism at home, and for pages with scripts in motion.

    Args:
        solutions: Of a run of the scene: whose poses and forces are shown.
        other: What it is compared with: where this one differs at home is drawn, too.
    """
    motion = followed(what, solutions or {}) if isinstance(what, Scene) else still(what)
    mechanism = motion.lay.mechanism
    beside = differing(mechanism, other) if other else []
    text = json.dumps(data(motion, beside), separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    title = f"{mechanism.title or mechanism.name}: home pose{' and what differs in the other' * bool(other)}"
    return Picture("mechanism", title, drawing(mechanism, beside), stage=text)


def told(picture: Picture) -> list[Block]:
    """What stands beside the picture of a mechanism: how it is held, and what looks odd."""
    found = json.loads(picture.stage)
    odd = [Paragraph("Suspicious, marked by cages:"), Items(tuple(found["doubts"]))] if found["doubts"] else []
    return [Items(tuple(found["words"])), *odd]


def data(motion: Motion, beside: Sequence[Shape] = ()) -> dict[str, Any]:
    """What ``stage.js`` draws, and what is said beside it. Lengths in lengths of the mechanism, from its middle."""
    mechanism, at, unit = motion.lay.mechanism, motion.at, length(motion.lay)
    points = at.p[0, 1:] + np.einsum("bij,bj->bi", at.R[0, 1:], np.array([body.com for body in mechanism.bodies]))
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    columns, keys = mechanism.independent_columns, few(np.arange(len(motion.t)), HELD)
    found, shown = held(motion.lay, at.rows(keys)), arrows(motion)
    solids, longest = shapes(mechanism), dict[tuple[str, bool], float]()
    for one in shown:
        key = one.group, one.turns
        longest[key] = max(longest.get(key, 0.0), float(np.linalg.norm(one.vectors, axis=1).max()))
    scales: dict[str, str] = {}
    for (group, turns), most in longest.items():
        scales[group] = f"{scales.get(group, 'longest:')}{',' * (group in scales)} {most:.4g} N{' m' * turns}"
    return {
        "title": mechanism.title or mechanism.name,
        "said": motion.said,
        "unit": unit,
        "view": _rounded(viewed_from(mechanism)),
        "t": [float(f"{t:.6g}") for t in motion.t],
        "y": {name: _rounded(at.q[:, i]) for name, i in zip(mechanism.independent, columns, strict=True)},
        "units": [mechanism.units[i] for i in columns],
        "bodies": list(mechanism.body_index),
        "poses": [_poses(R, (p - middle) / unit) for R, p in zip(at.R, at.p, strict=True)],
        "shapes": [_shape(one) for one in (*solids, *beside)],
        "arrows": [_arrow(one, unit, longest[one.group, one.turns]) for one in shown],
        "scales": scales,
        "keys": keys.tolist(),
        "holds": _holds(found, middle, unit),
        "doubts": [one.name for one in solids if one.group == "doubts"],
        "words": sentences(motion.lay, at.rows(keys), found, motion.t[keys]),
    }


def _rounded(array: Array, digits: int = 4) -> list[Any]:
    return list((np.round(array, digits) + 0.0).tolist())


def _poses(R: Array, p: Array) -> list[float]:
    """Position and quaternion (w, x, y, z) of each body, one after the other."""
    return [x for turn, at in zip(R, p, strict=True) for x in _rounded(np.concatenate([at, quaternion(turn)]))]


def _shape(one: Shape) -> dict[str, Any]:
    ends = {"a": _rounded(one.a), "b": _rounded(one.b.T.ravel())}
    return {
        "g": one.group,
        "k": one.kind,
        "i": one.body,
        "j": one.other,
        **ends,
        "r": round(one.size, 4),
        "c": one.colour,
        "n": one.name,
    }


def _arrow(one: Arrow, unit: float, longest: float) -> dict[str, Any]:
    vectors = _rounded((one.vectors * LONGEST / longest).ravel(), 3)
    start = {"i": one.body, "p": _rounded(one.point / unit)}
    return {"g": one.group, "n": one.name, "c": TONES[one.group], "m": int(one.turns), **start, "v": vectors}


def _holds(found: Sequence[Held], middle: Array, unit: float) -> list[dict[str, Any]]:
    """Wrenches of legs and twists left at some samples: point, direction and `kind` of each element, one by one."""
    out = []
    for i, leg in enumerate((*found[0].legs, None)):
        systems = [one.twists if leg is None else one.wrenches[i] for one in found]
        told = (
            ("freedoms", found[0].body, "#777777") if leg is None else ("wrenches", leg.name, COLOURS[i % len(COLOURS)])
        )
        for k in range(max(map(len, systems))):
            rows = [
                [*_rounded((s[k].point - middle) / unit, 3), *_rounded(s[k].direction, 3), kind(s[k])]
                if k < len(s)
                else [0] * 6 + [-1]
                for s in systems
            ]
            out.append({**dict(zip("gnc", told, strict=True)), "w": [x for row in rows for x in row]})
    return out
