"""Ladders of how fast the mechanism moves and how hard it is pushed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from screwgauge.reference.applied import Load
from screwgauge.scene.read import load_scene
from screwgauge.study.stress.case import Case, Rung
from screwgauge.study.stress.inverse.measure import measure, still
from screwgauge.study.stress.inverse.states import ACCELERATIONS, POSES, RATES, SCENE, decades, samples

#: Directions of rates, and of accelerations, the larger component being one.
_RATE = np.array([[1.0, -0.6], [0.5, -1.0], [-0.3, 1.0]])
_ACCELERATION = np.array([[0.4, 1.0], [-1.0, 0.2], [1.0, -0.5]])
#: Force [N] and moment [N m] at the platform's centre of mass, the largest component being one.
_FORCE, _TORQUE = np.array([0.3, -0.2, 1.0]), np.array([1.0, 0.1, -0.2])


def speed() -> Case:
    """From rest to where centrifugal forces are a million times the weight."""

    def rung(w: float, quick: bool) -> Rung:
        y, yd, ydd = samples(POSES, quick), w * samples(_RATE, quick), w**2 * samples(_ACCELERATION, quick)
        return Rung(w, lambda: measure(still(load_scene(SCENE), y, yd, ydd)))

    return Case(
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
        rung=rung,
    )


def load() -> Case:
    """From no load to the weight of a mountain."""

    def rung(size: float, quick: bool) -> Rung:
        loads = (Load("platform", None, size * _FORCE, size * _TORQUE),)
        y, yd, ydd = (samples(array, quick) for array in (POSES, RATES, ACCELERATIONS))
        return Rung(size, lambda: measure(still(replace(load_scene(SCENE), loads=loads), y, yd, ydd)))

    return Case(
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
        rung=rung,
    )
