"""How far the loops of a tree are from closed, and what closures and couplings ask of its velocities."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import polynomial

from screwgauge.models.kinematics.tree import Motion, States, Tree, home, move
from screwgauge.models.readings.reading import ClosureReading
from screwgauge.reference.equations.screws import acceleration_at
from screwgauge.reference.rotations import Array, cross, rotation_vector


def gaps(tree: Tree, motion: Motion) -> dict[str, Array]:
    """Second frame of each closure against the first, world axes: of a weld the rotation vector, then the way [rad, m].

    Returns:
        Closure -> shape (n, 3) of points, (n, 6) of welds.
    """
    out = {}
    for name, closure in tree.reading.closures.items():
        (_, _, R1, p1), (_, _, R2, p2) = _ends(tree, motion, closure)
        turn = [] if closure.kind == "point" else [rotation_vector(R2 @ np.swapaxes(R1, 1, 2))]
        out[name] = np.concatenate([*turn, p2 - p1], axis=1)
    return out


def residual_at_home(tree: Tree) -> dict[str, float]:
    """Largest entry of each closure's gap at home [m, or rad of a welded turn]."""
    motion = move(tree, home(tree.reading))
    return {name: float(np.abs(gap).max()) for name, gap in gaps(tree, motion).items()}


def constraint_rows(tree: Tree, motion: Motion) -> dict[str, Array]:
    """Relative velocity of the second frame of each closure at its origin, world axes, at unit velocities.

    Returns:
        Closure -> shape (n, 3, n_freedom) of points, (n, 6, n_freedom) of welds.
    """
    out, (w, v) = {}, (motion.screws[..., :3], motion.screws[..., 3:])
    for name, closure in tree.reading.closures.items():
        rows = np.zeros((*motion.screws.shape[:2], 6))
        for sign, i, _, p in _ends(tree, motion, closure):
            if i >= 0:
                moving = np.concatenate([w, v + cross(w, np.broadcast_to(p[:, None], w.shape))], axis=-1)
                rows += sign * tree.moves[i][:, None] * moving
        out[name] = np.swapaxes(rows[..., 3:] if closure.kind == "point" else rows, 1, 2)
    return out


def _ends(tree: Tree, motion: Motion, closure: ClosureReading) -> list[tuple[float, int, Array, Array]]:
    """Of both sides of a closure its sign, the number of the body (-1 the ground) and its frame in the world.

    Shapes of these (n, 3, 3), (n, 3).
    """
    found, names, n = [], list(tree.reading.bodies), len(motion.R)
    for sign, body, T in ((-1.0, closure.first, closure.first_frame), (1.0, closure.second, closure.second_frame)):
        i = names.index(body) if body in names else -1
        R, p = (motion.R[:, i], motion.p[:, i]) if i >= 0 else (np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)))
        found.append((sign, i, R @ T[:3, :3], R @ T[:3, 3] + p))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """All closures and couplings of a tree at states; rows first of the closures.

    Attributes:
        gap: What is open [m or rad]. Shape (n, m).
        rows: Its rate at unit velocities. Shape (n, m, n_freedom).
        bias: Second derivative of the gaps at zero accelerations, Jdot v; of a welded turn where it is closed. (n, m).
    """

    gap: Array
    rows: Array
    bias: Array


def equations(tree: Tree, states: States) -> Equations:
    """Of all closures and couplings."""
    motion = move(tree, replace(states, qdd=np.zeros_like(states.qdd)))
    open_, rates = gaps(tree, motion), constraint_rows(tree, motion)
    n, wide = len(states.q), len(tree.before)
    gap, rows, bias = [np.zeros((n, 0))], [np.zeros((n, 0, wide))], [np.zeros((n, 0))]
    for name in tree.reading.closures:
        gap.append(open_[name])
        rows.append(rates[name])
        bias.append(_acceleration(tree, motion, name)[:, -open_[name].shape[1] :])
    for coupling in tree.reading.couplings.values():
        p, row = coupling.polynomial, np.zeros((n, 1, wide))
        row[:, 0, tree.freedoms[coupling.joint]] = 1.0
        follows, second = np.full((n, 1), p[0]), np.zeros((n, 1))
        if coupling.of:
            lead, at = states.q[:, tree.places[coupling.of]], tree.freedoms[coupling.of]
            follows = polynomial.polyval(lead, p)
            row[:, 0, at] -= polynomial.polyval(lead, polynomial.polyder(p))
            second = polynomial.polyval(lead, polynomial.polyder(p, 2)) * states.qd[:, at] ** 2
        gap.append(states.q[:, tree.places[coupling.joint]] - follows)
        rows.append(row)
        bias.append(-second)
    return Equations(np.hstack(gap), np.concatenate(rows, axis=1), np.hstack(bias))


def _acceleration(tree: Tree, motion: Motion, name: str) -> Array:
    """Angular and linear acceleration of the second frame of a closure against the first. Shape (n, 6)."""
    out = np.zeros((len(motion.R), 6))
    for sign, i, _, p in _ends(tree, motion, tree.reading.closures[name]):
        if i >= 0:
            twist, change = motion.twist[:, i], motion.acceleration[:, i]
            out += sign * np.concatenate([change[:, :3], acceleration_at(twist, change, p)], axis=1)
    return out
