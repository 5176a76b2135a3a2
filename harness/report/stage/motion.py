"""A mechanism in motion for display: poses and forces at selected samples of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from screwgauge.judging.assembly_modes import assembly_of
from screwgauge.problem import GivenMotion, Rows, spread
from screwgauge.reference.applied import Load
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.equations.joint_types import components, constraint_wrenches
from screwgauge.reference.equations.kinematics import TreePose, pose
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.reference.graph import Layout, layout
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array, times
from screwgauge.scene.scene import Scene
from screwgauge.solution import REFERENCE, Solution, Values

FRAMES = 120  # largest number of frames of a motion


@dataclass(frozen=True, eq=False)
class DrawnMotion:
    """Selected samples of a motion, or the home pose if there is no motion.

    Attributes:
        q: Joint coordinates. Shape (n, n_q).
        t: Time [s]. Shape (n,).
        values: Quantity -> values that an engine computed at these samples.
        loads: Loads of the scene at these samples.
        source: Engine that computed the poses, or ``home pose``.
    """

    lay: Layout
    q: Array
    t: Array
    source: str
    values: Mapping[str, Values] = field(default_factory=dict)
    loads: tuple[Load, ...] = ()

    @cached_property
    def at(self) -> TreePose:
        """Poses of bodies, and screws of joints."""
        return pose(self.lay, self.q)


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """A force or moment on a body over time.

    Attributes:
        point: Point of application, in the frame of the body [m]. Shape (3,).
        vectors: Force or moment in world axes [N or N m]. Shape (n, 3).
    """

    group: str
    name: str
    body: int
    point: Array
    vectors: Array
    turns: bool = False


def home_pose(mechanism: Mechanism) -> DrawnMotion:
    """Return the home pose as a motion."""
    return DrawnMotion(layout(mechanism), mechanism.home[None], np.zeros(1), "home pose")


def drawn_motion(scene: Scene, solutions: Mapping[str, Solution]) -> DrawnMotion:
    """Return a scene's motion from the first engine that computed all joints, or close loops along the given motion."""
    lay = layout(scene.mechanism)
    for name, solution in solutions.items():
        q = assembly_of(scene.mechanism, solution)
        if q is not None and name != REFERENCE and len(q) == len(scene.t):
            finite = np.flatnonzero(np.isfinite(q).all(axis=1))
            rows = finite[spread(len(finite), FRAMES)]
            if len(rows):
                values = {quantity: one.at(rows) for quantity, one in solution.values.items()}
                return DrawnMotion(lay, q[rows], scene.t[rows], name, values, _loads(scene, rows))
    if isinstance(scene.task, GivenMotion):
        rows = spread(len(scene.t), FRAMES)
        try:
            q = positions(lay, scene.task.y[rows], scene.t[rows])
        except ScrewgaugeError:  # the report names a motion that cannot be followed
            return home_pose(scene.mechanism)
        return DrawnMotion(lay, q, scene.t[rows], "screw", loads=_loads(scene, rows))
    return home_pose(scene.mechanism)


def _loads(scene: Scene, rows: Rows) -> tuple[Load, ...]:
    n = len(rows)

    def at_rows(v: Array) -> Array:
        return v[rows] if v.ndim == 2 and len(v) == len(scene.t) else np.broadcast_to(v, (n, 3))

    loads = [load.at(scene.t[rows]) for load in scene.applied.loads]
    return tuple(replace(one, force=at_rows(one.force), torque=at_rows(one.torque)) for one in loads)


def arrows(motion: DrawnMotion) -> list[Arrow]:
    """Return arrows of loads, actuator forces and joint reactions."""
    mechanism, drawn = motion.lay.mechanism, list[Arrow]()
    index = mechanism.body_index
    for load in motion.loads:
        i = index[load.body]
        point = mechanism.body(load.body).com if load.point is None else load.point
        R = motion.at.R[:, i]
        force, torque = (times(R, x) if load.axes == "body" else x for x in (load.force, load.torque))
        drawn += [Arrow("loads", f"load on {load.body}", i, point, force)]
        drawn += [Arrow("loads", f"load on {load.body}", i, point, torque, True)]
    if (forces := motion.values.get("actuator_force")) is not None:
        columns = dict(zip(forces.components, forces.array.T, strict=True))
        for name, joint in zip(mechanism.actuator_names, mechanism.actuators, strict=False):
            turns, S = joint.angles == 1, motion.at.S[:, motion.lay.columns[joint.name][0]]
            vectors = columns[name][:, None] * (S[:, :3] if turns else S[:, 3:])
            drawn += [Arrow("actuators", f"{name}, actuator", index[joint.child], joint.child_frame.p, vectors, turns)]
    if (forces := motion.values.get("reaction")) is not None:
        columns = dict(zip(forces.components, forces.array.T, strict=True))
        for joint in mechanism.joints:
            labels, W = components(joint), constraint_wrenches(motion.at.joint(joint))
            where = f"{joint.name}, reaction", index[joint.child], joint.child_frame.p
            for turns, unit in ((False, "N"), (True, "N m")):
                own = [(columns[f"{joint.name}.{label}"], i) for i, (label, has) in enumerate(labels) if has == unit]
                part = slice(3, 6) if turns else slice(3)
                vectors = [size[:, None] * W[:, i, part] for size, i in own]
                if joint.fixed and turns:  # the constraint that locks its hinge
                    vectors.append(columns[f"{joint.name}.mz"][:, None] * motion.at.joint(joint).last)
                drawn += [Arrow("reactions", *where, np.sum(vectors, axis=0), turns)] if vectors else []
    return [one for one in drawn if np.isfinite(one.vectors).all() and one.vectors.any()]
