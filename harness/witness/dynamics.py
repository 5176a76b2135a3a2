"""Newton-Euler equations of bodies in motion, and forces along the velocities of a tree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from screwgauge.reference.rotations import Array, cross, lanes, quaternion_rotation, skew, times
from screwgauge.witness.kinematics import TreeMotion, move, unit_twists
from screwgauge.witness.tree import FREEDOMS, SpanningTree, TreeStates


@dataclass(frozen=True, slots=True, eq=False)
class NewtonEulerTerms:
    """Terms of the wrench that each body requires: force, and moment about the centre of mass.

    Attributes:
        inertial: ``m a`` and ``J b``. Shape (n, m, 6).
        gravity: Minus the weight. Shape (m, 3).
        gyroscopic: Moment ``w x J w``. Shape (n, m, 3).
    """

    inertial: Array
    gravity: Array
    gyroscopic: Array

    @property
    def wrenches(self) -> Array:
        """Sum of the terms. Shape (n, m, 6)."""
        total = self.inertial.copy("K")
        total[..., :3] += self.gravity
        total[..., 3:] += self.gyroscopic
        return total


def newton_euler(tree: SpanningTree, R: Array, w: Array, b: Array, a: Array, g: Array) -> NewtonEulerTerms:
    """Compute Newton-Euler terms from bodies' orientation, angular motion and acceleration of the centre of mass.

    Args:
        g: Gravity, common or for each body [m/s^2]. Shape (3,) or (m, 3).
    """
    inertial = lanes(len(R), len(tree.mass), 6)
    inertial[..., :3], inertial[..., 3:] = tree.mass[:, None] * a, momentum(tree, R, b)
    return NewtonEulerTerms(inertial, -tree.mass[:, None] * g, cross(w, momentum(tree, R, w)))


def momentum(tree: SpanningTree, R: Array, w: Array) -> Array:
    """Return the angular momentum ``R J R^T w`` about the centre of mass. Shape (n, m, 3)."""
    return times(R, times(tree.inertia[None], times(R.swapaxes(-1, -2), w)))


def kinetic_energy(motion: TreeMotion[SpanningTree]) -> Array:
    """Return the kinetic energy of all bodies [J]. Shape (n,)."""
    tree, com = motion.tree, motion.com
    turning = np.sum(com.w * momentum(tree, com.R, com.w), axis=(1, 2))
    return np.asarray(0.5 * (np.sum(com.v**2, axis=2) @ tree.mass + turning))


def project_forces(motion: TreeMotion[SpanningTree], wrenches: Array) -> Array:
    """Return the power of wrenches at the bodies' centres of mass, see `NewtonEulerTerms`, per unit velocity.

    Args:
        wrenches: Shape (..., n, n_body, 6).

    Returns:
        Shape (..., n, n_freedom).
    """
    tree, force = motion.tree, wrenches[..., :3]
    number, _, turns = tree.velocity
    # wrenches summed over all bodies that a velocity moves; moments about the world's origin, then about the joint
    whole = tree.moves.T @ np.concatenate([force, wrenches[..., 3:] + cross(motion.com.p, force)], axis=-1)
    moment = whole[..., 3:] - cross(motion.links.p[:, number], whole[..., :3])
    return np.asarray(np.sum(motion.axes * np.where(turns[:, None], moment, whole[..., :3]), axis=-1))


def mass_matrix(motion: TreeMotion[SpanningTree]) -> Array:
    """Compute the mass matrix without armature (see Featherstone, Rigid Body Dynamics Algorithms, table 6.2).

    Returns:
        Shape (n, n_freedom, n_freedom).
    """
    tree = motion.tree
    number, rates = tree.velocity[0], unit_twists(motion)
    carried = np.einsum("bi,nbjk->nijk", tree.moves, _inertia_at_origin(motion), optimize=True)
    momenta = (carried @ rates[..., None])[..., 0]
    product = rates @ np.swapaxes(momenta, 1, 2)  # twist of velocity i times momentum of the bodies moved by j
    inner = tree.before.T + (number[:, None] == number)  # i precedes j, or belongs to the same joint
    lower = np.swapaxes(product * tree.before.T, 1, 2)
    return np.asarray(product * inner + lower)


def _inertia_at_origin(motion: TreeMotion[SpanningTree]) -> Array:
    """Return each body's inertia about the world origin: twist -> angular and linear momentum. (n, n_body, 6, 6)."""
    tree, com = motion.tree, motion.com
    C, m = skew(com.p), tree.mass[:, None, None]
    out = np.empty((*com.p.shape[:2], 6, 6))
    out[..., :3, :3] = com.R @ tree.inertia @ np.swapaxes(com.R, -1, -2) - m * (C @ C)
    out[..., :3, 3:] = m * C
    out[..., 3:, :3] = -m * C
    out[..., 3:, 3:] = m * np.eye(3)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class InverseDynamics:
    """Forces along a tree's velocities that its motion requires [N m or N].

    Attributes:
        tau: Total motor forces. Shape (n, n_freedom).
        mass_matrix: Mass matrix with armature. Shape (n, n_freedom, n_freedom).
        bias: Forces due to gravity and velocities, without joint forces. Shape (n, n_freedom).
        gravity: Forces due to weight. Shape (n, n_freedom).
        passive: Forces of damping, friction and springs. Shape (n, n_freedom).
        velocity: Angular velocity of each body and velocity of its origin, in world axes. Shape (n, n_body, 6).
        acceleration: Time derivatives of `velocity`. Shape (n, n_body, 6).
    """

    tau: Array
    mass_matrix: Array
    bias: Array
    gravity: Array
    passive: Array
    velocity: Array
    acceleration: Array


