"""Ladders of what a solver should take in its stride: masses, size and inertia of the bodies, speed, load."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from screwgauge.reference.applied import Load
from screwgauge.scene.read import load_scene
from screwgauge.study.cases.case import Case
from screwgauge.study.cases.given import SCENE, Tables, changed, compare, decades, exactly, moving, still, times
from screwgauge.study.cases.question import Question

#: Moments of the platform as a plate and of a leg half as a rod [kg m^2], about those of the paper.
PLATE, ROD = 0.46, 1.16e-2
#: Directions of rates, and of accelerations, the larger component being one.
_RATE = np.array([[1.0, -0.6], [0.5, -1.0], [-0.3, 1.0]])
_ACCELERATION = np.array([[0.4, 1.0], [-1.0, 0.2], [1.0, -0.5]])
#: Force [N] and moment [N m] at the platform's centre of mass, the largest component being one.
_FORCE, _TORQUE = np.array([0.3, -0.2, 1.0]), np.array([1.0, 0.1, -0.2])


def bodies(change: Callable[[Tables, float], None], severity: float, quick: bool, folder: Path) -> Iterator[Question]:
    """Bodies that are changed by a severity."""
    yield compare(moving(changed(change, severity, folder), quick), folder)


def speed(w: float, quick: bool, folder: Path) -> Iterator[Question]:
    """From rest to where centrifugal forces are a million times the weight."""
    scene = moving(load_scene(SCENE), quick)
    y, n = scene.motion.y, len(scene.motion)
    yield compare(still(scene, y, w * _RATE[:n], w**2 * _ACCELERATION[:n]), folder)


def load(size: float, quick: bool, folder: Path) -> Iterator[Question]:
    """From no load to the weight of a mountain."""
    loads = (Load("platform", None, size * _FORCE, size * _TORQUE),)
    yield compare(moving(load_scene(SCENE).under(loads=loads), quick), folder)


def _heavier_legs(tables: Tables, ratio: float) -> None:
    for name, body in tables["bodies"].items():
        if name.startswith("leg"):
            body["mass"] = times(body["mass"], ratio)
            body["inertia"] = {key: times(value, ratio) for key, value in body["inertia"].items()}


def _larger(tables: Tables, s: float) -> None:
    for body in tables["bodies"].values():
        body["mass"] = times(body["mass"], s**3)
        body["com"] = [times(x, s) for x in body["com"]]
        body["inertia"] = {key: times(value, s**5) for key, value in body["inertia"].items()}
    for joint in tables["joints"].values():
        for frame in (joint[key] for key in ("parent_frame", "child_frame") if key in joint):
            frame["position"] = [times(x, s) for x in frame["position"]]
        if joint["kind"] == "P":
            joint["home"] = [times(x, s) for x in joint["home"]]


def _slender(tables: Tables, e: float) -> None:
    for name, body in tables["bodies"].items():
        if name.startswith("leg"):
            moments, axis = (ROD, ROD, ROD * e), ["3/7", "2/7", "-6/7"]
        else:
            moments, axis = (PLATE * (1.0 + e), PLATE, 2.0 * PLATE), ["6/7", "2/7", "3/7"]
        body["inertia"] = {key: exactly(x) for key, x in zip(("xx", "yy", "zz"), moments, strict=True)}
        body["inertia_rotation"] = {"axis": axis, "angle": "0.4"}


MASS_RATIO = Case(
    name="mass-ratio",
    title="Mass of the legs against the platform's",
    axis="mass ratio, 1 = paper",
    about="Mass and inertia of all leg halves times the ratio: below 1 the platform is the heavier, above 1 the "
    "legs are. Gravity and rates of 10 rad/s, no load.",
    drawn="actuator_force",
    low=1e-12,
    high=1e12,
    full=decades(-6, 6),
    quick=decades(-6, 6, 2),
    ask=partial(bodies, _heavier_legs),
)
SCALE = Case(
    name="scale",
    title="Size of the whole mechanism",
    axis="scale of lengths, 1 = paper",
    about="Lengths times s, masses times s^3, inertias times s^5, the same angles, rates and gravity.",
    drawn="actuator_force",
    low=1e-3,
    high=1e3,
    full=decades(-3, 3),
    quick=decades(-3, 3),
    ask=partial(bodies, _larger),
)
INERTIA_ANISOTROPY = Case(
    name="inertia-anisotropy",
    title="Needles for legs, a plate for the platform",
    axis="slenderness e [1]",
    about="Leg halves have the principal moments J (1, 1, e), the platform I (1 + e, 1, 2): both reach the "
    "bound of the triangle inequality as e vanishes. Their axes are turned against the bodies' frames, so that "
    "an engine that diagonalises the tensor has to find a small moment beside a large one.",
    drawn="actuator_force",
    low=1e-18,
    high=1.0,
    full=decades(0, -16),
    quick=decades(0, -15, 3),
    ask=partial(bodies, _slender),
    falling=True,
)
SPEED = Case(
    name="speed",
    title="Speed",
    axis="rate [rad/s]",
    about="Rates w and accelerations w^2 of the platform's angles, the load of the default scene. A wrong term "
    "that is quadratic in the rates would show here, as it cannot in the paper's own case.",
    drawn="actuator_force",
    low=0.0,
    high=1e6,
    full=(0.0, *decades(-3, 3)),
    quick=(0.0, *decades(-1, 3)),
    ask=speed,
)
LOAD = Case(
    name="load",
    title="Load on the platform",
    axis="load [N], [N m]",
    about="A force and a moment at the platform's centre of mass. Errors are relative to the largest force: under "
    "1e9 N the weight of the legs has five digits left.",
    drawn="actuator_force",
    low=0.0,
    high=1e15,
    full=(0.0, *decades(0, 9)),
    quick=(0.0, *decades(1, 9, 2)),
    ask=load,
)
