"""What each library reads from a model file, in the terms of the description.

A reading never follows a file's own layout: bodies are compared by name, in their own frames, and joints by
the screws they turn about in the world, so that nothing depends on how a format splits joints and frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from screwgauge.models.mjcf import LEAST, POWERS
from screwgauge.reference.mechanism import GROUND
from screwgauge.reference.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class BodyReading:
    """A body with mass, in its own frame.

    Attributes:
        near: Body on its ground side; massless links between them do not count.
        coordinates: Names of the elementary joints between the two, from `near` outwards.
        mass: [kg]; `com` [m], shape (3,); `inertia` about the centre of mass, shape (3, 3).
        pose: World pose at the home coordinates. Shape (4, 4).
    """

    near: str
    coordinates: tuple[str, ...]
    mass: float
    com: Array
    inertia: Array
    pose: Array


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What was read.

    Attributes:
        bodies: Every body with mass.
        screws: Coordinate -> unit screw [angular; linear at the world origin] at home. Shape (6,).
        closures: Name -> (body, frame in it, body, frame in it) of a closure that the file has; the origins
            (of a weld the frames) coincide. Frames have shape (4, 4).
        actuators: Name -> coordinate, of a file that has actuators.
        gravity: World axes [m/s^2], shape (3,); None where the file cannot say it.
        couplings: Name -> (coordinate, the one it is a polynomial of or empty, coefficients of shape (m,)).
    """

    bodies: Mapping[str, BodyReading]
    screws: Mapping[str, Array]
    closures: Mapping[str, tuple[str, Array, str, Array]] = field(default_factory=dict)
    actuators: Mapping[str, str] = field(default_factory=dict)
    gravity: Array | None = None
    couplings: Mapping[str, tuple[str, str, Array]] = field(default_factory=dict)


def matrix(p: Array, R: Array) -> Array:
    """A placement as a (4, 4) matrix."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def screw(turns: bool, axis: Array, point: Array) -> Array:
    """Unit screw of a rotation or translation. Shape (6,)."""
    return np.concatenate([axis, np.cross(point, axis)] if turns else [np.zeros(3), axis])


#: Link -> the link above it and the moving joints between the two, from above downwards.
Above = Mapping[str, tuple[str, tuple[str, ...]]]


def _upwards(name: str, above: Above, stops: Iterable[str]) -> tuple[str, tuple[str, ...]]:
    """Nearest of some links above one, and the moving joints passed on the way, from above downwards."""
    passed: tuple[str, ...] = ()
    while name in above:
        name, joints = above[name]
        passed = joints + passed
        if name in stops:
            break
    return name, passed


def read_yourdfpy(path: Path, home: Mapping[str, float]) -> Reading:
    """Reads a URDF by yourdfpy."""
    import yourdfpy

    robot = yourdfpy.URDF.load(str(path), load_meshes=False, load_collision_meshes=False)
    robot.update_cfg({name: home.get(name, 0.0) for name in robot.actuated_joint_names})
    moving = {"revolute", "prismatic", "continuous"}
    joints = robot.joint_map.values()
    above = {joint.child: (joint.parent, (joint.name,) if joint.type in moving else ()) for joint in joints}
    solid = {name: link for name, link in robot.link_map.items() if link.inertial and link.inertial.mass}
    bodies = {}
    for name, link in solid.items():
        origin = np.eye(4) if link.inertial.origin is None else link.inertial.origin
        inertia = origin[:3, :3] @ link.inertial.inertia @ origin[:3, :3].T
        near, passed = _upwards(name, above, {*solid, robot.base_link})
        pose = robot.get_transform(name, robot.base_link)
        bodies[name] = BodyReading(near, passed, float(link.inertial.mass), origin[:3, 3], inertia, pose)
    screws = {}
    for joint in joints:
        if joint.type in moving:
            T = robot.get_transform(joint.child, robot.base_link)
            screws[joint.name] = screw(joint.type != "prismatic", T[:3, :3] @ joint.axis, T[:3, 3])
    return Reading(bodies, screws)


def read_pinocchio(path: Path, home: Mapping[str, float]) -> Reading:
    """Reads a URDF by Pinocchio."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    q = pinocchio.neutral(model)
    for name, joint in zip(model.names[1:], model.joints[1:], strict=True):
        q[joint.idx_q] = home.get(name, 0.0)
    pinocchio.computeJointJacobians(model, data, q)
    pinocchio.updateFramePlacements(model, data)
    # Links and joints may share a name, so frames are told apart by their numbers.
    above = {}
    for i, frame in enumerate(model.frames):
        moves = frame.type == pinocchio.FrameType.JOINT
        if i:
            above[str(i)] = str(frame.parentFrame), (frame.name,) if moves else ()
    solid = _pinocchio_inertias(model)
    bodies = {}
    for i, Y in solid.items():
        near, passed = _upwards(str(i), above, {*map(str, solid), "1"})  # frame 1 is the root link
        pose = np.array(data.oMf[i].homogeneous)
        bodies[model.frames[i].name] = BodyReading(
            model.frames[int(near)].name, passed, float(Y.mass), np.array(Y.lever), np.array(Y.inertia), pose
        )
    screws, J = {}, np.reshape(data.J, (6, model.nv))  # one column alone comes as a vector
    for name, joint in zip(model.names[1:], model.joints[1:], strict=True):
        column = J[:, joint.idx_v]  # [linear; angular]
        screws[name] = np.concatenate([column[3:], column[:3]])
    return Reading(bodies, screws)


