"""Residuals of equations in one engine's answer: body balances, power, virtual work, open tree, force rule, energy."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from screwgauge.judging.allowance import MOST
from screwgauge.judging.answer import Answer, largest
from screwgauge.judging.residual import Residuals
from screwgauge.judging.trust import SAFETY
from screwgauge.problem import given_columns
from screwgauge.quantities import BODY_MOTION, FLOOR, FORCE, OF_BODIES, arm, description_names, pairs
from screwgauge.reference.graph import Layout, spanning_tree
from screwgauge.reference.resistance import LOSSES, resistances
from screwgauge.reference.rotations import Array, cross, lanes, times
from screwgauge.solution import Values
from screwgauge.witness.constraints import AdmissibleMotion
from screwgauge.witness.dynamics import kinetic_energy, project_forces
from screwgauge.witness.dynamics import mass_matrix as inertia
from screwgauge.witness.dynamics import newton_euler as body_equations
from screwgauge.witness.joints import open_tree
from screwgauge.witness.kinematics import move
from screwgauge.witness.tree import TreeStates
from screwgauge.witness.wrenches import (
    JointWrench,
    balance_amounts,
    exerted_wrenches,
    joint_forces,
    resistance_force,
    spring_energy,
    unit_wrenches,
    wrench_columns,
)

#: Forces that do work on motions that the loops allow.
WORKING = ("generalized_force", "actuator_force", "axis_moment")


def body_motion(answer: Answer, what: str) -> Array:
    """Compute the body motion of a quantity in `BODY_MOTION` from the joint coordinates. Shape (n, n_body, 3)."""
    return np.asarray(getattr(answer.motion.com, what))


def required_wrenches(answer: Answer, *, loaded: bool = True) -> tuple[Array, Array]:
    """Return wrenches that joints and actuators must exert on bodies: force, and moment about the centre of mass.

    Uses the body motions that the engine reports, or those computed from its joint coordinates; orientations always
    follow from the coordinates.

    Args:
        loaded: Whether to include loads, springs and motors besides inertia and gravity.

    Returns:
        Wrenches, shape (n, n_body, 6), and the largest force and moment among each body's terms, shape (n_body, 2).
    """
    tree, applied = answer.tree, answer.applied
    w, b, a = (
        _vectors(answer[BODY_MOTION[what]]) if answer.has(BODY_MOTION[what]) else body_motion(answer, what)
        for what in "wba"
    )
    terms = body_equations(tree, answer.motion.com.R, w, b, a, applied.g)
    wrenches, sizes = terms.wrenches, np.zeros((len(tree.mass), 2))
    for k, parts in enumerate(
        ((terms.inertial[..., :3], terms.gravity[None]), (terms.inertial[..., 3:], terms.gyroscopic))
    ):
        sizes[:, k] = np.max([np.nanmax(np.abs(part), axis=(0, 2), initial=0.0) for part in parts], axis=0)
    exerted = exerted_wrenches(answer.motion, answer.t, applied) if loaded else ()
    for body, force, moment, point in exerted:
        lever = cross(point, np.broadcast_to(force, point.shape))
        wrenches[:, body, :3] -= force
        wrenches[:, body, 3:] -= moment + lever
        sizes[body] = np.maximum(sizes[body], [largest(force), largest(moment, lever)])
    return wrenches, sizes


def _vectors(array: Array) -> Array:
    """Reshape to one vector per body in the memory layout of `lanes`. Shape (n, 3 n_body) -> (n, n_body, 3)."""
    vectors = lanes(len(array), array.shape[1] // 3, 3)
    vectors[:] = array.reshape(vectors.shape)
    return vectors


def level_sizes(sizes: Array, length: float) -> Array:
    """Raise the smaller of the force and moment scales to match the larger; the mechanism's length converts between
    them.

    Args:
        sizes: Largest force [N] and moment [N m]. Shape (..., 2).
        length: Length of the mechanism [m].
    """
    force = np.maximum(sizes[..., 0], sizes[..., 1] / length)
    return np.stack([force, force * length], axis=-1)


def unit_wrenches_of(answer: Answer, *quantities: str) -> Iterator[tuple[str, JointWrench]]:
    """Yield each quantity, ``reaction`` or ``actuator_force``, with the unit wrench of each of its components."""
    for quantity in quantities:
        yield from ((quantity, unit) for unit in unit_wrenches(answer.motion, quantity))


def amount(answer: Answer, quantity: str, unit: JointWrench) -> Array:
    """Return an answer's values of the component that a unit wrench represents [N or N m]. Shape (n, 1)."""
    values = answer.values[quantity]
    return np.ascontiguousarray(values.array[:, values.components.index(unit.name)])[:, None]


