"""Whether forces balance: Newton and Euler for each body, power, virtual work. From one engine's answer alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.quantities import FORCE
from screwgauge.reference.rotations import Array, cross, lanes
from screwgauge.witness.admissible_motion import AdmissibleMotion
from screwgauge.witness.dynamics import newton_euler as body_equations
from screwgauge.witness.wrenches import UnitWrench, exerted_wrenches, unit_wrenches

#: Motion of the bodies: quantity -> field of `Moving`.
BODY_MOTION = {"body_angular_velocity": "w", "body_angular_acceleration": "b", "com_acceleration": "a"}


def body_motion(answer: Answer, quantity: str) -> Array:
    """One of `BODY_MOTION` as it follows from the joint coordinates. Shape (n, n_body, 3)."""
    return np.asarray(getattr(answer.motion.com, BODY_MOTION[quantity]))


def required_wrenches(answer: Answer, *, loaded: bool = True) -> tuple[Array, Array]:
    """What joints and actuators must exert on each body: force, and moment about the centre of mass.

    From the body motions that the engine reports, or those that follow from its joint coordinates; attitudes always
    follow from these.

    Args:
        loaded: With loads, springs and motors, and not for inertia and gravity alone.

    Returns:
        Wrenches, shape (n, n_body, 6), and the largest force and moment among the terms of each, shape (n_body, 2).
    """
    tree, applied = answer.tree, answer.applied
    reported = (_vectors(answer[name]) if answer.has(name) else body_motion(answer, name) for name in BODY_MOTION)
    terms = body_equations(tree.matter, answer.motion.com.R, *reported, applied.g)
    wrenches, sizes = terms.wrenches, np.zeros((len(tree.matter.mass), 2))
    for k, parts in enumerate(
        ((terms.inertial[..., :3], terms.gravity[None]), (terms.inertial[..., 3:], terms.gyroscopic))
    ):
        sizes[:, k] = np.max([np.nanmax(np.abs(part), axis=(0, 2), initial=0.0) for part in parts], axis=0)
    exerted = exerted_wrenches(tree, answer.motion, answer.states, answer.t, applied) if loaded else ()
    for body, force, moment, point in exerted:
        lever = cross(point, np.broadcast_to(force, point.shape))
        wrenches[:, body, :3] -= force
        wrenches[:, body, 3:] -= moment + lever
        sizes[body] = np.maximum(sizes[body], [largest(force), largest(moment, lever)])
    return wrenches, sizes


def _vectors(array: Array) -> Array:
    """Three numbers of each body, as `lanes`. Shape (n, 3 n_body) -> (n, n_body, 3)."""
    found = lanes(len(array), array.shape[1] // 3, 3)
    found[:] = array.reshape(found.shape)
    return found


def unit_wrenches_of(answer: Answer, *quantities: str) -> Iterator[tuple[str, UnitWrench]]:
    """Unit wrenches of all components of ``reaction`` or ``actuator_force``, each with its quantity."""
    for quantity in quantities:
        yield from ((quantity, unit) for unit in unit_wrenches(answer.tree, answer.motion, answer.q, quantity))


def amount(answer: Answer, quantity: str, unit: UnitWrench) -> Array:
    """How much of it an answer has [N or N m]. Shape (n, 1)."""
    values = answer.values[quantity]
    return np.ascontiguousarray(values.array[:, values.components.index(unit.name)])[:, None]


def newton_euler(answer: Answer, required: Array, sizes: Array) -> Iterator[Row]:
    """What the reported reactions and actuator forces leave over of the balance of each body."""
    mechanism, missing, sizes, loose = answer.mechanism, required.copy("K"), sizes.copy(), np.zeros_like(sizes)
    for quantity, unit in unit_wrenches_of(answer, "reaction", "actuator_force"):
        admitted, size = answer.admitted(quantity, unit.unit), amount(answer, quantity, unit)
        for body, wrench in unit.on_bodies(answer.tree, answer.motion.com):
            exerted = size * wrench
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
    taken = required * np.concatenate([answer.motion.com.v, answer.motion.com.w], axis=2)
    missing = np.sum(taken, axis=(1, 2)) - np.sum(given, axis=1)
    # at a dead centre the sum is zero and only its terms tell how large rounding is
    size, about = largest(given, taken, _loose(answer, rates)), ("actuator_force", "joint_velocity", *BODY_MOTION)
    yield answer.residual("power_balance", "W", ["all actuators"], missing[:, None], size, about)


def _loose(answer: Answer, rates: Array) -> Array:
    """Power of the actuators that an error admitted by the scene is a share of, rates being (n, n_actuator, ...)."""
    forces = [answer.admitted("actuator_force", unit) for unit in answer.mechanism.actuator_units]
    return np.tensordot(np.abs(rates), forces, (1, 0))


def virtual_work(answer: Answer, admissible: AdmissibleMotion, required: Array, sizes: Array) -> Iterator[Row]:
    """Work of the required wrenches on every admissible motion less that of the generalised and actuator forces.

    Where an answer has no forces the first must vanish, whatever the reactions, and is measured by its largest term.
    """
    mechanism = answer.mechanism
    joints, bodies = admissible.partial, admissible.bodies
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
