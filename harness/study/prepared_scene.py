"""A scene with a given motion, ready for methods: its times, model files, true values and states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from screwgauge.problem import GivenMotion, ModelFiles, Problem, States, Task, spread
from screwgauge.reference.applied import Applied
from screwgauge.reference.graph import spanning_tree
from screwgauge.reference.mechanism import Mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.scene import Scene
from screwgauge.study.reference import Reference, reference_values
from screwgauge.study.runner import model_files, write_scene_models
from screwgauge.witness.joints import mechanism_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates, stacked

#: What is measured of given motions, in this order.
QUANTITIES = ("joint_position", "joint_velocity", "joint_acceleration", "actuator_force")


@dataclass(frozen=True, slots=True, eq=False)
class PreparedScene:
    """A scene prepared for methods.

    Attributes:
        whole: The scene with its own times, rule ``min_norm``.
        scene: The same at the compared times.
        folder: Where the generated model files are.
    """

    whole: Scene
    scene: Scene
    folder: Path
    reference: Reference

    @property
    def t(self) -> Array:
        """Compared times [s]. Shape (n,)."""
        return self.scene.t

    def files(self, engine: str) -> ModelFiles:
        """The generated model of an engine."""
        return model_files(self.scene, engine, self.folder)

    def written(self) -> list[Path]:
        """All files in its folder."""
        return [path for path in self.folder.rglob("*") if path.is_file()]

    def problem(self, *wanted: str, task: Task | None = None) -> Problem:
        """The question of the scene, or the same with another task."""
        return Problem(self.scene.applied, self.scene.task if task is None else task, frozenset(wanted))

    def moving(self, coordinates: tuple[str, ...]) -> States:
        """The true motion of some joint coordinates."""
        q, v, a = (self.reference.values[name].pick(coordinates).array for name in QUANTITIES[:3])
        return States(coordinates, q, v, a=a)

    def pushed(self, coordinates: tuple[str, ...]) -> Problem:
        """The question for accelerations at the true states of a tree, see `pushed`."""
        q, force = (self.reference.values[name].array for name in ("joint_position", "actuator_force"))
        return pushed(self.scene.mechanism, self.scene.applied, self.moving(coordinates), q, force)


def pushed(mechanism: Mechanism, applied: Applied, states: States, q: Array, force: Array) -> Problem:
    """The question for accelerations of a tree under actuator forces and the loads.

    Loads are among the forces along the coordinates, so that engines need not turn them.

    Args:
        q: All joint coordinates, see `along_tree`. Shape (n, n_q).
        force: Of the actuators. Shape (n, n_actuator).
    """
    names = states.coordinates
    tau = along_tree(mechanism, names, q, applied)
    tau[:, [names.index(joint.coordinates[0]) for joint in mechanism.actuators]] += force
    task = States(names, states.q, states.v, tau=tau)
    return Problem(Applied(gravity=applied.g), task, frozenset(("joint_acceleration",)))


def along_tree(mechanism: Mechanism, coordinates: tuple[str, ...], q: Array, applied: Applied) -> Array:
    """Loads as forces along coordinates of the spanning tree, by what each coordinate alone moves.

    Args:
        q: All joint coordinates; those of cut joints move nothing. Shape (n, n_q).

    Returns:
        Shape (n, n_coordinate).
    """
    out = np.zeros((len(q), len(coordinates)))
    if not applied.loads:
        return out
    tree, still = mechanism_tree(mechanism, spanning_tree(mechanism)), np.zeros_like(q)
    motion, columns = move(tree, TreeStates(q, still, still)), mechanism.columns(coordinates)
    for load in applied.loads:
        point = mechanism.body(load.body).com if load.point is None else load.point
        at = stacked([tree.body_frames[load.body].placed(np.eye(3), point)])
        J = motion.jacobian(at, motion.links.frames(at).p)[:, 0][..., columns]
        out += load.torque @ J[:, :3] + load.force @ J[:, 3:]
    return out


def pose_scene(scene: Scene, folder: Path, *, samples: int) -> PreparedScene:
    """Writes the model files and computes the reference values.

    Args:
        folder: For the model files.
        samples: Compared times, at most.

    Raises:
        ScrewgaugeError: The scene cannot be computed.
    """
    whole = replace(scene, rule="min_norm", models={})
    motion: GivenMotion = whole.motion
    here = whole.at(motion.t[spread(len(motion), samples)])
    write_scene_models(scene, folder)
    return PreparedScene(whole, here, folder, reference_values(whole, here.t, QUANTITIES))