def newton_euler(answer: Answer, required: Array, sizes: Array) -> Residuals:
    """Yield the balance residual of each body under the reported reactions and actuator forces.

    The residual is scaled by the largest force on the body, or by the largest moment divided by the mechanism's length
    if this is larger. Rounding of a force also causes rounding of its moment, even if the lever arm at this body is
    zero.
    """
    mechanism, missing, sizes, loose = answer.mechanism, required.copy("K"), sizes.copy(), np.zeros_like(sizes)
    for quantity, unit in unit_wrenches_of(answer, "reaction", "actuator_force"):
        admitted, size = answer.loose_scale(quantity, unit.unit), amount(answer, quantity, unit)
        for body, wrench in unit.on_bodies(answer.motion):
            exerted = size * wrench
            missing[:, body] -= exerted
            sizes[body] = np.maximum(sizes[body], [largest(exerted[:, :3]), largest(exerted[:, 3:])])
            if admitted:
                loose[body] += admitted * np.array([largest(wrench[:, :3]), largest(wrench[:, 3:])])
    sizes = level_sizes(np.maximum(sizes, loose), answer.scales["m"])
    for part, (unit_name, label) in enumerate((("N", "f"), ("N m", "m"))):
        names = [f"{body.name}.{label}{axis}" for body in mechanism.bodies for axis in "xyz"]
        values = missing[:, :, 3 * part : 3 * part + 3].reshape(len(missing), -1)
        about = ("reaction", "actuator_force", *OF_BODIES)
        yield answer.residual("newton_euler", unit_name, names, values, np.repeat(sizes[:, part], 3), about)


def power_balance(answer: Answer, required: Array, sizes: Array) -> Residuals:
    """Yield the power of inertia, gravity and loads minus the power of the actuators."""
    rates = answer.joints[1][:, answer.mechanism.actuated_columns]
    given = answer["actuator_force"] * rates
    moved = np.concatenate([answer.motion.com.v, answer.motion.com.w], axis=2)
    taken, terms = required * moved, np.repeat(sizes, 3, axis=1) * moved
    missing = np.sum(taken, axis=(1, 2)) - np.sum(given, axis=1)
    # at a dead centre the sum is zero, and only its terms show how large rounding is
    size, about = largest(given, terms, _loose_power(answer, rates)), ("actuator_force", "joint_velocity", *OF_BODIES)
    yield answer.residual("power_balance", "W", ["all actuators"], missing[:, None], size, about)


def _loose_power(answer: Answer, rates: Array) -> Array:
    """Return the power of actuator forces whose tolerance the scene loosens; `rates` has shape (n, n_actuator, ...)."""
    forces = [answer.loose_scale("actuator_force", unit) for unit in answer.mechanism.actuator_units]
    return np.tensordot(np.abs(rates), forces, (1, 0))


