"""Whether forces balance: Newton and Euler for each body, power, virtual work. From one engine's answer alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.judging.kinetics import unit_motions
from screwgauge.reference.continuation import velocity_map
from screwgauge.reference.reactions import reaction_components
from screwgauge.reference.rotations import Array, cross
from screwgauge.reference.wrenches import State, applied_wrenches

#: Motion of the bodies: quantity -> field of `Moving`, and the joint quantities that it follows from.
BODY_MOTION = {
    "body_angular_velocity": ("w", {"joint_velocity"}),
    "body_angular_acceleration": ("b", {"joint_velocity", "joint_acceleration"}),
    "com_acceleration": ("a", {"joint_velocity", "joint_acceleration"}),
}
_FORCE = {"rad": "N m", "m": "N"}


def walked(answer: Answer, quantity: str) -> Array:
    """One of `BODY_MOTION` as it follows from the joint coordinates. Shape (n, 3 n_body)."""
    motion: Array = getattr(answer.motions.com, BODY_MOTION[quantity][0])
    return motion.reshape(len(motion), -1)


def judgeable(answer: Answer) -> bool:
    """Whether the forces of a given motion can be judged: with springs and motors that takes velocities, too."""
    acting = answer.applied.springs or answer.applied.motors
    return answer.has(*BODY_MOTION, "actuator_force", *(["joint_velocity"] if acting else []))


def required_wrenches(answer: Answer) -> tuple[Array, Array]:
    """What joints and actuators must exert on each body: force, and moment about the centre of mass.

    From the body motions that the engine reports, or those that follow from its joint coordinates; attitudes always
    follow from these.

    Returns:
        Wrenches, shape (n, n_body, 6), and the largest force and moment among the terms of each, shape (n_body, 2).
    """
    mechanism, applied, R = answer.mechanism, answer.applied, answer.motions.com.R
    shape = *R.shape[:2], 3
    w, b, a = ((answer[name] if answer.has(name) else walked(answer, name)).reshape(shape) for name in BODY_MOTION)
    mass = np.array([body.mass for body in mechanism.bodies])[:, None]
    com = np.stack([body.com for body in mechanism.bodies])
    J = R @ np.stack([body.inertia for body in mechanism.bodies]) @ R.swapaxes(-1, -2)
    terms = [(mass * a, _times(J, b)), (np.broadcast_to(-mass * applied.g, shape), cross(w, _times(J, w)))]
    for load in applied.loads:
        i = mechanism.body_index[load.body] - 1
        force, torque, moment = np.zeros((3, *shape))
        force[:, i], torque[:, i] = -load.force, -load.torque
        if load.point is not None:
            moment[:, i] = -cross(R[:, i] @ (load.point - com[i]), load.force)
        terms += [(force, torque), (np.zeros(shape), moment)]
    if applied.springs or applied.motors:
        exerted = _springs_and_motors(answer)[:, 1:]
        force, moment = exerted[..., :3], exerted[..., 3:]
        terms += [(-force, -moment), (np.zeros(shape), cross(_times(R, com), force))]
    wrenches = np.concatenate([sum(parts) for parts in zip(*terms, strict=True)], axis=2)
    sizes = [[np.nanmax(np.abs(part), axis=(0, 2), initial=0.0) for part in term] for term in terms]
    return wrenches, np.max(sizes, axis=0).T


def _times(matrix: Array, vector: Array) -> Array:
    """Matrix times vector. Shapes (..., 3, 3), (..., 3)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _springs_and_motors(answer: Answer) -> Array:
    """Force and moment about its origin on each body, ground first. Shape (n, n_body + 1, 6)."""
    bodies, index = answer.motions.bodies, answer.mechanism.body_index
    twists = np.concatenate([bodies.w, bodies.v], axis=2)
    return applied_wrenches(
        answer.mechanism.joints,
        answer.applied,
        State(answer.t, bodies.R, bodies.p, twists, answer["joint_position"], answer["joint_velocity"]),
        index,
        lambda joint: (index[joint.parent], index[joint.child]),
    )


def newton_euler(answer: Answer, required: Array, sizes: Array) -> Iterator[Row]:
    """What the reported reactions and actuator forces leave over of the balance of each body."""
    if not answer.has("reaction"):
        return
    mechanism, com, index = answer.mechanism, answer.motions.com, answer.mechanism.body_index
    missing, sizes = required.copy(), sizes.copy()
    for k, force, moment, point in _exerted(answer):
        joint = mechanism.joints[k]
        for side, sign in ((joint.child, 1.0), (joint.parent, -1.0)):
            i = index[side] - 1
            if i >= 0:
                terms = force, moment + cross(point - com.p[:, i], force)
                missing[:, i] -= sign * np.concatenate(terms, axis=1)
                sizes[i] = np.maximum(sizes[i], [largest(term) for term in terms])
    for part, (unit, label) in enumerate((("N", "f"), ("N m", "m"))):
        names = [f"{body.name}.{label}{axis}" for body in mechanism.bodies for axis in "xyz"]
        values = missing[:, :, 3 * part : 3 * part + 3].reshape(len(missing), -1)
        yield answer.residual("newton_euler", unit, names, values, np.repeat(sizes[:, part], 3), "reaction")


