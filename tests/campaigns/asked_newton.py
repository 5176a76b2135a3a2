"""Newton's inverse dynamics of a USD, in 32 bits, of the tree that its reading has."""

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import newton
import numpy as np
import warp
from campaigns.own_library import Forces
from newton.usd import SchemaResolverMjc, SchemaResolverNewton, SchemaResolverPhysx
from scipy.spatial.transform import Rotation

from screwgauge.diagnosis.libraries import joint_states
from screwgauge.engines.raw_queries import JointStates, frame_motion
from screwgauge.models.kinematics import ReadingTree
from screwgauge.models.readings.reading import JointReading
from screwgauge.reference.rotations import Array, cross, skew
from screwgauge.witness.tree import TreeStates

#: Schemas that are read, the one that is asked first in front.
SCHEMAS = (SchemaResolverNewton, SchemaResolverMjc, SchemaResolverPhysx)


def ask(path: Path, tree: ReadingTree, states: TreeStates) -> Forces:
    """Torques made of mass matrix, bias and gravity, with rotors, without damping.

    Raises:
        ValueError: Newton has a joint otherwise.
    """
    model = _loaded(path)
    joints = joint_states(tree, states)
    places = {name: _places(model, tree, name) for name in joints if f"{name}.loop" not in tree.reading.closures}
    tau = []
    for k in range(len(states.q)):
        q, B = model.joint_q.numpy().astype(float), np.zeros((model.joint_dof_count, tree.freedom))
        extra = np.zeros(model.joint_dof_count)
        for name, (at_q, at) in places.items():
            each = joints[name]
            if each.kind == "free":
                q[at_q], B[at, tree.freedoms[name]], extra[at] = _free(_com(model, at), each, k)
            else:
                q[at_q], B[at, tree.freedoms[name]] = each.q[k], 1.0
        tau.append(_inverse(model, q, B @ states.qd[k], B @ states.qdd[k] + extra) @ B)
    return Forces(np.array(tau), frozenset({"armature"}))


def _loaded(path: Path) -> Any:
    warp.config.quiet = True
    builder, schemas = newton.ModelBuilder(), [each() for each in SCHEMAS]
    with warnings.catch_warnings(action="ignore"):
        builder.add_usd(str(path), collapse_fixed_joints=False, load_visual_shapes=False, schema_resolvers=schemas)
        return builder.finalize(device="cpu")


def _places(model: Any, tree: ReadingTree, name: str) -> tuple[slice, slice]:
    """Coordinates and velocities of a joint in Newton's arrays; Newton has one joint for each body."""
    joint = tree.reading.joints[name]
    body = next(body for body, one in tree.reading.bodies.items() if name in one.joints)
    carried = [model.body_label[i].rpartition("/")[2] for i in model.joint_child.numpy()]
    moving = [i for i, dims in enumerate(model.joint_dof_dim.numpy()) if carried[i] == body and dims.any()]
    if len(moving) != 1 or model.joint_articulation.numpy()[moving[0]] < 0:
        raise ValueError(f"newton has joint {name} otherwise")
    q, v = (int(starts.numpy()[moving[0]]) for starts in (model.joint_q_start, model.joint_qd_start))
    if joint.kind == "free":
        return slice(q, q + 7), slice(v, v + 6)
    k = _number(model, moving[0], v, joint)
    return slice(q + k, q + k + 1), slice(v + k, v + k + 1)


def _number(model: Any, i: int, start: int, joint: JointReading) -> int:
    """Which of the freedoms of a joint goes the way of a joint of the reading, at home."""
    slides, turns = model.joint_dof_dim.numpy()[i]
    first, last = (0, slides) if joint.kind == "slide" else (slides, slides + turns)
    near = model.joint_parent.numpy()[i]
    R = Rotation.from_quat(model.joint_X_p.numpy()[i][3:])
    R = R if near < 0 else Rotation.from_quat(model.body_q.numpy()[near][3:]) * R
    axes = R.apply(model.joint_axis.numpy()[start + first : start + last])
    return int(first + np.abs(axes @ joint.direction).argmax())


def _com(model: Any, at: slice) -> Array:
    """Centre of mass of the body of a free joint, without what is fixed to it."""
    child = model.joint_child.numpy()[[*model.joint_qd_start.numpy()].index(at.start)]
    return np.asarray(model.body_com.numpy()[child], dtype=float)


def _free(com: Array, states: JointStates, k: int) -> tuple[Array, Array, Array]:
    """Pose, and velocity of the centre of mass before the angular one, along axes of the world."""
    T = states.frame @ frame_motion(states, states.frame)[0][k]
    R, rates = T[:3, :3], states.qd[k]
    to_com = np.hstack([-skew(com), np.eye(3)])
    turning = cross(rates[:3], to_com @ rates)
    q = np.concatenate([T[:3, 3], Rotation.from_matrix(R).as_quat()])
    return q, np.vstack([R @ to_com, np.hstack([R, np.zeros((3, 3))])]), np.concatenate([R @ turning, np.zeros(3)])


def _inverse(model: Any, q: Array, qd: Array, qdd: Array) -> Array:
    state = model.state()
    state.joint_q.assign(q)
    state.joint_qd.assign(qd)
    newton.eval_fk(model, state.joint_q, state.joint_qd, state)
    width = model.max_dofs_per_articulation
    M = warp.zeros((model.articulation_count, width, width), dtype=float)
    gravity, bias = (warp.zeros(model.joint_dof_count, dtype=float) for _ in range(2))
    newton.eval_inverse_dynamics_passive(model, state, mass_matrix=M, gravity_force=gravity, coriolis_force=bias)
    tau = bias.numpy().astype(float) + gravity.numpy()
    joints, starts = model.articulation_start.numpy(), model.joint_qd_start.numpy()
    for block, (first, last) in zip(M.numpy().astype(float), pairwise(starts[joints]), strict=True):
        tau[first:last] += block[: last - first, : last - first] @ qdd[first:last]
    return tau