def virtual_work(answer: Answer, admissible: AdmissibleMotion, required: Array, sizes: Array) -> Residuals:
    """Yield the work of required wrenches on admissible motions minus the work of generalised and actuator forces.

    Springs and motors at joints are subtracted from axis moments, because the wrenches contain them. If an answer has
    no forces, the work of the wrenches must vanish for any reactions. The residual is scaled by its largest term.
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
        loose = _loose_power(answer, driven)
    if answer.has("axis_moment"):
        driving = answer["axis_moment"] - joint_forces(mechanism, answer.states, answer.t, answer.applied)
        given[" about axes"] = np.einsum("nqj,nq->nj", joints, driving)
    units = [mechanism.units[column] for column in mechanism.independent_columns]
    for unit in dict.fromkeys(units):
        columns = [k for k, has in enumerate(units) if has == unit]
        names = [f"{list(mechanism.independent)[k]}{how}" for how in given or [""] for k in columns]
        missing = [needed[:, columns] - forces[:, columns] for forces in given.values()] or [needed[:, columns]]
        size = max(float(terms[columns].max()), largest(loose[..., columns]))
        left, about = np.concatenate(missing, axis=1), (*WORKING, *OF_BODIES)
        yield answer.residual("virtual_work", FORCE[unit], names, left, size, about)


def inertia_of(answer: Answer, admissible: AdmissibleMotion) -> Array:
    """Return the inertia of all bodies and rotors for the admissible motions. Shape (n, k, k)."""
    partial = admissible.partial
    M = inertia(answer.motion) + np.diag(answer.mechanism.rotors)
    return np.asarray(partial.swapaxes(1, 2) @ M @ partial)


def mass_matrix(answer: Answer, admissible: AdmissibleMotion) -> Residuals:
    """Yield the reported mass matrix minus the inertia for admissible motions, composed from the tips inwards."""
    mechanism = answer.mechanism
    labels = zip(mechanism.independent, mechanism.independent_columns, strict=True)
    names, units = pairs({label: mechanism.units[column] for label, column in labels})
    M = inertia_of(answer, admissible)
    right = M[(..., *np.triu_indices(M.shape[-1]))]
    yield from _deviations(answer, "mass_matrix", names, units, right)


def _deviations(answer: Answer, name: str, names: Sequence[str], units: Sequence[str], right: Array) -> Residuals:
    """Yield a reported quantity minus its correct values `right`, (n, m); the mechanism's length converts scales."""
    missing, length = answer.values[name].pick(tuple(names)).array - right, answer.scales["m"]
    load = largest(right / [arm(unit, length) for unit in units])
    for unit in dict.fromkeys(units):
        columns = [i for i, has in enumerate(units) if has == unit]
        some, size = [names[i] for i in columns], load * arm(unit, length)
        yield answer.residual(name, unit, some, missing[:, columns], size, (name,))


def jacobian(answer: Answer, admissible: AdmissibleMotion, idle: Collection[int]) -> Residuals:
    """Yield the reported Jacobian minus the rates per unit rate of each actuator, with `idle` coordinates at rest."""
    mechanism, com, points = answer.mechanism, answer.motion.com, answer.points
    v, w = np.split(admissible.bodies, 2, axis=2)  # shapes (n, n_body, 3, k)
    spots = [(i, -body.com) for i, body in enumerate(mechanism.bodies)]
    spots += [(mechanism.body_index[one.body] - 1, one.place - mechanism.body(one.body).com) for one in points]
    arms = [times(com.R[:, i], place) for i, place in spots]
    moved = [v[:, i] + np.cross(w[:, i], arm[..., None], axis=1) for (i, _), arm in zip(spots, arms, strict=True)]
    twists = [x for i in range(len(mechanism.bodies)) for x in (w[:, i], moved[i])]
    rates = np.concatenate([*twists, *moved[len(mechanism.bodies) :]], axis=1)
    driven = given_columns(rates.shape[2], idle)
    B = admissible.partial[:, mechanism.actuated_columns][..., driven]
    right = (rates[..., driven] @ np.linalg.pinv(B)).reshape(len(B), -1)
    yield from _deviations(answer, "jacobian", *description_names(mechanism, points)["jacobian"], right)


def resistance(answer: Answer) -> Residuals:
    """Yield reported minus computed forces of rotors, damping and dry friction at the joints."""
    reported = answer.values["resistance"]
    for unit in dict.fromkeys(reported.units):
        some = [one for one in answer.mechanism.resistances if one.unit == unit]
        names, each = tuple(one.name for one in some), [resistance_force(one, answer.states) for one in some]
        missing, size = reported.pick(names).array - np.stack(each, axis=1), largest(*each)
        yield answer.residual("resistance", unit, names, missing, size, ("resistance",))


TREE_FORCES = ("tree_force", "tree_force_soft")