def _exerted(answer: Answer) -> Iterator[tuple[int, Array, Array, Array]]:
    """(joint, force, moment, point) of every reaction component and every actuator, parent on child. (n, 3) each."""
    mechanism, bodies = answer.mechanism, answer.motions.bodies
    joints, index = mechanism.joints, mechanism.body_index
    R_parent = [bodies.R[:, index[joint.parent]] for joint in joints]
    R_child = [bodies.R[:, index[joint.child]] for joint in joints]
    p_child = [bodies.p[:, index[joint.child]] for joint in joints]
    parts = reaction_components(joints, R_parent, R_child, p_child)
    for k, name in enumerate(parts.names):
        value = answer["reaction"][:, [answer.values["reaction"].components.index(name)]]
        yield parts.joints[k], parts.force[:, k] * value, parts.moment[:, k] * value, parts.point[:, k]
    for column, joint in enumerate(mechanism.actuators):
        k, frame = joints.index(joint), joint.child_frame
        value = R_child[k] @ (frame.R @ joint.axes[0]) * answer["actuator_force"][:, [column]]
        pair = (np.zeros_like(value), value) if joint.kind == "R" else (value, np.zeros_like(value))
        yield k, *pair, p_child[k] + R_child[k] @ frame.p


def power_balance(answer: Answer, required: Array) -> Iterator[Row]:
    """What motion, gravity and loads take up less the power of the actuators."""
    if not answer.has("joint_velocity"):
        return
    given = answer["actuator_force"] * answer["joint_velocity"][:, answer.mechanism.actuated_columns]
    taken = required * answer.motions.velocities
    missing = np.sum(taken, axis=(1, 2)) - np.sum(given, axis=1)
    # at a dead centre the sum is zero and only its terms tell how large rounding is
    yield answer.residual("power_balance", "W", ["all actuators"], missing[:, None], largest(given, taken), "")


def virtual_work(answer: Answer, required: Array, sizes: Array) -> Iterator[Row]:
    """Work of the required wrenches on every allowed motion less that of the generalised and actuator forces.

    Where an answer has no forces the first must vanish, whatever the reactions, and is measured by its largest term.
    """
    mechanism = answer.mechanism
    joints, bodies = allowed_motions(answer)
    needed = np.einsum("nbx,nbxj->nj", required, bodies)
    terms = np.einsum("bx,nbxj->nj", np.repeat(sizes, 3, axis=1), np.abs(bodies)).max(axis=0)
    given = {}
    if answer.has("generalized_force"):
        given[""] = answer["generalized_force"]
    if answer.has("actuator_force"):
        driven = joints[:, mechanism.actuated_columns]
        given[" by actuators"] = np.einsum("nkj,nk->nj", driven, answer["actuator_force"])
    units = [mechanism.units[column] for column in mechanism.independent_columns]
    for unit in dict.fromkeys(units):
        columns = [k for k, has in enumerate(units) if has == unit]
        names = [f"{list(mechanism.independent)[k]}{how}" for how in given or [""] for k in columns]
        missing = [needed[:, columns] - forces[:, columns] for forces in given.values()] or [needed[:, columns]]
        size = largest(needed[:, columns]) if given else terms[columns]
        left = np.concatenate(missing, axis=1)
        yield answer.residual("virtual_work", _FORCE[unit], names, left, size, "generalized_force")


def allowed_motions(answer: Answer) -> tuple[Array, Array]:
    """Motions that close the loops, by walking the mechanism with one joint velocity at a time.

    Returns:
        Per velocity of y, the velocities of the joints, shape (n, n_q, k), and those of the centres of mass over the
        angular velocities, shape (n, n_body, 6, k).
    """
    q = answer["joint_position"]
    n, n_q = q.shape
    motions = list(unit_motions(answer.mechanism, answer.tree, q, range(n_q)))
    columns, length = answer.mechanism.independent_columns, answer.scales["m"]  # equations without dimension
    size = np.array([1.0 if unit == "rad" else length for unit in answer.mechanism.units])
    lengths = np.array([1.0, length])[:, None]
    residuals = np.stack([(each.closure_residual(1) / lengths).reshape(n, -1) for each in motions], axis=2) * size
    chosen = np.tile(np.eye(n_q)[columns], (n, 1, 1))
    joints = velocity_map(np.concatenate([residuals, chosen], axis=1), len(columns)) * size[:, None] / size[columns]
    return joints, np.einsum("inbx,nij->nbxj", np.stack([each.velocities for each in motions]), joints)
