"""Ladders towards singular poses of the 3-UPS-UPU-S."""

from __future__ import annotations

import numpy as np

from screwgauge.scene import load_scene
from screwgauge.stress.case import Case, Rung
from screwgauge.stress.inverse import measure, still

#: Half the angle of the platform at which the first axis of leg 1 no longer holds it.
SINGULAR_B = float(np.arctan2(0.3 * np.sqrt(3.0), 0.5) - np.arccos(np.hypot(0.5, 0.3 * np.sqrt(3.0)) / 0.8))


def upu_singularity() -> Case:
    """The tilt b at which leg 1, at right angles to the line from O to its wrist, lets the platform turn."""

    def rung(distance: float, quick: bool) -> Rung:
        a = np.array([0.1] if quick else [0.05, 0.1, 0.3])
        y = np.stack([a, np.full_like(a, SINGULAR_B - distance)], axis=1)
        yd, ydd = np.tile([0.7, 0.4], (len(a), 1)), np.tile([-0.3, 0.9], (len(a), 1))
        scene = still(load_scene("3ups-upu-s"), y, yd, ydd)
        return Rung(distance, lambda: measure(scene))

    return Case(
        name="upu-singularity",
        title="Towards the UPU leg's constraint singularity",
        axis="distance [rad]",
        about="The platform gains a third freedom at b = 0.356801 rad; reactions grow as 1 / distance.",
        drawn="generalized_force",
        low=1e-15,
        high=0.3,
        full=tuple(10.0**-k for k in range(1, 13)),
        quick=tuple(10.0**-k for k in range(2, 13, 2)),
        rung=rung,
        falling=True,
    )
