"""Inverse dynamics of a tree by Newton and Euler about the world origin, all samples and bodies at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.models.kinematics.tree import Motion, States, Tree, move
from screwgauge.models.placement import quaternion_rotation
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.reference.equations.screws import acceleration_at, velocity_at
from screwgauge.reference.rotations import Array, cross, skew


@dataclass(frozen=True, slots=True, eq=False)
class Dynamics:
    """What a tree needs to move as it does; forces are those along the velocities of `reading.FREEDOMS` [N m or N].

    Attributes:
        tau: All that is asked of motors. Shape (n, n_freedom).
        mass_matrix: With armature. Shape (n, n_freedom, n_freedom).
        bias: Of gravity and velocities, without what joints add. Shape (n, n_freedom).
        gravity: Of weights alone. Shape (n, n_freedom).
        passive: Damping, friction and springs. Shape (n, n_freedom).
        velocity: Angular velocity of each body and velocity of its origin, world axes. Shape (n, n_body, 6).
        acceleration: Their derivatives. Shape (n, n_body, 6).
    """

    tau: Array
    mass_matrix: Array
    bias: Array
    gravity: Array
    passive: Array
    velocity: Array
    acceleration: Array


def dynamics(tree: Tree, states: States, motion: Motion | None = None) -> Dynamics:
    """Everything at once. Where the reading has no gravity there is none."""
    motion = motion or move(tree, states)
    M = mass_matrix(tree, motion) + np.diag(_of_joints(tree, "armature"))
    weights = _along(tree, motion, _wrenches(tree, motion, still=True))
    inertial = _along(tree, motion, _wrenches(tree, motion))
    armature, passive = armature_force(tree, states), passive_force(tree, states)
    return Dynamics(
        inertial + armature + passive,
        M,
        inertial + armature - (M @ states.qdd[..., None])[..., 0],
        weights,
        passive,
        np.concatenate([motion.twist[..., :3], velocity_at(motion.twist, motion.p)], axis=-1),
        np.concatenate(
            [motion.acceleration[..., :3], acceleration_at(motion.twist, motion.acceleration, motion.p)], axis=-1
        ),
    )


def inverse_dynamics(tree: Tree, states: States) -> Array:
    """`Dynamics.tau` alone. Shape (n, n_freedom)."""
    motion = move(tree, states)
    rigid = _along(tree, motion, _wrenches(tree, motion))
    return rigid + armature_force(tree, states) + passive_force(tree, states)


def downwards(reading: Reading) -> Array:
    """Gravity of a reading, zero where it has none [m/s^2]. Shape (3,)."""
    return np.zeros(3) if reading.gravity is None else reading.gravity


def not_modelled(reading: Reading) -> tuple[str, ...]:
    """What a reading says that is not in these dynamics; one phrase each."""
    density, viscosity = reading.medium
    fluid = (f"the medium (density {density:g} kg/m^3, viscosity {viscosity:g} Pa s)",)
    return fluid if density or viscosity else ()


def _wrenches(tree: Tree, motion: Motion, *, still: bool = False) -> Array:
    """Moment about the world origin and force that move each body. Shape (n, n_body, 6).

    Args:
        still: As if nothing moved: against gravity alone.
    """
    r = (motion.R @ tree.com[:, :, None])[..., 0] + motion.p
    falls = tree.weight[:, None] * downwards(tree.reading)
    if still:
        f = np.broadcast_to(-tree.mass[:, None] * falls, r.shape)
        return np.concatenate([cross(r, f), f], axis=-1)
    f = tree.mass[:, None] * (acceleration_at(motion.twist, motion.acceleration, r) - falls)
    I = motion.R @ tree.inertia @ np.swapaxes(motion.R, -1, -2)
    w, beta = motion.twist[..., :3], motion.acceleration[..., :3]
    spin = (I @ beta[..., None])[..., 0] + cross(w, (I @ w[..., None])[..., 0])
    return np.concatenate([spin + cross(r, f), f], axis=-1)


def _along(tree: Tree, motion: Motion, wrenches: Array) -> Array:
    """Power of the wrenches on all that a velocity moves, at unit rate. Shape (n, n_freedom)."""
    return np.asarray(np.sum(motion.screws * (tree.moves.T @ wrenches), axis=-1))


def mass_matrix(tree: Tree, motion: Motion) -> Array:
    """Without armature, by composite bodies (Featherstone, Rigid Body Dynamics Algorithms, table 6.2).

    Returns:
        Shape (n, n_freedom, n_freedom).
    """
    carried = np.einsum("bi,nbjk->nijk", tree.moves, _spatial(tree, motion), optimize=True)
    momenta = (carried @ motion.screws[..., None])[..., 0]
    product = motion.screws @ np.swapaxes(momenta, 1, 2)  # of screw i on the momentum of what j carries
    wide = [FREEDOMS[joint.kind] for joint in tree.reading.joints.values()]
    numbers = np.repeat(np.arange(len(wide)), wide)
    inner = tree.before.T + (numbers[:, None] == numbers)  # i is before j, or of the same joint
    lower = np.swapaxes(product * tree.before.T, 1, 2)
    return np.asarray(product * inner + lower)


def _spatial(tree: Tree, motion: Motion) -> Array:
    """Spatial inertia of each body about the world origin, twist -> [moment; momentum]. Shape (n, n_body, 6, 6)."""
    r = (motion.R @ tree.com[:, :, None])[..., 0] + motion.p
    C, m = skew(r), tree.mass[:, None, None]
    out = np.empty((*r.shape[:2], 6, 6))
    out[..., :3, :3] = motion.R @ tree.inertia @ np.swapaxes(motion.R, -1, -2) - m * (C @ C)
    out[..., :3, 3:] = m * C
    out[..., 3:, :3] = -m * C
    out[..., 3:, 3:] = m * np.eye(3)
    return out


def _of_joints(tree: Tree, entry: str) -> Array:
    """An entry of each joint, once for each of its freedoms. Shape (n_freedom,)."""
    joints = tree.reading.joints.values()
    return np.repeat([getattr(joint, entry) for joint in joints], [FREEDOMS[joint.kind] for joint in joints])


def rotor_acceleration(tree: Tree, states: States) -> Array:
    """What armature resists; of a free joint's translation the derivative in world axes. Shape (n, n_freedom)."""
    qdd = states.qdd.copy()
    for name, part in tree.freedoms.items():
        if tree.reading.joints[name].kind == "free":
            at, end = part.start + 3, part.stop
            qdd[:, at:end] += cross(states.qd[:, part.start : at], states.qd[:, at:end])
    return qdd


