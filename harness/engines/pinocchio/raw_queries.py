"""Query Pinocchio directly about any model at given states."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from screwgauge.engines.raw_queries import Answers, JointStates, frame_motion
from screwgauge.models.readings.pinocchio import elementary, load_pinocchio, start
from screwgauge.models.readings.source import prepare
from screwgauge.reference.rotations import Array


def ask(
    path: Path, bodies: tuple[str, ...], joints: Mapping[str, JointStates], floating: bool = False, whole: bool = False
) -> Answers:
    """Query Pinocchio, see `raw_queries.Ask`. RNEA includes armature, but not damping, friction or springs."""
    source = prepare(path, floating=floating)
    model = load_pinocchio(source)
    data = model.createData()
    q, v, a, B = _states(model, source, joints)
    B, turning = _planar(model, q, v, B)
    frames = [model.getFrameId(name, pin.FrameType.BODY) for name in bodies]
    states = zip(q, (B @ v[..., None])[..., 0], (B @ a[..., None])[..., 0] + turning, strict=True)
    samples = [_sample(model, data, frames, state) for state in states]
    tau, M, bias, gravity, velocity, acceleration = (np.array(each) for each in zip(*samples, strict=True))
    bias = bias + (M @ turning[..., None])[..., 0]
    tau, bias, gravity = ((each[:, None] @ B)[:, 0] for each in (tau, bias, gravity))
    return Answers(frozenset({"armature"}), tau, B.swapaxes(1, 2) @ M @ B, bias, gravity, velocity, acceleration)


def _planar(model: Any, q: Array, v: Array, B: Array) -> tuple[Array, Array]:
    """Return the velocity map at each sample, and the accelerations due to its rate. Shapes (n, n_v, m), (n, n_v).

    Pinocchio expresses the linear velocity of a planar joint in the axes of the outer body. The reading splits this
    joint into two slides and then a hinge, which use the axes of the inner body.
    """
    maps, turning = np.tile(B, (len(q), 1, 1)), np.zeros((len(q), model.nv))
    for joint in model.joints:
        if joint.shortname() == "JointModelPlanar":
            c, s = q[:, joint.idx_q + 2], q[:, joint.idx_q + 3]
            ways = slice(joint.idx_v, joint.idx_v + 2)
            rate = (v @ B[joint.idx_v + 2])[:, None]
            linear = v @ B[ways].T
            maps[:, ways] = np.stack([np.stack([c, s], axis=1), np.stack([-s, c], axis=1)], axis=1) @ B[ways]
            turned = np.stack([np.stack([-s, c], axis=1), np.stack([-c, -s], axis=1)], axis=1)
            turning[:, ways] = rate * (turned @ linear[..., None])[..., 0]
    return maps, turning


def _states(model: Any, source: Any, joints: Mapping[str, JointStates]) -> tuple[Array, Array, Array, Array]:
    """Return Pinocchio's coordinates, the reading's velocities and accelerations, and the velocity map.

    This map, evaluated at the home pose, converts the reading's velocities to Pinocchio's.
    """
    n = len(next(iter(joints.values())).q)
    q = np.tile(start(model), (n, 1))
    data = model.createData()
    pin.forwardKinematics(model, data, q[0])
    parts = {part.name: part for part in elementary(model, source)}
    B = np.zeros((model.nv, sum(each.qd.shape[1] for each in joints.values())))
    column = 0
    for name, states in joints.items():
        part, width = parts[name], states.qd.shape[1]
        rows = slice(part.v, part.v + width)
        if width == 1:
            B[part.v, column] = 1.0
            angle = states.q[:, 0]
            q[:, part.q : part.q + part.n_q] = (
                states.q if part.n_q == 1 else np.stack([np.cos(angle), np.sin(angle)], axis=1)
            )
        else:
            pose, velocity = frame_motion(states, data.oMi[part.joint].homogeneous)
            begin = pin.XYZQUATToSE3(q[0, part.q : part.q + 7]).homogeneous if width == 6 else np.eye(4)
            q[:, part.q : part.q + part.n_q] = [_coordinates(begin @ T, width) for T in pose]
            # [linear; angular] of a free joint
            order = [3, 4, 5, 0, 1, 2] if width == 6 else [0, 1, 2]
            B[rows, column : column + width] = velocity[order]
        column += width
    return q, np.hstack([each.qd for each in joints.values()]), np.hstack([each.qdd for each in joints.values()]), B


def _coordinates(T: Array, width: int) -> Array:
    """Return the coordinates of a ball or free joint, with the quaternion (real part last) at the end."""
    quaternion = pin.Quaternion(T[:3, :3]).coeffs()
    return np.concatenate([T[:3, 3], quaternion]) if width == 6 else np.asarray(quaternion)


def _sample(model: Any, data: Any, frames: list[int], state: tuple[Array, Array, Array]) -> tuple[Array, ...]:
    q, v, a = state
    M = np.array(pin.crba(model, data, q))
    M = np.triu(M) + np.triu(M, 1).T
    bias = pin.nonLinearEffects(model, data, q, v).copy()
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    tau = pin.rnea(model, data, q, v, a).copy()
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    twists = [pin.getFrameVelocity(model, data, i, axes) for i in frames]
    changes = [pin.getFrameClassicalAcceleration(model, data, i, axes) for i in frames]
    velocity, acceleration = (
        np.array([[*each.angular, *each.linear] for each in of]).reshape(-1, 6) for of in (twists, changes)
    )
    return tau, M, bias, gravity, velocity, acceleration
