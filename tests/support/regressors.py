"""What inverse dynamics is linear in, by other formulas than those of the package.

Ten inertial parameters of each body, the passive entries of joints, gravity.
Columns times parameters are forces along the velocities of `reading.FREEDOMS`.
"""

from __future__ import annotations

import numpy as np

from screwgauge.diagnosis.mechanics.dynamics import deflection, downwards, rotor_acceleration
from screwgauge.models.kinematics.tree import Motion, States, Tree
from screwgauge.models.placement import TENSOR
from screwgauge.reference.equations.screws import acceleration_at, velocity_at
from screwgauge.reference.rotations import Array, cross, skew

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


def inertial_regressor(tree: Tree, motion: Motion) -> Array:
    """Forces of unit parameters.

    Returns:
        Shape (n, n_freedom, n_body, 10).
    """
    inwards = np.swapaxes(motion.R, -1, -2)
    linear = acceleration_at(motion.twist, motion.acceleration, motion.p) - tree.weight[:, None] * downwards(
        tree.reading
    )
    a, w, beta = (
        (inwards @ each[..., None])[..., 0] for each in (linear, motion.twist[..., :3], motion.acceleration[..., :3])
    )
    W = np.zeros((*a.shape[:2], 6, PARAMETERS))  # [moment about the body's origin; force], body axes
    S = skew(w)
    W[..., 3:, 0] = a
    W[..., 3:, 1:4] = skew(beta) + S @ S
    W[..., :3, 1:4] = -skew(a)
    W[..., :3, 4:] = _tensor(beta) + S @ _tensor(w)
    screws = motion.screws[:, None]  # each velocity's, at each body's origin, in its axes
    at = velocity_at(screws, motion.p[:, :, None])
    inside = np.concatenate([screws[..., :3] + 0.0 * at, at], axis=-1) * tree.moves[..., None]
    local = np.concatenate([inside[..., :3] @ motion.R, inside[..., 3:] @ motion.R], axis=-1)
    return np.swapaxes(local @ W, 1, 2)


def _tensor(w: Array) -> Array:
    """``I @ w`` as a matrix times the six entries of I. Shape (..., 3) -> (..., 3, 6)."""
    out = np.zeros((*w.shape, 6))
    for k, (i, j) in enumerate(TENSOR.values()):
        out[..., i, k] = w[..., j]
        out[..., j, k] = w[..., i]
    return out


def passive_regressor(tree: Tree, states: States) -> dict[str, Array]:
    """Forces of unit entries, by entry: of each velocity's own joint alone. Shape (n, n_freedom) each."""
    return {
        "armature": rotor_acceleration(tree, states),
        "damping": states.qd,
        "friction": np.sign(states.qd),
        "stiffness": deflection(tree, states),
    }


def gravity_regressor(tree: Tree, motion: Motion) -> Array:
    """Forces of unit gravity along the world axes. Shape (n, n_freedom, 3)."""
    r = (motion.R @ tree.com[:, :, None])[..., 0] + motion.p
    share = -(tree.weight * tree.mass)[:, None, None]
    f = np.broadcast_to(share * np.eye(3), (*r.shape, 3))  # rows are forces of unit gravity along x, y, z
    wrenches = np.concatenate([cross(r[:, :, None] + 0.0 * f, f + 0.0 * r[:, :, None]), f], axis=-1)
    carried = np.einsum("bi,nbkj->nikj", tree.moves, wrenches, optimize=True)
    return np.asarray(np.einsum("nij,nikj->nik", motion.screws, carried, optimize=True))
