"""Given motions: states of the default scene, and every engine on them against the truth."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from screwgauge.models.generate import write_models
from screwgauge.problem import GivenMotion
from screwgauge.quantities import GIVEN
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.study.ask import solve
from screwgauge.study.cases.question import UNKNOWN, Question, by_size, put
from screwgauge.study.method import Method
from screwgauge.study.reference import TRUTH

SCENE = "3ups-upu-s"
#: Poses (a, b) [rad] with no symmetry, and rates and accelerations that make inertia matter as much as weight does.
POSES = np.array([[0.1, 0.05], [-0.15, 0.12], [0.2, -0.1]])
RATES = np.array([[7.0, 4.0], [5.0, -8.0], [-3.0, 6.0]])
ACCELERATIONS = np.array([[-30.0, 90.0], [70.0, 20.0], [-100.0, -50.0]])

ENGINES = ("screw", "pinocchio", "mujoco")
QUANTITIES = ("joint_acceleration", "com_acceleration", "generalized_force", "actuator_force", "reaction")
#: What the judge needs, and what a truth has.
JUDGED = tuple(name for name in GIVEN if not name.startswith("tree_force"))


def exactly(value: float) -> str:
    """All digits of a float64: what reads the text exactly gets the number that all others get."""
    return format(Decimal(float(value)), "f")


def moving(scene: Scene, quick: bool) -> Scene:
    """The scene at the poses, rates and accelerations of this module, or at the first of them."""
    return still(scene, *(array[: 1 if quick else None] for array in (POSES, RATES, ACCELERATIONS)))


def still(scene: Scene, y: Array, yd: Array | None = None, ydd: Array | None = None) -> Scene:
    """The scene at given states, the same doubles for every engine, one second apart.

    Args:
        y, yd, ydd: Independent coordinates and derivatives; zero by default. Shape (n, k).
    """
    zero, t = np.zeros_like(y), np.arange(len(y), dtype=float)
    motion = GivenMotion(t, y.copy(), *(zero.copy() if array is None else array for array in (yd, ydd)))
    return replace(scene, task=motion)


def compare(
    scene: Scene,
    folder: Path,
    *,
    engines: tuple[str, ...] = ENGINES,
    quantities: tuple[str, ...] = QUANTITIES,
    setting: str = "",
    cause: str = "",
) -> Question:
    """A given motion, put to engines. Where the truth lacks a sample, just those that matter, it is not known.

    Args:
        setting: Follows the name of every engine.
        cause: Why an engine other than ours is wrong where it says nothing.
    """
    write_models(scene.mechanism, folder, gravity=scene.applied.g)
    methods = tuple(Method(name, label=f"{name} {setting}".strip()) for name in engines)
    truth = solve(scene, (TRUTH,), quantities)[0].get(TRUTH)
    known = truth is not None and truth.rows is None
    right = by_size(TRUTH, scene.mechanism, truth.values) if truth is not None and known else UNKNOWN
    question = put(scene, folder, scene.problem(quantities if known else JUDGED), methods, quantities, right)
    return replace(question, cause=cause)