def _pinocchio_inertias(model: Any) -> dict[int, Any]:
    """Frame number of each link with mass -> its inertia in the link's frame.

    Pinocchio adds a link behind a fixed joint to the moving link before it, and keeps its share in the frame
    of the fixed joint.
    """
    import pinocchio

    fixed = {i: f for i, f in enumerate(model.frames) if f.type == pinocchio.FrameType.FIXED_JOINT and f.inertia.mass}
    inertias = {}
    for i, frame in enumerate(model.frames):
        if frame.type != pinocchio.FrameType.BODY or not frame.parentJoint:
            continue
        if model.frames[frame.parentFrame].type == pinocchio.FrameType.FIXED_JOINT:
            Y = model.frames[frame.parentFrame].inertia
        else:
            Y = model.inertias[frame.parentJoint]
            merged = [f.placement.act(f.inertia) for f in fixed.values() if f.parentJoint == frame.parentJoint]
            # What rounding leaves of a massless link must not pass for a body.
            if merged and Y.mass - sum(part.mass for part in merged) <= 1e-12 * Y.mass:
                continue
            for part in merged:
                Y = Y - part
        if Y.mass:
            inertias[i] = Y
    return inertias


def read_mujoco(path: Path, home: Mapping[str, float]) -> Reading:
    """Reads an MJCF by MuJoCo. The tensor is rebuilt from the principal axes that MuJoCo keeps."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    joints = {model.joint(i).name: i for i in range(model.njnt)}
    for name, i in joints.items():
        data.qpos[model.jnt_qposadr[i]] = home.get(name, 0.0)
    mujoco.mj_kinematics(model, data)
    names = [model.body(i).name for i in range(model.nbody)]
    solid = {names[i]: i for i in range(1, model.nbody) if model.body_mass[i] > LEAST}
    carried = [tuple(joint for joint, j in joints.items() if model.jnt_bodyid[j] == i) for i in range(model.nbody)]
    above = {names[i]: (names[model.body_parentid[i]], carried[i]) for i in range(1, model.nbody)}
    bodies = {}
    for name, i in solid.items():
        R = _mujoco_rotation(model.body_iquat[i])
        near, passed = _upwards(name, above, {*solid, GROUND})
        bodies[name] = BodyReading(
            GROUND if near == "world" else near,
            passed,
            float(model.body_mass[i]),
            model.body_ipos[i].copy(),
            R @ np.diag(model.body_inertia[i]) @ R.T,
            matrix(data.xpos[i], data.xmat[i].reshape(3, 3)),
        )
    screws = {
        name: screw(model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE, data.xaxis[i].copy(), data.xanchor[i])
        for name, i in joints.items()
    }
    actuators = {model.actuator(i).name: model.joint(model.actuator_trnid[i, 0]).name for i in range(model.nu)}
    gravity, couplings = model.opt.gravity.copy(), mujoco_couplings(model)
    return Reading(bodies, screws, _mujoco_closures(model), actuators, gravity, couplings)


def _mujoco_rotation(quaternion: Array) -> Array:
    import mujoco

    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _mujoco_closures(model: Any) -> dict[str, tuple[str, Array, str, Array]]:
    """Sites that the equality constraints join."""
    import mujoco

    def frame(site: int) -> Array:
        return matrix(model.site_pos[site], _mujoco_rotation(model.site_quat[site]))

    closures = {}
    for i in range(model.neq):
        if model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE:
            site1, site2 = model.eq_obj1id[i], model.eq_obj2id[i]
            body1, body2 = (model.body(model.site_bodyid[site]).name for site in (site1, site2))
            closures[model.equality(i).name] = (body1, frame(site1), body2, frame(site2))
    return closures


def mujoco_couplings(model: Any) -> dict[str, tuple[str, str, Array]]:
    """Joint equalities of a MuJoCo model: name -> joint, the one it depends on or nothing, and coefficients.

    MuJoCo's polynomial is one of coordinates that count from qpos0, that which is returned one of coordinates.
    """
    import mujoco

    def joint(i: int) -> tuple[str, float]:
        return (model.joint(i).name, float(model.qpos0[model.jnt_qposadr[i]])) if i >= 0 else ("", 0.0)

    couplings = {}
    for i in range(model.neq):
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            (name, zero), (of, of_zero) = joint(model.eq_obj1id[i]), joint(model.eq_obj2id[i])
            polynomial = model.eq_data[i, : POWERS if of else 1].copy()
            if of_zero:
                polynomial = Polynomial(polynomial)(Polynomial([-of_zero, 1.0])).coef
            polynomial[0] += zero
            couplings[model.equality(i).name] = name, of, polynomial
    return couplings


#: Reader -> (suffix of its model file, function).
READERS: dict[str, tuple[str, Callable[[Path, Mapping[str, float]], Reading]]] = {
    "yourdfpy": (".urdf", read_yourdfpy),
    "pinocchio": (".urdf", read_pinocchio),
    "mujoco": (".xml", read_mujoco),
}
