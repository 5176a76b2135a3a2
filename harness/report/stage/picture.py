"""The picture of a mechanism: static by projection, and as data for ``stage.js``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import length
from screwgauge.reference.reciprocal import Element, Held, held
from screwgauge.reference.rotations import Array
from screwgauge.report.blocks import Picture
from screwgauge.report.stage.drawing import drawing, viewed_from
from screwgauge.report.stage.motion import Arrow, Motion, arrows, followed, still
from screwgauge.report.stage.shapes import COLOURS, DRIVEN, KINDS, Shape, cut_joints, shapes
from screwgauge.report.stage.words import sentences
from screwgauge.scene.scene import Scene
from screwgauge.solution import Solution

SCRIPT = Path(__file__).with_name("stage.js")
HELD = 30  # samples at which a platform is asked how it is held, at most
LONGEST = 0.3  # of all arrows of forces, in lengths of the mechanism
TONES = {"loads": "#D62728", "actuators": DRIVEN, "reactions": "#7B5EA7"}


def stage(what: Scene | Mechanism, solutions: Mapping[str, Solution] | None = None) -> Picture:
    """A mechanism at home, and for pages with scripts in motion.

    Args:
        solutions: Of a run of the scene: whose poses and forces are shown.
    """
    scene, mechanism = (what, what.mechanism) if isinstance(what, Scene) else (None, what)
    motion = followed(scene, solutions or {}) if scene else still(mechanism)
    title = mechanism.title or mechanism.name
    text = json.dumps(data(motion), separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return Picture("mechanism", f"{title}: home pose", drawing(mechanism), stage=text.replace("</", "<\\/"))


def data(motion: Motion) -> dict[str, Any]:
    """What ``stage.js`` draws. Lengths in lengths of the mechanism, from its middle."""
    mechanism, at, unit = motion.lay.mechanism, motion.at, length(motion.lay)
    points = at.p[0, 1:] + np.einsum("bij,bj->bi", at.R[0, 1:], np.array([body.com for body in mechanism.bodies]))
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    columns = mechanism.independent_columns
    keys = np.unique(np.linspace(0, len(motion.t) - 1, min(HELD, len(motion.t))).round().astype(int))
    found = held(motion.lay, at.rows(keys))
    shown = arrows(motion)
    driven = {joint.name for joint in mechanism.actuators}
    return {
        "title": mechanism.title or mechanism.name,
        "said": motion.said,
        "unit": unit,
        "view": _rounded(viewed_from(mechanism)),
        "t": [float(f"{t:.6g}") for t in motion.t],
        "y": {name: _rounded(at.q[:, i]) for name, i in zip(mechanism.independent, columns, strict=True)},
        "units": [mechanism.units[i] for i in columns],
        "bodies": list(mechanism.body_index),
        "joints": {
            j.name: [KINDS[j.kind], j.name in driven, j.name in cut_joints(mechanism)] for j in mechanism.joints
        },
        "poses": [_poses(R, (p - middle) / unit) for R, p in zip(at.R, at.p, strict=True)],
        "shapes": [_shape(one) for one in shapes(mechanism)],
        "arrows": _arrows(shown, unit),
        "scales": _scales(shown),
        "keys": keys.tolist(),
        "holds": _holds(found, middle, unit),
        "words": sentences(motion.lay, at.rows(keys), found, motion.t[keys]),
    }


def _rounded(array: Array, digits: int = 4) -> list[Any]:
    return list((np.round(array, digits) + 0.0).tolist())


def _poses(R: Array, p: Array) -> list[float]:
    """Position and quaternion (x, y, z, w) of each body, one after the other."""
    return [x for turn, at in zip(R, p, strict=True) for x in _rounded(np.concatenate([at, _quaternion(turn)]))]


def _quaternion(R: Array) -> Array:
    """Unit quaternion (x, y, z, w): the dominant eigenvector of Bar-Itzhack's matrix (J. Guidance 23 (2000) 1085)."""
    d, (a, b, c) = np.diag(R), (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    K = np.zeros((4, 4))
    K[:3, :3] = R + R.T - np.eye(3) * d.sum()
    K[3, :3] = K[:3, 3] = a, b, c
    K[3, 3] = d.sum()
    return np.asarray(np.linalg.eigh(K)[1][:, -1])


def _shape(one: Shape) -> dict[str, Any]:
    a, b = _rounded(one.a), _rounded(one.b.T.ravel())
    entry = {"g": one.group, "k": one.kind, "i": one.body, "a": a, "b": b, "r": round(one.size, 4), "c": one.colour}
    return {**entry, "n": one.name, **({"j": one.other} if one.kind == "slide" else {})}


def _longest(shown: list[Arrow], turns: bool, group: str) -> float:
    return max(
        (float(np.linalg.norm(a.vectors, axis=1).max()) for a in shown if (a.turns, a.group) == (turns, group)),
        default=0.0,
    )


def _arrows(shown: list[Arrow], unit: float) -> list[dict[str, Any]]:
    return [
        {
            "g": one.group, "n": one.name, "c": TONES[one.group], "i": one.body, "p": _rounded(one.point / unit),
            "m": int(one.turns), "v": _rounded((one.vectors * LONGEST / _longest(shown, one.turns, one.group)).ravel(), 3),
        }
        for one in shown
    ]  # fmt: skip


def _scales(shown: list[Arrow]) -> dict[str, str]:
    """What the longest arrow of each group stands for."""
    said: dict[str, list[str]] = {}
    for group, turns in dict.fromkeys((one.group, one.turns) for one in shown):
        said.setdefault(group, []).append(f"{_longest(shown, turns, group):.4g} N{' m' * turns}")
    return {group: "longest: " + ", ".join(texts) for group, texts in said.items()}


def _holds(found: tuple[Held, ...], middle: Array, unit: float) -> list[dict[str, Any]]:
    """Wrenches of legs and twists left, at some samples: point, direction, and 0 line, 1 direction alone, 2 screw."""
    first = found[0]
    systems = [
        ("wrenches", leg.name, COLOURS[i % 6], [one.wrenches[i] for one in found]) for i, leg in enumerate(first.legs)
    ]
    systems.append(("freedoms", first.body, "#111111", [one.twists for one in found]))

    def row(one: Element | None) -> list[float]:
        if one is None:
            return [0.0] * 6 + [-1]
        kind = 0 if one.pitch == 0.0 else 1 if np.isinf(one.pitch) else 2
        return [*_rounded((one.point - middle) / unit, 3), *_rounded(one.direction, 3), kind]

    return [
        {"g": group, "n": name, "c": colour, "w": [x for one in along for x in row(one[k] if k < len(one) else None)]}
        for group, name, colour, along in systems
        for k in range(max(map(len, along)))
    ]
