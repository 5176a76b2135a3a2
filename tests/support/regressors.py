"""What inverse dynamics is linear in, by other formulas than those of the package.

Ten inertial parameters of each body, the passive entries of joints, gravity.
Columns times parameters are forces along the velocities of `reading.FREEDOMS`.
"""

import numpy as np

from screwgauge.models.formats import TENSOR
from screwgauge.models.kinematics import ReadingTree
from screwgauge.reference.rotations import Array, skew
from screwgauge.witness.dynamics import deflection, rotor_acceleration
from screwgauge.witness.kinematics import TreeMotion
from screwgauge.witness.tree import TreeStates

PARAMETERS = 10


def parameters(mass: Array, com: Array, inertia: Array) -> Array:
    """Mass, mass times centre of mass, and inertia about the origin in the order of `TENSOR`, in body axes.

    Args:
        mass: [kg], shape (...).
        com: [m], shape (..., 3).
        inertia: About the centre of mass [kg m^2], shape (..., 3, 3).

    Returns:
        Shape (..., 10).
    """
    C = skew(com)
    I = inertia - mass[..., None, None] * (C @ C)
    first = mass[..., None] * com
    entries = np.stack([I[..., i, j] for i, j in TENSOR.values()], axis=-1)
    return np.concatenate([mass[..., None], first, entries], axis=-1)


def inertial_regressor(tree: ReadingTree, motion: TreeMotion[ReadingTree]) -> Array:
    """Forces of unit parameters.

    Returns:
        Shape (n, n_freedom, n_body, 10).
    """
    inwards = np.swapaxes(motion.bodies.R, -1, -2)
    bodies = motion.bodies
    linear = bodies.a - np.reshape(tree.weight, (-1, 1)) * tree.gravity
    a, w, beta = ((inwards @ each[..., None])[..., 0] for each in (linear, bodies.w, bodies.b))
    W = np.zeros((*a.shape[:2], 6, PARAMETERS))  # [moment about the body's origin; force], body axes
    S = skew(w)
    W[..., 3:, 0] = a
    W[..., 3:, 1:4] = skew(beta) + S @ S
    W[..., :3, 1:4] = -skew(a)
    W[..., :3, 4:] = _tensor(beta) + S @ _tensor(w)
    inside = np.swapaxes(motion.jacobian(tree.bodies, bodies.p), 2, 3)  # each velocity's, at each body's origin
    local = np.concatenate([inside[..., :3] @ bodies.R, inside[..., 3:] @ bodies.R], axis=-1)
    return np.swapaxes(local @ W, 1, 2)


def _tensor(w: Array) -> Array:
    """``I @ w`` as a matrix times the six entries of I. Shape (..., 3) -> (..., 3, 6)."""
    out = np.zeros((*w.shape, 6))
    for k, (i, j) in enumerate(TENSOR.values()):
        out[..., i, k] = w[..., j]
        out[..., j, k] = w[..., i]
    return out


def passive_regressor(tree: ReadingTree, states: TreeStates) -> dict[str, Array]:
    """Forces of unit entries, by entry: of each velocity's own joint alone. Shape (n, n_freedom) each."""
    return {
        "armature": rotor_acceleration(tree, states),
        "damping": states.qd,
        "friction": np.sign(states.qd),
        "stiffness": deflection(tree, states),
    }


def gravity_regressor(tree: ReadingTree, motion: TreeMotion[ReadingTree]) -> Array:
    share = -(tree.weight * tree.mass)
    rates = motion.jacobian(tree.bodies, motion.com.p)[:, :, 3:]
    return np.asarray(np.einsum("b,nbkj->njk", share, rates))
