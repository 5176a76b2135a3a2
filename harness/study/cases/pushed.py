"""True states under the true forces: which accelerations do methods say that they have?"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from screwgauge.judging.kinetics import Motions
from screwgauge.models.loops import loops_of
from screwgauge.reference import linear
from screwgauge.reference.kinematics import Velocities, positions, velocities
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.pose import layout
from screwgauge.reference.rotations import Array, cross
from screwgauge.scene.read import load_scene
from screwgauge.study.cases.given import SCENE
from screwgauge.study.cases.question import Question, put
from screwgauge.study.method import Method
from screwgauge.study.posed import Posed, pose_scene

TIMES = (0.5, 1.0, 2.5)  # [s] of the default scene
ACCELERATION = "joint_acceleration"
SCREW = Method("screw")


def loaded(folder: Path) -> Posed:
    """The default scene, which is loaded, at three instants."""
    return pose_scene(load_scene(SCENE).at(TIMES), folder, samples=len(TIMES))


def push(posed: Posed, *methods: Method) -> Question:
    """The question for accelerations: of all joints from `screw`, of its tree from another engine."""
    mechanism = posed.scene.mechanism
    names = mechanism.coordinates if methods[0].engine == SCREW.engine else tree_coordinates(mechanism)
    values = {ACCELERATION: posed.reference.values[ACCELERATION].pick(names)}
    right = replace(posed.reference, values=values)  # measured by the scales of all
    return put(posed.scene, posed.folder, posed.pushed(names), methods, (ACCELERATION,), right)


def tree_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Coordinates of the tree of the engines' models, minimal cut."""
    return loops_of(mechanism, "minimal").tree


def closure_residuals(mechanism: Mechanism, motions: Motions) -> tuple[Array, Array]:
    """What lies between the points that close the loops, child less parent: distance [m] and velocity [m/s].

    Returns:
        Shape (n, n_point, 3) each.
    """
    bodies, sides = motions.bodies, []
    closures = loops_of(mechanism, "minimal").closures
    for side in ("parent", "child"):
        at = [(mechanism.body_index[getattr(c, side)], x) for c in closures for x in getattr(c, f"{side}_points")]
        i, points = [body for body, _ in at], np.array([point for _, point in at])
        arms = (bodies.R[:, i] @ points[..., None])[..., 0]
        sides.append((bodies.p[:, i] + arms, bodies.v[:, i] + cross(bodies.w[:, i], arms)))
    return sides[1][0] - sides[0][0], sides[1][1] - sides[0][1]


def true_velocities(posed: Posed) -> Velocities:
    """Closed poses and velocities by `screw`."""
    lay, motion = layout(posed.scene.mechanism), posed.scene.motion
    return velocities(lay, positions(lay, motion.y, motion.t), motion.yd)


def loop_condition(rate: Velocities) -> float:
    """Condition number of the closed loops, at its worst."""
    return float(linear.condition(rate.A).max())
