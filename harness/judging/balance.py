"""Whether forces balance: Newton and Euler for each body, power, virtual work. From one engine's answer alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.judging.answer import BODY_MOTION, FLOOR, Answer
from screwgauge.judging.kinetics import walk
from screwgauge.judging.residual import Residual, largest
from screwgauge.problem import Rows
from screwgauge.reference.continuation import partial_rates
from screwgauge.reference.reactions import reaction_components
from screwgauge.reference.rotations import Array, cross
from screwgauge.reference.wrenches import State, applied_wrenches

MOST = 201  # samples at which virtual work is asked for: it takes a walk for every joint coordinate


def spread(n: int) -> Rows:
    """At most `MOST` of n samples, both ends among them."""
    return np.unique(np.linspace(0, n - 1, MOST).astype(np.intp))


def required_wrenches(answer: Answer) -> tuple[Array, Array]:
    """What joints and actuators must exert on each body: force, and moment about the centre of mass.

    From the body motions that the engine reports, or those that follow from its joint coordinates; attitudes always
    follow from these.

    Returns:
        Wrenches, shape (n, n_body, 6), and the largest force and moment among the terms of each, shape (n_body, 2).
    """
    mechanism, applied, n = answer.mechanism, answer.applied, len(answer.t)
    w, b, a = (
        (answer.array(name) if answer.has(name) else answer.walked(name)).reshape(n, -1, 3) for name in BODY_MOTION
    )
    wrenches, sizes = np.empty((n, len(mechanism.bodies), 6)), np.empty((len(mechanism.bodies), 2))
    exerted = _springs_and_motors(answer)
    for i, body in enumerate(mechanism.bodies):
        R = answer.motions.com[i].R
        J = R @ body.inertia @ R.swapaxes(1, 2)
        forces = [body.mass * a[:, i], -body.mass * applied.g]
        moments = [(J @ b[:, i, :, None])[..., 0], cross(w[:, i], (J @ w[:, i, :, None])[..., 0])]
        for load in applied.loads:
            if load.body == body.name:
                forces.append(-load.force)
                moments.append(-load.torque)
                if load.point is not None:
                    moments.append(-cross(R @ (load.point - body.com), load.force))
        if exerted is not None:
            force, moment = exerted[:, i + 1, :3], exerted[:, i + 1, 3:]
            forces.append(-force)
            moments += [-moment, cross(R @ body.com, force)]
        for part, terms in enumerate((forces, moments)):
            wrenches[:, i, 3 * part : 3 * part + 3] = sum(terms)
            sizes[i, part] = largest(*terms)
    return wrenches, sizes


def _springs_and_motors(answer: Answer) -> Array | None:
    """Force and moment about its origin on each body, ground first, shape (n, b, 6); None if there are none."""
    applied = answer.applied
    if not (applied.springs or applied.motors):
        return None
    bodies, index = answer.motions.bodies, answer.mechanism.body_index
    return applied_wrenches(
        answer.mechanism.joints,
        applied,
        State(
            answer.t,
            np.stack([at.R for at in bodies], axis=1),
            np.stack([at.p for at in bodies], axis=1),
            np.stack([np.concatenate([at.w, at.v], axis=1) for at in bodies], axis=1),
            answer.array("joint_position"),
            answer.array("joint_velocity"),
        ),
        index,
        lambda joint: (index[joint.parent], index[joint.child]),
    )


def newton_euler(answer: Answer, required: Array, sizes: Array) -> Iterator[Residual]:
    """What the reported reactions and actuator forces leave over of the balance of each body."""
    mechanism, index = answer.mechanism, answer.mechanism.body_index
    rest, sizes = -required, sizes.copy()
    for k, force, moment, point in _exerted(answer):
        joint = mechanism.joints[k]
        for side, sign in ((joint.child, 1.0), (joint.parent, -1.0)):
            i = index[side] - 1
            if i >= 0:
                terms = force, moment + cross(point - answer.motions.com[i].p, force)
                rest[:, i] += sign * np.concatenate(terms, axis=1)
                sizes[i] = np.maximum(sizes[i], [largest(term) for term in terms])
    for part, (unit, label) in enumerate((("N", "f"), ("N m", "m"))):
        names = [f"{body.name}.{label}{axis}" for body in mechanism.bodies for axis in "xyz"]
        values = rest[:, :, 3 * part : 3 * part + 3].reshape(len(rest), -1)
        scale = np.repeat(np.maximum(sizes[:, part], FLOOR * answer.scales[unit]), 3)
        yield Residual("newton_euler", unit, names, answer.t, values, scale)


def _exerted(answer: Answer) -> Iterator[tuple[int, Array, Array, Array]]:
    """(joint, force, moment, point) of every reaction component and every actuator, parent on child. (n, 3) each."""
    mechanism, bodies, index = answer.mechanism, answer.motions.bodies, answer.mechanism.body_index
    joints, reaction = mechanism.joints, answer.values["reaction"]
    children = [bodies[index[joint.child]] for joint in joints]
    parts = reaction_components(
        joints,
        [bodies[index[joint.parent]].R for joint in joints],
        [child.R for child in children],
        [child.p for child in children],
    )
    for k, name in enumerate(parts.names):
        value = reaction.array[:, [reaction.components.index(name)]]
        yield parts.joints[k], parts.force[:, k] * value, parts.moment[:, k] * value, parts.point[:, k]
    for k, joint in enumerate(mechanism.actuators):
        at = bodies[index[joint.child]].frame(joint.child_frame)
        value = at.R @ joint.axes[0] * answer.array("actuator_force")[:, [k]]
        none = np.zeros_like(value)
        force, moment = (none, value) if joint.kind == "R" else (value, none)
        yield joints.index(joint), force, moment, at.p


def power_balance(answer: Answer, required: Array) -> Residual:
    """Power of the actuators less what motion, gravity and loads take up."""
    velocities = answer.array("joint_velocity")[:, answer.mechanism.actuated_columns]
    given = answer.array("actuator_force") * velocities
    bodies = np.stack([np.concatenate([at.v, at.w], axis=1) for at in answer.motions.com], axis=1)
    taken = required * bodies
    # at a dead centre the sum is zero and only its terms tell how large rounding is
    scale = max(largest(given, taken), FLOOR * answer.scales["W"])
    values = np.sum(given, axis=1) - np.sum(taken, axis=(1, 2))
    return Residual("power_balance", "W", ["all actuators"], answer.t, values[:, None], scale)


def virtual_work(answer: Answer, required: Array, sizes: Array) -> Iterator[Residual]:
    """Generalised and actuator forces against the work of the required wrenches on every allowed motion.

    Where an answer has no forces that work must vanish, whatever the reactions, and is measured by its largest term.
    The allowed motions come from walking the mechanism with one joint velocity at a time, at up to `MOST` samples.
    """
    mechanism, rows = answer.mechanism, spread(len(answer.t))
    joints, bodies = allowed_motions(answer, answer.array("joint_position")[rows])
    needed = np.einsum("nbx,nbxj->nj", required[rows], bodies)
    terms = np.einsum("bx,nbxj->nj", np.repeat(sizes, 3, axis=1), np.abs(bodies))
    given: dict[str, Array] = {}
    if answer.has("generalized_force"):
        given[""] = answer.array("generalized_force")[rows]
    if answer.has("actuator_force"):
        driven = joints[:, mechanism.actuated_columns]
        given[" by actuators"] = np.einsum("nkj,nk->nj", driven, answer.array("actuator_force")[rows])
    units = [mechanism.units[column] for column in mechanism.independent_columns]
    for unit in dict.fromkeys(units):
        columns = [k for k, has in enumerate(units) if has == unit]
        force = "N m" if unit == "rad" else "N"
        size = largest(needed[:, columns]) if given else terms[:, columns].max(axis=0)
        names = [f"{list(mechanism.independent)[k]}{how}" for how in given or [""] for k in columns]
        values = [Q[:, columns] - needed[:, columns] for Q in given.values()] or [needed[:, columns]]
        scale = np.maximum(size, FLOOR * answer.scales[force])
        yield Residual("virtual_work", force, names, answer.t[rows], np.concatenate(values, axis=1), scale)


def allowed_motions(answer: Answer, q: Array) -> tuple[Array, Array]:
    """Joint velocities per velocity of y, shape (n, n_q, k), and what they make of the bodies, (n, n_body, 6, k).

    The bodies' part is the velocity of the centre of mass over the angular velocity.
    """
    zero, closure, moved = np.zeros_like(q), [], []
    for i in range(q.shape[1]):
        unit = zero.copy()
        unit[:, i] = 1.0
        motions = walk(answer.mechanism, answer.tree, q, unit, zero)
        closure.append(motions.closure(1).reshape(len(q), -1))
        moved.append(np.stack([np.concatenate([at.v, at.w], axis=1) for at in motions.com], axis=1))
    chosen = np.eye(q.shape[1])[answer.mechanism.independent_columns]
    system = np.concatenate([np.stack(closure, axis=2), np.tile(chosen, (len(q), 1, 1))], axis=1)
    joints = partial_rates(system, len(chosen))
    return joints, np.einsum("inbx,nij->nbxj", np.stack(moved), joints)
