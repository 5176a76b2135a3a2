"""Ladders of what a solver should take in its stride: masses, size and inertia of the bodies, speed, load."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from screwgauge.models.catalog import load_mechanism, mechanism_tables
from screwgauge.reference.applied import Load
from screwgauge.reference.expressions import number
from screwgauge.reference.mechanism import KINDS
from screwgauge.scene.read import load_scene
from screwgauge.study.cases.asking import SCENE, compare, exactly, moving, still
from screwgauge.study.cases.case import Ask
from screwgauge.study.cases.question import Question

#: Moments of the platform as a plate and of a leg half as a rod [kg m^2], about those of the paper.
PLATE, ROD = 0.46, 1.16e-2
#: Directions of rates, and of accelerations, the larger component being one.
_RATE = np.array([[1.0, -0.6], [0.5, -1.0], [-0.3, 1.0]])
_ACCELERATION = np.array([[0.4, 1.0], [-1.0, 0.2], [1.0, -0.5]])
#: Force [N] and moment [N m] at the platform's centre of mass, the largest component being one.
_FORCE, _TORQUE = np.array([0.3, -0.2, 1.0]), np.array([1.0, 0.1, -0.2])

Tables = dict[str, Any]


def of_bodies(change: Callable[[Tables, float], None]) -> Ask:
    """A ladder of the default scene without its load, the tables of its mechanism changed in place.

    The change is written as a description, from which every engine's own model file is made as usual.
    """

    @wraps(change)
    def ask(severity: float, quick: bool, folder: Path) -> Iterator[Question]:
        tables, path = mechanism_tables(SCENE), folder / f"{SCENE}.toml"
        change(tables, severity)
        path.write_text(tomli_w.dumps(tables), encoding="utf-8")
        scene = replace(load_scene(SCENE), mechanism=load_mechanism(path), mechanism_file=path).under(loads=())
        yield compare(moving(scene, quick), folder)

    return ask


def speed(w: float, quick: bool, folder: Path) -> Iterator[Question]:
    """From rest to where centrifugal forces are a million times the weight."""
    scene = moving(load_scene(SCENE), quick)
    y, n = scene.motion.y, len(scene.motion)
    yield compare(still(scene, y, w * _RATE[:n], w**2 * _ACCELERATION[:n]), folder)


def load(size: float, quick: bool, folder: Path) -> Iterator[Question]:
    """From no load to the weight of a mountain."""
    loads = (Load("platform", None, size * _FORCE, size * _TORQUE),)
    yield compare(moving(load_scene(SCENE).under(loads=loads), quick), folder)


def _times(texts: list[Any], factor: float) -> list[str]:
    """Numbers of a description, which may be text, times a factor."""
    return [exactly(number(text, "description") * factor) for text in texts]


def _scale(body: Tables, mass: float, inertia: float) -> None:
    (body["mass"],) = _times([body["mass"]], mass)
    body["inertia"] = dict(zip(body["inertia"], _times([*body["inertia"].values()], inertia), strict=True))


@of_bodies
def mass_ratio(tables: Tables, ratio: float) -> None:
    for name, body in tables["bodies"].items():
        if name.startswith("leg"):
            _scale(body, ratio, ratio)


@of_bodies
def scale(tables: Tables, s: float) -> None:
    for body in tables["bodies"].values():
        _scale(body, s**3, s**5)
        body["com"] = _times(body["com"], s)
    for joint in tables["joints"].values():
        for frame in (joint[key] for key in ("parent_frame", "child_frame") if key in joint):
            frame["position"] = _times(frame["position"], s)
        if KINDS[joint["kind"]] == (False,):  # it slides
            joint["home"] = _times(joint["home"], s)


@of_bodies
def inertia_anisotropy(tables: Tables, e: float) -> None:
    for name, body in tables["bodies"].items():
        if name.startswith("leg"):
            moments, axis = (ROD, ROD, ROD * e), ["3/7", "2/7", "-6/7"]
        else:
            moments, axis = (PLATE * (1.0 + e), PLATE, 2.0 * PLATE), ["6/7", "2/7", "3/7"]
        body["inertia"] = dict(zip(("xx", "yy", "zz"), map(exactly, moments), strict=True))
        body["inertia_rotation"] = {"axis": axis, "angle": "0.4"}
