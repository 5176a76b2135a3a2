"""The rule that fixes the forces of redundant actuators, and forces that follow from others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from screwgauge.judging.answer import Answer, Row, largest
from screwgauge.judging.newton_euler_residuals import amount, unit_wrenches_of
from screwgauge.reference import linear
from screwgauge.reference.rotations import Array, cross
from screwgauge.solution import Values
from screwgauge.witness.admissible_motion import AdmissibleMotion


def _ruled(answer: Answer) -> bool:
    """Whether there are more actuators than freedoms."""
    return len(answer.mechanism.actuators) > len(answer.mechanism.independent)


def balanced(answer: Answer, required: Array) -> Answer:
    """The answer with what it lacks of reactions and actuator forces, as the balance of the bodies has it.

    Reactions follow only for a rule that is about them, and nothing where both are missing.

    Args:
        required: From `required_wrenches`. Shape (n, n_body, 6).
    """
    about = _ruled(answer) and answer.rule == "spherical_axial"
    wanted = ["actuator_force"] * answer.has("reaction") + ["reaction"] * (answer.has("actuator_force") and about)
    lacking = [name for name in wanted if not answer.has(name)]
    return _solved(answer, required, *lacking) if lacking else answer


def _solved(answer: Answer, required: Array, quantity: str) -> Answer:
    """The answer with a quantity that is what the balance of all bodies leaves open beside the other."""
    other = {"reaction": "actuator_force", "actuator_force": "reaction"}[quantity]
    right, unknown = required.copy(), [unit for _, unit in unit_wrenches_of(answer, quantity)]
    tree, com = answer.tree, answer.motion.com
    for _, unit in unit_wrenches_of(answer, other):
        for body, wrench in unit.on_bodies(tree, com):
            right[:, body] -= amount(answer, other, unit) * wrench
    columns = np.zeros((*required.shape, len(unknown)))
    for k, unit in enumerate(unknown):
        for body, wrench in unit.on_bodies(tree, com):
            columns[:, body, :, k] += wrench
    n, length = len(required), answer.scales["m"]  # by which equations and unknowns are forces
    rows = np.tile([1.0, 1.0, 1.0, length, length, length], required.shape[1])
    size = np.array([length if unit.unit == "N m" else 1.0 for unit in unknown])
    system = columns.reshape(n, len(rows), len(unknown)) / rows[:, None] * size
    found = linear.solve(system, (right.reshape(n, -1) / rows)[..., None])[..., 0] * size
    solved = Values(tuple(unit.name for unit in unknown), tuple(unit.unit for unit in unknown), found)
    return replace(answer, values={**answer.values, quantity: solved})


def force_rule(answer: Answer, admissible: AdmissibleMotion) -> Iterator[Row]:
    """What the forces of redundant actuators leave over of the rule that fixes them."""
    if _ruled(answer):
        yield from _axial(answer) if answer.rule == "spherical_axial" else _smallest(answer, admissible)


def _smallest(answer: Answer, admissible: AdmissibleMotion) -> Iterator[Row]:
    """The part of the actuator forces that moves nothing: those of the smallest norm have none.

    They are orthogonal to every preload, which does no work on any admissible motion.
    """
    mechanism, f = answer.mechanism, answer["actuator_force"]
    rates = admissible.partial[:, mechanism.actuated_columns]
    working = np.linalg.qr(rates / np.maximum(np.linalg.norm(rates, axis=1, keepdims=True), np.finfo(float).tiny))[0]
    preload = f - (working @ (working.swapaxes(1, 2) @ f[..., None]))[..., 0]
    units = np.array(mechanism.actuator_units)
    for unit in dict.fromkeys(mechanism.actuator_units):
        names = [name for name, has in zip(mechanism.actuator_names, units, strict=True) if has == unit]
        left = preload[:, units == unit]
        size = max(largest(f[:, units == unit]), len(units) * answer.admitted("actuator_force", unit))
        yield answer.residual("force_rule", unit, names, left, size, ("actuator_force",))


def _axial(answer: Answer) -> Iterator[Row]:
    """The force of the spherical joint across the line that it should lie along (eq. 56)."""
    mechanism = answer.mechanism
    if mechanism.axial is None:
        return
    name, direction = mechanism.axial
    joint, F, sizes = mechanism.joint(name), np.zeros((len(answer.t), 3)), []
    for quantity, unit in unit_wrenches_of(answer, "reaction"):
        for act in unit.acts:
            force = amount(answer, quantity, unit) * act.force
            sizes.append(largest(force))
            if act.joint is joint:
                F += force
    line = answer.motion.bodies.R[:, mechanism.body_index[joint.child] - 1] @ direction
    names = [f"{name}.f{axis}" for axis in "xyz"]
    yield answer.residual("force_rule", "N", names, cross(line, F), max(sizes), ("reaction", "actuator_force"))
