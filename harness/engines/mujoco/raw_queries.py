"""Query MuJoCo directly about any model at given states, with constraints and contacts disabled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from screwgauge.engines.raw_queries import Answers, JointStates, frame_motion
from screwgauge.models.readings.compiled import collect_phrases
from screwgauge.models.readings.mujoco import load_mujoco
from screwgauge.models.readings.source import prepare
from screwgauge.reference.rotations import Array, cross

_EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
#: Arrays of passive forces and inertia that readings omit with a note.
_IN_NO_READING = (
    *("tendon_stiffness", "tendon_stiffnesspoly", "tendon_damping", "tendon_dampingpoly", "tendon_armature"),
    *("jnt_stiffnesspoly", "jnt_springyield", "dof_dampingpoly", "jnt_actgravcomp"),
    *("actuator_armature", "actuator_damping", "actuator_dampingpoly"),
)
COVERS = frozenset({"armature", "damping", "stiffness", "medium"})


def ask(
    path: Path, bodies: tuple[str, ...], joints: Mapping[str, JointStates], floating: bool = False, whole: bool = False
) -> Answers:
    """Query MuJoCo, see `raw_queries.Ask`. `mj_inverse` includes passive forces, but no dry friction (a constraint)."""
    with collect_phrases():
        model, data, states = _load(path, joints, floating, ("CONSTRAINT",), whole=whole)
        numbers = [model.body(name).id for name in bodies]
        samples = [_sample(model, data, numbers, state) for state in states]
    tau, M, bias, gravity, velocity, acceleration = (np.array(each) for each in zip(*samples, strict=True))
    return Answers(COVERS, tau, M, bias, gravity, velocity, acceleration)


def closing_rows(path: Path, joints: Mapping[str, JointStates], floating: bool = False) -> tuple[Array, Array]:
    """Return the equality constraints' rows with respect to the reading's velocities; other constraints are disabled.

    Returns:
        Rows J, shape (n, m, n_freedom), and ``Jdot v``, shape (n, m), which is valid if the velocities keep the loops
        closed.
    """
    with collect_phrases():
        model, data, states = _load(path, joints, floating, ("CONTACT", "FRICTIONLOSS", "LIMIT"))
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        samples = [_sample_closures(model, data, state) for state in states]
    rows, bias = (np.array(each) for each in zip(*samples, strict=True))
    return rows, bias


def _load(
    path: Path, joints: Mapping[str, JointStates], floating: bool, off: Iterable[str], *, whole: bool = False
) -> tuple[Any, Any, Iterator[tuple[Array, ...]]]:
    """Load a model with the constraints in `off` disabled; return it, its data, and an iterator over its states."""
    model = load_mujoco(prepare(path, floating=floating))
    for name in off:
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    if not whole:
        model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)
        for entry in _IN_NO_READING:
            if hasattr(model, entry):  # in all versions of MuJoCo
                getattr(model, entry)[:] = 0
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    motions = {name: _carry(model, data, name, each) for name, each in joints.items() if each.qd.shape[1] > 1}
    n = len(next(iter(joints.values())).q)
    return model, data, (_state(model, joints, motions, k) for k in range(n))


def _sample_closures(model: Any, data: Any, state: tuple[Array, ...]) -> tuple[Array, ...]:
    q, v, a, B, qdd = state
    _inverse(model, data, (q, np.zeros(model.nv), a))
    rest = data.efc_aref.copy()
    _inverse(model, data, (q, v, a))
    own = data.efc_type == _EQUALITY
    J = data.efc_J.reshape(data.nefc, model.nv)[own]
    # accelerations due to the turning of a free joint's velocity axes belong to the velocity terms
    return J @ B, (rest - data.efc_aref)[own] + J @ (a - B @ qdd)


def _carry(model: Any, data: Any, name: str, states: JointStates) -> tuple[Array, Array]:
    body, frame = model.jnt_bodyid[model.joint(name).id], np.eye(4)
    frame[:3, :3], frame[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    pose, velocity = frame_motion(states, frame)
    return frame @ pose if states.kind == "free" else pose, velocity


def _state(
    model: Any, joints: Mapping[str, JointStates], motions: Mapping[str, tuple[Array, Array]], k: int
) -> tuple[Array, Array, Array, Array, Array]:
    """Return MuJoCo's coordinates, velocities and accelerations, the velocity map, and the reading's accelerations.

    The map converts the reading's velocities to MuJoCo's.
    """
    q, a, column = model.qpos0.copy(), np.zeros(model.nv), 0
    B = np.zeros((model.nv, sum(each.qd.shape[1] for each in joints.values())))
    qd, qdd = (np.concatenate([getattr(each, rate)[k] for each in joints.values()]) for rate in ("qd", "qdd"))
    for name, states in joints.items():
        i, width = model.joint(name).id, states.qd.shape[1]
        at, dof = model.jnt_qposadr[i], model.jnt_dofadr[i]
        columns = slice(column, column + width)
        if width == 1:
            q[at], B[dof, column] = states.q[k, 0], 1.0
        else:
            poses, V = motions[name]
            T = poses[k]
            R, quaternion = T[:3, :3], np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
            q[at + width - 3 : at + width + 1] = quaternion
            if width == 3:
                B[dof : dof + 3, columns] = V
            else:  # velocity of the origin in the world, then angular velocity in the body
                q[at : at + 3] = T[:3, 3]
                B[dof : dof + 3, columns], B[dof + 3 : dof + 6, columns] = R @ V[3:], V[:3]
                rates = V @ qd[columns]
                a[dof : dof + 3] = R @ cross(rates[:3], rates[3:])
        column += width
    return q, B @ qd, B @ qdd + a, B, qdd


def _sample(model: Any, data: Any, bodies: list[int], state: tuple[Array, ...]) -> tuple[Array, ...]:
    q, v, a, B, qdd = state
    zero, M = np.zeros(model.nv), np.empty((model.nv, model.nv))
    gravity = _inverse(model, data, (q, zero, zero)) - _passive(data)
    # accelerations due to the turning of a free joint's velocity axes belong to the velocity terms
    bias = _inverse(model, data, (q, v, a - B @ qdd)) - _passive(data)
    tau = _inverse(model, data, (q, v, a))
    for unit, column in zip(np.eye(model.nv), M, strict=True):  # `mj_fullM` takes other arguments since 4.0
        mujoco.mj_mulM(model, data, column, unit)
    mujoco.mj_rnePostConstraint(model, data)
    velocity, acceleration = np.zeros((len(bodies), 6)), np.zeros((len(bodies), 6))
    for k, i in enumerate(bodies):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, i, velocity[k], 0)
        mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_XBODY, i, acceleration[k], 0)
    if not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        acceleration[:, 3:] += model.opt.gravity  # MuJoCo's acceleration of a falling body is zero
    return tau @ B, B.T @ M @ B, bias @ B, gravity @ B, velocity, acceleration


def _inverse(model: Any, data: Any, state: tuple[Array, Array, Array]) -> Array:
    data.qpos[:], data.qvel[:], data.qacc[:] = state
    mujoco.mj_inverse(model, data)
    return np.array(data.qfrc_inverse)


def _passive(data: Any) -> Array:
    """Return the forces that overcome springs, dampers and the medium, excluding gravity compensation."""
    return np.asarray(data.qfrc_gravcomp - data.qfrc_passive)