def tree_forces(answer: Answer) -> Residuals:
    """Yield reported forces minus the work of gravity and inertia when a single joint of the tree moves.

    The tree consists of the joints named in the answer. A joint that leads to a body already reached leads to a copy of
    that body; the body and its copies have equal shares of the mass.
    """
    mechanism, needed = answer.mechanism, dict[tuple[str, ...], Array]()
    for quantity in TREE_FORCES:
        if not answer.has(quantity):
            continue
        values, units = answer.values[quantity], np.array(answer.values[quantity].units)
        names = values.components
        joints = [joint for joint in mechanism.joints if {*joint.coordinates} <= {*names}]
        tree = spanning_tree(mechanism, [joint.name for joint in joints])
        reached = all(edge.joint in joints for edge in tree.edges)
        if not reached or sorted(names) != sorted(name for joint in joints for name in joint.coordinates):
            row = answer.residual(quantity, units[0], names, np.full_like(values.array, np.nan), 1.0, (quantity,))
            reason = "the components are not the joint coordinates of a spanning tree of the mechanism"
            yield replace(row, reason=reason)
            continue
        if names not in needed:
            along_joints, load = _tree_force(answer, tree, {joint.name for joint in joints})
            needed[names] = along_joints[:, mechanism.columns(names)]
        for unit in dict.fromkeys(values.units):
            right = needed[names][:, units == unit]
            left = values.array[:, units == unit] - right
            some = [name for name, has in zip(names, units, strict=True) if has == unit]
            size = max(largest(right), load * arm(unit, answer.scales["m"]))
            if quantity == "tree_force_soft":  # soft constraints convert closure residuals due to rounding to forces
                size = max(size, answer.softness.get(unit, 0.0) / answer.tolerance)
            yield answer.residual(quantity, unit, some, left, size, (quantity,))


def _tree_force(answer: Answer, graph: Layout, joints: Collection[str]) -> tuple[Array, float]:
    """Return the force along each open-tree coordinate of some joints, shape (n, n_q), and the largest term [N]."""
    tree, bodies, shares = open_tree(answer.mechanism, graph, joints)
    still = np.zeros_like(answer.q)
    required, sizes = required_wrenches(answer, loaded=False)
    wrenches, load = required[:, bodies] * shares[:, None], largest(level_sizes(sizes, answer.scales["m"])[:, 0])
    rotors = answer.mechanism.rotors * answer.states.qdd
    return project_forces(move(tree, TreeStates(answer.q, still, still)), wrenches) + rotors, load


def _is_ruled(answer: Answer) -> bool:
    """Return True if there are more actuators than degrees of freedom."""
    return len(answer.mechanism.actuator_names) > len(answer.mechanism.independent)


def complete_forces(answer: Answer, required: Array) -> Answer:
    """Complete an answer with reactions or actuator forces computed from the balance of the bodies.

    Reactions are computed only for a rule about reactions. If both quantities are missing, neither is computed.

    Args:
        required: Wrenches from `required_wrenches`. Shape (n, n_body, 6).
    """
    about = _is_ruled(answer) and answer.rule == "spherical_axial"
    wanted = ["actuator_force"] * answer.has("reaction") + ["reaction"] * (answer.has("actuator_force") and about)
    lacking = [name for name in wanted if not answer.has(name)]
    return _solve(answer, required, *lacking) if lacking else answer


def _solve(answer: Answer, required: Array, quantity: str) -> Answer:
    """Solve the balance of all bodies for reactions or actuator forces, given the other quantity."""
    other = {"reaction": "actuator_force", "actuator_force": "reaction"}[quantity]
    right = required.copy()
    for _, unit in unit_wrenches_of(answer, other):
        for body, wrench in unit.on_bodies(answer.motion):
            right[:, body] -= amount(answer, other, unit) * wrench
    units, columns = wrench_columns([part for _, part in unit_wrenches_of(answer, quantity)], answer.motion)
    no_rule = np.zeros((len(right), 0, len(units)))
    amounts = balance_amounts(units.values(), columns, right[..., None], answer.scales["m"], no_rule)[..., 0]
    solved = Values(tuple(units), tuple(units.values()), amounts)
    return replace(answer, values={**answer.values, quantity: solved})


def force_rule(answer: Answer, admissible: AdmissibleMotion, sizes: Array) -> Residuals:
    """Yield the residual of the rule that fixes redundant actuator forces."""
    if _is_ruled(answer):
        yield from _axial(answer) if answer.rule == "spherical_axial" else _smallest(answer, admissible, sizes)


