"""What several cases ask: given motions, against the truth; accelerations, for true states under the true forces."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from screwgauge.models.generate import write_models
from screwgauge.models.urdf import loops_of
from screwgauge.problem import GivenMotion
from screwgauge.quantities import GIVEN
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed_motion import ClosedMotion, motion_at
from screwgauge.reference.graph import layout
from screwgauge.reference.mechanism import Frame, Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.study.cases.question import UNKNOWN, Question, put
from screwgauge.study.methods import Method
from screwgauge.study.reference import TRUTH, PreparedScene, Reference, pose_scene
from screwgauge.study.solving import solve
from screwgauge.witness.joints import MechanismTree
from screwgauge.witness.kinematics import TreeMotion
from screwgauge.witness.tree import stacked

SCENE = "3ups-upu-s"
#: Poses (a, b) [rad] with no symmetry, and rates and accelerations that make inertia matter as much as weight does.
POSES = np.array([[0.1, 0.05], [-0.15, 0.12], [0.2, -0.1]])
RATES = np.array([[7.0, 4.0], [5.0, -8.0], [-3.0, 6.0]])
ACCELERATIONS = np.array([[-30.0, 90.0], [70.0, 20.0], [-100.0, -50.0]])

ENGINES = ("screw", "pinocchio", "mujoco")
QUANTITIES = ("joint_acceleration", "com_acceleration", "generalized_force", "actuator_force", "reaction")
#: What the judge needs, and what a truth has.
JUDGED = tuple(name for name in GIVEN if not name.startswith("tree_force"))

TIMES = (0.5, 1.0, 2.5)  # [s] of the default scene
ACCELERATION = "joint_acceleration"
SCREW = Method("screw")


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
    rates, seconds = (zero.copy() if array is None else array for array in (yd, ydd))
    motion = GivenMotion(t, y.copy(), rates, seconds)
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
    right = Reference.by_size(TRUTH, scene.mechanism, truth.values) if truth is not None and known else UNKNOWN
    question = put(scene, folder, scene.problem(quantities if known else JUDGED), methods, quantities, right)
    return replace(question, cause=cause)


def loaded(folder: Path) -> PreparedScene:
    """The default scene, which is loaded, at three instants."""
    return pose_scene(load_scene(SCENE).at(TIMES), folder, samples=len(TIMES))


def push(posed: PreparedScene, *methods: Method) -> Question:
    """The question for accelerations: of all joints from `screw`, of its tree from another engine."""
    mechanism = posed.scene.mechanism
    names = mechanism.coordinates if methods[0].engine == SCREW.engine else tree_coordinates(mechanism)
    values = {ACCELERATION: posed.reference.values[ACCELERATION].pick(names)}
    right = replace(posed.reference, values=values)  # measured by the scales of all
    return put(posed.scene, posed.folder, posed.pushed(names), methods, (ACCELERATION,), right)


def tree_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Coordinates of the tree of the engines' models, minimal cut."""
    return loops_of(mechanism, "minimal").tree


def closure_residuals(tree: MechanismTree, motion: TreeMotion) -> tuple[Array, Array]:
    """What lies between the points that close the loops, child less parent: distance [m] and velocity [m/s].

    Returns:
        Shape (n, n_point, 3) each.
    """
    closures = loops_of(tree.mechanism, "minimal").closures
    parent, child = (
        motion.links.frames(
            stacked([tree.on(getattr(c, side), Frame(x)) for c in closures for x in getattr(c, f"{side}_points")])
        )
        for side in ("parent", "child")
    )
    return child.p - parent.p, child.v - parent.v


def true_velocities(posed: PreparedScene) -> ClosedMotion:
    """Closed poses and velocities by `screw`."""
    lay, motion = layout(posed.scene.mechanism), posed.scene.motion
    return motion_at(lay, positions(lay, motion.y, motion.t), motion.yd)


def loop_condition(at: ClosedMotion) -> float:
    """Condition number of the closed loops, at its worst."""
    return float(at.condition.max())
