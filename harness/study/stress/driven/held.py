"""A scene let go: the actuator forces of one instant stay as they are, and the motion goes on from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter

import numpy as np

from screwgauge.engines.screw.integrate import Trajectory, integrate
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.forward import Forces, forward_dense
from screwgauge.reference.pose import Layout, layout
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene, load_scene
from screwgauge.study.run import solve

#: The reference; its own error after a second is about 1e-11 of the motion.
TIGHT = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """The motion under constant forces, integrated by `screw`.

    Attributes:
        scene: At the instant from which the forces are kept.
        forces: What acts: the actuator forces, gravity and loads.
        path: The motion from then on.
        reactions: All constraint forces on the way [N or N m]. Shape (n, m).
        names: Their names.
        seconds: Wall time of the integration.
    """

    scene: Scene
    lay: Layout
    forces: Forces
    path: Trajectory
    reactions: Array
    names: tuple[str, ...]
    seconds: float

    @property
    def t(self) -> Array:
        """Times since then [s]. Shape (n,)."""
        return self.path.t

    def columns(self, coordinates: Sequence[str]) -> list[int]:
        """Where joint coordinates stand in those of the mechanism."""
        names = self.lay.mechanism.coordinates
        return [names.index(name) for name in coordinates]


def hold(scene: Scene, instant: float, times: Array, tolerance: float = TIGHT) -> Held:
    """Keeps the actuator forces of an instant and integrates the motion.

    Args:
        times: Since the instant, the first being zero [s]. Shape (n,).

    Raises:
        ScrewgaugeError: The motion does not lead so far.
    """
    here, lay = scene.at([instant]), layout(scene.mechanism)
    solutions, failures = solve(here, ("screw",), ("actuator_force",))
    if failures:
        raise ScrewgaugeError(failures["screw"].reason, f"{scene.name} at {instant:g} s", "choose a pose")
    loads = [(load.body, load.point, load.force, load.torque) for load in scene.loads]
    actuators = solutions["screw"].values["actuator_force"].array[0]
    forces = Forces(actuators=actuators, gravity=scene.gravity, loads=loads)
    clock = perf_counter()
    path = integrate(
        lay,
        forces,
        times,
        start=here.motion.y[0],
        yd=here.motion.yd[0],
        rtol=tolerance,
        atol=tolerance,
    )
    seconds = perf_counter() - clock
    if path.stopped:
        raise ScrewgaugeError(path.stopped, f"{scene.name} held at {instant:g} s", "choose a shorter time")
    whole = forward_dense(lay, path.rates, forces)
    return Held(here, lay, forces, path, whole.reactions, whole.names, seconds)


@lru_cache(maxsize=4)
def default_scene_held(duration: float, samples: int, tolerance: float = TIGHT) -> Held:
    """The default scene from t = 1 s on, where all its terms are at work."""
    return hold(load_scene("3ups-upu-s"), 1.0, np.linspace(0.0, duration, samples), tolerance)