def _smallest(answer: Answer, admissible: AdmissibleMotion, sizes: Array) -> Residuals:
    """Yield the part of the actuator forces that does not affect motion; it vanishes for minimum-norm forces.

    Minimum-norm forces are orthogonal to every preload. A preload does no work on any admissible motion.
    """
    mechanism, f = answer.mechanism, answer["actuator_force"]
    rates = admissible.partial[:, mechanism.actuated_columns]
    working = np.linalg.qr(rates / np.maximum(np.linalg.norm(rates, axis=1, keepdims=True), np.finfo(float).tiny))[0]
    preload = f - (working @ (working.swapaxes(1, 2) @ f[..., None]))[..., 0]
    units = np.array(mechanism.actuator_units)
    for unit in dict.fromkeys(mechanism.actuator_units):
        names = [name for name, has in zip(mechanism.actuator_names, units, strict=True) if has == unit]
        left = preload[:, units == unit]
        load = largest(level_sizes(sizes, answer.scales["m"])[:, 0]) * arm(unit, answer.scales["m"])
        size = max(largest(f[:, units == unit]), load, len(units) * answer.loose_scale("actuator_force", unit))
        yield answer.residual("force_rule", unit, names, left, size, ("actuator_force",))


def _axial(answer: Answer) -> Residuals:
    """Yield the component of the spherical joint's force perpendicular to the line of eq. (56)."""
    mechanism = answer.mechanism
    if mechanism.axial is None:
        return
    name, direction = mechanism.axial
    joint, F, sizes = mechanism.joint(name), np.zeros((len(answer.t), 3)), []
    for quantity, unit in unit_wrenches_of(answer, "reaction"):
        force = amount(answer, quantity, unit) * unit.force
        sizes.append(largest(force))
        if unit.joint is joint:
            F += force
    i = mechanism.body_index[joint.child]  # 0 for ground, which is not among the moving bodies
    line = answer.motion.bodies.R[:, i - 1] @ direction if i else np.tile(direction, (len(answer.t), 1))
    names = [f"{name}.f{axis}" for axis in "xyz"]
    yield answer.residual("force_rule", "N", names, cross(line, F), max(sizes), ("reaction", "actuator_force"))


def energy_balance(answer: Answer, looser: Sequence[Answer] = ()) -> Residuals:
    """Yield the energy gained since the first sample minus the work done since then [J], if the work is known.

    The residual is scaled by its largest term: kinetic energy, gravity, springs or work.

    Args:
        looser: Answers for the same simulation with looser tolerances; changes in the balance count as integration
            error.
    """
    if (balance := _balance(answer)) is None:
        return
    missing, size = balance
    others = [other[0] for one in looser if (other := _balance(one)) is not None]
    reason = ""
    if others:
        apart = largest(*(a - b for a, b in combinations([missing, *others], 2)))
        left = min(SAFETY * apart / max(size, FLOOR * answer.scales["J"]), MOST)
        answer = replace(answer, tolerance=answer.tolerance + left)
        reason = f"the integration error is at most {left:.1g}"
    row = answer.residual("energy_balance", "J", ["energy"], missing, size, ())
    yield replace(row, reason=row.reason or reason)


def _balance(answer: Answer) -> tuple[Array, float] | None:
    """Return the energy residual at each sample, shape (n, 1), and the largest term of the balance [J]."""
    applied, work = answer.applied, answer.work
    resists = resistances(answer.mechanism.joints, LOSSES)
    if not (applied.motors or applied.loads or resists or any(spring.damping for spring in applied.springs)):
        work = np.zeros(len(answer.t))
    if not answer.has("joint_velocity") or work is None or np.isnan(work).all():
        return None
    work = work - work[0]  # the first sample may come after the start
    kinetic, *stored = energies(answer)
    gained = [part - part[0] for part in (kinetic, *stored)]
    missing = (sum(gained) - work)[:, None]
    return np.asarray(missing), largest(kinetic, *gained, work)


def energies(answer: Answer) -> tuple[Array, Array, Array]:
    """Return kinetic energy, and potential energies of gravity and springs [J]. Shape (n,) each."""
    gravity = -(answer.motion.com.p @ answer.applied.g) @ answer.tree.mass
    springs = spring_energy(answer.motion, answer.applied)
    rotors = 0.5 * answer.states.qd**2 @ answer.mechanism.rotors
    return kinetic_energy(answer.motion) + rotors, gravity, springs
