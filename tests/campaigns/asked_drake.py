"""Drake's inverse dynamics of an SDF, of the tree that its reading has."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from campaigns.own_library import Forces
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from screwgauge.diagnosis.libraries import joint_states
from screwgauge.engines.raw_queries import JointStates, frame_motion
from screwgauge.models.kinematics import ReadingTree
from screwgauge.reference.rotations import Array, cross
from screwgauge.witness.dynamics import passive_parts
from screwgauge.witness.tree import TreeStates

#: Elements that Drake's parser refuses where other simulators put them, of which no dynamics depend.
REFUSED = ("plugin", "contact", "material", "visual", "sensor", "gripper", "self_collide")
#: Ends the name of what closes a loop behind a joint that carries a copy of its child.
CLOSING = ".loop"
#: Joints of Drake with a frame that turns freely, in its model or as it floats.
FREE, BALL = "quaternion_floating", "ball_rpy"


def ask(path: Path, tree: ReadingTree, states: TreeStates) -> Forces:
    """Inverse dynamics with damping, in the gravity of the reading: Drake takes none from a file.

    Raises:
        ValueError: Drake refuses the file, or has a joint otherwise.
    """
    with TemporaryDirectory() as folder:
        plant = _loaded(_open(path, tree, Path(folder)), tree.gravity)
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    joints = {plant.get_joint(i).name(): plant.get_joint(i) for i in plant.GetJointIndices()}
    carriers = {joint: body for body, one in tree.reading.bodies.items() for joint in one.joints}
    rows = {
        name: _Moves(plant, joints.get(carriers[name] if each.kind == "free" else name.rpartition(".")[2]), name, each)
        for name, each in joint_states(tree, states).items()
        if f"{name}{CLOSING}" not in tree.reading.closures
    }
    tau, passive = [], sum(passive_parts(tree, states).values())
    for k in range(len(states.q)):
        B, extra = np.zeros((plant.num_velocities(), tree.freedom)), np.zeros(plant.num_velocities())
        for name, row in rows.items():
            own, more = row.put(context, k)
            B[row.at, tree.freedoms[name]], extra[row.at] = own, more
        plant.SetVelocities(context, B @ states.qd[k])
        plant.CalcForceElementsContribution(context, forces)
        tau.append(plant.CalcInverseDynamics(context, B @ states.qdd[k] + extra, forces) @ B)
    left = np.array([name not in rows for name, at in tree.freedoms.items() for _ in range(at.stop - at.start)])
    return Forces(np.where(left, passive, np.array(tau)), frozenset({"armature", "damping", "stiffness"}), False)


def _loaded(file: Path, gravity: Array) -> Any:
    plant = MultibodyPlant(0.0)
    try:
        Parser(plant).AddModels(str(file))
        plant.mutable_gravity_field().set_gravity_vector(gravity)
        plant.Finalize()
    except RuntimeError as error:
        raise ValueError(f"drake: {str(error).splitlines()[0]}") from None
    return plant


def _open(path: Path, tree: ReadingTree, folder: Path) -> Path:
    """A copy without joints that close loops, which Drake has not, and without what it refuses and nothing moves.

    It lacks the axes of balls, too, which the format has none of, and of which Drake takes the damping.
    """
    root = ET.fromstring(path.read_text(encoding="utf-8").strip())
    closing = {name.removesuffix(CLOSING) for name in tree.reading.closures}
    for parent in [*root.iter()]:
        for child in [*parent]:
            of_ball = parent.tag == "joint" and parent.get("type") == "ball" and child.tag == "axis"
            if child.tag in REFUSED or of_ball or (child.tag == "joint" and child.get("name") in closing):
                parent.remove(child)
    file = folder / "model.sdf"
    file.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
    return file


class _Moves:
    def __init__(self, plant: Any, joint: Any, name: str, states: JointStates) -> None:
        self.states, self.joint = states, joint
        if self.joint is None or self.joint.num_velocities() != states.qd.shape[1]:
            raise ValueError(f"drake has joint {name} otherwise")
        self.at = slice(self.joint.velocity_start(), self.joint.velocity_start() + self.joint.num_velocities())
        self.put: Callable[[Any, int], tuple[Array, Array]] = self._single
        if self.joint.num_velocities() > 1:
            context = plant.CreateDefaultContext()
            frame = plant.EvalBodyPoseInWorld(context, self.joint.child_body()).GetAsMatrix4()
            if self.joint.type_name() == FREE:
                self.plant, self.start, self.motion = plant, frame, frame_motion(states, frame)
                self.put = self._free
            elif self.joint.type_name() == BALL:
                R = self.joint.frame_on_child().CalcPoseInWorld(context).rotation().matrix()
                self.turn = R.T @ states.frame[:3, :3]
                self.put = self._ball
            else:
                raise ValueError(f"drake has joint {name} as {self.joint.type_name()}")

    def _single(self, context: Any, k: int) -> tuple[Array, Array]:
        q = self.states.q[k, :1]
        if self.joint.type_name() == "revolute":
            self.joint.set_angle(context, q[0])
        else:
            self.joint.set_translation(context, q[0])
        return np.eye(1), np.zeros(1)

    def _free(self, context: Any, k: int) -> tuple[Array, Array]:
        """Angular velocity, and velocity of the origin, along axes of the world."""
        poses, V = self.motion
        T = self.start @ poses[k]
        X = RigidTransform(RotationMatrix.ProjectToRotationMatrix(T[:3, :3]), T[:3, 3])
        self.plant.SetFreeBodyPose(context, self.joint.child_body(), X)
        R, rates = T[:3, :3], V @ self.states.qd[k]
        B = np.vstack([R @ V[:3], R @ V[3:]])
        return B, np.concatenate([np.zeros(3), R @ cross(rates[:3], rates[3:])])

    def _ball(self, context: Any, k: int) -> tuple[Array, Array]:
        """Angular velocity of what it carries, along axes of the frame that carries it."""
        X = frame_motion(self.states, self.states.frame)[0][k][:3, :3]
        R = self.turn @ X @ self.turn.T
        self.joint.set_angles(context, RollPitchYaw(RotationMatrix(R)).vector())
        return self.turn @ X, np.zeros(3)
