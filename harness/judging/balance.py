"""Whether forces balance: Newton and Euler for each body, power, virtual work. From one engine's answer alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.judging.allowed import Allowed
from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.judging.exerted import unit_forces
from screwgauge.quantities import FORCE
from screwgauge.reference.rotations import Array, cross, lanes, times
from screwgauge.reference.wrenches import State, applied_wrenches

#: Motion of the bodies: quantity -> field of `Moving`.
BODY_MOTION = {"body_angular_velocity": "w", "body_angular_acceleration": "b", "com_acceleration": "a"}


def walked(answer: Answer, quantity: str) -> Array:
    """One of `BODY_MOTION` as it follows from the joint coordinates. Shape (n, n_body, 3)."""
    return np.asarray(getattr(answer.motions.com, BODY_MOTION[quantity]))


def required_wrenches(answer: Answer, *, loaded: bool = True) -> tuple[Array, Array]:
    """What joints and actuators must exert on each body: force, and moment about the centre of mass.

    From the body motions that the engine reports, or those that follow from its joint coordinates; attitudes always
    follow from these.

    Args:
        loaded: With loads, springs and motors, and not for inertia and gravity alone.

    Returns:
        Wrenches, shape (n, n_body, 6), and the largest force and moment among the terms of each, shape (n_body, 2).
    """
    mechanism, applied, R = answer.mechanism, answer.applied, answer.motions.com.R
    w, b, a = (_vectors(answer[name]) if answer.has(name) else walked(answer, name) for name in BODY_MOTION)
    mass = np.array([body.mass for body in mechanism.bodies])[:, None]
    com, J = (np.stack([getattr(body, name) for body in mechanism.bodies]) for name in ("com", "inertia"))
    wrenches, sizes = lanes(len(R), len(mass), 6), np.zeros((len(mass), 2))
    wrenches[:] = 0.0

    def add(bodies: slice, *wrench: Array) -> None:
        for k, part in enumerate(wrench):
            wrenches[:, bodies, 3 * k : 3 * k + 3] += part
            size = np.nanmax(np.abs(part), axis=(0, 2), initial=0.0)
            sizes[bodies, k] = np.maximum(sizes[bodies, k], size)

    def inertial(vector: Array) -> Array:
        return times(R, times(J[None], times(R.swapaxes(-1, -2), vector)))

    every, none = slice(None), np.zeros((1, 1, 3))
    add(every, mass * a, inertial(b))
    add(every, (-mass * applied.g)[None], cross(w, inertial(w)))
    for load in applied.loads if loaded else ():
        i = mechanism.body_index[load.body] - 1
        body = slice(i, i + 1)
        add(body, -load.force[None, None], -load.torque[None, None])
        if load.point is not None:
            add(body, none, -cross(times(R[:, body], load.point - com[i]), load.force))
    if loaded and (applied.springs or applied.motors):
        exerted = _springs_and_motors(answer)[:, 1:]
        force, moment = exerted[..., :3], exerted[..., 3:]
        add(every, -force, -moment)
        add(every, none, cross(times(R, com), force))
    return wrenches, sizes


def _vectors(array: Array) -> Array:
    """Three numbers of each body, as `lanes`. Shape (n, 3 n_body) -> (n, n_body, 3)."""
    found = lanes(len(array), array.shape[1] // 3, 3)
    found[:] = array.reshape(found.shape)
    return found


def _springs_and_motors(answer: Answer) -> Array:
    """Force and moment about its origin on each body, ground first. Shape (n, n_body + 1, 6)."""
    bodies, index = answer.motions.bodies, answer.mechanism.body_index
    twists = np.concatenate([bodies.w, bodies.v], axis=2)
    return applied_wrenches(
        answer.mechanism.joints,
        answer.applied,
        State(answer.t, bodies.R, bodies.p, twists, *answer.joints[:2]),
        index,
        lambda joint: (index[joint.parent], index[joint.child]),
    )


def newton_euler(answer: Answer, required: Array, sizes: Array) -> Iterator[Row]:
    """What the reported reactions and actuator forces leave over of the balance of each body."""
    mechanism, missing, sizes, loose = answer.mechanism, required.copy("K"), sizes.copy(), np.zeros_like(sizes)
    for unit in (*unit_forces(answer, "reaction"), *unit_forces(answer, "actuator_force")):
        admitted, amount = answer.admitted(unit.quantity, unit.unit), unit.amount(answer)
        for body, wrench in unit.sides(answer):
            exerted = amount * wrench
            missing[:, body] -= exerted
            sizes[body] = np.maximum(sizes[body], [largest(exerted[:, :3]), largest(exerted[:, 3:])])
            if admitted:
                loose[body] += admitted * np.array([largest(wrench[:, :3]), largest(wrench[:, 3:])])
    sizes = np.maximum(sizes, loose)
    for part, (unit_name, label) in enumerate((("N", "f"), ("N m", "m"))):
        names = [f"{body.name}.{label}{axis}" for body in mechanism.bodies for axis in "xyz"]
        values = missing[:, :, 3 * part : 3 * part + 3].reshape(len(missing), -1)
        about = ("reaction", "actuator_force", *BODY_MOTION)
        yield answer.residual("newton_euler", unit_name, names, values, np.repeat(sizes[:, part], 3), about)


def power_balance(answer: Answer, required: Array) -> Iterator[Row]:
    """What motion, gravity and loads take up less the power of the actuators."""
    rates = answer.joints[1][:, answer.mechanism.actuated_columns]
    given = answer["actuator_force"] * rates
    taken = required * answer.motions.velocities
    missing = np.sum(taken, axis=(1, 2)) - np.sum(given, axis=1)
    # at a dead centre the sum is zero and only its terms tell how large rounding is
    size, about = largest(given, taken, _loose(answer, rates)), ("actuator_force", "joint_velocity", *BODY_MOTION)
    yield answer.residual("power_balance", "W", ["all actuators"], missing[:, None], size, about)


def _loose(answer: Answer, rates: Array) -> Array:
    """Power of the actuators that an error admitted by the scene is a share of, rates being (n, n_actuator, ...)."""
    forces = [answer.admitted("actuator_force", unit) for unit in answer.mechanism.actuator_units]
    return np.tensordot(np.abs(rates), forces, (1, 0))


def virtual_work(answer: Answer, allowed: Allowed, required: Array, sizes: Array) -> Iterator[Row]:
    """Work of the required wrenches on every allowed motion less that of the generalised and actuator forces.

    Where an answer has no forces the first must vanish, whatever the reactions, and is measured by its largest term.
    """
    mechanism = answer.mechanism
    joints, bodies = allowed.partial
    needed = np.einsum("nbx,nbxj->nj", required, bodies)
    terms = np.einsum("bx,nbxj->nj", np.repeat(sizes, 3, axis=1), np.abs(bodies)).max(axis=0)
    given, loose = {}, np.zeros(terms.shape)
    if answer.has("generalized_force"):
        given[""] = answer["generalized_force"]
    if answer.has("actuator_force"):
        driven = joints[:, mechanism.actuated_columns]
        given[" by actuators"] = np.einsum("nkj,nk->nj", driven, answer["actuator_force"])
        loose = _loose(answer, driven)
    units = [mechanism.units[column] for column in mechanism.independent_columns]
    for unit in dict.fromkeys(units):
        columns = [k for k, has in enumerate(units) if has == unit]
        names = [f"{list(mechanism.independent)[k]}{how}" for how in given or [""] for k in columns]
        missing = [needed[:, columns] - forces[:, columns] for forces in given.values()] or [needed[:, columns]]
        size = largest(needed[:, columns], loose[..., columns]) if given else terms[columns]
        left, about = np.concatenate(missing, axis=1), ("generalized_force", "actuator_force", *BODY_MOTION)
        yield answer.residual("virtual_work", FORCE[unit], names, left, size, about)