def dynamics(tree: SpanningTree, states: TreeStates) -> InverseDynamics:
    """Compute all terms of `InverseDynamics`."""
    motion = move(tree, states)
    bodies, needed = motion.bodies, _terms(motion)
    weights = np.zeros_like(needed.inertial)
    weights[..., :3] = needed.gravity
    M = mass_matrix(motion) + np.diag(_entry(tree, "armature"))
    inertial = project_forces(motion, needed.wrenches)
    armature, passive = armature_force(tree, states), passive_force(tree, states)
    bias = inertial + armature - (M @ states.qdd[..., None])[..., 0]
    return InverseDynamics(
        inertial + armature + passive,
        M,
        bias,
        project_forces(motion, weights),
        passive,
        bodies.velocity,
        bodies.acceleration,
    )


def inverse_dynamics(tree: SpanningTree, states: TreeStates) -> Array:
    """Compute `InverseDynamics.tau` only. Shape (n, n_freedom)."""
    motion = move(tree, states)
    return project_forces(motion, _terms(motion).wrenches) + armature_force(tree, states) + passive_force(tree, states)


def _terms(motion: TreeMotion[SpanningTree]) -> NewtonEulerTerms:
    tree, com = motion.tree, motion.com
    return newton_euler(tree, com.R, com.w, com.b, com.a, np.reshape(tree.weight, (-1, 1)) * tree.gravity)


def _entry(tree: SpanningTree, name: str) -> Array:
    """Return an entry of `SpanningTree.passive`, or zeros if there is none."""
    return tree.passive.get(name, np.zeros(tree.freedom))


def rotor_acceleration(tree: SpanningTree, states: TreeStates) -> Array:
    """Return the acceleration that armature resists; a free joint's translation is taken in world axes.

    Shape (n, n_freedom).
    """
    qdd = states.qdd.copy()
    for link in tree.links:
        if link.kind == "free":
            turn, way = (slice(link.velocity + k, link.velocity + k + 3) for k in (0, 3))
            qdd[:, way] += cross(states.qd[:, turn], states.qd[:, way])
    return qdd


def deflection(tree: SpanningTree, states: TreeStates) -> Array:
    """Return each joint's displacement from its spring's rest position, along its velocities. Shape (n, n_freedom)."""
    out = np.empty_like(states.qd)
    for link in tree.links:
        part = slice(link.velocity, link.velocity + FREEDOMS[link.kind])
        if FREEDOMS[link.kind] == 1:
            out[:, part.start] = states.q[:, link.coordinate] - _entry(tree, "rest")[part.start]
            continue
        start = link.coordinate + 3 * (link.kind == "free")
        w, axis = states.q[:, start], states.q[:, start + 1 : start + 4]
        sine = np.linalg.norm(axis, axis=1)
        angle = 2.0 * np.arctan2(sine, np.abs(w)) * np.where(w < 0, -1.0, 1.0)  # the shorter rotation
        out[:, part.start : part.start + 3] = axis * (angle / np.maximum(sine, 1e-300))[:, None]
        if link.kind == "free":
            R = quaternion_rotation(states.q[:, start : start + 4])
            out[:, part.start + 3 : part.stop] = (states.q[:, None, start - 3 : start] @ R)[:, 0]
    return out


def armature_force(tree: SpanningTree, states: TreeStates) -> Array:
    """Return the forces that accelerate the rotors. Shape (n, n_freedom)."""
    return _entry(tree, "armature") * rotor_acceleration(tree, states)


def passive_force(tree: SpanningTree, states: TreeStates) -> Array:
    """Return motor forces that overcome damping, dry friction and springs. Shape (n, n_freedom)."""
    return np.asarray(sum(passive_parts(tree, states).values()))


def passive_parts(tree: SpanningTree, states: TreeStates) -> dict[str, Array]:
    """Return the parts of `passive_force` by name."""
    stiffness = _entry(tree, "stiffness")
    return {
        "damping": _entry(tree, "damping") * states.qd,
        "friction": _entry(tree, "friction") * np.sign(states.qd),
        "stiffness": stiffness * deflection(tree, states) if stiffness.any() else np.zeros_like(states.qd),
    }