def deflection(tree: Tree, states: States) -> Array:
    """How far each joint is from where its spring rests, along its velocities. Shape (n, n_freedom)."""
    out = np.empty_like(states.qd)
    for name, part in tree.freedoms.items():
        joint, q = tree.reading.joints[name], states.q[:, tree.places[name]]
        if FREEDOMS[joint.kind] == 1:
            out[:, part] = q - joint.rest
            continue
        w, axis = q[:, -4], q[:, -3:]
        sine = np.linalg.norm(axis, axis=1)
        angle = 2.0 * np.arctan2(sine, np.abs(w)) * np.where(w < 0, -1.0, 1.0)  # the shorter way
        out[:, part.start : part.start + 3] = axis * (angle / np.maximum(sine, 1e-300))[:, None]
        if joint.kind == "free":
            out[:, part.start + 3 : part.stop] = (q[:, None, :3] @ quaternion_rotation(q[:, 3:]))[:, 0]
    return out


def armature_force(tree: Tree, states: States) -> Array:
    """Of rotors. Shape (n, n_freedom)."""
    return _of_joints(tree, "armature") * rotor_acceleration(tree, states)


def passive_force(tree: Tree, states: States) -> Array:
    """That motors need against damping, dry friction and springs. Shape (n, n_freedom)."""
    return np.asarray(sum(passive_parts(tree, states).values()))


def passive_parts(tree: Tree, states: States) -> dict[str, Array]:
    """Of what `passive_force` is made."""
    stiffness = _of_joints(tree, "stiffness")
    return {
        "damping": _of_joints(tree, "damping") * states.qd,
        "friction": _of_joints(tree, "friction") * np.sign(states.qd),
        "stiffness": stiffness * deflection(tree, states) if stiffness.any() else np.zeros_like(states.qd),
    }
