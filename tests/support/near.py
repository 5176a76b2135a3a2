"""Scenes of the 3-UPS-UPU-S at given distances from its singular poses, and their errors against the truth."""

from dataclasses import replace

import numpy as np

from screwgauge import Scene, load_scene
from screwgauge.problem import GivenMotion
from screwgauge.solution import Solution

RISE = np.arctan2(0.3 * np.sqrt(3.0), 0.5)  # of the line from O to a wrist centre above the platform
UPU = RISE - np.arccos(np.sqrt(0.25 + 0.27) / 0.8)  # b where the constraint of leg 1 is lost
BASE = -RISE  # b where the line of leg 3 runs along the first axis of its base
WRIST = -0.706951724841129  # a where the chart of leg 2's wrist locks, b being zero
QUANTITIES = (
    *("joint_position", "joint_velocity", "joint_acceleration"),
    *("body_angular_velocity", "body_angular_acceleration", "com_acceleration"),
    *("generalized_force", "actuator_force", "reaction"),
)


def moving_at(y, *, speed: float = 1.0, seed: int = 0, scene: str | Scene = "3ups-upu-s") -> Scene:
    rng = np.random.default_rng(seed)
    y = np.asarray(y, dtype=float)
    motion = GivenMotion(np.arange(len(y)) * 1.0, y, *(speed * rng.normal(size=(2, *y.shape))))
    return replace(load_scene(scene) if isinstance(scene, str) else scene, task=motion)


def before_upu(distance, n: int = 4, seed: int = 0) -> np.ndarray:
    """Poses (a, b) at distances from the lost constraint, in one direction: along it steps are small. Shape (n, 2)."""
    rng = np.random.default_rng(seed)
    return np.stack([np.full(n, rng.uniform(-0.3, 0.3)), UPU - distance * rng.uniform(0.7, 1.3, n)], axis=1)


def errors(found: Solution, truth: Solution, quantity: str) -> np.ndarray:
    values = truth.values[quantity]
    worst = np.zeros(len(values.array))
    for unit in set(values.units):
        columns = [i for i, has in enumerate(values.units) if has == unit]
        difference = np.abs(found.values[quantity].array[:, columns] - values.array[:, columns]).max(axis=1)
        worst = np.maximum(worst, difference / np.nanmax(np.abs(values.array[:, columns])))
    return worst
